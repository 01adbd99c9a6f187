"""Kalman filter and LQG: optimality, separation, zero steady error, and the thesis's rows on the nonlinear arm."""

from __future__ import annotations

import warnings

import control
import numpy as np
import pytest
from loops import axes, press
from palpate import devices
from palpate.control import Controller, closed_loop, kalman, loop_gain, lqg, margins, spectral_radius
from palpate.devices.reach import conditioning
from palpate.errors import DesignError, PalpateWarning, PoseError
from palpate.linear import rendering_plant
from scipy.linalg import solve_discrete_lyapunov

T = 5e-4
POSE = np.array([0.0, 2.2305, 3.2776])
ARM = devices.load("phantom-premium-1.5a")
SOFT = rendering_plant(ARM, POSE, stiffness=1000.0, period=T)
ONE_DESIGN = lqg(SOFT)  # serves every row below
STIFFNESSES = (1000.0, 1050.0, 2000.0, 2500.0, 3000.0, 3500.0)  # N/m


def test_a_design_warns_near_a_singular_pose_and_is_refused_at_it() -> None:
    """By the thresholds of a run: the arm is stretched where the forearm is a right angle beyond the upper arm."""
    for away, ratio in ((0.3, 0.15), (0.03, 0.015)):
        pose = np.array([0.0, 2.2305, 2.2305 + np.pi / 2 - away])
        assert conditioning(ARM, pose[None])[0] == pytest.approx(ratio, rel=0.3)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", PalpateWarning)
            rendering_plant(ARM, pose, stiffness=1000.0, period=T)
        assert ["comes near a singular one" in str(one.message) for one in caught] == [True] * (away == 0.03)
    with pytest.raises(PoseError, match="the Jacobian is singular at this pose"):
        rendering_plant(ARM, [0.0, 2.2305, 2.2305 + np.pi / 2 - 1e-3], stiffness=1000.0, period=T)


def test_kalman_of_a_random_walk_is_the_textbook_one() -> None:
    """x+ = x + w, y = x + v: p = (q + sqrt(q^2 + 4 q r))/2, gain = p/(p + r)."""
    q, r = 0.3, 2.0
    p = (q + np.sqrt(q**2 + 4 * q * r)) / 2
    found = kalman(control.StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], 1.0), np.sqrt(q), np.sqrt(r))
    assert found.covariance[0, 0] == pytest.approx(p)
    assert found.gain[0, 0] == pytest.approx(p / (p + r))
    assert found.poles == pytest.approx([r / (p + r)])


def test_no_other_gain_has_a_smaller_error() -> None:
    """The stationary error covariance by Lyapunov's equation grows for any change of the gain."""
    found = kalman(SOFT, 1.0, 0.01)
    noise, drive = 0.01**2 * np.eye(3), SOFT.B @ SOFT.B.T

    def covariance(gain: np.ndarray) -> np.ndarray:
        a = SOFT.A @ (np.eye(6) - gain @ SOFT.C)
        k = SOFT.A @ gain
        return solve_discrete_lyapunov(a, drive + k @ noise @ k.T)

    best = covariance(found.gain)
    assert best == pytest.approx(found.covariance, rel=1e-6, abs=1e-12)
    rng = np.random.default_rng(3)
    for _ in range(10):
        change = covariance(found.gain * (1 + 0.05 * rng.normal(size=found.gain.shape))) - best
        assert np.trace(change) > 0


@pytest.mark.parametrize("method", ["zoh", "tustin"])
@pytest.mark.parametrize("integrators", [True, False])
def test_separation(method: str, integrators: bool) -> None:
    """The closed loop's poles are those of the state feedback and those of the filter, also with a direct part."""
    plant = rendering_plant(ARM, POSE, stiffness=1000.0, period=T, method=method)  # type: ignore[arg-type]
    controller = lqg(plant, integrators=integrators)
    expected = np.concatenate([controller.notes["feedback_poles"], controller.notes["filter_poles"]])
    found = list(np.linalg.eigvals(closed_loop(controller, plant).A))
    assert len(found) == len(expected)
    for pole in expected:
        nearest = int(np.argmin(np.abs(np.array(found) - pole)))
        assert abs(found.pop(nearest) - pole) < 1e-6


