"""Work of every program in the benchmark, and its reference trajectory.

The PHANToM device runs in a force-tracking loop at 1 kHz. The object is a sampled spring and damper (backward
difference), the reference force is a sine. Torques J^T (F_ref - F_object + hold) are held for a period.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from palpate import devices
from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import PalpateError
from palpate.linear.linearization import static_tip_force
from palpate.scenario import Scenario
from scipy.integrate import solve_ivp

__all__ = ["DURATION", "PERIOD", "ForceLaw", "Workload"]

PERIOD = 1e-3  # s
DURATION = 1.0  # s
STIFFNESS, DAMPING = 500.0, 2.0  # N/m, N*s/m
FORCE = (1.0, 0.5, -0.7)  # N, amplitude
FREQUENCY = 3.0  # Hz
POSE = (0.0, 2.2305, 3.2776)  # rad

SCENARIO = {
    "title": "benchmark: nonlinear device and sampled spring",
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": [f"{angle} rad" for angle in POSE]},
    "servo": {"topology": "force_tracking", "period": f"{PERIOD} s"},
    "reference": {"shape": "sine", "force": [f"{force} N" for force in FORCE], "frequency": f"{FREQUENCY} Hz"},
    "object": {"kind": "spring", "stiffness": f"{STIFFNESS} N/m", "damping": f"{DAMPING} N*s/m"},
}


class ForceLaw:
    """Sampled force law in Python, for the peers: angles (3,), rad, to torques (3,), N*m, once per period."""

    def __init__(self, device: Device) -> None:
        self._device = device
        pose = np.array(POSE)
        self._anchor = device.forward(pose)
        self._before = np.zeros(3)
        self._hold = static_tip_force(device.jacobian(pose), device.gravity(pose))

    def torque(self, tick: int, q: Array) -> Array:
        """Return the torques to hold from sample `tick` on."""
        mechanism, row = self._device.core, q.reshape(1, -1)
        deflection = np.asarray(mechanism.forward(row))[0] - self._anchor
        force = STIFFNESS * deflection + DAMPING * (deflection - self._before) / PERIOD
        self._before = deflection
        reference = np.array(FORCE) * np.sin(2 * np.pi * FREQUENCY * PERIOD * tick)
        return np.asarray(np.asarray(mechanism.jacobian(row))[0].T @ (reference - force + self._hold))


@dataclass(frozen=True)
class Workload:
    """Device and number of servo periods."""

    device: Device
    ticks: int

    @classmethod
    def standard(cls) -> Workload:
        """Return one second of the published device."""
        return cls(devices.load("phantom-premium-1.5a"), round(DURATION / PERIOD))

    def scenario(self, substeps: int, controller: str | None = None) -> Scenario:
        """Return the work as a scenario, without a controller or with the default one of a kind."""
        run = {"duration": f"{self.ticks * PERIOD!r} s", "substeps": substeps}
        chosen = {} if controller is None else {"controller": {"kind": controller}}
        return Scenario.from_dict({**SCENARIO, **chosen, "run": run})

    def torques(self) -> Array:
        """Return the torques (ticks, 3), N*m, held from each sample to the next."""
        from palpate.simulation.simulator import simulate

        return np.asarray(simulate(self.scenario(substeps=4))["torque"])[: self.ticks]

    def acceleration(self, q: Array, qd: Array, torque: Array) -> Array:
        """Return qdd (3,), rad/s^2, from the core without checks."""
        device = self.device
        rows = (q.reshape(1, -1), qd.reshape(1, -1), torque.reshape(1, -1))
        rows_out: Array = np.asarray(device.core.acceleration(device.core_friction, *rows))
        return np.asarray(rows_out[0])

    def reference(self) -> Array:
        """Return angles (ticks + 1, 3) by DOP853 at a relative tolerance of 1e-13, restarted at every sample."""
        law = ForceLaw(self.device)
        state = np.concatenate([POSE, np.zeros(3)])
        rows = [state[:3].copy()]
        for tick in range(self.ticks):
            torque = law.torque(tick, state[:3])
            solution = solve_ivp(
                lambda _, y, torque=torque: np.concatenate([y[3:], self.acceleration(y[:3], y[3:], torque)]),
                (0.0, PERIOD), state, method="DOP853", rtol=1e-13, atol=1e-15, first_step=PERIOD / 2,
            )  # fmt: skip
            if not solution.success:
                raise PalpateError(f"the reference trajectory failed at tick {tick}: {solution.message}")
            state = solution.y[:, -1]
            rows.append(state[:3].copy())
        return np.array(rows)
