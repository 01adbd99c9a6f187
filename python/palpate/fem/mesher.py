"""fTetWild in a process of its own: it takes Ctrl-C away from Python, writes where it is called, and may crash."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from numpy.typing import NDArray

from palpate.fem.errors import BodyError

__all__ = ["tetrahedra"]

Array = NDArray[np.float64]
_PROGRAM: Final = """
import numpy as np
from pytetwild import tetrahedralize

given = np.load("surface.npz")
found = tetrahedralize(given["points"], given["triangles"], edge_length_abs=float(given["spacing"]), quiet=True)
np.savez("volume.npz", points=found[0], tetrahedra=found[1])
"""


def tetrahedra(points: Array, triangles: NDArray[np.int32], spacing: float) -> tuple[Array, NDArray[np.int64]]:
    """Return points (n, 3), m, and tetrahedra (m, 4), perhaps none, that fill a surface, with edges of about `spacing`.

    Raises BodyError if fTetWild is not installed, or gives up.
    """
    with TemporaryDirectory() as place:
        np.savez(Path(place) / "surface.npz", points=points, triangles=triangles, spacing=spacing)
        done = subprocess.run([sys.executable, "-c", _PROGRAM], cwd=place, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            told = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
            if told.startswith(("ImportError", "ModuleNotFoundError")):
                raise BodyError(
                    "a surface is filled by fTetWild: pip install 'palpate[mesher]', or bring tetrahedra (.msh, .vtk); "
                    f"{told}"
                )
            raise BodyError(f"the surface cannot be filled: fTetWild ended with code {done.returncode}; {told}")
        with np.load(Path(place) / "volume.npz") as found:
            return np.asarray(found["points"], dtype=float), np.asarray(found["tetrahedra"], dtype=np.int64)
