"""The linear model against finite differences of the dynamics, the thesis's printed matrices and exact eigenvalues."""

from __future__ import annotations

import control
import numpy as np
import pytest
from derivatives import central
from numpy.typing import NDArray
from palpate import devices
from palpate.errors import PoseError
from palpate.linear import damping_effect, discretize, equilibria, linearize, modes
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import reachable_space

from experiments.hosseini2004.checks import Check, compare

Array = NDArray[np.float64]
ARM = devices.load("phantom-premium-1.5a")
SLIDER = devices.load("slider")
POSE = np.array([0.0, 2.2305, 3.2776])  # rad, (3.8)
TORQUE = np.array([0.0, 0.01, 0.01])  # N m
K = 3500.0  # N/m


@pytest.mark.parametrize("seed", range(8))
def test_torque_model_is_the_derivative_of_the_motion(seed: int) -> None:
    """A and B are the partial derivatives of (qd, qdd) at any pose, speed and torque, not only at rest."""
    rng = np.random.default_rng(seed)
    q, qd, tau = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-3, 3, 3), rng.uniform(-0.2, 0.2, 3)
    model = linearize(ARM, q, qd, tau)

    def motion(state: Array) -> Array:
        return np.concatenate([state[3:6], ARM.acceleration(state[:3], state[3:6], state[6:])])

    expected = central(motion, np.concatenate([q, qd, tau]))
    computed = np.hstack([model.A, model.B])
    assert np.abs(computed - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("seed", range(8))
def test_force_model_is_the_derivative_with_the_jacobian_turning(seed: int) -> None:
    """With tau = J(q)^T (held + u) the position columns hold d(J^T held)/dq, and B = a_tau J^T."""
    rng = np.random.default_rng(seed)
    q, held = POSE + rng.uniform(-0.4, 0.4, 3), rng.uniform(-1, 1, 3)
    torque = ARM.jacobian(q).T @ held
    each = [1e3, 2e3, 3e3]
    model = linearize(ARM, q, None, torque, inputs="force", outputs="object_force", force=held, stiffness=each)

    def motion(state: Array) -> Array:
        push = ARM.jacobian(state[:3]).T @ (held + state[6:])
        return np.concatenate([state[3:6], ARM.acceleration(state[:3], state[3:6], push)])

    expected = central(motion, np.concatenate([q, np.zeros(6)]))
    computed = np.hstack([model.A, model.B])
    assert np.abs(computed - expected).max() < 1e-7 * np.abs(expected).max()
    stiff = np.diag(each) @ central(ARM.forward, q)
    assert np.abs(model.C[:, :3] - stiff).max() < 1e-7 * np.abs(stiff).max()
    assert not np.any(model.C[:, 3:])


def test_thesis_matrices_to_their_printed_digits() -> None:
    """(3.9), (3.41) and (3.42) entry by entry; where the print is wrong, the corrected value."""
    bare = linearize(ARM.frictionless(), POSE, tau=TORQUE).A
    damped = linearize(ARM.frictionless().with_viscous([1, 1, 1]), POSE, tau=TORQUE).A
    held = static_tip_force(ARM.jacobian(POSE), TORQUE)
    continuous = linearize(ARM, POSE, inputs="force", outputs="object_force", force=held, stiffness=K)
    sampled = discretize(continuous, 5e-4, "tustin")
    checks: list[Check] = [
        *compare("eq3.9-position", bare[4:, 1:3]),
        *compare("eq3.9-yaw-damping", damped[3, 3]),
        *compare("eq3.9-k2", damped[4:, 4]),
        *compare("eq3.9-k3", damped[4:, 5]),
        *compare("eq3.41-A_ci", continuous.A[3:]),
        *compare("eq3.41-C_ci", continuous.C[:, :3]),
        *compare("eq3.42-A_di", sampled.A),
        *compare("eq3.42-B_di", sampled.B),
        *compare("eq3.42-C_di", sampled.C),
        *compare("eq3.42-D_di", sampled.D),
    ]
    wrong = [(c.id, c.printed, c.computed) for c in checks if c.status == "differs"]
    assert len(checks) > 40
    assert not wrong


def test_undamped_equilibrium_only_swings() -> None:
    """Without friction the eigenvalues at the equilibrium are 0, 0, +-2.3j, +-9.2j: none in the right half-plane."""
    rest = equilibria(ARM, torque=TORQUE)[0]
    assert np.round(rest.q, 4) == pytest.approx([0.0, 2.2314, 3.2776], abs=1e-9)
    assert rest.stable
    assert rest.free == 1
    values = np.linalg.eigvals(linearize(ARM.frictionless(), rest.q, tau=TORQUE).A)
    assert np.sort(np.round(values.imag, 1)).tolist() == [-9.2, -2.3, 0.0, 0.0, 2.3, 9.2]
    assert np.abs(values.real).max() < 1e-7
    # By energy: the squared frequencies are the generalised eigenvalues of (dN/dq, M), both symmetric.
    hessian = central(ARM.gravity, rest.q)
    squares = np.linalg.eigvals(np.linalg.solve(ARM.mass_matrix(rest.q), hessian)).real
    assert np.sort(values.imag**2)[::2] == pytest.approx(np.sort(squares), abs=1e-6)


def test_friction_damps_every_swing() -> None:
    """The device's own damping moves every swinging mode into the left half-plane."""
    before, after = damping_effect(ARM, equilibria(ARM, torque=TORQUE)[0].q)
    assert max(abs(m.pole.real) for m in before) < 1e-7
    assert sum(m.pole == 0 for m in after) == 1  # the free yaw
    assert all(m.pole.real < -0.1 for m in after if m.pole != 0)
    assert before[0].frequency == 0.0


def test_equilibria_are_where_nothing_accelerates() -> None:
    """Newton's roots satisfy the equations of motion, for a torque and for a tip force."""
    for rest in equilibria(ARM, torque=TORQUE):
        assert np.abs(ARM.acceleration(rest.q, np.zeros(3), TORQUE)).max() < 1e-8
    force = np.array([0.0, -0.1, 0.2])
    for rest in equilibria(ARM, force=force, starts=5):
        push = ARM.jacobian(rest.q).T @ force
        assert np.abs(ARM.acceleration(rest.q, np.zeros(3), push)).max() < 1e-7
        assert rest.torque == pytest.approx(push)


def test_slider_is_a_damped_mass() -> None:
    """One degree of freedom: A = [0 1; 0 -b/m], B = [0; 1/m], also with the tip force as the input."""
    mass = float(SLIDER.mass_matrix([0.0])[0, 0])
    torque, force = linearize(SLIDER, [0.0]), linearize(SLIDER, [0.0], inputs="force", outputs="tip")
    assert pytest.approx(np.array([[0, 1], [0, -float(SLIDER.viscous[0]) / mass]])) == torque.A
    assert force.B[1] == pytest.approx([1 / mass, 0, 0])
    assert force.C[0] == pytest.approx([1, 0])


def test_modes_of_a_sampled_system_are_those_of_the_continuous_one() -> None:
    """log(z)/T of the hold-exact model gives the continuous poles back."""
    model = linearize(ARM, POSE)
    ours = np.sort_complex(np.array([m.pole for m in modes(discretize(model, 1e-3))]))
    assert ours == pytest.approx(np.sort_complex(np.array([m.pole for m in modes(model)])), abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "options", "says"),
    [
        (([0.0, 1.0],), {}, "q must be 3 values in rad"),
        (([0.0, np.nan, 0.0],), {}, "finite"),
        (([0.0, 0.5, 0.5 + np.pi / 2],), {"inputs": "force"}, "singular"),
        ((POSE,), {"inputs": "volts"}, '"torque" or "force"'),
        ((POSE,), {"inputs": "force", "outputs": "object_force"}, "needs the object's stiffness"),
        ((POSE,), {"outputs": "object_force", "stiffness": -1.0}, "not negative"),
        ((POSE,), {"stiffness": 1.0}, "only for"),
        ((POSE,), {"force": [0, 0, 0]}, "pass tau"),
        ((POSE,), {"outputs": "speed"}, '"angle", "tip" or'),
    ],
)
def test_bad_input_gets_one_sentence(arguments, options, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(PoseError, match=says):
        linearize(ARM, *arguments, **options)


def test_a_load_without_equilibrium_is_refused() -> None:
    """Gravity cannot balance a torque about the vertical yaw axis."""
    with pytest.raises(PoseError, match="no equilibrium"):
        equilibria(ARM, torque=[0.01, 0, 0], starts=3)
    with pytest.raises(PoseError, match="either torque"):
        equilibria(ARM)


def test_the_space_that_an_input_reaches_has_the_rank_of_the_controllability_matrix() -> None:
    """In any units of the states: two chains of three and two states; each input reaches its own."""
    draw = np.random.default_rng(4)
    a = np.zeros((5, 5))
    a[:3, :3], a[3:, 3:] = draw.normal(size=(3, 3)), draw.normal(size=(2, 2))
    inputs = np.eye(5)[:, [0, 4]]
    for units in (np.ones(5), np.array([1e-6, 1e3, 1.0, 1e5, 1e-4])):
        step, entry = units[:, None] * a / units, units[:, None] * inputs
        for column, rank in ((0, 3), (1, 2)):
            basis, inverse = reachable_space(step, entry, entry[:, [column]])
            assert basis.shape == (5, rank)
            assert inverse @ basis == pytest.approx(np.eye(rank), abs=1e-9)
            inside = basis @ inverse
            for vector in (entry[:, [column]], step @ entry[:, [column]]):
                assert (inside @ vector - vector) / units[:, None] == pytest.approx(np.zeros((5, 1)), abs=1e-9)


@pytest.mark.parametrize("ratio", [-0.2, 0.0, 0.3, 1.0])
@pytest.mark.parametrize("period", [None, 1e-3])
def test_a_mode_has_the_frequency_and_damping_ratio_of_its_oscillator(ratio: float, period: float | None) -> None:
    """x'' + 2 ratio w x' + w^2 x = f; the ratio is negative for one that grows."""
    w = 40.0
    one = control.StateSpace([[0.0, 1.0], [-(w**2), -2 * ratio * w]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    for mode in modes(one if period is None else control.sample_system(one, period, "zoh")):
        assert mode.frequency == pytest.approx(w, rel=1e-6)
        assert mode.damping == pytest.approx(ratio, abs=1e-6)
