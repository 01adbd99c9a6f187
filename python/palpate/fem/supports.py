"""Supports added to a condensed body, without its mesh: an update of the compliance by the held rows.

The displacements u of all nodes are C f + C_s r with the forces r on the k held rows s, which make u_s zero. So the
compliance of the other nodes is C - C_s^T C_ss^-1 C_s: C_ss is the capacitance matrix (James & Pai, ArtDefo, 1999).

The vibration modes of the body without the supports are coordinates in which those with them are found: with the shapes
Phi, the frequencies W and the compliance R = C - Phi W^-2 Phi^T that they leave out, constant u_s leave the stiffness
W^2 + Phi_s^T R_ss^-1 Phi_s. Its eigenvectors V are the modes, with the shapes (Phi - R_s^T R_ss^-1 Phi_s) V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.linalg import LinAlgError, blas, cholesky, solve_triangular

from palpate.arrays import Flags, Indices, Single
from palpate.fem.checks import bounds_of
from palpate.fem.errors import BodyError
from palpate.fem.selectors import Selector, parse_selectors
from palpate.fem.storage import BodyData

_YIELD: Final = 1e-6  # least compliance of the supports over that of a held node, of a body with modes
_MOST_YIELD: Final = 1e-3  # the same, largest
_NEGLIGIBLE: Final = 3e-6  # static response of a mode over the compliance of a node


def hold(contents: BodyData, regions: str | Selector | Sequence[str | Selector], vertices: Indices) -> BodyData:
    """Return a body's contents with the contact nodes in the regions held in place, and its modes of vibration then.

    Args:
        contents: of the body.
        regions: see `palpate.fem.parse_selector`.
        vertices: mesh vertex of each contact node (n,).

    Raises:
        BodyError: no contact node or all of them are held, or the compliance of the held nodes is singular. Or the body
            has modes, and so many nodes were held one after the other that rounding has added up.
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
    fixed[vertices[held]] = True
    modes, yielding = _held_modes(contents, held)
    return replace(
        contents,
        nodes=contents.nodes[keep],
        normals=contents.normals[keep],
        areas=contents.areas[keep],
        compliance=_updated(contents.compliance, held, yielding),
        **modes,
        dirichlet=fixed,
        record={**contents.record, "held": [*contents.record.get("held", []), *map(str, where)]},
    )


def _held_modes(contents: BodyData, held: Flags) -> tuple[dict[str, Any], float]:
    """Return frequencies and shapes of a body's modes and residual vectors with nodes held (n,), and their supports.

    Residual vectors may represent the whole compliance of a node. R_ss is rounding then, so the supports have a
    compliance, m/N: twice its largest negative part, and 1e-6 of a held node's compliance or more. Without modes they
    have none. Residual vectors that only move the supports are left out.
    """
    count = len(contents.frequencies)
    if count == 0:
        return {"shapes": np.empty((3 * np.count_nonzero(~held), 0), dtype=np.float32)}, 0.0
    frequencies, single = contents.modes_and_residuals()
    squares, rows = frequencies**2, np.repeat(held, 3)
    inside, outside = single[rows].astype(float), single[~rows].astype(float)
    own = float(np.diag(contents.compliance)[rows].max())
    at_held = contents.compliance[np.ix_(rows, rows)] - inside / squares @ inside.T
    yielding = max(_YIELD * own, -2.0 * float(np.linalg.eigvalsh(at_held)[0]))
    if yielding > _MOST_YIELD * own:
        raise BodyError(
            "held: rounding hides what the vibration modes leave of the compliance of these nodes; hold all regions in "
            "one call, held([...]), or build the body with this support"
        )
    at_held[np.diag_indices_from(at_held)] += yielding
    pulled = np.linalg.solve(at_held, inside)
    found, vectors = np.linalg.eigh(np.diag(squares) + inside.T @ pulled)
    across = contents.compliance[np.ix_(~rows, rows)] - outside / squares @ inside.T
    moved = (outside - across @ pulled) @ vectors
    kept = (moved**2).max(axis=0, initial=0.0) / found > _NEGLIGIBLE * own
    kept[:count] = True
    frequencies, shapes = np.sqrt(found[kept]), moved[:, kept].astype(np.float32)
    modes = {
        "frequencies": frequencies[:count],
        "shapes": np.ascontiguousarray(shapes[:, :count]),
        "residual_frequencies": frequencies[count:],
        "residual_shapes": np.ascontiguousarray(shapes[:, count:]),
    }
    return modes, yielding


def _updated(compliance: Single, held: Flags, yielding: float) -> Single:
    """Return the compliance of the nodes that are not held (n,), by a symmetric rank-k update; `yielding` in m/N."""
    rows = np.repeat(held, 3)
    capacitance = compliance[np.ix_(rows, rows)].astype(float)
    capacitance[np.diag_indices_from(capacitance)] += yielding
    try:
        factor = cholesky(capacitance, lower=True)
    except LinAlgError:
        raise BodyError("held: the compliance of the held nodes is singular to rounding; hold fewer nodes") from None
    update = solve_triangular(factor, compliance[np.ix_(rows, ~rows)], lower=True).astype(np.float32)
    rest = np.asfortranarray(compliance[np.ix_(~rows, ~rows)])
    lower = np.tril(blas.ssyrk(-1.0, update, beta=1.0, c=rest, trans=1, lower=1, overwrite_c=1))
    lower += np.tril(lower, -1).T
    return np.ascontiguousarray(lower)
