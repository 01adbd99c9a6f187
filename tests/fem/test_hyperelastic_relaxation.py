"""Standard linear solid at large strain: its law, its limits, and the passivity of a body that relaxes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate import _core
from palpate.errors import ScenarioError, StabilityError
from palpate.fem import Body, BodyError, HyperelasticModel, Law, Material, QuasiStaticSolver, block, build
from palpate.fem.selectors import half_space
from palpate.scenario import Scenario
from palpate.simulation.body_response.held_tip import HeldTip
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
YOUNG, POISSON, RATIO, CREEP_TIME = 5e3, 0.4, 3.0, 0.3
SHEAR, LAME = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
RELAXATION_TIME = CREEP_TIME / RATIO
LAWS: list[Law] = ["neo-hookean", "corotational"]
both_laws = pytest.mark.parametrize("law", LAWS)
CUBE = block((0.01, 0.01, 0.01), 0.005)


class Uniform:
    """Cube without support under uniform deformation, of the core's model."""

    def __init__(self, law: Law, ratio: float = RATIO) -> None:
        x, cells = np.ascontiguousarray(CUBE.points), np.ascontiguousarray(CUBE.tetrahedra, dtype=np.int64)
        moduli = np.full(len(cells), SHEAR), np.full(len(cells), LAME)
        free = np.zeros(len(x), dtype=bool)
        self.core = _core.HyperelasticModel(x, cells, *moduli, free, law == "corotational", ratio, CREEP_TIME)

    def stress(self, deformation: Array, duration: float) -> Array:
        """Return the first Piola-Kirchhoff stress after a step to a deformation gradient, Pa."""
        x = CUBE.points
        forces = self.core.evaluate(np.ascontiguousarray(x @ (deformation - np.eye(3)).T), duration)[1]
        return np.asarray(forces.T @ x / 1e-6)


def elastic_stress(deformation: Array, law: Law) -> Array:
    """First Piola-Kirchhoff stress of the long term (..., 3, 3), Pa, from the laws of the docstring."""
    if law == "neo-hookean":
        j = np.linalg.det(deformation)[..., None, None]
        cofactor = j * np.swapaxes(np.linalg.inv(deformation), -1, -2)
        return SHEAR * (deformation - cofactor) + (LAME + SHEAR) * (j - 1) * cofactor
    u, s, v = np.linalg.svd(deformation)
    return 2 * SHEAR * (deformation - u @ v) + LAME * (s.sum(-1) - 3)[..., None, None] * (u @ v)


def shear_and_turn(time: Array | float) -> Array:
    """Deformation gradients (..., 3, 3) of a motion with shear to 0.6, compression to 0.7 and a rotation of 115 deg."""
    t = np.asarray(time)
    out = np.zeros((*t.shape, 3, 3)) + np.diag([1.0, 1.0, 1.1])
    out[..., 0, 1], out[..., 1, 1] = 0.6 * np.sin(4 * t), 1.0 - 0.3 * np.sin(3 * t) ** 2
    return Rotation.from_rotvec(2 * t.reshape(-1, 1) * np.array([0.0, 0.0, 1.0])).as_matrix().reshape(out.shape) @ out


@both_laws
def test_stress_at_large_strain_is_the_integral_of_the_law_and_its_error_falls_with_the_square_of_the_step(
    law: Law,
) -> None:
    """Reference: S(1) + (r - 1) [S(0) w(0) + integral of w S' dt], w = exp(-(1 - t) / tau), by the trapezoidal rule."""
    t = np.linspace(0.0, 1.0, 8001)
    f = shear_and_turn(t)
    second = np.linalg.solve(f, elastic_stress(f, law))
    fading = np.exp(-(1.0 - 0.5 * (t[1:] + t[:-1])) / RELAXATION_TIME)[:, None, None]
    overstress = (RATIO - 1) * (second[0] * np.exp(-1.0 / RELAXATION_TIME) + (fading * np.diff(second, axis=0)).sum(0))
    expected = f[-1] @ (second[-1] + overstress)
    errors = []
    for steps in (40, 80, 160):
        cube = Uniform(law)
        cube.stress(shear_and_turn(0.0), 0.0)
        for k in range(steps):
            stress = cube.stress(shear_and_turn((k + 1) / steps), 1.0 / steps)
        errors.append(np.abs(stress - expected).max() / np.abs(expected).max())
    assert errors[-1] < 2e-4
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.05)


