"""Critical stiffness of a wall: the exact interval of stiffness in which the sampled loop is stable."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeAlias

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import finite
from palpate.errors import StabilityError
from palpate.linear.linear_device import LinearDevice, SampledDevice
from palpate.linear.wall import WallLoop, wall_loop
from palpate.units import array_to_si

__all__ = [
    "Device",
    "StabilityInterval",
    "as_wall_loop",
    "critical_stiffness",
    "is_stable",
    "stability_interval",
    "wall_spectral_radius",
]

OPTIONS = frozenset({"period", "delay", "velocity_filter", "controller"})
Device: TypeAlias = LinearDevice | SampledDevice | WallLoop | control.StateSpace


@dataclass(frozen=True)
class StabilityInterval:
    """First interval of stiffness, from zero up, in which a loop is stable.

    Attributes:
        stiffness: upper end, the critical stiffness, N/m; 0 if no wall is stable, inf if every stiff wall is.
        min_stable_stiffness: lower end, N/m; above 0 if the device is unstable without a wall.
        frequency: frequency of the oscillation at the upper end, Hz; half the sampling rate for a root at -1, nan if
            there is no upper end.
    """

    stiffness: float
    min_stable_stiffness: float
    frequency: float


def critical_stiffness(device: Device, *, virtual_damping: float | str = 0.0, **loop: Any) -> float:
    """Return the least stiffness (N/m) at which ``device`` against a wall becomes unstable, exactly.

    Args:
        device: a LinearDevice, a continuous SISO state space from force (N) to motion (m), or a WallLoop.
        virtual_damping: B of the wall, N s/m.
        **loop: period (s), delay (samples, may be fractional), velocity_filter, controller: as ``wall_loop``.

    Raises:
        StabilityError: as ``wall_loop``.
    """
    return stability_interval(as_wall_loop(device, loop), virtual_damping).stiffness


def stability_interval(loop: WallLoop, virtual_damping: float | str = 0.0) -> StabilityInterval:
    """Return the first interval of stiffness, from zero up, in which the loop is stable.

    Every real K with a root on the unit circle is found: at +1, at -1, and in between where Im W = B Im V. Eigenvalues
    decide the stability of the intervals between them.
    """
    b = finite(virtual_damping, "virtual_damping", "N*s/m")
    for density in (1, 8):
        angles, values = _crossings(loop, b, density)
        edges = np.concatenate([[0.0], values, [2 * values[-1] if values.size else 1.0]])
        middles = list(enumerate(0.5 * (edges[1:] + edges[:-1])))
        first = next((i for i, k in middles if is_stable(loop, k, b)), None)
        if first is None:
            return StabilityInterval(0.0, 0.0, float("nan"))
        beyond = next((i for i, k in middles[first + 1 :] if not is_stable(loop, k, b)), None)
        lower = float(edges[first])
        if beyond is None:
            return StabilityInterval(float("inf"), lower, float("nan"))
        upper, frequency = float(edges[beyond]), float(angles[beyond - 1]) / (2 * np.pi * loop.period)
        shares = np.concatenate([np.geomspace(1e-3, 0.5, 6), [0.7, 0.9, 0.999]])
        width = upper - lower
        if all(is_stable(loop, k, b) for k in lower + width * shares) and not is_stable(loop, lower + width * 1.001, b):
            break
    return StabilityInterval(upper, lower, frequency)


def wall_spectral_radius(
    device: Device, *, stiffness: ArrayLike, virtual_damping: ArrayLike = 0.0, workers: int | None = None, **loop: Any
) -> Array:
    """Return the largest modulus of the loop's eigenvalues for every wall; below 1 is stable.

    Args:
        device: as ``critical_stiffness``.
        stiffness: K, N/m, any shape.
        virtual_damping: B, N s/m, broadcast against K.
        workers: number of threads; None: one per core. The result does not depend on it.
        **loop: as ``wall_loop``.

    Returns:
        Array of the broadcast shape.

    Raises:
        StabilityError: as ``wall_loop``; or a stiffness or damping that is not finite.
    """
    closed = as_wall_loop(device, loop)
    k, b = np.broadcast_arrays(
        array_to_si(stiffness, "N/m", "stiffness", error=StabilityError),
        array_to_si(virtual_damping, "N*s/m", "virtual_damping", error=StabilityError),
    )
    if not (np.all(np.isfinite(k)) and np.all(np.isfinite(b))):
        raise StabilityError("stiffness and virtual_damping must be finite, in N/m and N s/m")
    flat_k, flat_b = k.ravel(), b.ravel()
    result = np.empty(flat_k.size)
    size = 20_000  # walls per block, to limit memory

    def compute(start: int) -> None:
        window = slice(start, start + size)
        result[window] = np.abs(np.linalg.eigvals(closed.matrix(flat_k[window], flat_b[window]))).max(axis=-1)

    starts = range(0, flat_k.size, size)
    threads = min(workers or os.cpu_count() or 1, len(starts))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(compute, starts))
    else:
        for start in starts:
            compute(start)
    return result.reshape(k.shape)


def as_wall_loop(device: Device, options: dict[str, Any]) -> WallLoop:
    """Return ``device`` if it is a WallLoop, else its loop against a wall with the ``options`` of ``wall_loop``.

    Raises:
        StabilityError: as ``wall_loop``; or an option that ``wall_loop`` does not have.
    """
    if isinstance(device, WallLoop):
        if options:
            raise StabilityError(f"{min(options)} is part of the given loop; build the loop with it")
        return device
    if unknown := options.keys() - OPTIONS:
        hint = "; the wall's damping is virtual_damping" if "damping" in unknown else ""
        raise StabilityError(
            f"{min(unknown)} is not an option of a loop; options are {', '.join(sorted(OPTIONS))}{hint}"
        )
    return wall_loop(device, **options)


def is_stable(loop: WallLoop, stiffness: float, damping: float) -> bool:
    """Return whether the loop is stable against a wall of ``stiffness`` (N/m) and ``damping`` (N s/m)."""
    return loop.spectral_radius(stiffness, damping) < 1.0


def _crossings(loop: WallLoop, b: float, density: int) -> tuple[Array, Array]:
    """Return angles (k,) and stiffnesses (k,), ascending and positive, of all roots on the circle for damping ``b``."""

    def mismatch(theta: Array) -> Array:
        return np.asarray(loop.required_wall_response(theta).imag - b * loop.velocity_response(theta).imag, dtype=float)

    theta = _angle_grid(loop, density)
    values = mismatch(theta)
    k = np.nonzero(values[:-1] * values[1:] < 0)[0]
    low, high, at_low = theta[k], theta[k + 1], values[k]
    for _ in range(60):  # bisection of all brackets at once, to rounding
        middle = 0.5 * (low + high)
        if middle.size == 0 or np.all(high - low <= 4e-16 * high):
            break
        at_middle = mismatch(middle)
        left = at_middle * at_low > 0
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    angles = np.concatenate([0.5 * (low + high), [np.pi]])
    values = loop.required_wall_response(angles).real - b * loop.velocity_response(angles).real
    static = _static_limit(loop)
    angles, values = np.concatenate([angles, [0.0]]), np.concatenate([values, [static]])
    # a sign change through a pole of W, where the response of the device vanishes, is not a root
    real = np.isfinite(values) & (values > 0) & (values < 1e15)
    order = np.argsort(values[real])
    return angles[real][order], values[real][order]


def _angle_grid(loop: WallLoop, density: int = 1) -> Array:
    """Return angles in (0, pi), rad per sample, dense about the device's resonances."""
    parts = [np.geomspace(1e-5, np.pi, 700 * density), np.linspace(1e-3, np.pi, 500 * density)]
    for value in np.linalg.eigvals(np.eye(len(loop.tip.step)) + loop.tip.step):
        if abs(value) > 0 and abs(np.angle(value)) > 0:
            width = max(abs(np.log(abs(value))), 1e-7)
            parts.append(abs(np.angle(value)) + width * np.linspace(-8, 8, 64 * density + 1))
    theta = np.unique(np.concatenate(parts))
    return np.asarray(theta[(theta > 1e-6) & (theta < np.pi * (1 - 1e-9))], dtype=float)


def _static_limit(loop: WallLoop) -> float:
    """Return the stiffness (N/m) with a root at +1, where the loop becomes statically stable; 0 if there is none."""
    step = loop.tip.step
    scale = np.abs(step).max()
    if np.linalg.matrix_rank(step / scale, tol=1e-13) < len(step):
        return 0.0
    gain = -loop.tip.out @ np.linalg.solve(step, loop.tip.now + loop.tip.before)
    if (c := loop.controller) is not None:
        rest = np.eye(c.nstates) - c.A
        if c.nstates and np.linalg.matrix_rank(rest) < c.nstates:
            return 0.0  # an integrator balances any static load
        gain = gain * float((c.C @ np.linalg.solve(rest, c.B) + c.D)[0, 0])
    return float(-1 / gain) if gain != 0 else 0.0
