"""The compliance of a body's touchable surface, condensed from its volume.

C = B^T K^-1 B with the loads B of unit forces on the touchable vertices: how far each moves, on average over its hat,
under a unit force on each (Bro-Nielsen & Cotin 1996; James & Pai 1999). It is symmetric and positive definite, as K is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from palpate.bodies.elements import Elements
from palpate.bodies.errors import BodyError
from palpate.bodies.factor import Factor
from palpate.units import quantity

__all__ = ["check_memory", "condense", "digest", "expected_memory"]

Progress = Callable[[str, float], None]
_COLUMNS = 96  # right sides solved at once


def expected_memory(elements: Elements) -> tuple[float, float]:
    """Return the bytes of the compliance, and of the factor of N unknowns (8 bytes x 10 to 18 N^(4/3) in blocks)."""
    return 4.0 * (3 * len(elements.touchable)) ** 2, 8.0 * 20.0 * len(elements.free) ** (4 / 3)


def check_memory(elements: Elements, budget: float | str) -> tuple[float, float]:
    """Return `expected_memory`; raise BodyError with a proposal if they are over `budget`, bytes or "4 GB"."""
    allowed = quantity(budget, "byte", "memory", error=BodyError) if isinstance(budget, str) else float(budget)
    result, factor = expected_memory(elements)
    if result + factor > allowed:
        n = len(elements.touchable)
        proposal = "a coarser mesh"
        if factor < 0.8 * allowed:
            proposal += f", or a touchable part of at most {int(np.sqrt((allowed - factor) / 36.0))} vertices"
        raise BodyError(
            f"the compliance of {n} vertices takes {result / 1e9:.3g} GB and the factor of {len(elements.free)} "
            f"unknowns about {factor / 1e9:.3g} GB, over the budget of {allowed / 1e9:.3g} GB: "
            f"{proposal}, or more memory"
        )
    return result, factor


def digest(elements: Elements) -> str:
    """Name what the compliance depends on, for a build that is taken up again."""
    total = hashlib.sha256()
    for array in (
        elements.volume.points,
        elements.volume.tetrahedra,
        elements.young,
        elements.held,
        elements.touchable,
        elements.triangles,
    ):
        total.update(np.ascontiguousarray(array).tobytes())
    total.update(f"{elements.material.poisson!r} {elements.order}".encode())
    return total.hexdigest()[:16]


def condense(
    elements: Elements, factor: Factor, *, resume: Path | None = None, progress: Progress | None = None
) -> NDArray[np.float32]:
    """Return the compliance (3n, 3n), m/N, row 3 x touchable vertex + axis.

    With `resume`, finished rows are kept in that file, and a build that was killed goes on from there; a row that was
    only half written is solved again.
    """
    load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free].tocsc()
    size = load.shape[1]
    compliance = np.empty((size, size), dtype=np.float32)
    done = _take_up(resume, compliance)
    transposed = load.T.tocsr()
    for begin in range(done, size, _COLUMNS):
        end = min(begin + _COLUMNS, size)
        compliance[begin:end] = (transposed @ factor.solve(load[:, begin:end].toarray())).T
        if resume is not None:
            with resume.open("ab") as file:
                file.write(compliance[begin:end].tobytes())
        if progress is not None:
            progress(f"solving for {size // 3} vertices", end / size)
    _make_symmetric(compliance)
    return compliance


def _take_up(resume: Path | None, compliance: NDArray[np.float32]) -> int:
    """Read the rows that an earlier build finished; return how many, and cut off what it left half written."""
    if resume is None or not resume.exists():
        return 0
    row = compliance.shape[1] * 4
    whole = int(min(resume.stat().st_size // row, len(compliance)))
    with resume.open("r+b") as file:
        file.truncate(whole * row)
        compliance[:whole] = np.frombuffer(file.read(), dtype=np.float32).reshape(whole, -1)
    return whole


def _make_symmetric(compliance: NDArray[np.float32]) -> None:
    """Average with the transpose, in place, block by block; refuse what differs by more than rounding."""
    scale, worst = float(np.abs(compliance).max()), 0.0
    for i in range(0, len(compliance), 1024):
        for j in range(0, i + 1, 1024):
            a, b = compliance[i : i + 1024, j : j + 1024], compliance[j : j + 1024, i : i + 1024]
            worst = max(worst, float(np.abs(a - b.T).max()))
            mean = 0.5 * (a + b.T)
            a[:], b[:] = mean, mean.T
    if not np.isfinite(scale) or worst > 1e-4 * scale:
        raise BodyError("the compliance is not symmetric to rounding: the elements are too flat, mesh again")
