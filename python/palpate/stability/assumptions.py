"""Assumptions and method of a certificate in words."""

from __future__ import annotations

import numpy as np

from palpate.arrays import Array
from palpate.devices import Device
from palpate.scenario import Scenario

__all__ = ["assumptions", "method", "redesigned", "start_pose"]


def start_pose(s: Scenario) -> Array:
    """Return the pose (dof,) at which a scenario starts, rad or m."""
    if s.start.tip is not None:
        return s.load_device().inverse(s.start.tip)
    return np.array(s.start.pose, dtype=float)


def assumptions(s: Scenario) -> tuple[str, ...]:
    """Return the assumptions of a certificate, each a sentence."""
    device = s.load_device()
    rate, delay = 1 / s.period, s.device.delay
    sentences = [
        f"{device.name} at {rate:g} Hz, {delay or 'no'} sample{'' if delay == 1 else 's'} of delay, every tick on time."
    ]
    if s.servo.jitter > 0.0:
        late = f"up to {1e3 * s.servo.jitter:.4g} ms"
        sentences.append(f"The scenario's late ticks ({late}) enter only the run and the passivity condition.")
    sentences.append(_operator(s))
    if s.device.model == "nonlinear":
        sentences.append("Small motions about the pose: the device is linearized exactly there.")
    else:
        source = "linearization at the start" if s.device.model == "linear" else "identified model"
        sentences.append(f"The device is its {source}: its inertia, weight and friction do not change with the pose.")
    if s.device.kinematics == "linear":
        sentences.append("The kinematics are those of the start: a tip force keeps its joint torques at every pose.")
    if device.flexible is not None:
        sentences.append(f"The {device.flexible}, is linear and alike in every direction.")
    else:
        sentences.append("Links and transmission are rigid: the device file has no flexible mode.")
    if s.object.kind == "wall":
        sentences.append("The tip stays in the wall; the operator controls motions along the surface.")
    if (tool := s.servo.tool) is not None:
        sentences.append(
            f"A tool of {tool.mass:g} kg and {tool.damping:g} N s/m touches the object. The sensor reads the force of "
            "the operator on the tip at each tick, without noise."
        )
    elif s.controller.normalizes:
        sentences.append(
            "The controller divides reference and object force by the object's stiffness of the same tick: in the loop "
            "the object is a constant spring of the design stiffness."
        )
    elif redesigned(s):
        sentences.append(
            "Factors on the object leave the controller as it is: a scenario with another object.stiffness has another "
            "controller, unless controller.stiffness is given."
        )
    neglected = _neglected(s, device)
    if neglected:
        sentences.append(f"Neglected: {'; '.join(neglected)}.")
    pole = _unstable_pole(s)
    if pole is not None:
        sentences.append(
            f"The controller by itself is unstable (a pole of modulus {pole:.6g}): the verdict does not hold while the "
            "loop is open, off a wall or at a limit of the drive."
        )
    return tuple(sentences)


def redesigned(s: Scenario) -> bool:
    """Return whether another stiffness of the object gives the scenario another controller."""
    designed = s.controller.kind in ("lead_lag", "lqg") and not s.controller.normalizes
    return designed and bool(s.object.stiffness) and "stiffness" not in s.controller.options


def method(s: Scenario) -> tuple[str, ...]:
    """Return the method of a certificate, each step a sentence."""
    return (
        f"The loop is one matrix, exact for forces held over {s.period * 1e3:g} ms; neither the hold nor the delay is "
        "approximated.",
        "Eigenvalues, Jury's table, Routh's array (bilinear map) and a Lyapunov matrix were computed independently, "
        "and a verdict is given only if all four agree.",
    )


def _operator(s: Scenario) -> str:
    o = s.operator
    if o.kind == "arm":
        grip = "rigidly" if o.tissue_stiffness is None else f"through fingertip tissue of {o.tissue_stiffness:g} N/m"
        return f"This operator: an arm of {o.mass:g} kg, {o.damping:g} N s/m, {o.stiffness:g} N/m that grips {grip}."
    if s.servo.topology != "force_tracking":
        return "The operator adds no mass and no damping at the tip: a hand that only pushes."
    return "A reference force that does not depend on the motion."


def _neglected(s: Scenario, device: Device) -> list[str]:
    effects = []
    if np.any(device.coulomb > 0):
        effects.append(
            "dry friction, which dissipates energy but with integral action can sustain a limit cycle (hunting)"
        )
    if s.device.encoder:
        count = float((np.abs(device.jacobian(start_pose(s))).max(axis=0) * device.encoder_step).max())
        effects.append(
            f"encoder counts (up to {count * 1e6:.2g} µm at the tip), which can sustain a limit cycle of a few counts"
        )
    if s.device.saturation:
        effects.append("the drive's limits, which affect large oscillations and a force that heats the motors for long")
    return effects


def _unstable_pole(s: Scenario) -> float | None:
    """Return the modulus of the controller's largest pole if it is outside the unit circle."""
    if s.controller.kind != "state_space" or not s.controller.A:
        return None
    largest = float(np.abs(np.linalg.eigvals(np.array(s.controller.A, dtype=float))).max())
    return largest if largest > 1 + 1e-9 else None
