"""Tetrahedral mesher fTetWild in a separate process.

In this process it would intercept Ctrl-C, write files to the current folder, and could crash the interpreter.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Indices
from palpate.fem.errors import BodyError

_PROGRAM: Final = """
import numpy as np
from pytetwild import tetrahedralize

surface = np.load("surface.npz")
spacing = float(surface["spacing"])
points, cells = tetrahedralize(surface["points"], surface["triangles"], edge_length_abs=spacing, quiet=True)[:2]
np.savez("volume.npz", points=points, tetrahedra=cells)
"""


def tetrahedra(points: Array, triangles: NDArray[np.int32], spacing: float) -> tuple[Array, Indices]:
    """Return points (n, 3), m, and tetrahedra (m, 4) that fill a surface, with edges of about `spacing`, m.

    There may be no tetrahedra.

    Raises:
        BodyError: fTetWild is not installed, or fails.
    """
    with TemporaryDirectory() as folder:
        np.savez(Path(folder) / "surface.npz", points=points, triangles=triangles, spacing=spacing)
        done = subprocess.run([sys.executable, "-c", _PROGRAM], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            message = (done.stderr.strip().splitlines() or ["no message"])[-1]
            if message.startswith(("ImportError", "ModuleNotFoundError")):
                raise BodyError(
                    "a surface is filled by fTetWild: pip install 'palpate[mesher]', or give tetrahedra (.msh, .vtk); "
                    f"{message}"
                )
            raise BodyError(f"the surface cannot be filled: fTetWild ended with code {done.returncode}; {message}")
        with np.load(Path(folder) / "volume.npz") as volume:
            return np.asarray(volume["points"], dtype=float), np.asarray(volume["tetrahedra"], dtype=np.int64)
