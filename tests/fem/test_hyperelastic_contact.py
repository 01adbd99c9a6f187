"""Spheres and flat ends on hyperelastic bodies: converged forces, energy, rotation and finer cells."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate.fem import Body, BodyError, HyperelasticModel, Law, Material, QuasiStaticSolver, Volume, block, build
from palpate.fem.checks import TipShape
from palpate.fem.selectors import Selector, half_space

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def cylinder(cells: int, layers: int) -> Volume:
    """Return a cylinder of radius 30 mm and height 20 mm: a block whose squares become disks."""
    made = block((1e-3 * cells, 1e-3 * cells, 1e-3 * layers), 1e-3)
    x, y, z = (made.points / [0.5e-3 * cells, 0.5e-3 * cells, 1e-3 * layers] - [1, 1, 0]).T
    points = np.stack([0.03 * x * np.sqrt(1 - y**2 / 2), 0.03 * y * np.sqrt(1 - x**2 / 2), 0.02 * z], axis=1)
    return Volume(points, made.tetrahedra)


def pressed(volume: Volume, poisson: float, law: Law = "neo-hookean") -> QuasiStaticSolver:
    bottom, top = half_space("z", "<", 1e-9), half_space("z", ">", 0.02 - 1e-9)
    return QuasiStaticSolver(HyperelasticModel(volume, Material(10e3, poisson), bottom, top, law=law))


# Converged axisymmetric quadratic elements with the same laws, at 2, 4 and 6 mm.
CONVERGED: list[tuple[Law, float, tuple[float, ...]]] = [
    ("neo-hookean", 0.3, (0.139, 0.417, 0.784)),
    ("neo-hookean", 0.45, (0.158, 0.471, 0.876)),
    ("neo-hookean", 0.49, (0.167, 0.494, 0.919)),
    ("corotational", 0.3, (0.130, 0.361, 0.620)),
    ("corotational", 0.45, (0.138, 0.368, 0.602)),
    ("corotational", 0.49, (0.142, 0.371, 0.599)),
]


COARSE, FINE = (14, 5, 0.08), (21, 7, 0.04)  # 1,350 and 3,872 points


@pytest.mark.parametrize(
    ("case", "mesh"), [(case, COARSE) for case in CONVERGED] + [(case, FINE) for case in (CONVERGED[0], CONVERGED[5])]
)
def test_a_sphere_on_a_cylinder_feels_converged_elements(
    case: tuple[Law, float, tuple[float, ...]], mesh: tuple[int, int, float]
) -> None:
    """The fine mesh at the extremes: the softest law and the stiffest."""
    (law, poisson, expected), (cells, layers, bound) = case, mesh
    body = pressed(cylinder(cells, layers), poisson, law)
    rest = [0.0, 0.0, 0.028]
    centers = np.array([[rest - depth * UP] for depth in (2e-3, 4e-3, 6e-3)])
    rows = body.core.settle(centers, np.broadcast_to(UP, centers.shape).copy(), np.array([8e-3]), False, 60)
    assert rows[:, -1].all()
    assert rows[:, 2] == pytest.approx(expected, rel=bound)


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_the_force_is_the_slope_of_the_energy_in_each_direction(tip: TipShape) -> None:
    """Of body and layer, with the tip beside the center and pressed 3 mm: by central differences of equilibria."""
    body = pressed(block((0.04, 0.04, 0.02), 0.005), 0.4)
    flat = tip == "flat"
    middle = np.array([0.018, 0.023, 0.02 - 3e-3 + (0.0 if flat else 8e-3)])

    def energy(at: Array) -> tuple[float, Array]:
        row = body.core.settle(at[None, None], UP[None, None].copy(), np.array([8e-3]), flat, 100)[0]
        assert row[-1] > 0
        return body.core.energy(), row[:3]

    _, force = energy(middle)
    step = 1e-4
    slopes = [(energy(middle + step * way)[0] - energy(middle - step * way)[0]) / (2 * step) for way in np.eye(3)]
    assert -np.array(slopes) == pytest.approx(force, abs=0.01 * force[2])


def test_turning_body_and_tip_turns_the_force() -> None:
    volume = block((0.04, 0.04, 0.02), 0.005)
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    forces = []
    for rotation in (np.eye(3), turn):

        def at_height(low: float, high: float, rotation: Array = rotation) -> Selector:
            def inside(points: Array) -> NDArray[np.bool_]:
                height = points @ rotation[:, 2]
                return (height > low) & (height < high)

            return Selector("between two heights", inside)

        turned = Volume(volume.points @ rotation.T, volume.tetrahedra)
        model = HyperelasticModel(turned, Material(8e3, 0.4), at_height(-1.0, 1e-9), at_height(0.02 - 1e-9, 1.0))
        body = QuasiStaticSolver(model)
        force, _ = body.indent(rotation @ [0.018, 0.023, 0.02], 8e-3, 4e-3, outward=rotation @ UP)
        forces.append(rotation.T @ force)
    assert forces[1] == pytest.approx(forces[0], abs=1e-3 * forces[0][2])


def test_finer_cells_change_the_force_by_less_than_a_tenth() -> None:
    """Cells of 5 and 3.3 mm under a sphere of 8 mm, 4 mm deep."""
    forces = []
    for cells in (8, 12):
        body = pressed(block((0.04, 0.04, 0.02), 0.04 / cells), 0.45)
        forces.append(body.indent([0.02, 0.02, 0.02], 8e-3, 4e-3, outward=UP)[0][2])
    assert forces[0] == pytest.approx(forces[1], rel=0.1)


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
def test_a_tip_outside_of_an_open_contact_surface_feels_nothing(law: Law) -> None:
    """Beside and below a block that is touched on its top, as on the same block that is touched all over.

    The cone that continues a deep sphere widens without end, and contains the top of a tip that is lower.
    """
    volume = block((0.04, 0.04, 0.02), 5e-3)
    bottom, top = half_space("z", "<", 1e-9), half_space("z", ">", 0.02 - 1e-9)
    solid = QuasiStaticSolver(HyperelasticModel(volume, Material(10e3, 0.45), bottom, top, law=law))
    for place in ([-7, 20, 10], [-6.5, 20, 10], [-8, 20, 4], [48, 20, 19], [20, 20, -8], [20, 20, -60]):
        path = np.tile(1e-3 * np.array(place), (60, 1))
        solid.reset()
        felt = solid.simulate_path(path, 6e-3, outward=[0.0, 0.0, 1.0], every=5)
        assert not felt.force.any(), place
    down, beside = np.linspace(24.5e-3, 8e-3, 300), np.linspace(10e-3, -6.5e-3, 300)
    path = np.concatenate([[[x, 0.02, 24.5e-3] for x in beside], [[-6.5e-3, 0.02, z] for z in down]])
    solid.reset()
    felt = solid.simulate_path(path, 6e-3, outward=[0.0, 0.0, 1.0], every=20)
    assert np.linalg.norm(felt.force[:100, 0], axis=1).max() > 0.05
    assert not felt.force[300:].any()


def slender(size: tuple[float, float, float], cell: float, fixed: str, poisson: float = 0.4) -> Body:
    return build(block(size, cell), young=2e4, poisson=poisson, fixed=fixed)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_forces_of_a_touch_as_deep_as_rounding_are_found(friction: float) -> None:
    """They vanish as the beam yields, and the residual of a force of 1 nN counted as an error of its sum."""
    beam = slender((0.06, 0.01, 0.01), 2.5e-3, "x < 0.1 mm").hyperelastic("1 ms", static_friction=friction)
    touch = np.array([0.05, 0.005, 0.016])
    for depth in 10.0 ** np.random.default_rng(3).uniform(-11.0, -8.0, 60):
        heights = np.array([1e-4, 5e-5, -depth, -depth])
        force = beam.simulate_path(touch + heights[:, None] * UP, 6e-3).force
        assert np.linalg.norm(force, axis=1).max() < 1e-5


def test_a_force_that_lags_for_want_of_energy_is_refused_and_shorter_updates_find_it() -> None:
    """A tip led round a circle on a column came to rest with half its force or less, and nothing said so."""
    column = slender((0.016, 0.016, 0.04), 4e-3, "z < 0.1 mm", poisson=0.45)
    angle = np.maximum(np.linspace(-0.1 * np.pi, 6.0 * np.pi, 3970), 0.0)
    circle = 2e-3 * np.stack([np.sin(angle), -np.cos(angle), np.zeros_like(angle)], axis=1) + [0.008, 0.008, 0.046]

    def path(depth: float) -> Array:
        down = circle[0] + np.linspace(2e-4, -depth, 200)[:, None] * UP
        round_ = circle - depth * UP
        return np.vstack([down, round_, np.repeat(round_[-1:], 1000, axis=0)])

    with pytest.raises(BodyError, match=r"the contact force was not found in \d+ of 5170 ticks.*shorter interval"):
        column.hyperelastic("1 ms", update_interval="20 ms").simulate_path(path(2e-3), 6e-3)
    force = column.hyperelastic("1 ms", update_interval="2 ms").simulate_path(path(1.5e-3), 6e-3).force
    assert np.linalg.norm(force[-1] - force[350]) < 0.01 * np.linalg.norm(force[350])


def test_a_tip_that_slides_over_a_beam_feels_all_of_its_friction() -> None:
    """The beam yields more and more on the way. Its energy counted as given by nobody, which drained the friction."""
    beam = slender((0.06, 0.014, 0.01), 3e-3, "x < 0.1 mm")
    touched = np.array([0.03, 0.007, 0.016])
    down = touched + np.linspace(2e-4, -2e-3, 150)[:, None] * UP
    path = np.vstack([down, down[-1] + np.linspace(0.0, 0.02, 1000)[:, None] * [1.0, 0.0, 0.0]])
    for update in ("2 ms", "10 ms", "20 ms"):
        felt = beam.hyperelastic("1 ms", update_interval=update, static_friction=0.4).simulate_path(path, 6e-3)
        friction, normal = (np.linalg.norm(f, axis=1)[-500:] for f in (felt.friction, felt.force - felt.friction))
        assert np.abs(friction / normal / 0.4 - 1.0).max() < 0.12


def without(cells: Volume, cut: NDArray[np.bool_]) -> Volume:
    """Return a volume without some of its tetrahedra."""
    used, number = np.unique(cells.tetrahedra[~cut], return_inverse=True)
    return Volume(cells.points[used], number.reshape(-1, 4), "cut")


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
def test_a_wall_beside_a_sphere_is_not_touched(law: Law) -> None:
    """The cone above a sphere contains the upper part of a wall beside it, which pushed the sphere away."""
    whole = block((0.04, 0.024, 0.028), 4e-3)
    center = whole.points[whole.tetrahedra].mean(axis=1)
    step = without(whole, (center[:, 0] < 0.024) & (center[:, 2] > 0.012))
    for radius, gap, within in ((4e-3, 1e-3, 1e-6), (6e-3, 1e-3, 1e-6), (4e-3, 1e-4, 1e-4)):
        point = (0.024 - radius - gap, 0.012, 0.012)
        force, wall = [], []
        for touch in (None, "box -1 -1 11.9 to 24.1 25 12.1 mm"):
            body = build(step, young=10e3, fixed="z <= 0 mm", touch=touch).hyperelastic("1 ms", law=law)
            found = body.indent(point, radius, 1.5e-3)
            force.append(found.force)
            wall.append(np.abs(found.displacement[body.nodes[:, 2] > 0.02]).max(initial=0.0))
        assert force[0] == pytest.approx(force[1], abs=within)
        assert 0.0 < wall[0] < 0.2e-3


def test_a_sphere_presses_a_cavity_from_inside_as_if_its_other_walls_could_not_be_touched() -> None:
    """Its cone contains the opposite wall, and was refused for inverted tetrahedra."""
    whole = block((0.04, 0.04, 0.04), 4e-3)
    center = whole.points[whole.tetrahedra].mean(axis=1) - 0.02
    hollow = without(whole, (np.abs(center) < 0.012).all(axis=1))
    force = []
    for touch in ("box 7 7 7 to 33 33 33 mm", "box 7 7 31.9 to 33 33 32.1 mm"):
        body = build(hollow, young=10e3, fixed="z <= 0 mm", touch=touch).hyperelastic("1 ms")
        force.append(body.indent((0.021, 0.019, 0.032), 5e-3, 1.5e-3).force)
    assert force[1][2] < -0.02
    assert force[0] == pytest.approx(force[1], abs=1e-6)


def test_the_rim_of_a_deep_dent_stays_under_the_cone() -> None:
    """A sphere 1.8 radii deep: no vertex of the surface lies in the shaft above it."""
    body = build(block((0.04, 0.04, 0.03), 4e-3), young=10e3, fixed="z <= 0 mm", touch="z >= 30 mm", poisson=0.4)
    solid = body.hyperelastic("1 ms")
    radius, point = 5e-3, np.array([0.021, 0.019, 0.03])
    found = solid.indent(point, radius, 1.8 * radius)
    place = solid.nodes + found.displacement - (point + (radius - 1.8 * radius) * UP)
    aside = np.linalg.norm(place[:, :2], axis=1)
    assert (place[:, 2] > 0.0).sum() > 20
    assert aside[place[:, 2] > 0.0].min() > 0.8 * radius
