"""Normals of faces, edges and vertices: barycentric weights, and what does not change them."""

from __future__ import annotations

import numpy as np
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import barycentric

ROOF = np.array(
    [[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [-1.0, 0.0, 0.0], [-1.0, 2.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]
)


def test_barycentric_weights_restore_a_point() -> None:
    corners = np.random.default_rng(6).normal(size=(20, 3, 3))
    weights = np.random.default_rng(7).dirichlet(np.ones(3), 20)
    np.testing.assert_allclose(barycentric(np.einsum("nk,nkx->nx", weights, corners), corners), weights, atol=1e-9)


def test_the_normal_on_the_ridge_of_a_roof_halves_its_angle_from_either_side() -> None:
    """Whichever triangle was found for the point, and whichever diagonal divides a side of the roof."""
    one = np.array([[0, 1, 2], [1, 3, 2], [0, 4, 1], [1, 4, 5]])
    other = np.array([[0, 3, 2], [0, 1, 3], [0, 4, 5], [0, 5, 1]])
    up, left = np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0]) / np.sqrt(2.0)
    for faces in (one, other):
        normals = Pseudonormals(ROOF, faces)
        on_ridge = np.flatnonzero(np.isin(faces, [0, 1]).sum(axis=1) == 2)
        assert len(on_ridge) == 2
        np.testing.assert_allclose(normals.at(np.array([[0.0, 0.7, 1.0]] * 2), on_ridge), [up, up], atol=1e-15)
        for corner in (0, 1):  # ends of the ridge: the angles of both sides are 90 degrees
            around = np.flatnonzero((faces == corner).any(axis=1))
            np.testing.assert_allclose(normals.at(ROOF[[corner] * len(around)], around), [up] * len(around), atol=1e-15)
        face = np.flatnonzero((faces == 2).any(axis=1))[0]
        inside = ROOF[faces[face]].mean(axis=0)
        np.testing.assert_allclose(normals.at(inside[None], np.array([face])), [left], atol=1e-15)
