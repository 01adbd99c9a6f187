"""Hyperelastic bodies with inertia: swings after a release, fast taps, and the return to rest."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate.errors import ScenarioError, StabilityError
from palpate.fem import Body, BodyError, HyperelasticModel, Law, Material, Volume, block, build
from palpate.fem.selectors import half_space
from palpate.scenario import Scenario
from palpate.simulation.body_response.held_tip import HeldTip
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

Array = NDArray[np.float64]
BOTTOM, UP, DENSITY = half_space("z", "<", 1e-9), np.array([0.0, 0.0, 1.0]), 1000.0


def masses(volume: Volume) -> Array:
    """Lumped mass of each point (N,), kg."""
    x, cells = volume.points, volume.tetrahedra
    mass = np.zeros(len(x))
    size = np.abs(np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]])) / 6
    np.add.at(mass, cells.ravel(), np.repeat(DENSITY * size / 4, 4))
    return mass


def lowest(solid: HyperelasticModel) -> tuple[float, Array]:
    """Lowest frequency at rest, rad/s, from the tangent and the lumped masses; weights (N, 3) of its amplitude."""
    solid.evaluate(0.0 * solid.points)
    free = np.flatnonzero(np.repeat(~solid.elements.dirichlet, 3))
    columns = [solid.core.tangent(np.eye(3 * len(solid.points))[k].reshape(-1, 3)).ravel()[free] for k in free]
    stiffness, mass = np.array(columns), np.repeat(masses(solid.elements.volume), 3)[free]
    squares, modes = eigh(0.5 * (stiffness + stiffness.T), np.diag(mass), subset_by_index=(0, 0))
    weights = np.zeros(3 * len(solid.points))
    weights[free] = mass * modes[:, 0]
    return float(np.sqrt(squares[0])), weights.reshape(-1, 3)


COLUMN = block((0.005, 0.005, 0.02), 0.005)


def column(interval: float, law: Law = "neo-hookean", alpha: float = 0.0) -> Body:
    built = build(COLUMN, young=5e3, poisson=0.4, fixed=BOTTOM, order=1)
    return built.hyperelastic("1 ms", law=law, update_interval=interval, density=DENSITY, rayleigh_alpha=alpha)


def released(body: Body, weights: Array, ticks: int, interval: int) -> tuple[Array, Array]:
    """Push the top of the column 1.5 mm to the side and let go. Return a mode's amplitude and the energy by update."""
    side = np.array([1.0, 0.0, 0.0])
    x = np.array([5e-3 + 4e-3, 2.5e-3, 0.0175])
    body.core.settle(x[None] - 1.5e-3 * side, side[None], 4e-3, False, 100)
    away = np.tile(x + 0.02 * side, (interval, 1))
    place, energy = [], []
    for _ in range(ticks // interval):
        body.core.simulate_path(away, np.empty((0, 3)), 4e-3, False)
        place.append(float((weights * body.core.displacement()).sum()))
        energy.append(body.core.energy())
    return np.array(place), np.array(energy)


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
def test_a_released_body_swings_at_its_lowest_frequency_and_never_gains_energy(law: Law) -> None:
    """A damped one loses exp(-alpha t) of its energy, and passes its rest as often."""
    w, mode = lowest(HyperelasticModel(COLUMN, Material(5e3, 0.4), BOTTOM, law=law))
    interval = 10
    place, energy = released(column(interval * 1e-3, law), mode, 800, interval)
    assert np.all(np.diff(energy[1:]) <= 1e-9 * energy[1])
    down = np.flatnonzero((place[:-1] > 0.0) & (place[1:] <= 0.0))
    zeros = (down + place[down] / (place[down] - place[down + 1])) * interval * 1e-3
    assert 2 * np.pi / np.diff(zeros).mean() == pytest.approx(w, rel=0.02)
    late = slice(len(energy) // 3, None)
    loss = -np.polyfit(np.arange(len(energy))[late] * interval * 1e-3, np.log(energy[late]), 1)[0]
    assert 0.0 <= loss < 0.3  # 1/s
    alpha = 4.0
    _, damped = released(column(interval * 1e-3, law, alpha), mode, 800, interval)
    fall = -np.polyfit(np.arange(len(energy))[late] * interval * 1e-3, np.log(damped[late]), 1)[0]
    assert fall - loss == pytest.approx(alpha, rel=0.05)


SMALL = block((0.01, 0.01, 0.015), 0.005)
TOP = half_space("z", ">", 0.015 - 1e-9)
DEPTH, DURATION = 1.5e-3, 0.03


def depth_at(time: Array | float) -> Array:
    return DEPTH * np.sin(np.pi * np.clip(np.asarray(time) / DURATION, 0.0, 1.0)) ** 2


def tap_by_scipy(solid: HyperelasticModel, times: Array) -> Array:
    """Force of a flat end that covers the top, N, by scipy: the solid's forces and the formula of the layer."""
    x, faces, mass = solid.points, solid.elements.triangles, masses(solid.elements.volume)[:, None]
    area = np.linalg.norm(np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]]), axis=1) / 2
    patch = np.zeros(len(x))
    np.add.at(patch, faces.ravel(), np.repeat(area / 3, 3))
    radius = np.sqrt(patch / np.pi)
    weights, stiffness, scale = [], [], []
    for f, face in enumerate(faces):
        for c in range(3):
            for share, own, following, last in ((0.2, 18, 0, 0), (0.4, 11, 5, 2), (0.4, 11, 2, 5)):
                row = np.zeros(len(x))
                row[face[[c, (c + 1) % 3, (c + 2) % 3]]] = np.array([own, following, last]) / 18
                weights.append(row)
                stiffness.append(share * 5e3 / (1 - 0.4**2) * area[f] / 3 / (0.21 * radius[face[c]]))
                scale.append(0.06 * radius[face[c]])
    points, k, s = np.array(weights), np.array(stiffness), np.array(scale)
    flank = 0.02 - np.linalg.norm((points @ x)[:, :2] - 5e-3, axis=1)  # of the end, which does not slide
    flare = 0.25 * s / 0.06
    free = ~solid.elements.dirichlet[:, None]

    def pressed(time: float, state: Array) -> Array:
        e = np.maximum(points @ state[: 3 * len(x)].reshape(-1, 3)[:, 2] + depth_at(time), 0.0)
        root = np.hypot(flare, e)
        f, slope = flank + 1.3 * flare * e / root, 1.3 * (flare / root) ** 3
        depth, steepness = e * f / (e + f), (f**2 + slope * e**2) / (e + f) ** 2
        return k * depth * (1 + (depth / s) ** 2) * steepness

    def rate(time: float, state: Array) -> Array:
        force = -solid.evaluate(state[: 3 * len(x)].reshape(-1, 3)).forces
        force[:, 2] -= points.T @ pressed(time, state)
        return np.concatenate((state[3 * len(x) :], np.where(free, force / mass, 0.0).ravel()))

    run = solve_ivp(rate, (0.0, times[-1]), np.zeros(6 * len(x)), t_eval=times, rtol=1e-5, atol=1e-8)
    return np.array([pressed(t, y).sum() for t, y in zip(run.t, run.y.T, strict=True)])


