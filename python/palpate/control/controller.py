"""Sampled linear controller of the servo loop."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import DesignError
from palpate.units import bounded_to_si, to_si


@dataclass(frozen=True)
class Controller:
    """A discrete controller from [F_ref (3); F_object (3)] in N to the commanded tip force u (3) in N.

    Each servo period, with v = [F_ref; F_object]:
    u = C x + D v;  x <- A x + B v + antiwindup (u_applied - u).

    With ``design_stiffness`` K0, v is scaled to an object of that stiffness: the forces along the normal (per axis
    without a normal) are divided by the object's stiffness K of the same tick and multiplied by K0. In force tracking
    the loop is then the same for every K, and K may change at any tick.

    Attributes:
        system: python-control StateSpace, 6 inputs, 3 outputs, dt = servo period in s.
        antiwindup: (n states, 3), feedback of the saturation error to the state; None: no anti-windup.
        kind: "gain", "lead_lag", "lqg" or "state_space".
        notes: specification and result of the design, for reports.
        design_stiffness: K0 per axis, N/m; None: the forces are not scaled.

    Raises:
        DesignError: wrong shapes, a continuous system, or a value that is not finite.
    """

    system: control.StateSpace
    antiwindup: Array | None = None
    kind: str = "state_space"
    notes: dict[str, Any] = field(default_factory=dict)
    design_stiffness: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        s = self.system
        if (s.ninputs, s.noutputs) != (6, 3):
            raise DesignError(
                f"a controller maps 6 inputs [F_ref; F_object] to 3 outputs, not {s.ninputs} to {s.noutputs}"
            )
        if not s.isdtime(strict=True) or s.dt is True or not s.dt > 0:
            raise DesignError(f"a controller is sampled with its servo period in s, not dt = {s.dt}")
        if not all(np.all(np.isfinite(m)) for m in (s.A, s.B, s.C, s.D)):
            raise DesignError("a controller's matrices must be finite")
        if self.antiwindup is not None and self.antiwindup.shape != (s.nstates, 3):
            raise DesignError(f"antiwindup must be {s.nstates} x 3 (states x forces), not {self.antiwindup.shape}")

    def normalized(self, stiffness: ArrayLike | str) -> Controller:
        """Return the controller with its inputs scaled to an object of the given stiffness, for which it is designed.

        Args:
            stiffness: K0, N/m, one number for all axes or three; or text with a unit.

        Raises:
            DesignError: a stiffness that is not positive and finite.
        """
        k = (
            to_si(stiffness, "N/m", "normalized: stiffness", error=DesignError)
            if isinstance(stiffness, str)
            else stiffness
        )
        x, y, z = (
            bounded_to_si(float(one), "N/m", "normalized: stiffness", error=DesignError)
            for one in np.broadcast_to(np.asarray(k, dtype=float), (3,))
        )
        return replace(self, design_stiffness=(x, y, z))

    @property
    def period(self) -> float:
        """Servo period, s."""
        return float(self.system.dt)

    @property
    def feedback(self) -> control.StateSpace:
        """Subsystem from F_object to u (3 x 3); the loop gain is -feedback times the plant."""
        s = self.system
        return control.StateSpace(s.A, s.B[:, 3:], s.C, s.D[:, 3:], s.dt)

    @classmethod
    def gain(cls, value: float | Array, period: float | str) -> Controller:
        """Return u = value (F_ref - F_object); value in N/N, one number or three; period in s, or text with a unit."""
        period = to_si(period, "s", "gain: period", error=DesignError)
        k = np.diag(np.broadcast_to(np.asarray(value, dtype=float), (3,)))
        system = control.StateSpace([], [], [], np.hstack([k, -k]), period)
        return cls(system, None, "gain", {"gain": np.diag(k).tolist()})
