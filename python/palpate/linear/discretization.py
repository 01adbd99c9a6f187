"""Discretization of a continuous state space, and the sampled plant for controller design."""

from __future__ import annotations

from typing import Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from palpate.devices import Device, load
from palpate.devices.reach import check_reach
from palpate.errors import DesignError, PoseError
from palpate.linear.linearization import linearize
from palpate.units import array_to_si, bounded_to_si


def discretize(
    sys: control.StateSpace,
    period: float | str,
    method: Literal["zoh", "tustin", "series"] = "zoh",
    *,
    order: int = 4,
) -> control.StateSpace:
    """Return ``sys`` sampled every ``period`` seconds.

    - ``"zoh"``: exact for an input held between samples; the state is the continuous state.
    - ``"tustin"``: s -> (2/T)(z-1)/(z+1), with A_d = (I-AT/2)^-1 (I+AT/2), B_d = (I-AT/2)^-1 B,
      C_d = C (I-AT/2)^-1 T, D_d = D + C (I-AT/2)^-1 B T/2. Its state is the continuous state minus the
      direct part of the input, divided by T. python-control scales by sqrt(T) instead; the transfer
      function is the same.
    - ``"series"``: zero-order hold with the exponential truncated to the nested series
      psi = I + AT/2 (I + AT/3 (I + ... (I + AT/order))); A_d = I + AT psi, B_d = T psi B.

    Args:
        sys: continuous state space (n states, m inputs, p outputs).
        period: T, s, positive; or text such as "0.5 ms".
        method: discretization rule.
        order: number of nested terms of the series, at least 2; its error is O((AT)^(order+1)).

    Raises:
        DesignError: ``sys`` is sampled already, the period is not positive, the method is unknown, or
            the system has a pole at 2/T (Tustin).
    """
    if not sys.isctime(strict=False) or sys.isdtime(strict=True):
        raise DesignError(f"discretize: the system is sampled already (dt = {sys.dt}); pass a continuous one")
    period = bounded_to_si(period, "s", "discretize: period", error=DesignError)
    a, b, c, d = sys.A, sys.B, sys.C, sys.D
    n, m = b.shape
    eye = np.eye(n)
    if method == "zoh":
        big = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * period)
        ad, bd, cd, dd = big[:n, :n], big[:n, n:], c, d
    elif method == "tustin":
        left = eye - a * period / 2
        if n and np.linalg.cond(left) > 1e14:
            raise DesignError(f"discretize: Tustin has no result for a pole at 2/T = {2 / period:g} 1/s")
        inverse = np.linalg.inv(left)
        ad, bd = inverse @ (eye + a * period / 2), inverse @ b
        cd, dd = c @ inverse * period, d + c @ inverse @ b * (period / 2)
    elif method == "series":
        if order < 2:
            raise DesignError(f"discretize: the series needs an order of at least 2, not {order}")
        psi = eye
        for k in range(order, 1, -1):
            psi = eye + a @ psi * (period / k)
        ad, bd, cd, dd = eye + a @ psi * period, psi @ b * period, c, d
    else:
        raise DesignError(f'discretize: method must be "zoh", "tustin" or "series", not {method!r}')
    return control.StateSpace(
        ad, bd, cd, dd, period, inputs=sys.input_labels, outputs=sys.output_labels, states=sys.state_labels
    )


def rendering_plant(
    device: Device,
    q: ArrayLike,
    *,
    stiffness: ArrayLike,
    period: float | str,
    method: Literal["zoh", "tustin", "series"] = "zoh",
) -> control.StateSpace:
    """Return the sampled plant from tip force u (3, N) to object force K (p - p0) (3, N) about the pose ``q``.

    The device rests at ``q`` under the constant tip force that balances gravity. The change of the Jacobian with the
    pose is included.

    Args:
        q: pose (dof,), rad; this and the next two may be text with units as well.
        stiffness: K, N/m, one value or three (x, y, z).
        period: servo period, s.
        method: as in ``discretize``; "zoh" corresponds to the servo loop.

    Raises:
        PoseError, DesignError: from ``linearize`` and ``discretize``; the pose is singular, or beyond joint limits.

    Warns:
        PalpateWarning: the pose is near a singular one, or near a joint limit.
    """
    device = load(device)
    continuous = linearize(device, q, inputs="force", outputs="object_force", stiffness=stiffness)
    check_reach(device, array_to_si(q, device.joint_unit, "q", error=PoseError), "rendering_plant")
    return discretize(continuous, period, method)