def test_a_fast_tap_feels_the_inertia_as_an_independent_integration_does() -> None:
    """Within 5 % of the peak at each tick: at first several times the static force, then less than it."""
    solid = HyperelasticModel(SMALL, Material(5e3, 0.4), BOTTOM, TOP)
    built = build(SMALL, young=5e3, poisson=0.4, fixed=BOTTOM, touch=TOP, order=1)
    period, times = 1e-4, np.arange(0.0, 0.035, 1e-4)
    path = np.column_stack((np.full(len(times), 5e-3), np.full(len(times), 5e-3), 0.015 - depth_at(times)))
    felt = built.hyperelastic(period, update_interval=period, density=DENSITY)
    force = felt.simulate_path(path, 0.02, outward=UP, tip="flat").force[:, 2]
    expected = tap_by_scipy(solid, times)
    assert np.abs(force - expected).max() < 0.05 * expected.max()
    static = built.hyperelastic(period)
    start, middle = (static.indent([5e-3, 5e-3, 0.015], 0.02, depth_at(t), tip="flat").force[2] for t in (3e-3, 15e-3))
    assert force[30] > 2.0 * start
    assert force[150] < 0.7 * middle


def test_a_slow_press_and_an_indentation_feel_the_static_force() -> None:
    built = build(SMALL, young=5e3, poisson=0.4, fixed=BOTTOM, touch=TOP, order=1)
    swinging = built.hyperelastic("1 ms", density=DENSITY, rayleigh_alpha=20.0)
    static = built.hyperelastic("1 ms")
    point, radius, depth = [5e-3, 5e-3, 0.015], 6e-3, 1e-3
    expected = static.indent(point, radius, depth).force[2]
    assert swinging.indent(point, radius, depth).force[2] == pytest.approx(expected, rel=1e-3)
    swinging.core.reset()
    depths = np.clip(np.arange(1600) * 1e-6, 0.0, depth)
    path = np.array(point) + (radius - depths)[:, None] * UP
    first = swinging.simulate_path(path, radius, outward=UP).force
    assert first[-1, 2] == pytest.approx(expected, rel=0.01)
    swinging.core.reset()
    np.testing.assert_array_equal(swinging.simulate_path(path, radius, outward=UP).force, first)


def test_options_of_inertia_that_make_no_sense_are_refused_in_a_sentence() -> None:
    built = build(SMALL, young=5e3, poisson=0.4, fixed=BOTTOM, touch=TOP, order=1)
    with pytest.raises(BodyError, match="rayleigh_beta: a hyperelastic body without density has no inertia"):
        built.hyperelastic("1 ms", rayleigh_beta="1 ms")
    with pytest.raises(BodyError, match="density: the density is positive"):
        built.hyperelastic("1 ms", density=0.0)
    with pytest.raises(BodyError, match="rayleigh_alpha"):
        built.hyperelastic("1 ms", density=DENSITY, rayleigh_alpha=-1.0)


BODY = {"shape": "block", "size": ["20 mm", "20 mm", "15 mm"], "young": "5 kPa", "spacing": "5 mm", "radius": "6 mm"}


def scenario(**options: str) -> Scenario:
    body = {**BODY, "kind": "neo-hookean", **options}
    tables = {"device": {"name": "phantom-premium-1.5a"}, "servo": {"topology": "impedance_display"}}
    tables |= {"operator": {"kind": "fixed"}, "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]}}
    return Scenario.from_dict({**tables, "object": {"kind": "body", "body": body}})


def test_scenarios_name_density_and_damping_and_linear_analyses_refuse_them() -> None:
    with pytest.raises(ScenarioError, match="rayleigh_alpha: without density neo-hookean has no inertia"):
        scenario(rayleigh_alpha="1 1/s")
    with pytest.raises(ScenarioError, match="density"):
        scenario(density="0 kg/m^3")
    swinging = scenario(density="1000 kg/m^3", rayleigh_alpha="1 1/s", rayleigh_beta="1 ms")
    with pytest.raises(StabilityError, match="does not take neo-hookean with inertia"):
        HeldTip(swinging, np.zeros((1, 3)))
