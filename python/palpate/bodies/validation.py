"""Bodies held against independent answers: a finite-element answer that converged, and closed forms.

These take minutes, so they are a command, not a test: `palpate body validate`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from palpate.bodies.build import build
from palpate.bodies.elements import Elements
from palpate.bodies.factor import Factor
from palpate.bodies.material import Material
from palpate.bodies.places import beyond, box
from palpate.bodies.volume import Volume, grid

__all__ = ["hertz", "punch", "punch_reference", "validate"]

Array = NDArray[np.float64]
_YOUNG, _POISSON, _RADIUS, _SIDE, _HEIGHT = 20e3, 0.45, 10e-3, 0.1, 0.05
_BOTTOM: Final = beyond("z", "<", 1e-9)


def punch(spacing: float, aside: float = 0.0) -> float:
    """Stiffness, N/m, of a flat end of 10 mm radius on the bonded block of 100 x 100 x 50 mm, 20 kPa, nu 0.45."""
    middle, top = _SIDE / 2, _HEIGHT
    patch = box((middle - 0.017, middle - 0.017, top - 1e-6), (middle + 0.017, middle + 0.017, top + 1e-6))
    planes = np.linspace(0.0, _SIDE, round(_SIDE / spacing) + 1)
    volume = grid([planes, planes, top - _graded(spacing, 2 * spacing, top)[::-1]], "block")
    body = build(volume, young=_YOUNG, poisson=_POISSON, fixed=_BOTTOM, touch=patch, memory="16 GB")
    felt = body.press([middle + aside, middle + 0.6 * aside, top], _RADIUS, 1e-3, tip="flat")
    return float(felt.force[2] / 1e-3)


def punch_reference(spacing: float) -> float:
    """Return the same by another road: no contact, no condensation; the nodes under the end are moved as one.

    The mesh's lines follow the end's edge, and its cells grow away from it.
    """
    quarter = grid(
        [_graded(spacing, _RADIUS, _SIDE / 2)] * 2 + [_HEIGHT - _graded(spacing, _RADIUS, _HEIGHT)[::-1]],
        "",
    )
    volume = _mirrored(_rounded(quarter))
    elements = Elements(volume, Material(_YOUNG, _POISSON), [_BOTTOM])
    x = elements.nodes
    under = np.flatnonzero((x[:, 2] > _HEIGHT - 1e-9) & (np.hypot(x[:, 0], x[:, 1]) < _RADIUS * (1 + 1e-6)))
    moved = 3 * under + 2
    free = np.setdiff1d(elements.free, moved)
    stiffness = elements.stiffness
    pushed = np.asarray(stiffness[:, moved].sum(axis=1)).ravel()  # all by one metre
    rest = Factor(stiffness[free][:, free]).solve(-pushed[free][:, None]).ravel()
    return float(pushed[moved].sum() + (stiffness[moved][:, free] @ rest).sum())


def hertz(spacing: float, depth: float = 1.25e-3, radius: float = 20e-3) -> float:
    """Force of a sphere on a block of 100 mm, deep against the contact, over Hertz's 4/3 E* sqrt(R) d^(3/2)."""
    side, young = 0.1, 10e3
    half = _graded(spacing, 7e-3, side / 2)
    planes = np.concatenate([side / 2 - half[:0:-1], side / 2 + half])
    volume = grid([planes, planes, side - _graded(spacing, 5e-3, side)[::-1]], "deep block")
    patch = box((side / 2 - 8e-3, side / 2 - 8e-3, side - 1e-6), (side / 2 + 8e-3, side / 2 + 8e-3, side + 1e-6))
    body = build(volume, young=young, poisson=_POISSON, fixed=_BOTTOM, touch=patch, memory="16 GB")
    felt = body.press([side / 2, side / 2, side], radius, depth)
    return float(felt.force[2] / (4 / 3 * young / (1 - _POISSON**2) * np.sqrt(radius) * depth**1.5))


def validate(progress: Callable[[str, float], None] | None = None) -> list[dict[str, Any]]:
    """Return rows of what was asked and what was measured; minutes."""
    tell = progress if progress is not None else (lambda _text, _fraction: None)
    rows: list[dict[str, Any]] = []
    tell("reference of the flat end", 0.0)
    coarse, fine = 10e-3 / 3, 2.5e-3
    first, second = punch_reference(coarse), punch_reference(fine)
    # The stress under the end's edge is singular: the error falls with the cells' size, no faster (order one).
    reference = second - (first - second) * fine / (coarse - fine)
    for i, h in enumerate((5e-3, 4e-3, 10e-3 / 3)):
        tell(f"flat end, cells of {h * 1e3:.3g} mm", 0.3 + 0.15 * i)
        for aside in (0.0, h / 2):
            rows.append(
                {
                    "what": f"flat end of 10 mm, cells of {h * 1e3:.3g} mm, {'on' if aside == 0 else 'between'} nodes",
                    "measured": punch(h, aside) / reference,
                    "asked": 0.05,
                }
            )
    tell("sphere on a deep block", 0.75)
    rows.append({"what": "sphere on a deep block over Hertz", "measured": hertz(5e-3 / 3), "asked": 0.05})
    return rows


def _graded(step: float, near: float, end: float, growth: float = 1.35) -> Array:
    """Lines from 0 to `end`, m: `step` apart up to `near`, then growing."""
    even = np.linspace(0.0, near, max(1, round(near / step)) + 1)
    more, width = [0.0], step
    while more[-1] < end - near:
        width *= growth
        more.append(more[-1] + width)
    rest = np.array(more[1:]) * (end - near) / more[-1]
    return np.concatenate([even, near + rest])


def _rounded(quarter: Volume) -> Volume:
    """Move the lines so that the square |x| = |y| = radius becomes a circle; nothing moves beyond 2.5 radii."""
    points = quarter.points.copy()
    square = points[:, :2].max(axis=1)
    reach = np.hypot(points[:, 0], points[:, 1])
    near = np.clip(square / _RADIUS, 0.0, 1.0) ** 2 * np.clip((2.5 - square / _RADIUS) / 1.5, 0.0, 1.0)
    scale = 1.0 + near * (np.divide(square, reach, out=np.ones_like(reach), where=reach > 0) - 1.0)
    points[:, :2] *= scale[:, None]
    return Volume(points, quarter.tetrahedra, "rounded block")


def _mirrored(quarter: Volume) -> Volume:
    """Four quarters around the z axis, welded."""
    points = np.concatenate([quarter.points * [sx, sy, 1.0] for sx in (1, -1) for sy in (1, -1)]) + 0.0
    cells = np.concatenate([quarter.tetrahedra + i * len(quarter.points) for i in range(4)])
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return Volume(points[first], same.reshape(-1)[cells], "mirrored block")
