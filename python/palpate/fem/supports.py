"""Supports added to a condensed body, without its mesh: an update of the compliance by the held rows.

The displacements u of all nodes are C f + C_s r with the forces r on the k held rows s, which make u_s zero. So the
compliance of the other nodes is C - C_s^T C_ss^-1 C_s: C_ss is the capacitance matrix (James & Pai, ArtDefo, 1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgError, blas, cholesky, solve_triangular

from palpate.arrays import Flags, Indices, Single
from palpate.fem.checks import bounds_of
from palpate.fem.errors import BodyError
from palpate.fem.selectors import Selector, parse_selectors
from palpate.fem.storage import BodyData


def hold(contents: BodyData, regions: str | Selector | Sequence[str | Selector], vertices: Indices) -> BodyData:
    """Return a body's contents with the contact nodes in the regions held in place, and without vibration modes.

    Args:
        contents: of the body.
        regions: see `palpate.fem.parse_selector`.
        vertices: mesh vertex of each contact node (n,); empty for a body without a volume mesh.

    Raises:
        BodyError: no contact node or all of them are held, or the compliance of the held nodes is singular.
    """
    try:
        where = parse_selectors(regions)
    except BodyError as problem:
        raise BodyError(f"held: {problem}") from None
    nodes = contents.points[contents.nodes]
    held = np.zeros(len(nodes), dtype=bool)
    for region in where:
        inside = region.inside(nodes)
        if not inside.any():
            raise BodyError(
                f'held: no contact node lies in "{region}"; they extend {bounds_of(nodes)}, and only they can be held'
            )
        held |= inside
    if held.all():
        raise BodyError("held: all contact nodes are held, so nothing of the body can be touched")
    if not held.any():
        return contents
    keep = ~held
    fixed = contents.dirichlet.copy()
    if len(vertices):
        fixed[vertices[held]] = True
    return replace(
        contents,
        nodes=contents.nodes[keep],
        normals=contents.normals[keep],
        areas=contents.areas[keep],
        compliance=_updated(contents.compliance, held),
        frequencies=np.empty(0),
        shapes=np.empty((3 * np.count_nonzero(keep), 0), dtype=np.float32),
        residual_frequencies=np.empty(0),
        residual_shapes=np.empty((0, 0), dtype=np.float32),
        dirichlet=fixed,
        record={**contents.record, "held": [*contents.record.get("held", []), *map(str, where)]},
    )


def _updated(compliance: Single, held: Flags) -> Single:
    """Return the compliance of the nodes that are not held (n,), by a symmetric rank-k update."""
    rows = np.repeat(held, 3)
    try:
        factor = cholesky(compliance[np.ix_(rows, rows)].astype(float), lower=True)
    except LinAlgError:
        raise BodyError("held: the compliance of the held nodes is singular to rounding; hold fewer nodes") from None
    update = solve_triangular(factor, compliance[np.ix_(rows, ~rows)], lower=True).astype(np.float32)
    rest = np.asfortranarray(compliance[np.ix_(~rows, ~rows)])
    lower = np.tril(blas.ssyrk(-1.0, update, beta=1.0, c=rest, trans=1, lower=1, overwrite_c=1))
    lower += np.tril(lower, -1).T
    return np.ascontiguousarray(lower)
