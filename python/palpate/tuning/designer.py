"""Design of a workspace controller from a specification, with its proofs, or the constraint that forbids it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.control import WorkspaceController, workspace
from palpate.devices import load
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.metrics.device_performance import moving_axes, tip_inertia
from palpate.scenario import Scenario
from palpate.stability.workspace_certificate import WorkspaceCertificate, certify_workspace, workspace_loops
from palpate.tuning.axis import (
    MOST_OVERSHOOT,
    OPERATOR,
    OPERATORS,
    RUN,
    SAMPLING,
    AxisData,
    AxisDesign,
    first_limit,
    tune_axis,
)
from palpate.tuning.outcome import ControllerDesign
from palpate.tuning.presses import (
    FEW,
    Press,
    choose,
    draw_poses,
    draw_presses,
    hold_time,
    press_tables,
    share_within_reach,
)
from palpate.tuning.remedies import (
    DRIVE,
    FRICTION,
    RANGE,
    Trial,
    drive_remedies,
    friction_remedies,
    most_reachable,
    sampling_remedies,
)
from palpate.tuning.specification import Specification, specify

__all__ = ["axis_data", "design"]

POSES: Final = 40
HELD: Final = 4  # poses at which each operator holds the whole arm
VERTICES: Final = 8  # poses of the linear matrix inequalities
OVERSHOOT: Final = "overshoot"
SLOWER: Final = 0.85  # factor on the reference model if a device of `against` overshoots

Progress = Callable[[str, float], None]


def design(
    device: str | PathLike[str],
    stiffness: str | Sequence[float | str],
    force: float | str,
    settle: float | str,
    *,
    period: float | str | None = None,
    delay: int = 0,
    pose: ArrayLike | None = None,
    tip: ArrayLike | None = None,
    operators: Sequence[HumanArm] = OPERATORS,
    against: Sequence[str | PathLike[str]] = (),
    progress: Progress | None = None,
) -> ControllerDesign:
    """Return the fastest workspace controller that meets every constraint, judged against a specification.

    The bandwidth is the largest that meets the constraints of `tuning.tune_axis`. Presses at random poses are then
    simulated with the limits of the drive at both ends and in the middle of the range. If they settle too late, the
    result names the binding constraint and changes of the specification that would do, each tried.

    Args:
        device: name in the catalog, or path of a device file; one to three joints.
        stiffness: range of the object, "50 N/m..10 N/mm", or two values in N/m.
        force: largest reference force in any direction, N.
        settle: wanted settling time to 5 %, s.
        period: servo period, s; None: that of the device.
        delay: samples from a command to its application.
        pose: start of the scenario (3,), rad; None: the mechanism's working pose. Poses are drawn around it.
        tip: position of the tip at the start (3,), m, in place of `pose`.
        operators: that must be stable at every tip mass of the workspace; each with 0.83, 1 and 1.17 of the inertia.
        against: devices that the controller does not know; its overshoot there is at most 5 %.
        progress: called with a text and the share done.

    Raises:
        DesignError: a reversed range, a value out of range or without unit, more than three joints, a force above the
            peak force.
        PoseError: the start is singular, beyond the limits, or the tip cannot be there.
        DeviceError: there is no such device.
    """
    report = progress or (lambda _text, _fraction: None)
    s = specify(device, stiffness, force, settle, period, delay, pose, tip, operators, against)
    return _Designer(s, report).run()


def axis_data(s: Specification, poses: Array) -> AxisData:
    """Return the tip masses and the encoder count of poses: extremes and median; coarsest joint, median pose."""
    inertia = np.array([tip_inertia(s.device, q) for q in poses])
    masses = np.linalg.eigvalsh(inertia)
    axes = np.array([moving_axes(s.device, q) for q in poses])
    moved = np.swapaxes(axes, 1, 2) @ s.device.jacobian(poses)
    steps = np.linalg.norm(inertia @ moved, axis=1) * s.device.encoder_step
    return AxisData(
        (float(masses.min()), float(np.median(masses)), float(masses.max())),
        float(np.median(steps.max(axis=1))),
        s.operators,
        s.device.flexible,
    )


class _Designer:
    """Steps of one design."""

    def __init__(self, specification: Specification, report: Progress) -> None:
        self.s, self.report = specification, report
        self.poses = draw_poses(specification.device, specification.start, POSES)
        self.data = axis_data(specification, self.poses)

    def run(self) -> ControllerDesign:
        s = self.s
        self.report("tuning one axis", 0.05)
        axis = tune_axis(s.period, s.delay, self.data)
        if axis is None:
            limit, reason = first_limit(s.period, s.delay, self.data)
            return self._result(None, None, constraint=limit, reason=f"At every bandwidth: {reason}.")
        controller = workspace(s.device, s.period, **axis.options)
        self.report("drive limit", 0.2)
        presses = draw_presses(s.device, self.poses, s.force, s.stiffness[0])
        share = share_within_reach(presses, self.poses)
        if share < FEW:
            reason, remedies = most_reachable(s, self.poses)
            return self._result(controller, axis, share=share, constraint=RANGE, reason=reason, remedies=remedies)
        worst = max(presses, key=lambda press: press.bound)
        chosen = choose(presses)
        trial = Trial(s, controller, self.poses, chosen, worst.bound)
        self.report("pressing", 0.3)
        controller, overshoot = self._calmed(controller, trial)
        trial = replace(trial, controller=controller)
        low, high = s.stiffness
        stiffness = sorted({low, float(np.sqrt(low * high)), high})
        runs = {k: trial.run(s.force, k) for k in stiffness}
        overshoot = max(overshoot, *(float(run.overshoot.max()) for run in runs.values()))
        settling = {k: float(run.times.max()) for k, run in runs.items()}
        self.report("remedies", 0.6)
        constraint, reason, remedies = self._judged(axis, trial, settling, worst)
        if not constraint and (lost := self._lost_operator(controller)):
            constraint, reason = OPERATOR, f"The whole arm is {lost}."
        if not constraint and overshoot > MOST_OVERSHOOT:
            constraint, reason = OVERSHOOT, f"The slowest reference model tried overshoots by {100 * overshoot:.3g} %."
        return self._result(controller, axis, share, constraint, reason, remedies, worst, settling, overshoot, presses)

    def _judged(
        self, axis: AxisDesign, trial: Trial, settling: dict[float, float], worst: Press
    ) -> tuple[str, str, tuple[str, ...]]:
        """Return the binding constraint, the reason and the remedies; empty if the specification is met."""
        s = self.s
        if max(settling.values()) <= s.settle and not worst.bound > s.settle:
            return "", "", ()
        if not axis.settling <= s.settle:
            slow = f"more than {1e3 * RUN:g} ms" if np.isnan(axis.settling) else f"{1e3 * axis.settling:.3g} ms"
            return (
                axis.limit,
                f"Without limits of the drive a step settles in {slow}: {axis.reason}.",
                sampling_remedies(s, self.data, axis, max(settling.values())),
            )
        if settling[s.stiffness[0]] <= s.settle and not worst.bound > s.settle:
            return self._stuck(trial, settling)
        if np.isinf(worst.bound):
            reason = (
                f"The motors give {s.device.peak_force:g} N at the tip and hold {s.force:g} N and the weight: they "
                "cannot brake the press"
            )
        else:
            reason = f"The motors need at least {1e3 * worst.bound:.3g} ms at the worst pose on {s.stiffness[0]:g} N/m"
        slowest, hold = max(settling.values()), trial.hold(s.force, s.stiffness[0])
        reached = "does not settle" if np.isinf(slowest) else f"needs {1e3 * slowest:.3g} ms"
        if np.isinf(slowest) and 0.0 < hold < np.inf:
            reason += f", and cold motors hold the force for {hold:.3g} s"
        return DRIVE, f"{reason}; the controller {reached}.", drive_remedies(trial, settling)

    def _stuck(self, trial: Trial, settling: dict[float, float]) -> tuple[str, str, tuple[str, ...]]:
        """Return the constraint if presses on the stiffer objects alone settle too late."""
        slowest = max(settling.values())
        reached = "does not settle" if np.isinf(slowest) else f"needs {1e3 * slowest:.3g} ms"
        remedies = friction_remedies(trial, settling)
        if self.s.device.coulomb.any():
            return FRICTION, f"Dry friction holds the tip short of a stiff object's target: it {reached}.", remedies
        return SAMPLING, f"The nonlinear press on a stiffer object {reached}.", remedies

    def _calmed(self, controller: WorkspaceController, trial: Trial) -> tuple[WorkspaceController, float]:
        """Return the controller with a reference model that overshoots little on the other devices, and the overshoot.

        Presses that the drive cannot give do not count.
        """
        s, overshoot = self.s, 0.0
        for _ in range(8 if s.against else 0):
            runs = [
                replace(trial, controller=controller, name=name).run(s.force, k)
                for name in s.against
                for k in s.stiffness
            ]
            exact = [replace(trial, controller=controller).run(s.force, k) for k in s.stiffness] * len(s.against)
            overshoot = max(
                float(run.overshoot[np.isfinite(same.times)].max(initial=0.0))
                for run, same in zip(runs, exact, strict=True)
            )
            if overshoot <= MOST_OVERSHOOT:
                break
            controller = replace(controller, reference=float(np.floor(SLOWER * controller.reference)))
        return controller, overshoot

    def _lost_operator(self, controller: WorkspaceController) -> str:
        """Return the first operator with a rigid grip who is unstable on the whole arm, in words; "" if none is."""
        s = self.s
        for arm in s.operators:
            if arm.tissue_stiffness is None:
                loops = workspace_loops(controller, self.poses[:HELD], arm=arm, delay=s.delay)
                radius = np.abs(np.linalg.eigvals(loops)).max(axis=1)
                if radius.max() >= 1.0:
                    pose = np.round(self.poses[int(np.argmax(radius))], 3).tolist()
                    return f"unstable at {pose} with {arm.mass:g} kg, {arm.damping:g} N s/m, {arm.stiffness:g} N/m"
        return ""

    def _certified(self, controller: WorkspaceController) -> tuple[WorkspaceCertificate | None, str]:
        """Return a Lyapunov matrix and its scope, or the reason why there is none."""
        s, poses = self.s, self.poses
        try:
            loops = [workspace_loops(controller, poses, delay=s.delay)]
            loops += [workspace_loops(controller, poses, load(name), delay=s.delay) for name in s.against]
            vertices = [loops[0][:VERTICES], *(part[: VERTICES // 2] for part in loops[1:])]
            found = certify_workspace(np.concatenate(vertices))
            elsewhere = found.verify(np.concatenate(loops))
        except StabilityError as problem:
            return None, f"none: {problem}"
        if elsewhere >= 1.0:
            return (
                None,
                f"none: the matrix of {found.vertices} loops does not decay at other poses ({elsewhere:.6g} a tick)",
            )
        others = f", also with the inertia of {', '.join(s.against)}" if s.against else ""
        return found, (
            f"one Lyapunov matrix of {found.vertices} loops: its norm shrinks to {elsewhere:.6g} of itself per tick "
            f"at all {len(poses)} poses{others}, without operator and limits of the drive"
        )

    def _scenario(self, controller: WorkspaceController, presses: Sequence[Press]) -> Scenario:
        """Return a scenario in the middle of the range, from the start if a press there stays within reach."""
        s = self.s
        stiffness = float(f"{np.sqrt(s.stiffness[0] * s.stiffness[1]):.4g}")
        own = [p for p in draw_presses(s.device, s.start[None], s.force, stiffness) if np.isfinite(p.bound)]
        press = max(own, key=lambda p: p.bound) if own else presses[0]
        press = replace(press, direction=np.round(press.direction, 3) + 0.0)  # reads well; no -0.0
        held = 0.9 * hold_time(s.device, press.pose, press.direction, s.force, stiffness)
        duration = float(f"{min(max(0.2, 10.0 * s.settle), held):.2g}")
        tables = press_tables(press, s.name, s.force, stiffness, s.period, s.delay, duration)
        units = {"bandwidth": " rad/s", "reference": " rad/s"}
        options: dict[str, Any] = {
            key: f"{getattr(controller, key)!r}{unit}" if (unit := units.get(key)) else getattr(controller, key)
            for key in ("bandwidth", "observer", "disturbance", "reference")
        }
        title = f"{s.force:g} N on {stiffness:g} N/m, designed for {s.objects}"
        return Scenario.from_dict({"title": title, **tables, "controller": {"kind": "workspace", **options}})

    def _hold(self, presses: Sequence[Press]) -> float:
        """Return the time for which cold motors hold the force at every press, on every object of the range."""
        device, force, softest = self.s.device, self.s.force, self.s.stiffness[0]
        return min((hold_time(device, p.pose, p.direction, force, softest) for p in presses), default=float("nan"))

    def _result(
        self,
        controller: WorkspaceController | None,
        axis: AxisDesign | None,
        share: float = 0.0,
        constraint: str = "",
        reason: str = "",
        remedies: tuple[str, ...] = (),
        worst: Press | None = None,
        settling: dict[float, float] | None = None,
        overshoot: float = float("nan"),
        presses: Sequence[Press] = (),
    ) -> ControllerDesign:
        self.report("certifying", 0.9)
        if controller is None or constraint:
            certificate, remark = None, "none: the specification is not met"
        else:
            certificate, remark = self._certified(controller)
        return ControllerDesign(
            self.s,
            controller,
            axis,
            float("nan") if worst is None else worst.bound,
            None if worst is None else worst.pose,
            None if worst is None else worst.direction,
            self._hold(presses),
            share,
            settling or {},
            overshoot,
            float(
                np.linalg.norm(np.abs(self.s.device.jacobian(self.poses)) @ self.s.device.encoder_step, axis=1).max()
            ),
            certificate,
            remark,
            constraint,
            reason,
            remedies,
            self._scenario(controller, presses) if controller is not None and presses and not constraint else None,
        )
