"""Bodies of masses and springs: against the solid they stand for, and the laws that any network keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nightly import some
from palpate import fem as bodies
from palpate.fem import Body, BodyError, block
from palpate.fem.elements import Elements
from palpate.fem.material import Material
from palpate.fem.selectors import half_space
from palpate.fem.spring_network import build_network, contact_patches
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

HEIGHT = 0.02
BOTTOM, TOP = half_space("z", "<", 1e-9), half_space("z", ">", HEIGHT - 1e-9)
VOLUME = block((0.03, 0.03, HEIGHT), 0.005)
YOUNG, POISSON = 5e3, 0.45
TICKS = (1e-4, 1e-3, 4e-3)  # s


@pytest.fixture(scope="module")
def body() -> Body:
    return bodies.build(VOLUME, young=YOUNG, poisson=POISSON, fixed=BOTTOM, touch=TOP)


@pytest.fixture(scope="module")
def lattice(body: Body) -> Body:
    return body.mass_spring("1 ms", rayleigh_beta=2e-3)


def static_compliance(body: Body) -> np.ndarray:
    """Of the network near rest (3n, 3n), m/N, through its patches."""
    begin, vertices, weights = body._patches()
    load = sparse.csr_matrix((weights, vertices, begin), shape=(len(body.nodes), len(body.contents.vertices)))
    free = np.flatnonzero(np.repeat(~body.contents.dirichlet, 3))
    full = sparse.kron(load, sparse.eye(3), format="csr")[:, free]
    return np.asarray(full @ splu(body.spring_network.matrix[free][:, free].tocsc()).solve(full.T.toarray()))


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.49])
def test_its_compliance_is_near_that_of_finite_elements(poisson: float) -> None:
    solid = bodies.build(VOLUME, young=YOUNG, poisson=poisson, fixed=BOTTOM, touch=TOP)
    found = static_compliance(solid)
    assert np.linalg.norm(found - solid.compliance) < 0.15 * np.linalg.norm(solid.compliance)


@pytest.mark.parametrize(("poisson", "layer", "depth"), some([(0.25, "2 mm = 2 kPa", "2 mm"), (0.1, None, "6 mm")]))
def test_a_press_that_inverts_tetrahedra_is_refused(poisson: float, layer: str | None, depth: str) -> None:
    """The springs hold inverted cells, and negative pressures blow them up: forces of 5e84 N at a ratio of 0.1."""
    solid = block((0.04, 0.04, HEIGHT), 0.003, layers=["2 mm"])
    deep = bodies.build(solid, young=1e4, poisson=poisson, fixed=BOTTOM, touch=TOP, surface_layer=layer)
    network = deep.mass_spring("1 ms")
    assert network.indent([0.02, 0.02, HEIGHT], "8 mm", "1 mm").force[2] > 0.0
    with pytest.raises(BodyError, match=r"the tip inverts tetrahedra of the body, which its springs do not prevent"):
        network.indent([0.02, 0.02, HEIGHT], "8 mm", depth)
    path = np.array([0.02, 0.02, HEIGHT + 8e-3]) - np.outer(np.linspace(0.0, 6e-3, 250), [0.0, 0.0, 1.0])
    with pytest.raises(BodyError, match=r"in \d+ of 250 ticks the tip inverts tetrahedra"):
        network.simulate_path(path, "8 mm")


def test_a_path_whose_last_tick_inverts_tetrahedra_is_refused() -> None:
    """The shape at the end of a tick decides: a jump of 16 mm passed."""
    solid = bodies.build(block((0.04, 0.04, HEIGHT), 0.004), young=1e4, poisson=0.45, fixed=BOTTOM, touch=TOP)
    network = solid.mass_spring("1 ms")
    path = np.array([0.02, 0.02, HEIGHT + 8e-3]) - np.outer([0.0, 0.0, 16e-3], [0.0, 0.0, 1.0])
    with pytest.raises(BodyError, match=r"in 1 of 3 ticks the tip inverts tetrahedra"):
        network.simulate_path(path, "8 mm")


@pytest.mark.parametrize("poisson", [0.0, 0.25, 0.45])
def test_uniform_strain_stores_what_the_solid_stores(poisson: float) -> None:
    """The patch test that a network can pass: nearly"""
    net = build_network(VOLUME, np.full(len(VOLUME.tetrahedra), YOUNG), poisson, 1000.0)
    shear = YOUNG / (2 * (1 + poisson))
    lame = 2 * shear * poisson / (1 - 2 * poisson)
    random = np.random.default_rng(1)
    assert net.misfit < 0.25
    for _ in range(6):
        strain = random.normal(size=(3, 3))
        strain = 0.5 * (strain + strain.T)
        u = (VOLUME.points @ strain).ravel()
        expected = VOLUME.size * (lame * np.trace(strain) ** 2 + 2 * shear * (strain**2).sum())
        assert u @ (net.matrix @ u) == pytest.approx(expected, rel=0.1)


def test_springs_alone_have_poissons_ratio_one_quarter() -> None:
    net = build_network(VOLUME, np.full(len(VOLUME.tetrahedra), YOUNG), 0.25, 1000.0)
    assert np.abs(net.pressure).max() < 1e-9 * YOUNG
    assert (net.stiffness >= 0).all()
    assert net.masses.sum() == pytest.approx(1000.0 * VOLUME.size)


def test_forces_spread_as_those_of_finite_elements(body: Body) -> None:
    elements = Elements(VOLUME, Material(YOUNG, POISSON), [BOTTOM], TOP, 1)
    begin, vertices, weights = contact_patches(VOLUME.points, elements.triangles, elements.contact_nodes)
    load = sparse.csr_matrix((weights, vertices, begin), shape=(len(elements.contact_nodes), len(VOLUME.points)))
    assert np.abs(load.T - elements.load).max() < 1e-12


def test_moved_as_a_whole_it_feels_nothing(lattice: Body) -> None:
    core, places = lattice.core, lattice.spring_network.points
    turned = places @ Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix().T + [0.01, 0.02, -0.03]
    core.reset()
    core.set_state(turned, np.zeros_like(turned))
    assert core.energy < 1e-25
    lattice.simulate_path([[1.0, 1.0, 1.0]] * 100, 0.005, outward=[0, 0, 1], go_on=True)
    assert np.abs(core.positions() - turned).max() < 1e-12
    core.set_state(places * [1.0, 1.0, 1.1], np.zeros_like(places))
    assert core.energy > 1e-6


@pytest.mark.parametrize("period", [2e-4, 1e-3, 5e-3])
def test_a_force_held_for_long_gives_the_static_answer_at_any_period(body: Body, period: float) -> None:
    """The core's ticks beside the stiffness that is assembled in Python."""
    node = int(np.argmin(np.linalg.norm(body.nodes - [0.01, 0.015, HEIGHT], axis=1)))
    force = 1e-3
    found = body.mass_spring(period, rayleigh_beta=3e-3).core.node_response(node, np.full(int(1.5 / period), force))[-1]
    assert found == pytest.approx(force * static_compliance(body)[3 * node + 2, 3 * node + 2], rel=2e-3)


