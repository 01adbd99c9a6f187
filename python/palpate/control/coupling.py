"""Sampled virtual coupling between tip and object: spring and damper in parallel."""

from __future__ import annotations

from typing import Literal

import control

from palpate.errors import DesignError
from palpate.units import bounded_to_si


def virtual_coupling(
    stiffness: float | str,
    damping: float | str,
    period: float | str,
    difference: Literal["backward", "bilinear"] = "backward",
) -> control.StateSpace:
    """Return the sampled K + B s from deflection (m) to the force of the tip on the object (N).

    - ``"backward"``: s = (1 - 1/z)/T. The display is passive if the device damping b >= B + K T/2.
    - ``"bilinear"``: s = (2/T)(z - 1)/(z + 1) (Zilles & Salisbury 1995). Its pole at z = -1 sustains an
      oscillation at half the sampling rate, where the gain is unbounded.

    With B = 0 both are the constant K without a state.

    Args:
        stiffness: K, N/m; each of the three may also be text with a unit.
        damping: B, N s/m.
        period: T, s.
        difference: discretization rule of the damper.

    Raises:
        DesignError: a value that is negative or not finite, a period that is not positive, or an unknown rule.
    """
    stiffness = bounded_to_si(stiffness, "N/m", "virtual_coupling: stiffness", zero=True, error=DesignError)
    damping = bounded_to_si(damping, "N*s/m", "virtual_coupling: damping", zero=True, error=DesignError)
    period = bounded_to_si(period, "s", "virtual_coupling: period", error=DesignError)
    if difference not in ("backward", "bilinear"):
        raise DesignError(f'virtual_coupling: difference must be "backward" or "bilinear", not {difference!r}')
    if damping == 0:
        return control.StateSpace([], [], [], [[stiffness]], period)
    if difference == "backward":
        # the state is the deflection one sample ago
        rate = damping / period
        return control.StateSpace([[0.0]], [[1.0]], [[-rate]], [[stiffness + rate]], period)
    # d'_k = 2/T (d_k - d_{k-1}) - d'_{k-1}; the state is -(2/T d_k + d'_k) of the last sample
    rate = 2 / period
    return control.StateSpace([[-1.0]], [[-2 * rate]], [[damping]], [[stiffness + damping * rate]], period)
