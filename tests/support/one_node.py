"""A body of one node: a wall of known stiffness, for tests."""

from pathlib import Path

import numpy as np
from palpate.fem.storage import BodyData, write


def one_node(stiffness: float, path: Path) -> Path:
    """Write a body whose one node, at the origin, yields by 1 / `stiffness`, m/N, in each direction."""
    contents = BodyData(
        points=np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]]),
        triangles=np.array([[0, 1, 2]]),
        contact_triangles=np.array([True]),
        nodes=np.array([0]),
        normals=np.array([[0.0, 0.0, 1.0]]),
        areas=np.array([1e-6]),
        compliance=np.diag([1.0 / stiffness] * 3).astype(np.float32),
        frequencies=np.empty(0),
        shapes=np.empty((3, 0), dtype=np.float32),
        vertices=np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, -1e-3]]),
        tetrahedra=np.array([[0, 2, 1, 3]]),
        young=np.array([1e4]),
        dirichlet=np.array([False, True, True, True]),
        record={"source": "one node"},
    )
    return write(contents, path)