@pytest.mark.parametrize("young", [2e3, 100e3])
def test_no_tick_makes_energy_while_a_tip_shakes_it(young: float) -> None:
    """At 1 kHz, without damping of its own; the work is that of the forces on what the nodes really moved."""
    springy = bodies.build(VOLUME, young=young, poisson=0.49, fixed=BOTTOM, touch=TOP).mass_spring("1 ms")
    core, inward = springy.core, -springy.normals
    random = np.random.default_rng(2)
    place, before, total, pressed = np.zeros(3), springy.displacement(), 0.0, 0
    for _ in range(1500):
        place = 0.95 * place + random.normal(size=3) * [1e-3, 1e-3, 4e-4]
        had = core.energy
        springy.simulate_path(
            (place + np.array([0.015, 0.015, HEIGHT + 0.0075]))[None], 0.008, outward=[0, 0, 1], go_on=True
        )
        nodes, forces = core.contact_forces()
        now = springy.displacement()
        work = (forces * np.einsum("ij,ij->i", inward[nodes], (now - before)[nodes])).sum()
        assert core.energy <= had + work + 1e-9 * (had + abs(work))
        before, total, pressed = now, total + work, pressed + (len(nodes) > 0)
    assert 50 < pressed < 1400
    assert 0 <= core.energy < total
    assert core.limited_steps == 0


def test_thrown_about_violently_it_only_loses_energy(lattice: Body) -> None:
    """Speeds that turn tetrahedra inside out: far outside of what it models, and still it does not blow up."""
    core, random = lattice.core, np.random.default_rng(3)
    places = lattice.spring_network.points
    core.set_state(places, random.normal(size=places.shape) * 10.0)
    had = core.energy
    for _ in range(300):
        lattice.simulate_path([[1.0, 1.0, 1.0]], 0.005, outward=[0, 0, 1], go_on=True)
        assert core.energy <= had * (1 + 1e-12)
        had = core.energy
    assert np.isfinite(core.positions()).all()


def test_closed_paths_of_the_tip_give_no_work(lattice: Body) -> None:
    t = np.linspace(0, 2 * np.pi, 400)
    random = np.random.default_rng(4)
    for _ in range(10):
        a, b = random.normal(size=(2, 3)) * [3e-3, 3e-3, 8e-4]
        way = np.outer(1 - np.cos(t), a) + np.outer(np.sin(2 * t), b) + [0.015, 0.015, HEIGHT + 0.0078]
        lattice.core.reset()
        felt = lattice.simulate_path(way, 0.008, outward=[0, 0, 1])
        assert -(felt.force[1:] * np.diff(way, axis=0)).sum() > -1e-9