@both_laws
def test_a_small_strain_relaxes_as_the_standard_linear_solid(law: Law) -> None:
    strain = np.eye(3) + 1e-6 * np.array([[2.0, 1.0, 0.0], [1.0, -1.0, 0.5], [0.0, 0.5, 3.0]])
    cube = Uniform(law)
    initial = cube.stress(strain, 0.0)
    for time in np.arange(1, 9) * 0.05:
        expected = (1 + (RATIO - 1) * np.exp(-time / RELAXATION_TIME)) / RATIO * initial
        np.testing.assert_allclose(cube.stress(strain, 0.05), expected, rtol=1e-9, atol=1e-9 * np.abs(initial).max())


@both_laws
def test_a_sudden_step_is_as_stiff_as_the_ratio_and_a_long_hold_is_elastic(law: Law) -> None:
    rng = np.random.default_rng(1)
    moved = 3e-4 * rng.standard_normal(CUBE.points.shape)
    elastic, solid = Uniform(law, 1.0).core, Uniform(law).core
    energy, forces = elastic.evaluate(moved)
    np.testing.assert_allclose(solid.evaluate(moved, 0.0)[1], RATIO * forces, rtol=1e-12)
    for _ in range(40):
        held = solid.evaluate(moved, RELAXATION_TIME)
    np.testing.assert_allclose(held[1], forces, rtol=1e-12)
    assert held[0] == pytest.approx(energy, rel=1e-12)
    solid.evaluate(0.5 * moved, 0.0)
    np.testing.assert_array_equal(solid.evaluate(moved)[1], forces)


@both_laws
def test_a_rotation_of_a_strained_solid_turns_its_forces_and_nothing_else(law: Law) -> None:
    rng = np.random.default_rng(2)
    moved = 5e-4 * rng.standard_normal(CUBE.points.shape)
    turn = Rotation.from_rotvec([0.7, -1.9, 1.1]).as_matrix()
    turned = np.ascontiguousarray((CUBE.points + moved) @ turn.T - CUBE.points)
    still, rotated = Uniform(law).core, Uniform(law).core
    for core in (still, rotated):
        core.evaluate(0.6 * moved, 0.0)
    energy, forces = still.evaluate(moved, 0.05)
    spun_energy, spun = rotated.evaluate(turned, 0.05)
    np.testing.assert_allclose(spun @ turn, forces, rtol=0, atol=1e-11 * np.abs(forces).max())
    assert spun_energy == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(rotated.evaluate(moved, 0.02)[1], still.evaluate(moved, 0.02)[1], atol=1e-11)


@both_laws
def test_the_tangent_is_the_derivative_of_the_forces_at_the_end_of_the_step(law: Law) -> None:
    rng = np.random.default_rng(3)
    before, at = 4e-4 * rng.standard_normal((2, *CUBE.points.shape))
    way = rng.standard_normal(CUBE.points.shape)

    def forces(displacement: Array) -> tuple[Array, Array]:
        core = Uniform(law).core
        core.evaluate(before, 0.02)
        return np.asarray(core.evaluate(displacement, 0.03)[1]), np.asarray(core.tangent(way))

    difference = (forces(at + 1e-7 * way)[0] - forces(at - 1e-7 * way)[0]) / 2e-7
    np.testing.assert_allclose(forces(at)[1], difference, rtol=0, atol=1e-5 * np.abs(difference).max())


