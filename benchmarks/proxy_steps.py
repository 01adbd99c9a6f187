"""Time of a proxy's step on the path of the measurements of peers."""

from __future__ import annotations

from typing import Any

import numpy as np
from palpate.arrays import Array
from palpate.contact.mesh import Mesh
from palpate.contact.proxy import Proxy
from palpate.contact.surface import Surface

__all__ = ["orbit", "time_steps"]


def orbit(ticks: int, bump: float = 0.0) -> Array:
    """Return a 1 kHz path (n, 3), m, 10 to 30 mm under a ball of radius 0.5 (1 + bump sin 10x sin 10y sin 10z)."""
    t = np.arange(ticks) * 1e-3
    a, b = 2 * np.pi * 0.31 * t, 2 * np.pi * 0.17 * t
    unit = np.stack([np.cos(a), np.sin(a), 0.8 * np.sin(b)], axis=1)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    radius = 0.5 * (1.0 + bump * np.prod(np.sin(10.0 * unit), axis=1))
    return np.asarray(unit * (radius - 0.5 * (0.04 + 0.02 * np.sin(2 * np.pi * 2.3 * t)))[:, None])


def time_steps(mesh: Mesh, path: Array, radius: float = 0.0, passes: int = 3) -> dict[str, Any]:
    """Return the time of each step on a path, the minimum over `passes` passes, with 100 N/m and friction 0.6 / 0.4.

    Times are in us. "median", "p99.9" and "worst" include the time of the clock, about 0.03 us. "worst_single" is the
    largest of all passes and includes interruptions by the machine. "lost" and "unfinished" are counts of ticks.
    """
    surface = Surface(stiffness=100.0, static_friction=0.6, dynamic_friction=0.4)
    times = np.empty((passes, len(path)))
    for i in range(passes):
        times[i] = 1e6 * np.asarray(Proxy(mesh, surface, radius).core.step_durations(path))
    proxy = Proxy(mesh, surface, radius)
    contacts = proxy.simulate_path(path)
    best = times.min(axis=0)
    return {
        "median": float(np.median(best)),
        "p99.9": float(np.quantile(best, 0.999)),
        "worst": float(best.max()),
        "worst_single": float(times.max()),
        "lost": int(np.sum(~contacts.touching)),
        "unfinished": proxy.iteration_limit_count,
    }
