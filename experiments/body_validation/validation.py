"""Bodies held against independent answers: finite elements that converge, closed forms, and the law of energy.

These take minutes, so they are a command, not a test: `python -m experiments.body_validation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from palpate.fem.body import Body
from palpate.fem.builder import build
from palpate.fem.checks import whole
from palpate.fem.free_form import weights
from palpate.fem.selectors import box, half_space
from palpate.fem.volume import block, grid
from scipy import sparse
from scipy.sparse.linalg import splu

from experiments.body_validation import indenter as punch
from experiments.body_validation.passivity import energy_out, small_body

__all__ = ["Answers", "flat_end", "hertz", "lattice_near_rest", "other_kinds", "spline_in_full", "validate"]

Array = NDArray[np.float64]
Tell = Callable[[str, float], None]
Row = dict[str, Any]
_BOTTOM: Final = half_space("z", "<", 1e-9)
_SPACINGS: Final = (punch.SIDE / 20, punch.SIDE / 24, punch.SIDE / 30)  # even numbers: a node is in the middle
_HIGH: Final = 0.03  # m, of the block of `other_kinds`
_REFINED: Final = (4, 6, 9)  # cells under the end of the reference, each 1.5 times finer


def flat_end(spacing: float, aside: float = 0.0, radius: float = 10e-3) -> float:
    """Stiffness, N/m, of a flat end pressed into a body: the bonded block of 100 x 100 x 50 mm, 20 kPa, nu 0.45.

    `spacing`, m, of the cells; `aside`, m, of the end's middle from the block's, where a node is.
    """
    middle, top, half = punch.SIDE / 2, punch.HEIGHT, radius + 2.01 * spacing  # all nodes that the end may reach
    patch = box((middle - half, middle - half, top - 1e-6), (middle + half, middle + half, top + 1e-6))
    planes = np.linspace(0.0, punch.SIDE, round(punch.SIDE / spacing) + 1)
    volume = grid([planes, planes, top - _graded(spacing, 2 * spacing, top)[::-1]], "block")
    body = build(volume, young=punch.YOUNG, poisson=punch.POISSON, fixed=_BOTTOM, touch=patch, memory="16 GB")
    felt = body.indent([middle + aside, middle + 0.6 * aside, top], radius, 1e-3, tip="flat")
    return float(felt.force[2] / 1e-3)


def hertz(spacing: float, depth: float = 1.25e-3, radius: float = 20e-3) -> float:
    """Force of a sphere on a block of 100 mm, deep against the contact, over Hertz's 4/3 E* sqrt(R) d^(3/2)."""
    side, young, poisson = 0.1, 10e3, 0.45
    half = _graded(spacing, 7e-3, side / 2)
    planes = np.concatenate([side / 2 - half[:0:-1], side / 2 + half])
    volume = grid([planes, planes, side - _graded(spacing, 5e-3, side)[::-1]], "deep block")
    patch = box((side / 2 - 8e-3, side / 2 - 8e-3, side - 1e-6), (side / 2 + 8e-3, side / 2 + 8e-3, side + 1e-6))
    body = build(volume, young=young, poisson=poisson, fixed=_BOTTOM, touch=patch, memory="16 GB")
    felt = body.indent([side / 2, side / 2, side], radius, depth)
    return float(felt.force[2] / (4 / 3 * young / (1 - poisson**2) * np.sqrt(radius) * depth**1.5))


def validate(progress: Tell | None = None, *, paths: int = 10_000) -> list[Row]:
    """Return rows: "what" is held against what, how far it is "off" (a fraction), and what is "asked"; minutes.

    `paths`: random closed paths for each kind of body.
    """
    whole(paths, "paths", 1)
    tell = progress if progress is not None else (lambda _text, _fraction: None)
    tell("sphere on a deep block", 0.0)
    rows = [_row("sphere on a deep block, over Hertz", hertz(5e-3 / 3) - 1.0, 0.05)]
    rows += _flat_ends(tell)
    rows += other_kinds(progress=tell)
    return rows + _closed_paths(tell, paths)


class Answers(NamedTuple):
    """What the block of 60 x 60 x 30 mm does, and how far another kind of the same body is from it, as fractions."""

    stretch: float  # mean displacement of its top, pulled evenly
    shear: float  # the same, dragged evenly along x
    press: float  # force of a flat end of 10 mm radius, 1 mm deep in its middle
    surface: float  # displacement of the top under that end: largest difference, by 1 mm


_ALLOWED: Final = {"mass_spring": Answers(0.05, 0.05, 0.15, 0.1), "free_form": Answers(0.15, 0.55, 0.4, 0.3)}


def lattice_near_rest(body: Body) -> Body:
    """Return a body with the compliance that its lattice has for small displacements held for long."""
    begin, vertices, shares = body._patches()
    load = sparse.csr_matrix((shares, vertices, begin), shape=(len(body.nodes), len(body.contents.vertices)))
    free = np.flatnonzero(np.repeat(~body.contents.held, 3))
    full = sparse.kron(load, sparse.eye(3), format="csr")[:, free]
    found = full @ splu(body.spring_network.matrix[free][:, free].tocsc()).solve(full.T.toarray())
    return Body(replace(body.contents, compliance=found.astype(np.float32)))