def test_press_lets_it_come_to_rest(body: Body, lattice: Body) -> None:
    at = [0.015, 0.015, HEIGHT]
    pressed = lattice.indent(at, "8 mm", "1 mm", tip="flat")
    solid = body.indent(at, "8 mm", "1 mm", tip="flat")
    assert pressed.force[2] == pytest.approx(solid.force[2], rel=0.1)
    assert np.linalg.norm(pressed.displacement - solid.displacement) < 0.2 * np.linalg.norm(solid.displacement)


def test_a_press_waits_for_a_soft_body_that_it_has_thrown_off() -> None:
    """A body of 1 Pa is slower than the press: for some tenths of a second it flies ahead of the tip."""
    solid = block((0.04, 0.03, HEIGHT), 0.005)
    forces = []
    for young in (1.0, 1e3):
        soft = bodies.build(solid, young=young, poisson=0.3, fixed=BOTTOM, touch=TOP).mass_spring("1 ms")
        forces.append(soft.indent([0.02, 0.015, HEIGHT], 6e-3, 1.5e-3).force[2] / young)
    assert forces[0] == pytest.approx(forces[1], rel=0.1)


@pytest.mark.parametrize("place", [(0.015, 0.015), (0.0163, 0.0155)])
def test_the_force_under_a_flat_end_at_rest_does_not_depend_on_the_tick(body: Body, place: tuple[float, float]) -> None:
    """Where its edge crosses patches, too: they yield by their static compliance."""
    forces = [body.mass_spring(tick).indent([*place, HEIGHT], "8 mm", "1 mm", tip="flat").force[2] for tick in TICKS]
    assert np.ptp(forces) < 0.015 * min(forces)


def test_a_stiff_region_makes_stiff_springs() -> None:
    lump = bodies.build(VOLUME, young=YOUNG, fixed=BOTTOM, touch=TOP, regions=["box 0 0 0 to 15 30 20 mm = 50 kPa"])
    found, solid = np.diag(static_compliance(lump))[2::3], np.diag(lump.compliance)[2::3]
    soft, stiff = lump.nodes[:, 0] > 0.02, lump.nodes[:, 0] < 0.01
    assert found[soft].mean() / found[stiff].mean() == pytest.approx(solid[soft].mean() / solid[stiff].mean(), rel=0.15)


def test_it_comes_from_a_file_and_bad_numbers_are_told(body: Body, tmp_path: Path) -> None:
    again = Body.load(body.save(tmp_path / "b.h5"))
    assert np.array_equal(again.spring_network.stiffness, body.spring_network.stiffness)
    with pytest.raises(BodyError, match="period: 0 s must be positive"):
        body.mass_spring(0.0)
    with pytest.raises(BodyError, match="must not be negative"):
        body.mass_spring("1 ms", rayleigh_alpha=-1.0)


def test_a_network_that_is_unstable_at_rest_is_refused() -> None:
    """Below a Poisson's ratio of 1/4 pressures are negative: springs of a soft skin do not bear those of the core."""
    solid = block((0.03, 0.03, 0.02), 0.004)

    def skinned(poisson: float, skin: str = "0.5 kPa") -> Body:
        layered = bodies.build(
            solid, young=1e4, poisson=poisson, fixed=BOTTOM, touch=TOP, surface_layer=f"4 mm = {skin}"
        )
        return layered.mass_spring("1 ms")

    with pytest.raises(BodyError, match=r"mass_spring: below a Poisson's ratio of 0.25 .* unstable at rest"):
        skinned(-0.9, "10 kPa")
    with pytest.raises(
        BodyError, match=r"of stiff material they are over 4 times the shear modulus of the softest: it is too soft"
    ):
        skinned(0.1)
    assert skinned(0.3).indent([0.015, 0.015, 0.02], 8e-3, 5e-4, tip="flat").force[2] > 0.0
    assert (
        bodies.build(solid, young=1e4, poisson=0.1, fixed=BOTTOM, touch=TOP).mass_spring("1 ms").kind.name
        == "mass_spring"
    )


@pytest.mark.parametrize("period", [1e-3, 4e-3])
def test_a_press_waits_for_a_slender_body_that_creeps_to_equilibrium(period: float) -> None:
    """Its force fell by less than 0.1 % in 50 ms, and was 0.8 to 2.6 % too large."""
    strand = bodies.build(block((0.06, 0.012, 0.012), 4e-3), young=10e3, fixed="x <= 0 mm").mass_spring(period)
    point, radius, depth = np.array([0.0471, 0.0057, 0.012]), 4e-3, 1.3e-3
    pressed = strand.indent(point, radius, depth).force
    down = np.append(np.linspace(2e-4, -depth, 100), np.full(int(40.0 / period), -depth))
    held = strand.simulate_path(point + (down + radius)[:, None] * [0.0, 0.0, 1.0], radius, outward=(0, 0, 1)).force
    assert np.linalg.norm(pressed - held[-1]) < 2e-3 * np.linalg.norm(held[-1])
