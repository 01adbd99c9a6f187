"""Cases A to D of the thesis (3.10, chapter 4), their controllers, and the instability of case B with LQG.

=====  =====================  ====================
case   model torque -> angle  tip and torque by
=====  =====================  ====================
A      identified (3.25)      nonlinear kinematics
B      linearized (3.9)       nonlinear kinematics
C      identified (3.25)      linearized kinematics
D      linearized (3.9)       linearized kinematics
=====  =====================  ====================

In cases A and B the thesis designs the LQG for the model alone. Its angles (rad) stand for the measured object force
(N), and its torques (N m) for the commanded tip force (N). The Jacobians and the object's stiffness, K J J^T, are
missing from the loop of the design.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from palpate.control import (
    Controller,
    WorkspaceController,
    critical_gain,
    gain_interval,
    lead_lag,
    loop_gain,
    lqg,
    spectral_radius,
    workspace,
)
from palpate.devices import Device, load
from palpate.errors import DesignError
from palpate.linear import discretize, linearize
from palpate.linear.linearization import static_tip_force

from experiments.hosseini2004.experimental import PERIOD, experimental_model

__all__ = [
    "CASES",
    "DESIGN_STIFFNESS",
    "POSE",
    "STIFFEST",
    "Case",
    "CaseB",
    "Tracking",
    "angle_plant",
    "case_b",
    "case_plant",
    "design",
    "ignorant_lqg",
    "tracking_controllers",
]

Name = Literal["A", "B", "C", "D"]
Tracking = Controller | WorkspaceController  # of forces
POSE: Final = (0.0, 2.2305, 3.2776)  # rad, (3.8)
STIFFEST: Final = 3500.0  # N/m, table 2.1


@dataclass(frozen=True)
class Case:
    """One of the thesis's ways to model the loop, in a scenario's words.

    Attributes:
        model: device.model, "linear" or "experimental".
        kinematics: device.kinematics, "nonlinear" or "linear".
        jacobians: whether the thesis's LQG design knows the Jacobians.
        integrators: whether the thesis's LQG has them.
    """

    model: Literal["linear", "experimental"]
    kinematics: Literal["nonlinear", "linear"]
    jacobians: bool
    integrators: bool


CASES: Final[dict[str, Case]] = {
    "A": Case("experimental", "nonlinear", jacobians=False, integrators=False),
    "B": Case("linear", "nonlinear", jacobians=False, integrators=True),
    "C": Case("experimental", "linear", jacobians=True, integrators=False),
    "D": Case("linear", "linear", jacobians=True, integrators=True),
}
# One fixed design for every row: on the softest object for the arm, the stiffest for the identified model.
DESIGN_STIFFNESS: Final[dict[str, float]] = {"linear": 1000.0, "experimental": STIFFEST}  # N/m
# The identified model has a zero at z = 1.0053 (10.6 rad/s, right half-plane) between y and z: no controller moves that
# direction fast without sending it the wrong way first, so its loops settle in a second or two.
OPTIONS: Final[dict[tuple[str, str], dict[str, Any]]] = {
    ("linear", "lead_lag"): {},
    ("linear", "lqg"): {},
    ("experimental", "lead_lag"): {"crossover": (100.0, 150.0, 150.0), "decouple": False},
    ("experimental", "lqg"): {},
}
# Jacobians ignored: Q = I, R = 10 I for feedback and filter, the only weights the thesis prints. With them case A is
# unstable (spectral radius 6.02), and the thesis shows it stable; with R = 10⁶ I, palpate's own choice, it is.
IGNORANT_R: Final[dict[str, float]] = {"linear": 10.0, "experimental": 1e6}


def design(
    case: Name,
    kind: Literal["lead_lag", "lqg"],
    *,
    integrators: bool | None = None,
    jacobians: bool | None = None,
    stiffness: float | None = None,
    device: Device | None = None,
    pose: ArrayLike = POSE,
    **options: Any,
) -> Controller:
    """Return the controller of a case: one fixed design, the same for every force and stiffness.

    Args:
        case: "A", "B", "C" or "D".
        kind: "lead_lag" (always designed with the kinematics, as the thesis tuned it) or "lqg".
        integrators: of the LQG; None: as the thesis.
        jacobians: whether the LQG's design knows the Jacobians and the stiffness; None: as the thesis.
        stiffness: of the object designed for, N/m; None: 1 N/mm on the linearized arm, 3.5 N/mm on the identified.
        device: the arm; None: phantom-premium-1.5a.
        pose: (3,), rad, at which everything is linearized.
        options: of ``lead_lag`` or ``lqg``; without the Jacobians, of ``ignorant_lqg``.

    Raises:
        DesignError: an unknown case or kind, or no controller meets the options.
    """
    if case not in CASES:
        raise DesignError(f'a case is "A", "B", "C" or "D", not {case!r}')
    chosen = CASES[case]
    k = DESIGN_STIFFNESS[chosen.model] if stiffness is None else stiffness
    plant = case_plant(case, k, device=device, pose=pose)
    if kind == "lead_lag":
        controller = lead_lag(plant, **{**OPTIONS[chosen.model, kind], **options})
    elif kind == "lqg":
        with_integrators = chosen.integrators if integrators is None else integrators
        if chosen.jacobians if jacobians is None else jacobians:
            controller = lqg(plant, integrators=with_integrators, **{**OPTIONS[chosen.model, kind], **options})
        else:
            angles = angle_plant(chosen.model, device=device, pose=pose)
            weights = {"input_weight": IGNORANT_R[chosen.model], **options}
            controller = ignorant_lqg(angles, integrators=with_integrators, **weights)
    else:
        raise DesignError(f'kind must be "lead_lag" or "lqg", not {kind!r}')
    notes = {**controller.notes, "case": case, "design_stiffness": k}
    return Controller(controller.system, controller.antiwindup, controller.kind, notes)


def tracking_controllers() -> dict[str, Tracking]:
    """Return palpate's own controllers by name, one design of each kind for every force and stiffness of case D.

    The normalized LQG is the LQG with its forces divided by the object's stiffness of their tick.
    """
    fixed = design("D", "lqg")
    return {
        "lead–lag": design("D", "lead_lag"),
        "LQG": fixed,
        "LQG normalized": fixed.normalized(DESIGN_STIFFNESS["linear"]),
        "workspace": workspace(_arm(), PERIOD),
    }


def ignorant_lqg(
    angles: control.StateSpace, *, integrators: bool, input_weight: float = 10.0, noise_variance: float = 10.0
) -> Controller:
    """Return an LQG for a model from torque to angle, put into a loop of forces as it is.

    Q = I on state and integrals, R = ``input_weight`` I; process noise I, measurement noise ``noise_variance`` I. It
    works on the error F_ref - F_object (figure 4.1): a feedforward that asks for angles has no meaning there.

    Raises:
        DesignError: from ``lqg``.
    """
    n = angles.nstates
    controller = lqg(
        angles,
        integrators=integrators,
        state_weight=np.eye(n + (3 if integrators else 0)),
        force_weight=input_weight,
        disturbance=np.eye(n),
        noise=float(np.sqrt(noise_variance)),
    )
    s = controller.system
    b, d = s.B[:, 3:], s.D[:, 3:]
    of_error = control.StateSpace(s.A, np.hstack([-b, b]), s.C, np.hstack([-d, d]), s.dt)
    notes = {**controller.notes, "jacobians": False, "input_weight": input_weight, "noise_variance": noise_variance}
    return Controller(of_error, controller.antiwindup, controller.kind, notes)


def angle_plant(
    model: Literal["linear", "experimental"], *, device: Device | None = None, pose: ArrayLike = POSE
) -> control.StateSpace:
    """Return the sampled model from torque (3, N m) to angle (3, rad), every 0.5 ms."""
    if model == "experimental":
        return experimental_model()
    arm = _arm() if device is None else device
    return discretize(linearize(arm, pose, inputs="torque", outputs="angle"), PERIOD)


def case_plant(
    case: Name, stiffness: ArrayLike, *, device: Device | None = None, pose: ArrayLike = POSE
) -> control.StateSpace:
    """Return the sampled plant of a case, tip force (3, N) to object force (3, N), to first order about ``pose``.

    It is (3.37): A + B (dJ^T/dq f) C, B J^T, K J C, with f the tip force that balances gravity at ``pose``. On the
    linearized arm this geometric stiffness acts within the hold, so the arm is discretized with it.

    Args:
        stiffness: of the object, N/m, one value or three.
    """
    arm = _arm() if device is None else device
    k = np.broadcast_to(np.asarray(stiffness, dtype=float), (3,))
    angles = angle_plant(CASES[case].model, device=arm, pose=pose)
    jacobian = arm.jacobian(pose)
    static_force = static_tip_force(jacobian, arm.gravity(pose))
    geometric_stiffness = np.einsum("k,kij->ij", static_force, arm.tip_hessian(pose))
    return control.StateSpace(
        angles.A + angles.B @ geometric_stiffness @ angles.C,
        angles.B @ jacobian.T,
        k[:, None] * (jacobian @ angles.C),
        np.zeros((3, 3)),
        PERIOD,
    )


@cache
def _arm() -> Device:
    return load("phantom-premium-1.5a")


@dataclass(frozen=True)
class CaseB:
    """What case B with LQG shows.

    Attributes:
        integrators: whether the LQG has them.
        mismatch: eigenvalues of K J J^T at 3.5 N/mm, N/rad per N m: the factors by which the loop is stronger than
            the one designed for.
        own_radius: spectral radius of the loop it was designed for, per sample.
        radius: of the loop it runs in, at 3.5 N/mm.
        critical_stiffness: stiffness at which that loop leaves the unit circle, N/m.
        critical_factor: the same over 3.5 N/mm: a loop gain this much smaller would be stable.
        dear_enough: smallest R / Q for which a design without the Jacobians is stable at 3.5 N/mm.
        dear_decay: time constant of the slowest mode with ten times that R, s: how slow such a loop is.
        aware_radius: spectral radius at 3.5 N/mm of the LQG that knows the Jacobians.
        aware_interval: stiffnesses for which that one fixed design is stable, N/m.
    """

    integrators: bool
    mismatch: tuple[float, float, float]
    own_radius: float
    radius: float
    critical_stiffness: float
    critical_factor: float
    dear_enough: float
    dear_decay: float
    aware_radius: float
    aware_interval: tuple[float, float]


def case_b(*, integrators: bool = False, device: Device | None = None, pose: ArrayLike = POSE) -> CaseB:
    """Find out whether case B with LQG must be unstable, from the exact eigenvalues of the sampled loops.

    It must, for every weighting that still renders: the loop is stronger than the one designed for by K J J^T, and
    J turns it besides. Only a command so dear that the loop takes seconds to answer survives. A design that
    knows the Jacobians is stable from the softest to the stiffest object.
    """
    arm = _arm() if device is None else device
    angles = angle_plant("linear", device=arm, pose=pose)
    plant = case_plant("B", STIFFEST, device=arm, pose=pose)

    def run(weight: float) -> control.StateSpace:
        return loop_gain(ignorant_lqg(angles, integrators=integrators, input_weight=weight), plant)

    ignorant = design("B", "lqg", integrators=integrators, jacobians=False, device=arm, pose=pose)
    loop = loop_gain(ignorant, plant)
    factor = critical_gain(loop)
    dear = _smallest_stable_weight(run)
    aware = loop_gain(design("B", "lqg", integrators=integrators, jacobians=True, device=arm, pose=pose), plant)
    low, high = gain_interval(aware)
    jacobian = arm.jacobian(pose)
    mismatch = np.linalg.eigvalsh(STIFFEST * jacobian @ jacobian.T)
    return CaseB(
        integrators=integrators,
        mismatch=(float(mismatch[0]), float(mismatch[1]), float(mismatch[2])),
        own_radius=spectral_radius(loop_gain(ignorant, angles)),
        radius=spectral_radius(loop),
        critical_stiffness=factor * STIFFEST,
        critical_factor=factor,
        dear_enough=dear,
        dear_decay=-PERIOD / float(np.log(spectral_radius(run(dear * 10.0)))),
        aware_radius=spectral_radius(aware),
        aware_interval=(low * STIFFEST, high * STIFFEST),
    )


def _smallest_stable_weight(run: Callable[[float], control.StateSpace]) -> float:
    """Return the smallest R from which on (by decades, then bisection) the loop ``run(R)`` is stable."""
    stable = 10.0
    while spectral_radius(run(stable)) >= 1.0:
        stable *= 10.0
        if stable > 1e10:
            raise DesignError("no weight up to R = 1e10 Q makes the loop stable")
    unstable = stable / 10.0
    for _ in range(30):
        middle = float(np.sqrt(stable * unstable))
        if spectral_radius(run(middle)) < 1.0:
            stable = middle
        else:
            unstable = middle
    return stable