def test_plain_weights_leave_the_natural_frequency_and_damp_it() -> None:
    """A mass on a sampled spring with |e|^2 + |u|^2: poles at sqrt(K/m) with a damping ratio of 1/sqrt 2."""
    mass, k = 0.1, 1000.0
    b = np.array([[T**2 / 2 / mass], [T / mass]])
    eye = np.eye(3)
    plant = control.StateSpace(
        np.kron(eye, np.array([[1, T], [0, 1]])), np.kron(eye, b), np.kron(eye, [[k, 0]]), np.zeros((3, 3)), T
    )
    poles = np.log(lqg(plant, integrators=False, force_weight=1.0, speed_weight=0.0).notes["feedback_poles"]) / T
    assert np.abs(poles) == pytest.approx(np.sqrt(k / mass), rel=0.01)
    assert -poles.real / np.abs(poles) == pytest.approx(np.sqrt(0.5), rel=0.01)


def test_feedback_equals_python_control() -> None:
    """Without integrators and with a weight on the state, the gain is dlqr's: same closed-loop poles."""
    weight = np.diag([3.0, 2.0, 1.0, 0.1, 0.2, 0.3])
    ours = lqg(SOFT, integrators=False, state_weight=weight, force_weight=1e-4).notes["feedback_poles"]
    _, _, theirs = control.dlqr(SOFT.A, SOFT.B, weight, 1e-4 * np.eye(3))
    assert np.sort_complex(ours) == pytest.approx(np.sort_complex(theirs), abs=1e-9)


@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_integrators_leave_no_steady_error(stiffness: float) -> None:
    """The linear loop passes a constant F_ref with gain exactly I, whatever the object's stiffness."""
    whole = closed_loop(ONE_DESIGN, rendering_plant(ARM, POSE, stiffness=stiffness, period=T))
    rest = whole.C @ np.linalg.solve(np.eye(whole.nstates) - whole.A, whole.B) + whole.D
    assert rest[:3] == pytest.approx(np.eye(3), abs=1e-6)


@pytest.mark.parametrize("force", [1.0, 4.0, 8.5])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_one_design_holds_every_row_on_the_nonlinear_arm(force: float, stiffness: float) -> None:
    """Within 0.1 % of F/K on every axis, under 6 % overshoot, settled to 5 % within 0.1 s, no more than 1.2 F."""
    trace = press(ONE_DESIGN, stiffness, force)
    for axis in axes(trace):
        assert axis["steady_deflection_m"] == pytest.approx(force / stiffness, rel=1e-3)
        assert axis["overshoot_percent"] < 6.0
        assert axis["settling_5_percent_s"] < 0.1
    assert np.abs(trace["command_force"]).max() < 1.2 * force


@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_the_one_design_keeps_margins_at_every_stiffness(stiffness: float) -> None:
    """At every row the sampled loop bears half as much stiffness again, 35 deg of phase and a period of delay."""
    m = margins(ONE_DESIGN, rendering_plant(ARM, POSE, stiffness=stiffness, period=T))
    assert m.gain_up > 1.5
    assert m.gain_down < 0.1
    assert m.phase > 35.0
    assert m.delay > T


def test_it_bears_encoder_counts_and_the_motors_limits() -> None:
    """With quantised angles the error stays at the counts' size; with 8.5 N peak it still settles."""
    for axis in axes(press(ONE_DESIGN, 3500.0, 8.5, encoder=True)):
        assert axis["steady_deflection_m"] == pytest.approx(8.5 / 3500.0, rel=0.01)
    for axis in axes(press(ONE_DESIGN, 3500.0, 1.0, saturation=True)):
        assert axis["steady_deflection_m"] == pytest.approx(1.0 / 3500.0, rel=1e-3)


def test_without_integrators_the_error_is_zero_only_at_the_design_stiffness() -> None:
    """The feedforward knows one K; on another object a steady error stays."""
    plain = lqg(SOFT, integrators=False)

    def rest(stiffness: float) -> np.ndarray:
        whole = closed_loop(plain, rendering_plant(ARM, POSE, stiffness=stiffness, period=T))
        return (whole.C @ np.linalg.solve(np.eye(whole.nstates) - whole.A, whole.B) + whole.D)[:3]

    assert rest(1000.0) == pytest.approx(np.eye(3), abs=1e-8)
    assert np.abs(rest(3500.0) - np.eye(3)).max() > 1e-3


def limited_step(controller: Controller, limit: float) -> np.ndarray:
    """Linear loop with the command cut at ``limit`` N; F_object along x of a 4 N step, then back to 1 N at 0.3 s."""
    p, c = SOFT, controller.system
    x, xc = np.zeros(p.nstates), np.zeros(c.nstates)
    out = []
    for k in range(3000):
        y = p.C @ x
        v = np.concatenate([[4.0 if k * T < 0.3 else 1.0, 0, 0], y])
        u = c.C @ xc + c.D @ v
        applied = np.clip(u, -limit, limit)
        xc = c.A @ xc + c.B @ v
        if controller.antiwindup is not None:
            xc = xc + controller.antiwindup @ (applied - u)
        x = p.A @ x + p.B @ applied
        out.append(y[0])
    return np.array(out)


