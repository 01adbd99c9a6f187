"""No energy out of a body: random closed paths of a tip, and the work that is done along them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from palpate.fem.body import Body, Shape
from palpate.fem.builder import build
from palpate.fem.volume import block

__all__ = ["energy_out", "small_body"]

Array = NDArray[np.float64]
_SIDE, _HEIGHT, _RADIUS, _DURATION = 0.04, 0.02, 6e-3, 2.0
_TIPS: tuple[Shape, Shape] = ("sphere", "flat")


def small_body() -> Body:
    """Return a block of 40 x 40 x 20 mm, 10 kPa, bonded below, touched on its top at 49 nodes, with 30 modes."""
    touch = "box 4 4 19.9 to 36 36 20.1 mm"
    return build(block((_SIDE, _SIDE, _HEIGHT), 5e-3), young=10e3, fixed="z <= 0 mm", touch=touch, modes=30)


def energy_out(
    kind: Callable[[float], Body],
    paths: int,
    *,
    held: bool,
    ticks: int = 2000,
    finest: int = 128_000,
    again: int = 20,
    progress: Callable[[float], None] | None = None,
) -> float:
    """Return the largest net work that a closed path got out of a body, over all the work exchanged along it.

    Every path begins and ends clear of the body, lasts 2 s, presses, slides, lifts off and comes back by chance; every
    other one is of a flat end. Steps of time add errors of their own, which fall with them: the `again` paths that
    seemed to give most are therefore followed once more in `finest` ticks, and it is these that count.

    Args:
        kind: makes the body for a period, s, from the one of `small_body`.
        paths: how many.
        held: a tick's force acts over the period that ends there (a body with a state); else it changes evenly
            between ticks.
        ticks: on each path, the first time.
        finest: on the worst paths, the second time.
        again: how many of the worst.
        progress: told the share done.
    """
    body, found = kind(_DURATION / ticks), np.empty(paths)
    for number in range(paths):
        found[number] = _lost(body, number, ticks, held)
        if progress is not None:
            progress((number + 1) / paths)
    fine = kind(_DURATION / finest)
    worst = np.argsort(found)[:again]
    return max(0.0, *(-_lost(fine, int(number), finest, held) for number in worst))


def _lost(body: Body, number: int, ticks: int, held: bool) -> float:
    """Net work done on the body along path `number`, by all that is exchanged; 0 for a path that does not touch."""
    tip = _TIPS[number % 2]
    path = _loop(np.random.default_rng(number), ticks)
    path[:, 2] += _RADIUS if tip == "sphere" else 0.0
    body.core.reset()
    force: Any = body.simulate_path(path, _RADIUS, outward=[0, 0, 1], tip=tip).force
    acting = force[1:] if held else 0.5 * (force[1:] + force[:-1])
    work = -(acting * np.diff(path, axis=0)).sum(axis=1)
    exchanged = np.abs(work).sum()
    return float(work.sum() / exchanged) if exchanged > 0 else 0.0


def _loop(rng: Generator, ticks: int) -> Array:
    """Places (ticks + 1, 3), m, of a smooth closed path around the middle of the top."""
    t = np.linspace(0.0, 2.0 * np.pi, ticks + 1)
    order = np.arange(1, 4)
    even, odd = rng.normal(size=(2, 3, 3)) / order
    path = (np.cos(np.outer(t, order)) @ even.T + np.sin(np.outer(t, order)) @ odd.T) * [3e-3, 3e-3, 0.8e-3]
    path += np.array([_SIDE / 2, _SIDE / 2, _HEIGHT - 1e-3])
    clear = 6e-3 * np.clip(1.0 - 2.0 * np.minimum(t, 2.0 * np.pi - t), 0.0, 1.0) ** 2
    path[:, 2] += clear
    return np.asarray(path)
