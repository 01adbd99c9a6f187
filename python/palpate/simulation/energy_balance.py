"""Energy that the motors of an impedance display generate in a run, beside that which its operator supplies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.recorded import Recorded, held_tip
from palpate.simulation.tool_motion import tool_poses
from palpate.simulation.windows import Window

__all__ = ["EnergyBalance", "energy_balance", "own_motions"]


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of one run of an impedance display, J.

    The work of a motor torque that varies about its mean is stored work, which returns to zero with every cycle, plus
    the energy that the display generates. In a motion that persists, friction and the operator's arm dissipate it.

    Attributes:
        supplied: largest net work of the operator on the device from the start of the run to any sample. The kinetic
            energy of a rigid arm is no part of it.
        generated: work of the varying motor torque in the last fifth of the judged window.
        generated_before: the same in the fourth fifth.
    """

    supplied: float
    generated: float
    generated_before: float

    @property
    def relative(self) -> tuple[float, float]:
        """Energy generated in the last and in the fourth fifth over that supplied; nan if none is supplied."""
        if self.supplied <= 0.0:
            return np.nan, np.nan
        return self.generated / self.supplied, self.generated_before / self.supplied


def energy_balance(trace: Recorded, scenario: Scenario, window: Window) -> EnergyBalance | None:
    """Return the energies of a run that records every tick; None where other sources than the operator supply energy.

    These are the motors under force tracking, which supply energy by design, and moving objects or tools.
    """
    fifth, end = window.fifth, window.end
    if scenario.servo.topology != "impedance_display" or scenario.run.record_every > 1 or fifth < 2:
        return None
    if any(np.ptp(motion, axis=0).any() for motion in own_motions(trace, scenario)):
        return None
    force, tip = trace["operator_force"], held_tip(trace)
    power = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(tip, axis=0), axis=1)
    supplied = np.concatenate([[0.0], np.cumsum(power)]) - _kinetic_energy_of_arm(trace.time, tip, scenario)
    torque, angle = trace["torque"], trace["angle"]
    works = (_varying_work(torque[a : a + fifth], angle[a : a + fifth + 1]) for a in (end - fifth, end - 2 * fifth))
    return EnergyBalance(float(supplied.max()), *works)


def own_motions(trace: Recorded, scenario: Scenario) -> list[Array]:
    """Return the motions (n, k) of the objects and tools that may move by themselves."""
    prefixes = [f"{name}_" if name else "" for name in scenario.each_object]
    frames = [f"{prefix}frame_{kind}" for prefix in prefixes for kind in ("position", "rotation")]
    motions = [*(trace[name] for name in frames if name in trace), tool_poses(scenario, trace.time)]
    return [motion for motion in motions if motion.shape[1]]


def _kinetic_energy_of_arm(time: Array, tip: Array, scenario: Scenario) -> Array:
    """Return the kinetic energy of an arm that grips the tip (n, 3), m, rigidly, since the start (n,), J.

    The recorded force of such an arm lacks its inertial force.
    """
    operator = scenario.operator
    if operator.kind != "arm" or operator.tissue_stiffness is not None:
        return np.zeros(len(time))
    velocity = np.gradient(tip, time, axis=0)
    velocity[0] = 0.0  # the device starts at rest
    return np.asarray(0.5 * (operator.mass or 0.0) * np.sum(velocity**2, axis=1), dtype=float)


def _varying_work(torque: Array, angle: Array) -> float:
    """Return the work of torques (n, dof) without their mean, each held between two of the angles (n + 1, dof), J."""
    return float(np.sum((torque - torque.mean(axis=0)) * np.diff(angle, axis=0)))