def test_antiwindup_keeps_a_saturated_step_from_overshooting() -> None:
    """Cut far below what it asks for, the loop with anti-windup overshoots less than half as much as without."""
    with_it = limited_step(ONE_DESIGN, 0.5)
    without = limited_step(Controller(ONE_DESIGN.system, None, "lqg"), 0.5)
    assert with_it.max() - 4.0 < 0.5 * (without.max() - 4.0)
    assert with_it[-1] == pytest.approx(1.0, abs=0.01)


def test_slider() -> None:
    """One degree of freedom: y and z are left alone and x is tracked."""
    slider = devices.load("slider")
    plant = rendering_plant(slider, [0.0], stiffness=1000.0, period=1e-3)
    controller = lqg(plant)
    assert not np.any(controller.system.C[1:])
    whole = closed_loop(controller, plant)
    rest = whole.C @ np.linalg.solve(np.eye(whole.nstates) - whole.A, whole.B) + whole.D
    assert rest[0, 0] == pytest.approx(1.0, abs=1e-6)
    assert spectral_radius(loop_gain(controller, plant)) < 1.0


def test_impossible_plants_are_refused_with_the_reason() -> None:
    eye, none = np.eye(3), np.zeros((3, 3))
    blind = np.diag([1.01, 0.5, 0.5, 0.5])
    sees, moves = np.eye(3, 4, 1), np.eye(4, 3, -1)
    with pytest.raises(DesignError, match=r"not stabilizable: no input reaches the mode at z = 1\.01"):
        lqg(control.StateSpace(blind, moves, np.eye(3, 4), none, T))
    with pytest.raises(DesignError, match=r"not detectable: no output sees the mode at z = 1\.01"):
        lqg(control.StateSpace(blind, np.eye(4, 3), sees, none, T))
    # A difference of the output: no constant force can be held.
    difference = control.StateSpace(0 * eye, eye, -eye, eye, T)
    with pytest.raises(DesignError, match="zero at z = 1"):
        lqg(difference)
    assert lqg(difference, integrators=False).system.nstates == 3
    with pytest.raises(DesignError, match="connects no force"):
        lqg(control.StateSpace(0.5 * eye, eye, none, none, T))
    with pytest.raises(DesignError, match="discretize it first"):
        lqg(control.StateSpace(-eye, eye, eye, none))
    with pytest.raises(DesignError, match="3 tip forces to 3 object forces"):
        lqg(control.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], T))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"force_weight": 0.0}, "force_weight must be positive"),
        ({"speed_weight": -1.0}, "speed_weight"),
        ({"integral_rate": 0.0}, "integral_rate"),
        ({"noise": 0.0}, "noise must be positive"),
        ({"disturbance": np.eye(2)}, "must be 6 x 6"),
        ({"state_weight": np.eye(6)}, "must be finite and 9 x 9"),
        ({"windup_time": np.nan}, "windup_time"),
    ],
)
def test_bad_options_get_one_sentence(options, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DesignError, match=says):
        lqg(SOFT, **options)


def test_the_default_weights_are_those_of_the_documented_time_constants() -> None:
    """Of the thesis's reproduction and of every scenario that names none; another default is another controller."""
    default = lqg(SOFT)
    same = lqg(SOFT, integrators=True, force_weight=2.0, speed_weight="12 ms", integral_rate="8 1/s", noise="10 mN")
    for name in ("A", "B", "C", "D"):
        assert np.allclose(getattr(default.system, name), getattr(same.system, name), rtol=1e-12)


@pytest.mark.parametrize("windup", [0.02, 0.2])
def test_the_integrals_follow_an_applied_force_with_the_time_of_the_windup(windup: float) -> None:
    """While the drive cuts the force, the state x+ = (A - B_aw C) x decays: one mode per axis at exp(-T / windup)."""
    design = lqg(SOFT, windup_time=windup)
    assert design.antiwindup is not None
    poles = np.linalg.eigvals(design.system.A - design.antiwindup @ design.system.C)
    assert np.abs(poles).max() < 1.0
    assert np.sum(np.abs(poles - np.exp(-T / windup)) < 1e-6) >= 3
