"""Eigenvalues of a linear model as natural frequencies and damping ratios."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.devices import Device
from palpate.linear.linearization import linearize


@dataclass(frozen=True)
class Mode:
    """One mode of a linear system.

    Attributes:
        eigenvalue: of A: 1/s for a continuous system, per sample for a discrete one.
        pole: the equivalent continuous pole, 1/s (log(z)/T for a discrete system).
        frequency: natural frequency |pole|, rad/s.
        damping: damping ratio -Re(pole)/|pole|; 1 for a pole at zero, where it is undefined.
    """

    eigenvalue: complex
    pole: complex
    frequency: float
    damping: float


def modes(sys: control.StateSpace) -> list[Mode]:
    """Return the modes of ``sys`` by ascending frequency, of conjugates the positive imaginary part first."""
    out = []
    # Eigenvalues that are zero except for rounding (the free yaw) are reported as zero.
    values = np.linalg.eigvals(sys.A) if sys.nstates else np.zeros(0)
    scale = float(np.abs(values).max()) if values.size else 0.0
    for value in values:
        z = complex(value)
        if sys.isdtime(strict=True):
            pole = complex(np.log(z) / sys.dt) if z != 0 else complex(-np.inf)
        else:
            pole = z if abs(z) > 1e-12 * scale else 0j
        frequency = abs(pole)
        out.append(Mode(z, pole, frequency, -pole.real / frequency if 0 < frequency < np.inf else 1.0))
    return sorted(out, key=lambda m: (round(m.frequency, 9), -m.pole.imag))


def damping_effect(device: Device, q: ArrayLike) -> tuple[list[Mode], list[Mode]]:
    """Return the open-loop modes at rest in ``q`` without viscous friction, and with that of the device.

    Args:
        q: pose (dof,), rad.

    Raises:
        PoseError: from ``linearize``.
    """
    return modes(linearize(device.frictionless(), q)), modes(linearize(device, q))
