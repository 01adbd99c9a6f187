"""Stability of any device: the arm at its poses, in hands, sampled with fractions of a delay, or measured."""

from __future__ import annotations

import control
import numpy as np
import pytest
from palpate import devices, linearize
from palpate.errors import DeviceError, PoseError, StabilityError
from palpate.linear import HumanArm, LinearDevice, discretize_zoh, wall_loop
from palpate.stability import (
    MeasuredResponse,
    critical_stiffness,
    stability_boundary,
    stability_interval,
    wall_limit,
    wall_spectral_radius,
    workspace,
)

ARM = devices.load("phantom-premium-1.5a")
SLIDER = devices.load("slider")
POSE = (0.0, 2.2314, 3.2776)  # rad, at rest
T = 1e-3


def test_apparent_mass_and_damping_along_a_line() -> None:
    """At a pose the tip is 1/(n J M^-1 J^T n); the yaw alone moves along x, so that x is one mass with one damper."""
    j, inertia = ARM.jacobian(POSE), ARM.mass_matrix(POSE)
    for along in (np.array([1.0, 0, 0]), np.array([0.3, -0.5, 0.8])):
        n = along / np.linalg.norm(along)
        expected = 1 / (n @ j @ np.linalg.inv(inertia) @ j.T @ n)
        assert LinearDevice.at_pose(ARM, POSE, along).apparent_mass == pytest.approx(expected, rel=1e-12)
    x = LinearDevice.at_pose(ARM, POSE)
    assert x.state_space.nstates == 2  # the motions that a wall across x does not feel are left out
    lever = j[0, 0]
    same = LinearDevice.of_mass(inertia[0, 0] / lever**2, ARM.viscous[0] / lever**2)
    for b in (0.0, 2.0, 20.0):
        assert critical_stiffness(x, period=T, virtual_damping=b) == pytest.approx(
            critical_stiffness(same, period=T, virtual_damping=b),
            rel=1e-5,  # the hold's force turns with the yaw
        )


def test_a_tips_device_may_be_named() -> None:
    """The name, as the device itself; and what is no device is told in a sentence."""
    assert LinearDevice.at_pose("slider", [0.0]).inertia == LinearDevice.at_pose(SLIDER, [0.0]).inertia
    assert (linearize("slider", [0.0]).A == linearize(SLIDER, [0.0]).A).all()
    assert LinearDevice.at_pose("phantom-premium-1.5a", POSE).name == LinearDevice.at_pose(ARM, POSE).name
    with pytest.raises(DeviceError, match="there is no device 'phantom' in the catalog"):
        LinearDevice.at_pose("phantom", POSE)
    with pytest.raises(DeviceError, match=r"a device is given by its name in the catalog .* not by None"):
        LinearDevice.at_pose(None, POSE)  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match="a file is named by text or a Path, not by None"):
        workspace(None)  # type: ignore[arg-type]


