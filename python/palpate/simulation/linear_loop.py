"""The servo loop of a scenario, linear about a pose and sampled as it runs: hold, delay, coupling, controller, hand.

Everything that the servo computes from samples stays sampled, the turning of the hold's torque with the pose included.
Everything that moves between samples (device, gravity, the operator's arm) is continuous behind the hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.coupling import virtual_coupling
from palpate.control.feedback_loop import closed_loop_matrix, spectral_radius
from palpate.devices import Device
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import assemble_loop, observable_reduction, sampled_plants
from palpate.scenario import Scenario
from palpate.simulation.controllers import build_controller
from palpate.simulation.plants import sampled_plant

__all__ = ["ScenarioLoop", "scenario_arm", "scenario_loop"]


@dataclass(frozen=True)
class OwnDamping:
    """Viscous friction of a device, and the turning of the torque that balances its weight, which takes some of it.

    The servo turns that torque with the pose at samples, so that it generates energy as a sampled spring does.

    Attributes:
        viscous: D of the joints (dof,), N m s/rad.
        rows: motion of the tip along the touched directions per joint motion (r, dof), m/rad.
        turning: W (dof, dof), N m/rad: what a period of 1 s takes of D.
    """

    viscous: Array
    rows: Array
    turning: Array

    @classmethod
    def of(cls, viscous: Array, rows: Array, geometric_stiffness: Array, delay: int) -> OwnDamping:
        """Return the damping of a device whose hold changes by the pose as ``geometric_stiffness`` (dof, dof).

        Without delay only a hold that pulls back to the pose generates energy, K T/2 of a spring K.
        """
        sizes, axes = np.linalg.eigh(-0.5 * (geometric_stiffness + geometric_stiffness.T))
        active = np.abs(sizes) if delay else np.maximum(sizes, 0.0)
        return cls(viscous, rows, (delay + 0.5) * (axes * active) @ axes.T)

    def felt(self, interval: float) -> float:
        """Return the least damping b (N s/m) that is left with ticks up to `interval` s apart; 0: none is.

        D - interval W - b rows^T rows is positive semidefinite.
        """
        left = np.diag(self.viscous) - interval * self.turning
        if np.linalg.eigvalsh(left).min() <= 0.0:
            return 0.0
        return float(1 / np.linalg.eigvalsh(self.rows @ np.linalg.solve(left, self.rows.T)).max())

    def longest_interval(self, required: float) -> float:
        """Return the longest interval (s) at which the damping left is that interval times `required`, N/m."""
        if np.any(self.viscous <= 0):
            return 0.0
        root = 1.0 / np.sqrt(self.viscous)
        taken = required * self.rows.T @ self.rows + self.turning
        most = float(np.linalg.eigvalsh(root[:, None] * taken * root).max())
        return 1.0 / most if most > 0.0 else float("inf")


@dataclass(frozen=True)
class ScenarioLoop:
    """A scenario's loop about one pose.

    Attributes:
        path: from the force on the object, as the controller sees it (r, N), to the deflection (r, m), r directions.
        directions: (3, r), orthonormal: those along which the object is felt and the device can move.
        stiffness: K (r, r), N/m; damping: B (r, r), N s/m.
        coupling: "backward" or "bilinear".
        device_damping: least damping of the device against tip motion in these directions, N s/m, beyond that which the
            turning of its hold takes; nan if unknown.
        rests: whether the device without object and hand rests where it is, rather than tipping over under gravity.
        normalized: whether the controller divides by the object's stiffness; K is then its design stiffness, and B is
            the object's damping times K over the object's stiffness.
        own: the device's own damping, at intervals other than the scenario's.
    """

    path: control.StateSpace
    directions: Array
    stiffness: Array
    damping: Array
    coupling: str
    device_damping: float
    rests: bool
    normalized: bool
    own: OwnDamping

    @property
    def period(self) -> float:
        """T, s."""
        return float(self.path.dt)

    def gain(self, stiffness: ArrayLike | None = None, damping: ArrayLike | None = None) -> control.StateSpace:
        """Return L(z) (r x r), negative feedback understood, broken at the object's force.

        Args:
            stiffness: other K (r, r), or one number for all directions, N/m.
            damping: other B likewise, N s/m.
        """
        r = self.directions.shape[1]
        k = self.stiffness if stiffness is None else np.asarray(stiffness, float) * np.eye(r)
        b = self.damping if damping is None else np.asarray(damping, float) * np.eye(r)
        # the coupling of a unit damper in the directions that have one, and the spring beside it
        rule = virtual_coupling(0.0, 1.0, self.period, "bilinear" if self.coupling == "bilinear" else "backward")
        sizes, axes = np.linalg.eigh(b)
        damped, p = axes[:, np.abs(sizes) > 1e-12 * np.abs(sizes).max(initial=0.0)].T, self.path
        av, bv, cv, dv = (float(m[0, 0]) for m in (rule.A, rule.B, rule.C, rule.D))
        direct = k + dv * b
        a = np.block([[p.A, np.zeros((p.nstates, len(damped)))], [bv * damped @ p.C, av * np.eye(len(damped))]])
        entry = np.vstack([p.B, bv * damped @ p.D])
        out = np.hstack([direct @ p.C, cv * b @ damped.T])
        return control.StateSpace(a, entry, -out, -direct @ p.D, p.dt)

    def matrix(self, scale: float = 1.0) -> Array:
        """Return the closed loop's matrix with the object's stiffness and damping times ``scale``."""
        return np.asarray(closed_loop_matrix(self.gain(), scale).real, dtype=float)

    def spectral_radius(self, stiffness: ArrayLike | None = None, damping: ArrayLike | None = None) -> float:
        """Return the largest modulus of the closed loop's eigenvalues, for another K and B if given."""
        return spectral_radius(self.gain(stiffness, damping))


