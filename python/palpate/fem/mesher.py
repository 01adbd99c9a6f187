"""Tetrahedral mesher fTetWild in a separate process.

In this process it would intercept Ctrl-C, write files to the current folder, and could crash the interpreter.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Indices
from palpate.fem.errors import BodyError
from palpate.files.isolated import IsolatedError, run_isolated

_PROGRAM: Final = """
import numpy as np
from pytetwild import tetrahedralize

with np.load("inputs.npz") as surface:
    points, triangles, spacing = (surface[name] for name in ("points", "triangles", "spacing"))
points, cells = tetrahedralize(points, triangles, edge_length_abs=float(spacing), quiet=True)[:2]
np.savez("result.npz", points=points, tetrahedra=cells)
"""


def tetrahedra(points: Array, triangles: NDArray[np.int32], spacing: float) -> tuple[Array, Indices]:
    """Return points (n, 3), m, and tetrahedra (m, 4) that fill a surface, with edges of about `spacing`, m.

    There may be no tetrahedra.

    Raises:
        BodyError: fTetWild is not installed, or fails.
    """
    try:
        volume = run_isolated(_PROGRAM, {"points": points, "triangles": triangles, "spacing": spacing})
    except IsolatedError as problem:
        if str(problem).startswith(("ImportError", "ModuleNotFoundError")):
            raise BodyError(
                "a surface is filled by fTetWild: pip install 'palpate[mesher]', or give tetrahedra (.msh, .vtk); "
                f"{problem}"
            ) from None
        raise BodyError(f"the surface cannot be filled: fTetWild failed: {problem}") from None
    return np.asarray(volume["points"], dtype=float), np.asarray(volume["tetrahedra"], dtype=np.int64)
