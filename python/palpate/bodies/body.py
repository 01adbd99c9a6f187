"""A body that yields where it is touched."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.bodies.store import Contents, read, write

__all__ = ["Body"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Body:
    """The touchable surface of an elastic solid: n nodes, and how far each moves under a force on each."""

    def __init__(self, contents: Contents) -> None:
        self.contents = contents

    @classmethod
    def load(cls, path: str | Path) -> Body:
        """Read a body that `palpate body build` wrote; BodyError if it is not one, or not whole."""
        return cls(read(path))

    def write(self, path: str | Path) -> Path:
        """Write the body (.h5), whole or not at all."""
        return write(self.contents, path)

    def __repr__(self) -> str:
        return f"<Body: {len(self.nodes)} nodes, {self.extent:.3g} m across, of {self.record['source']}>"

    @property
    def points(self) -> Array:
        """Of the whole surface at rest (s, 3), m."""
        return self.contents.points

    @property
    def triangles(self) -> Indices:
        """Of the whole surface (k, 3), anticlockwise seen from outside."""
        return self.contents.triangles

    @property
    def nodes(self) -> Array:
        """Places at rest of the nodes that carry contact (n, 3), m."""
        return self.contents.points[self.contents.nodes]

    @property
    def normals(self) -> Array:
        """Outward unit normals at the nodes (n, 3)."""
        return self.contents.normals

    @property
    def compliance(self) -> NDArray[np.float32]:
        """Displacement of each node by force on each (3n, 3n), m/N, row 3 x node + axis."""
        return self.contents.compliance

    @property
    def record(self) -> Mapping[str, Any]:
        """How it was made: inputs, sizes, times, versions."""
        return self.contents.record

    @property
    def extent(self) -> float:
        """Diagonal of the box around it, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))