def scenario_loop(
    scenario: Scenario,
    *,
    pose: ArrayLike | None = None,
    tip_force: ArrayLike = (0.0, 0.0, 0.0),
    operator_force: ArrayLike | None = None,
    arm: HumanArm | None = None,
    controller: Controller | None = None,
) -> ScenarioLoop:
    """Return the loop of ``scenario`` about its start, or about another pose of rest.

    Args:
        pose: (dof,), rad; the start's if not given. A linear model of the device keeps its plant at every pose, and the
            geometry of the tip changes with it unless `device.kinematics` is linear as well.
        tip_force: command of the controller at rest there (3,), N, without the hold.
        operator_force: of the hand at rest there (3,), N; the arm's spring at the start if not given.
        arm: holds the tip instead of the scenario's operator.
        controller: instead of the one that the scenario describes.

    Raises:
        StabilityError: nothing is touched, the hand does not let the tip move, or the directions cannot be pushed.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    require_spring(scenario, arm)
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    frozen = scenario.device.kinematics == "linear"
    at = start if pose is None else np.asarray(pose, dtype=float)
    adapts = scenario.controller.kind == "workspace"  # to the pose
    law = build_controller(scenario, device, at if adapts else start) if controller is None else controller
    stiffness, damping = controlled_object(scenario, law)
    hand = arm if arm is not None else scenario_arm(scenario)
    jacobian = device.jacobian(start if frozen else at)
    hold = _hold(scenario, device, start)
    motors = hold if frozen else hold + np.asarray(tip_force, dtype=float)
    if adapts and controller is None:
        motors = static_tip_force(jacobian, device.gravity(at))
    geometric_stiffness = np.einsum("k,kij->ij", motors, device.tip_hessian(start if frozen else at))
    plant = _plant(scenario, device, at, start, hand, operator_force)
    directions = touched_directions(scenario, jacobian)
    r = directions.shape[1]
    k, b = (directions.T @ np.diag(per_axis) @ directions for per_axis in (stiffness, damping))

    a, entry, out = assemble_loop(
        (plant.A, plant.B, plant.C), jacobian, geometric_stiffness, law, scenario.device.delay
    )
    small = observable_reduction(a, entry, out, directions)
    path = control.StateSpace(*small, np.zeros((r, r)), scenario.period)
    rests = _rests(device, at if scenario.device.model == "nonlinear" else start, geometric_stiffness)
    own = OwnDamping.of(device.viscous, directions.T @ jacobian, geometric_stiffness, scenario.device.delay)
    known = scenario.device.model != "experimental"
    felt = own.felt(scenario.period + scenario.servo.jitter) if known else float("nan")
    normalized = law.design_stiffness is not None
    return ScenarioLoop(path, directions, k, b, scenario.object.coupling, felt, rests, normalized, own)


def controlled_object(scenario: Scenario, law: Controller) -> tuple[Array, Array]:
    """Return the object's stiffness and damping per axis, N/m and N s/m, as the controller sees them.

    A normalized controller sees its design stiffness in place of K, and the damping B K0/K.
    """
    k, b = (np.asarray(one, dtype=float) for one in (scenario.object.stiffness, scenario.object.damping))
    if law.design_stiffness is None:
        return k, b
    ratio = np.divide(law.design_stiffness, k, out=np.ones(3), where=k > 0.0)
    return k * ratio, b * ratio


def require_linear_parts(scenario: Scenario, *, display: bool = False) -> None:
    """Raise StabilityError unless the scenario has one object, at rest, and no guard: an analysis takes no others.

    An admittance display is refused as well, unless `display`: its loop is not one of forces.
    """
    if scenario.servo.tool is not None and not display:
        raise StabilityError(
            "servo.topology: this analysis breaks the loop at the object's force on the tip, and in an "
            "admittance_display a tool touches the object: use palpate.stability.certify, or run the scenario"
        )
    if scenario.guard.kind != "none":
        raise StabilityError(
            "guard.kind: a guard makes the loop nonlinear, and an analysis is that of the linear loop: remove [guard] "
            "to analyze the loop without it, or run the scenario"
        )
    if scenario.contact_kind == "scene":
        raise StabilityError(
            "objects: an analysis takes one object, and the scenario has "
            f"{', '.join(scenario.objects or ())}: write the one to analyze as [object]"
        )
    if scenario.contact_kind == "moving":
        raise StabilityError("object.frame: an analysis takes an object at rest: remove the frame")


def require_spring(scenario: Scenario, arm: HumanArm | None = None, *, display: bool = False) -> None:
    """Raise StabilityError unless one linear loop describes the scenario's contact."""
    require_linear_parts(scenario, display=display)
    if scenario.object.kind == "none":
        raise StabilityError("object.kind: nothing is touched, so there is no loop to judge; give a spring or a wall")
    if scenario.object.kind == "mesh":
        raise StabilityError(
            "object.kind: a mesh has no one loop to judge: palpate.stability.certify tests every contact mode, or "
            "take a wall as stiff as its stiffest polygon"
        )
    if scenario.object.kind == "body":
        raise StabilityError(
            "object.kind: a deformable body has states of its own and no one stiffness: use palpate.stability.certify, "
            "or palpate.stability.contact_stability of a trace"
        )
    if scenario.object.kind not in ("spring", "wall"):
        raise StabilityError(
            f'object.kind: "{scenario.object.kind}" is no spring with one stiffness: use palpate.stability.certify'
        )
    if scenario.operator.kind == "fixed" and arm is None:
        raise StabilityError(
            'operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another operator'
        )