@pytest.mark.parametrize("rate", [0.1, 1.0, 10.0])
@both_laws
def test_a_cycle_of_strain_dissipates_as_the_standard_linear_solid(law: Law, rate: float) -> None:
    """Loss per volume of a small cycle of amplitude a and w rad/s: pi (r - 1) E w tau / (1 + (w tau)^2) a^2.

    Cycles between a compression and a stretch of a third lose energy, too.
    """
    angle = np.linspace(0.0, 6 * np.pi, 241)
    mixed = np.array([[1.0, 0.2, 0.0], [0.0, -0.5, 0.0], [0.1, 0.0, -0.3]])
    for size in (1e-5, 0.33):
        cube = Uniform(law)
        motion = np.eye(3) + size * np.sin(angle)[:, None, None] * mixed
        duration = (angle[1] - angle[0]) * RELAXATION_TIME / rate
        stress = np.array([cube.stress(f, duration) for f in motion])
        work = (0.5 * (stress[1:] + stress[:-1]) * np.diff(motion, axis=0)).sum((1, 2))
        loss = work[160:].sum() / size**2
        assert loss > 0.0
        if size < 1e-3:
            strain = 0.5 * (mixed + mixed.T)
            modulus = 2 * SHEAR * (strain**2).sum() + LAME * np.trace(strain) ** 2
            assert loss == pytest.approx(np.pi * (RATIO - 1) * modulus * rate / (1 + rate**2), rel=0.01)


BOTTOM, UP = half_space("z", "<", 1e-9), np.array([0.0, 0.0, 1.0])
PAD = block((0.02, 0.02, 0.015), 0.005)
TOP = half_space("z", ">", 0.015 - 1e-9)
MIDDLE, RADIUS = np.array([0.01, 0.01, 0.015]), 0.012


@both_laws
def test_a_small_load_creeps_as_on_the_linear_body(law: Law) -> None:
    """Displacement under a constant load: that of the long term times 1 - (1 - 1 / r) exp(-t / retardation_time)."""
    solid = HyperelasticModel(
        PAD, Material(YOUNG, POISSON), BOTTOM, TOP, law=law, instantaneous_ratio=RATIO, retardation_time=CREEP_TIME
    )
    load = np.where(PAD.points[:, 2:] > 0.0149, [[1e-7, 0.0, -2e-7]], 0.0)
    long_term = solid.solve_equilibrium(load)
    solid.reset()
    assert (
        np.abs(solid.solve_equilibrium(load, duration=0.0) - long_term / RATIO).max() < 1e-4 * np.abs(long_term).max()
    )
    step = 0.02
    for k in range(15):
        moved = solid.solve_equilibrium(load, duration=step)
        part = 1 - (1 - 1 / RATIO) * np.exp(-(k + 1) * step / CREEP_TIME)
        assert np.abs(moved - part * long_term).max() < 2e-3 * np.abs(long_term).max()


def pad(law: Law = "neo-hookean", ratio: float = RATIO, creep: float = CREEP_TIME) -> Body:
    built = build(PAD, young=YOUNG, poisson=POISSON, fixed=BOTTOM, touch=TOP, order=1)
    return built.hyperelastic(
        "1 ms", law=law, update_interval="10 ms", instantaneous_ratio=ratio, retardation_time=creep
    )


def pressed(depth: Array) -> Array:
    return MIDDLE + (RADIUS - depth)[:, None] * UP


def work(path: Array, force: Array) -> Array:
    """Work of the tip on the body since the start, by sample, J."""
    steps = -(0.5 * (force[1:] + force[:-1]) * np.diff(path, axis=0)).sum(1)
    return np.concatenate(([0.0], np.cumsum(steps)))


@both_laws
def test_a_deep_press_held_for_long_has_the_force_of_the_elastic_body(law: Law) -> None:
    """The elastic layer in series, a part of some percent on this mesh, makes the relaxation a little slower."""
    depth, elastic = 4e-3, pad(law, 1.0)
    expected = elastic.indent(MIDDLE, RADIUS, depth).force[2]
    body = pad(law)
    assert body.indent(MIDDLE, RADIUS, depth).force[2] == pytest.approx(expected, rel=1e-3)
    body.core.reset()
    force = body.simulate_path(pressed(np.minimum(np.arange(700) * 2e-4, depth)), RADIUS, outward=UP).force[:, 2]
    assert force[-1] == pytest.approx(expected, rel=5e-3)
    assert np.all(np.diff(force[100:]) < 1e-6 * expected)
    rate = -np.polyfit(np.arange(100, 400) * 1e-3, np.log(force[100:400] - expected), 1)[0]
    assert 1.0 < 1.0 / (rate * RELAXATION_TIME) < 1.12