@pytest.mark.parametrize("along", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_boundary_of_the_arm_is_where_its_eigenvalues_cross(along: tuple[int, int, int]) -> None:
    """Every point of the traced curve is an eigenvalue on the circle; one per mille inside is stable, outside not."""
    loop = wall_loop(LinearDevice.at_pose(ARM, POSE, along), T, 1.0)
    curve = stability_boundary(loop, points=60)
    k, b = curve.stiffness, curve.damping
    inner = k > 0.05 * k.max()
    assert wall_spectral_radius(loop, stiffness=k, virtual_damping=b) == pytest.approx(1.0, abs=1e-8)
    assert np.all(wall_spectral_radius(loop, stiffness=0.999 * k, virtual_damping=b)[inner] < 1)
    assert np.all(wall_spectral_radius(loop, stiffness=1.001 * k, virtual_damping=b)[inner] > 1)
    assert critical_stiffness(loop, virtual_damping=float(b[20])) == pytest.approx(k[20], rel=1e-6)


def test_slider_of_the_catalog_is_its_mass() -> None:
    tip = LinearDevice.at_pose(SLIDER, [0.0])
    assert critical_stiffness(tip, period=T) == pytest.approx(
        wall_limit(mass=0.06, damping=0.05, period=T).critical_stiffness, rel=1e-12
    )
    with pytest.raises(PoseError, match="cannot be pushed along"):
        LinearDevice.at_pose(SLIDER, [0.0], (0, 1, 0))


def test_delay_between_whole_samples_joins_them() -> None:
    """Critical stiffness falls from n = 0 to n = 2, ever more slowly, and meets the whole delays."""
    tip = LinearDevice.of_mass(0.06, 0.05)
    delays = np.linspace(0, 2, 41)
    values = np.array([critical_stiffness(tip, period=T, delay=d, virtual_damping=5.0) for d in delays])
    assert np.all(np.diff(values) < 0)
    assert np.all(np.diff(values, n=2) > 0)
    for n in (0, 1):
        at = critical_stiffness(tip, period=T, delay=n + 1e-7, virtual_damping=5.0)
        assert at == pytest.approx(values[20 * n], rel=1e-5)


def test_fraction_of_a_delay_against_a_finer_clock() -> None:
    """A loop at T with 2.5 samples of delay, simulated at T/2 where the delay is whole: the same eigenvalues."""
    m, b, k, v = 0.06, 0.3, 700.0, 1.0
    fine = discretize_zoh(LinearDevice.of_mass(m, b), T / 2)
    a, g = np.eye(2) + fine.step, fine.now
    state = 2 + 6 + 1  # motion, forces of the last six half periods, previous position
    half = np.zeros((state, state))  # a half period in which the oldest force acts
    half[:2, :2], half[:2, 7] = a, g
    half[3:8, 2:7] = np.eye(5)
    half[2, 2] = 1.0  # the command stays held
    half[8, 8] = 1.0
    command = np.eye(state)
    command[2] = 0
    command[2, :2], command[2, 8] = -(k + v / T) * fine.out, v / T
    command[8] = 0
    command[8, :2] = fine.out
    # after the command (entry 2) five shifts reach entry 7: 2.5 periods
    period = half @ half @ command
    direct = np.abs(np.linalg.eigvals(period)).max()
    loop = wall_loop(LinearDevice.of_mass(m, b), T, 2.5)
    assert loop.spectral_radius(k, v) == pytest.approx(direct, rel=1e-10)


def test_controller_and_filter_in_the_loop() -> None:
    """A gain of two halves the stiffness; a one-sample delay as a controller is a delay; alpha filters the speed."""
    tip = LinearDevice.of_mass(0.06, 0.05)
    plain = critical_stiffness(tip, period=T)
    twice = control.StateSpace([], [], [], [[2.0]], T)
    assert critical_stiffness(tip, period=T, controller=twice) == pytest.approx(plain / 2, rel=1e-12)
    shift = control.TransferFunction([1], [1, 0], T)
    assert critical_stiffness(tip, period=T, controller=shift, virtual_damping=3.0) == pytest.approx(
        critical_stiffness(tip, period=T, delay=1, virtual_damping=3.0), rel=1e-11
    )
    lag, tripled = control.TransferFunction([0.7], [1, -0.3], T), control.TransferFunction([2.1], [3, -0.9], T)
    assert critical_stiffness(tip, period=T, controller=tripled) == pytest.approx(
        critical_stiffness(tip, period=T, controller=lag), rel=1e-11
    )
    filtered = critical_stiffness(tip, period=T, velocity_filter=0.8, virtual_damping=10.0)
    assert filtered < critical_stiffness(tip, period=T, virtual_damping=10.0)
    loop = wall_loop(tip, T, 0.0, 0.8)
    assert loop.spectral_radius(filtered, 10.0) == pytest.approx(1.0, abs=1e-10)


def test_a_device_that_falls_over_needs_a_least_stiffness() -> None:
    """An inverted pendulum (stiffness -s) is stable from K = s on."""
    upright = control.StateSpace([[0, 1], [5.0 / 0.06, -2.0 / 0.06]], [[0], [1 / 0.06]], [[1, 0]], [[0]])
    limits = stability_interval(wall_loop(upright, T))
    assert limits.min_stable_stiffness == pytest.approx(5.0, rel=1e-9)
    assert limits.stiffness > 1000


@pytest.mark.parametrize(
    ("device", "options", "says"),
    [
        (LinearDevice.of_mass(1.0), {"period": 0.0}, "a rate of zero has none"),
        (LinearDevice.of_mass(1.0), {"period": T, "delay": -1}, "not be causal"),
        (LinearDevice.of_mass(1.0), {"period": np.nan}, "period must be finite"),
        (LinearDevice.of_mass(1.0), {}, "period is missing"),
        (LinearDevice.of_mass(1.0), {"period": T, "velocity_filter": 1.0}, "at least 0 and below 1"),
        (
            LinearDevice.of_mass(1.0),
            {"period": T, "controller": control.TransferFunction([1, 0, 0], [1, 0.5], T)},
            "not causal",
        ),
        (
            LinearDevice.of_mass(1.0),
            {"period": T, "controller": control.TransferFunction([1], [1, -1.2], T)},
            "unstable",
        ),
        (LinearDevice.of_mass(1.0), {"period": T, "controller": control.TransferFunction([1], [1, 1])}, "continuous"),
        (
            LinearDevice.of_mass(1.0),
            {"period": T, "controller": control.TransferFunction([1], [1, 0], 2 * T)},
            "sampled every",
        ),
        (control.StateSpace([[0.5]], [[1]], [[1]], [[0]], T), {"period": T}, "must be continuous"),
        (control.StateSpace([[-1.0]], [[1]], [[1]], [[1.0]]), {"period": T}, "D must be zero"),
        ("phantom", {"period": T}, "must be a LinearDevice"),
    ],
)
def test_what_cannot_be_judged_is_refused_in_one_sentence(
    device: object, options: dict[str, object], says: str
) -> None:
    with pytest.raises(StabilityError, match=says) as problem:
        critical_stiffness(device, **options)  # type: ignore[arg-type]
    assert "\n" not in str(problem.value)


def test_what_is_no_mass_or_hand_is_refused() -> None:
    with pytest.raises(StabilityError, match="mass must be positive in kg"):
        wall_limit(mass=0.0, period=T)
    with pytest.raises(StabilityError, match="damping must not be negative"):
        wall_limit(mass=1.0, damping=-1.0, period=T)
    with pytest.raises(StabilityError, match="behind fingertip tissue"):
        HumanArm(0.0, 1.0, 1.0, 500.0)
    with pytest.raises(StabilityError, match="along must be a direction"):
        LinearDevice.at_pose(ARM, POSE, (0, 0, 0))


def response(count: int = 400, noise: float = 0.0, top: float = 499.0) -> MeasuredResponse:
    """A response as an analyser would record it: 60 g, .5 N s/m, one sample of delay, relative noise."""
    rng = np.random.default_rng(0)
    f = np.linspace(2.0, top, count)
    g = discretize_zoh(LinearDevice.of_mass(0.06, 0.5), T, 1).response(2 * np.pi * f * T)
    disturbed = g * (1 + noise * (rng.normal(size=count) + 1j * rng.normal(size=count)))
    return MeasuredResponse(f, disturbed, T)


@pytest.mark.parametrize("damping", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_measured_response_holds_the_truth_in_its_interval(noise: float, damping: float) -> None:
    exact = critical_stiffness(discretize_zoh(LinearDevice.of_mass(0.06, 0.5), T, 1), virtual_damping=damping)
    verdict = response(noise=noise).critical_stiffness(damping)
    assert verdict.known
    assert verdict.low - 1e-3 * exact <= exact <= verdict.high + 1e-3 * exact
    if noise == 0.0:
        assert verdict.critical_stiffness == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize(
    ("measured", "says"),
    [
        (response(noise=0.6), "too noisy"),
        (response(top=20.0, count=50), "too short"),
        (response(count=10), "10 frequencies"),
        (response(count=18), "too far apart|too noisy"),
    ],
)
def test_measured_response_that_cannot_tell_says_why(measured: MeasuredResponse, says: str) -> None:
    verdict = measured.critical_stiffness(2.0)
    assert not verdict.known
    assert verdict.sentence.startswith("Undecided: ")
    assert any(part in verdict.sentence for part in says.split("|"))
    assert np.isnan(verdict.critical_stiffness)


def test_of_two_crossings_between_neighboring_frequencies_the_softer_one_is_the_limit() -> None:
    """W = K + j (theta - a)(theta - b) with a stiffness that rises with the angle: the limit is K(a)."""
    step = 0.45 / T / 64
    frequency = step * np.arange(1, 65)
    angle = 2 * np.pi * frequency * T
    first, second = (2 * np.pi * step * T * place for place in (30.1, 31.2))
    required = 1000.0 + 100.0 * angle + 50j * (angle - first) * (angle - second)
    found = MeasuredResponse(frequency, -1.0 / required, T, np.full(64, 1e-12)).critical_stiffness()
    assert found.known
    assert found.critical_stiffness == pytest.approx(1000.0 + 100.0 * first, rel=1e-9)
    assert found.frequency == pytest.approx(30.1 * step, rel=1e-9)


def test_measured_response_that_is_none_is_refused() -> None:
    with pytest.raises(StabilityError, match="half the sampling rate"):
        MeasuredResponse(np.array([1.0, 600.0]), np.array([1.0, 1.0 + 0j]), T)
    with pytest.raises(StabilityError, match="finite"):
        MeasuredResponse(np.array([1.0, 2.0]), np.array([1.0, np.nan + 0j]), T)


def test_the_traced_curve_misses_nothing() -> None:
    """Random devices, delays, filters and hands: wherever the search over K finds the limit, the curve passes."""
    rng = np.random.default_rng(12)
    seen = 0
    for _ in range(60):
        m, b, period = 10 ** rng.uniform(-2.5, 1), 10 ** rng.uniform(-4, 1.5), 10 ** rng.uniform(-4, -2)
        arm = None
        if rng.random() < 0.7:
            tissue = (10 ** rng.uniform(0, 5.5), 10 ** rng.uniform(-4, 1.5)) if rng.random() < 0.6 else ()
            arm = HumanArm(
                10 ** rng.uniform(-2.5, 0.5), 10 ** rng.uniform(-4, 1.5), 10 ** rng.uniform(-1, 5.5), *tissue
            )
        loop = wall_loop(
            LinearDevice.of_mass(m, b, arm), period, rng.choice([0, 1, 2, 5, 0.3]), rng.choice([0, 0.5, 0.9])
        )
        curve = stability_boundary(loop, points=400)
        assert wall_spectral_radius(loop, stiffness=curve.stiffness, virtual_damping=curve.damping) == pytest.approx(
            1, abs=1e-7
        )
        assert loop.spectral_radius(curve.inside[1], curve.inside[0]) < 1
        for damping in rng.uniform(0, curve.damping.max(), 2):
            limit = stability_interval(loop, damping).stiffness
            if 0 < limit < np.inf:
                right = (curve.damping - damping) / np.ptp(curve.damping)
                up = (curve.stiffness - limit) / curve.stiffness.max()
                assert np.hypot(right, up).min() < 0.02
                seen += 1
    assert seen > 90


def test_noise_of_a_measured_response_is_found_on_any_grid_of_frequencies() -> None:
    """A power law is straight in logarithms, so it has no noise; relative noise added to it is found."""
    rng = np.random.default_rng(2)
    f = np.cumsum(rng.uniform(0.05, 0.2, 3000)) + 1.0
    exact = 3e-4 * (1j * f) ** -1.5
    silent = MeasuredResponse(f, exact, T)._noise() / np.abs(exact)
    assert silent.max() < 1e-9
    noisy = exact * (1 + 0.01 * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f))))
    assert MeasuredResponse(f, noisy, T)._noise() / np.abs(noisy) == pytest.approx(0.01, rel=0.05)