def scenario_arm(scenario: Scenario) -> HumanArm | None:
    """Return the arm that holds the tip in a scenario; None: there is none."""
    o = scenario.operator
    if o.kind != "arm":
        return None
    return HumanArm(o.mass or 0.0, o.damping or 0.0, o.stiffness or 0.0, o.tissue_stiffness, o.tissue_damping or 0.0)


def _hold(scenario: Scenario, device: Device, start: Array) -> Array:
    if not scenario.servo.gravity_compensation:
        return np.zeros(3)
    return static_tip_force(device.jacobian(start), device.gravity(start))


def _plant(
    scenario: Scenario, device: Device, at: Array, start: Array, arm: HumanArm | None, operator_force: ArrayLike | None
) -> control.StateSpace:
    """Return the sampled plant from motor torques to joint angles, the hand on it."""
    if scenario.device.model != "nonlinear":
        if device.flexible is not None:
            raise StabilityError(
                f'device.model: "{scenario.device.model}" is a model of the rigid device, and {device.name} has a '
                f'{device.flexible}; write device.model = "nonlinear", or device.rigid = true to leave the mode out'
            )
        if arm is not None:
            raise StabilityError('operator: an arm moves with the nonlinear device; write device.model = "nonlinear"')
        p = sampled_plant(scenario.device.model, device, start, scenario.period)
        return control.StateSpace(p.a, p.b, p.c, np.zeros((device.dof, device.dof)), scenario.period)
    # the hand's force turns with the pose as well
    pull = pull_at_start(scenario, arm) if operator_force is None else np.asarray(operator_force, dtype=float)
    a, b, c = sampled_plants(device, at[None, :], arm, pull, scenario.period)
    return control.StateSpace(a[0], b[0], c[0], np.zeros((device.dof, device.dof)), scenario.period)


def pull_at_start(scenario: Scenario, arm: HumanArm | None) -> Array:
    """Return the force of the arm's spring on the tip at the start (3,), N."""
    if arm is None or scenario.operator.kind != "arm" or arm.tissue_stiffness is not None:
        return np.zeros(3)
    return arm.stiffness * np.array(scenario.operator.rest)


def touched_directions(scenario: Scenario, jacobian: Array) -> Array:
    """Return an orthonormal basis (3, r) of where the object pushes and the device moves."""
    if scenario.object.kind == "wall":
        normal = np.array(scenario.object.normal, dtype=float)
        if np.linalg.norm(normal @ jacobian) <= 1e-9 * np.linalg.norm(jacobian):
            raise StabilityError("object.normal: the device cannot move along it, so there is no loop to judge")
        return normal[:, None]
    stiff = np.asarray(scenario.object.stiffness, float) + np.asarray(scenario.object.damping, float)
    axes = np.flatnonzero((np.linalg.norm(jacobian, axis=1) > 1e-9 * np.linalg.norm(jacobian)) & (stiff > 0))
    if axes.size == 0:
        raise StabilityError("object.stiffness: the object is not felt along any axis in which the device moves")
    return np.asarray(np.eye(3)[:, axes], dtype=float)


def _rests(device: Device, at: Array, geometric_stiffness: Array) -> bool:
    """Return whether gravity and the hold's force together have no hilltop here: M q'' = -S q with S not negative."""
    a_q, _, _ = device.linearization(at, np.zeros(device.dof), device.gravity(at))
    stiffness = -device.mass_matrix(at) @ a_q - geometric_stiffness
    values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    return bool(values.min() >= -1e-9 * max(float(np.abs(values).max()), 1e-300))