@both_laws
def test_a_body_returns_less_the_faster_the_tip_leaves_it_and_never_more_than_it_holds(law: Law) -> None:
    depth = 4e-3
    returned = []
    for duration, creep in ((20, CREEP_TIME), (600, 0.1 * CREEP_TIME)):
        body = pad(law, creep=creep)
        body.core.settle(pressed(np.array([depth])), UP[None], RADIUS, False, 100)
        held = body.core.energy()
        path = pressed(np.concatenate((np.linspace(depth, -1e-3, duration), np.full(20, -1e-3))))
        returned.append(-work(path, body.simulate_path(path, RADIUS, outward=UP, go_on=True).force).min())
    assert 1.5 * returned[0] < returned[1] <= held


def test_a_tip_on_a_random_way_never_gains_energy() -> None:
    rng = np.random.default_rng(5)
    ticks = np.arange(400)
    knots = np.arange(0, 441, 40)
    depth = np.interp(ticks, knots, rng.uniform(-2e-3, 4e-3, len(knots)))
    aside = np.interp(ticks, knots, rng.uniform(-3e-3, 3e-3, len(knots)))
    depth[:20] = -2e-3
    path = pressed(depth) + aside[:, None] * np.array([1.0, 0.0, 0.0])
    done = work(path, pad().simulate_path(path, RADIUS, outward=UP).force)
    assert done.min() > -1e-9
    assert done[-1] > 1e-4  # lost in the body


def test_relaxation_that_makes_no_sense_is_refused_in_a_sentence() -> None:
    built = build(PAD, young=YOUNG, poisson=POISSON, fixed=BOTTOM, touch=TOP, order=1)
    with pytest.raises(BodyError, match=r"instantaneous_ratio: .* is 1 or more, not 0.5"):
        built.hyperelastic("1 ms", instantaneous_ratio=0.5)
    with pytest.raises(BodyError, match="retardation_time"):
        built.hyperelastic("1 ms", instantaneous_ratio=2.0, retardation_time="0 s")
    solid = HyperelasticModel(PAD, Material(YOUNG, POISSON), BOTTOM, TOP, instantaneous_ratio=2.0)
    with pytest.raises(BodyError, match="a QuasiStaticSolver has no clock, so its solid does not relax"):
        QuasiStaticSolver(solid)
    with pytest.raises(BodyError, match="duration"):
        solid.evaluate(0.0 * solid.points, duration="-1 s")
    assert "instantaneous_ratio" not in str(built.hyperelastic("1 ms").kind)


BODY = {"shape": "block", "size": ["20 mm", "20 mm", "15 mm"], "young": "5 kPa", "spacing": "5 mm", "radius": "6 mm"}


def scenario(**options: str | float) -> Scenario:
    body = {**BODY, "kind": "corotational", **options}
    tables = {"device": {"name": "phantom-premium-1.5a"}, "servo": {"topology": "impedance_display"}}
    tables |= {"operator": {"kind": "fixed"}, "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]}}
    return Scenario.from_dict({**tables, "object": {"kind": "body", "body": body}})


def test_scenarios_name_the_relaxation_and_linear_analyses_refuse_it() -> None:
    with pytest.raises(ScenarioError, match=r"instantaneous_ratio: 0\.5 must be 1 or more"):
        scenario(instantaneous_ratio=0.5)
    relaxing = scenario(instantaneous_ratio=2.0, retardation_time="0.5 s")
    with pytest.raises(StabilityError, match="does not take corotational with relaxation"):
        HeldTip(relaxing, np.zeros((1, 3)))