def spline_in_full(body: Body) -> Body:
    """Return a body with the compliance of its spline: along the normals and along the surface, nothing between."""
    law, n = body.free_form_law, len(body.nodes)
    b = weights(body.nodes, law.spacing)
    shared, layer = (b @ b.T).toarray(), np.diag(1.0 / body.contents.areas)
    normal = np.einsum("ia,jb->iajb", body.normals, body.normals)
    along, across = law.give * shared + law.layer * layer, law.give_across * shared + law.layer_across * layer
    facing = np.einsum("ia,ja->ij", body.normals, body.normals)
    part = np.eye(3) - np.einsum("ia,ib->iab", body.normals, body.normals)
    found = (along * facing)[:, None, :, None] * normal / np.where(facing, facing, 1.0)[:, None, :, None]
    found = found + across[:, None, :, None] * np.einsum("iac,jcb->iajb", part, part)
    return Body(replace(body.contents, compliance=found.reshape(3 * n, 3 * n).astype(np.float32)))


def other_kinds(ratios: Sequence[float] = (0.0, 0.3, 0.45, 0.49), *, progress: Tell | None = None) -> list[Row]:
    """Return rows, as `validate`: lattices and splines over quadratic finite elements on the same block.

    `ratios` are Poisson's.
    """
    rows = []
    for poisson in ratios:
        if progress is not None:
            progress(f"lattice and spline, Poisson's ratio {poisson:g}", 0.62)
        top = half_space("z", ">", _HIGH - 1e-9)
        solid = build(block((0.06, 0.06, _HIGH), 5e-3), young=5e3, poisson=poisson, fixed=_BOTTOM, touch=top)
        for kind, other in (("mass_spring", lattice_near_rest(solid)), ("free_form", spline_in_full(solid))):
            for (what, off), asked in zip(_answers(other, solid)._asdict().items(), _ALLOWED[kind], strict=True):
                rows.append(_row(f"{kind}, Poisson's ratio {poisson:g}, {what}: over quadratic elements", off, asked))
    return rows


def _answers(other: Body, solid: Body) -> Answers:
    share = solid.contents.areas / solid.contents.areas.sum()
    means, pressed = [], []
    for body in (other, solid):
        whole = body.compliance.reshape(len(share), 3, len(share), 3).astype(float)
        mean = np.einsum("i,iajb,j->ab", share, whole, share)
        felt = body.indent([0.03, 0.03, _HIGH], 10e-3, 1e-3, tip="flat")
        means.append(mean)
        pressed.append((felt.force[2], felt.displacement))
    (one, moved), (two, expected) = pressed
    ratio = means[0] / np.where(np.eye(3), means[1], 1.0)
    return Answers(ratio[2, 2] - 1, ratio[0, 0] - 1, one / two - 1, float(np.abs(moved - expected).max() / 1e-3))


def _flat_ends(tell: Tell) -> list[Row]:
    ends = []
    for i, cells in enumerate(_REFINED):
        tell(f"reference of the flat end, {cells} cells under it", 0.05 + 0.1 * i)
        ends.append(punch.stiffness(10e-3, cells))
    limit, order = punch.extrapolate(ends, 1.5)
    steps = ", ".join(f"{end:.4g}" for end in ends)
    rows = [
        _row(
            f"reference of the flat end, {steps} N/m, order {order:.2f}: finest over limit", ends[-1] / limit - 1, 0.01
        )
    ]
    for aside, where in ((0.0, "on"), (0.5, "between")):
        found = []
        for i, spacing in enumerate(_SPACINGS):
            tell(f"flat end {where} nodes, cells of {spacing * 1e3:.3g} mm", 0.35 + 0.05 * i + 0.15 * aside)
            found.append(flat_end(spacing, aside * spacing))
            text = f"flat end of 10 mm {where} nodes, cells of {spacing * 1e3:.3g} mm, over {limit:.4g} N/m"
            rows.append(_row(text, found[-1] / limit - 1.0, 0.05))
        rows.append(_row(f"the three {where} nodes: largest less smallest", np.ptp(found) / limit, 0.05))
    for i, radius in enumerate((7e-3, 15e-3)):
        tell(f"flat end of {radius * 1e3:g} mm", 0.55 + 0.05 * i)
        coarse, fine = (punch.stiffness(radius, cells) for cells in _REFINED[:2])
        spacing = _SPACINGS[1]
        limit = fine - (coarse - fine) / (1.5**order - 1.0)  # of the same order
        text = f"flat end of {radius * 1e3:g} mm between nodes, cells of {spacing * 1e3:.3g} mm, over {limit:.4g} N/m"
        rows.append(_row(text, flat_end(spacing, spacing / 2, radius) / limit - 1.0, 0.05))
    return rows


def _closed_paths(tell: Tell, paths: int) -> list[Row]:
    body, rows = small_body(), []
    kinds: dict[str, Callable[[float], Any]] = {
        "compliance": lambda _period: body,
        "modal": body.modal,
        "a standard linear solid": lambda period: body.viscoelastic(
            period, instantaneous_ratio=2.5, retardation_time="0.1 s"
        ),
    }
    for i, (name, kind) in enumerate(kinds.items()):
        text, begin = f"{paths} random closed paths on {name}", 0.65 + 0.115 * i

        def share(part: float, text: str = text, begin: float = begin) -> None:
            tell(text, begin + 0.115 * part)

        out = energy_out(kind, paths, held=name != "compliance", progress=share)
        rows.append(_row(f"{text}: energy given out, of what is exchanged", out, 1e-4))
    return rows


def _row(what: str, off: float, asked: float) -> Row:
    return {"what": what, "off": float(off), "asked": asked}


def _graded(step: float, near: float, end: float, growth: float = 1.35) -> Array:
    """Lines from 0 to `end`, m: `step` apart up to `near`, then growing."""
    even = np.linspace(0.0, near, max(1, round(near / step)) + 1)
    more, width = [0.0], step
    while more[-1] < end - near:
        width *= growth
        more.append(more[-1] + width)
    rest = np.array(more[1:]) * (end - near) / more[-1]
    return np.concatenate([even, near + rest])
