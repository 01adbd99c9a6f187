"""Passivity of a body: work of a tip along random closed paths."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from palpate.arrays import Array
from palpate.fem.body import Body
from palpate.fem.builder import build
from palpate.fem.checks import TipShape
from palpate.fem.volume import block

__all__ = ["energy_out", "small_body"]

_SIDE, _HEIGHT, _RADIUS, _DURATION = 0.04, 0.02, 6e-3, 2.0
_TIPS: tuple[TipShape, TipShape] = ("sphere", "flat")


def small_body() -> Body:
    """Return a block of 40 x 40 x 20 mm, 10 kPa, fixed at its bottom, with 49 contact nodes and 30 modes."""
    touch = "box 4 4 19.9 to 36 36 20.1 mm"
    return build(block((_SIDE, _SIDE, _HEIGHT), 5e-3), young=10e3, fixed="z <= 0 mm", touch=touch, modes=30)


def energy_out(
    kind: Callable[[float], Body],
    paths: int,
    *,
    piecewise_constant: bool,
    ticks: int = 2000,
    finest: int = 512_000,
    again: int = 20,
    progress: Callable[[float], None] | None = None,
) -> float:
    """Return the largest net work that a closed path extracts from a body, over the work exchanged along it.

    Each path lasts 2 s and begins and ends without contact. It presses, slides, lifts off and returns at random. Every
    other path uses a flat end. The error of the discretization decreases with the tick, so the `again` worst paths are
    repeated with `finest` ticks, and the result is that of the repetition.

    Args:
        kind: returns the body of `small_body` with a model for a period, s.
        paths: number of paths.
        piecewise_constant: whether the force of a tick acts over the whole period that ends there, as for a body with
            a state; otherwise it varies linearly between ticks.
        ticks: per path, in the first run.
        finest: ticks per path, in the repetition.
        again: number of paths that are repeated.
        progress: called with the fraction done.
    """
    body, dissipated = kind(_DURATION / ticks), np.empty(paths)
    for index in range(paths):
        dissipated[index] = _dissipated(body, index, ticks, piecewise_constant)
        if progress is not None:
            progress((index + 1) / paths)
    fine = kind(_DURATION / finest)
    worst = np.argsort(dissipated)[:again]
    return max(0.0, *(-_dissipated(fine, int(index), finest, piecewise_constant) for index in worst))


def _dissipated(body: Body, index: int, ticks: int, piecewise_constant: bool) -> float:
    """Return the net work on the body along a path over the work exchanged; 0 for a path without contact."""
    tip = _TIPS[index % 2]
    path = _loop(np.random.default_rng(index), ticks)
    path[:, 2] += _RADIUS if tip == "sphere" else 0.0
    body.core.reset()
    force: Any = body.simulate_path(path, _RADIUS, outward=[0, 0, 1], tip=tip).force
    acting = force[1:] if piecewise_constant else 0.5 * (force[1:] + force[:-1])
    work = -(acting * np.diff(path, axis=0)).sum(axis=1)
    exchanged = np.abs(work).sum()
    return float(work.sum() / exchanged) if exchanged > 0 else 0.0


def _loop(rng: Generator, ticks: int) -> Array:
    """Return a smooth closed path (ticks + 1, 3), m, around the center of the top."""
    t = np.linspace(0.0, 2.0 * np.pi, ticks + 1)
    order = np.arange(1, 4)
    even, odd = rng.normal(size=(2, 3, 3)) / order
    path = (np.cos(np.outer(t, order)) @ even.T + np.sin(np.outer(t, order)) @ odd.T) * [3e-3, 3e-3, 0.8e-3]
    path += np.array([_SIDE / 2, _SIDE / 2, _HEIGHT - 1e-3])
    clear = 6e-3 * np.clip(1.0 - 2.0 * np.minimum(t, 2.0 * np.pi - t), 0.0, 1.0) ** 2
    path[:, 2] += clear
    return np.asarray(path)
