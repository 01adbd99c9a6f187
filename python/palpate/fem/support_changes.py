"""Supports and contact areas that change at run time: the role of each contact node in each phase."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Flags
from palpate.fem.checks import bounds_of, not_negative
from palpate.fem.errors import BodyError
from palpate.fem.selectors import Selector, parse_selectors

Regions = str | Selector | Sequence[str | Selector]
Roles = NDArray[np.uint8]
DEFORMS, TOUCHED, HELD = 0, 1, 2  # roles of a node: deforms only, can be touched, is held
_KEYS: Final = ("at", "held", "touchable")


class SupportChange(NamedTuple):
    """Change of the supports or of the contact area of a body at a time.

    Attributes:
        at: s, after rest.
        held: regions whose contact nodes are held from then on, in place of those before; (): none. None: as before.
        touchable: regions whose contact nodes can be touched from then on; (): all. None: as before.
    """

    at: float
    held: tuple[str | Selector, ...] | None = None
    touchable: tuple[str | Selector, ...] | None = None

    @classmethod
    def of(cls, given: SupportChange | Mapping[str, Any]) -> Self:
        """Return a change of a table with `at` (s or text) and regions; raise BodyError."""
        if isinstance(given, SupportChange):
            return cls(given.at, *(None if regions is None else _listed(regions) for regions in given[1:]))
        if not isinstance(given, Mapping):
            raise BodyError(f'supports: a change is a table such as {{"at": "1 s", "held": "x < 1 mm"}}, not {given!r}')
        for key in given:
            if key not in _KEYS:
                raise BodyError(f'supports: unknown key "{key}"; there are {", ".join(_KEYS)}')
        if "at" not in given:
            raise BodyError('supports: at is missing; write for example at = "1 s"')
        return cls(
            not_negative(given["at"], "s", "at"),
            *(None if given.get(key) is None else _listed(given[key]) for key in ("held", "touchable")),
        )


class SupportPlan(NamedTuple):
    """Changes of a body whose ticks last `period`, s."""

    changes: tuple[SupportChange, ...] = ()
    period: float = 1e-3

    @property
    def steps(self) -> list[int]:
        """First tick of each phase: 0, and the first one at or after each change."""
        return [0, *(math.ceil(change.at / self.period - 1e-6) for change in self.changes)]

    def roles(self, nodes: Array) -> Roles:
        """Return the role of each of the nodes (n, 3), m, in each phase (phases, n).

        Raises:
            BodyError: the changes are not in the order of time, a region has another form or contains no contact node,
                or no node can be touched.
        """
        steps = self.steps
        for change, before, step in zip(self.changes, steps, steps[1:], strict=False):
            if step <= 0:
                raise BodyError(
                    f"supports: a change at {change.at:g} s is that of the start: hold a region from the start on with "
                    f"held in [object.body] or fem.build, or change the supports at {self.period:g} s or later"
                )
            if step <= before:
                raise BodyError(
                    f"supports: a change at {change.at:g} s needs a later tick than the one before: give "
                    "increasing times"
                )
        held, touchable = np.zeros(len(nodes), dtype=bool), np.ones(len(nodes), dtype=bool)
        rows = [_roles(held, touchable)]
        for change in self.changes:
            if change.held is None and change.touchable is None:
                raise BodyError(f"supports: the change at {change.at:g} s changes nothing: give held or touchable")
            if change.held is not None:
                held = inside(change.held, nodes, "held")
            if change.touchable is not None:
                touchable = (
                    inside(change.touchable, nodes, "touchable")
                    if change.touchable
                    else np.ones(len(nodes), dtype=bool)
                )
            rows.append(_roles(held, touchable))
            if not (rows[-1] == TOUCHED).any():
                raise BodyError(f"supports: from {change.at:g} s on, no node of the body can be touched")
        return np.array(rows)


def inside(regions: Sequence[str | Selector], nodes: Array, key: str) -> Flags:
    """Return whether each of the nodes (n, 3), m, lies in a region (n,); raise BodyError if one contains none."""
    found = np.zeros(len(nodes), dtype=bool)
    try:
        where = parse_selectors(list(regions))
    except BodyError as problem:
        raise BodyError(f"supports: {key}: {problem}") from None
    for region in where:
        within = region.inside(nodes)
        if not within.any():
            raise BodyError(f'supports: {key}: no contact node lies in "{region}"; they extend {bounds_of(nodes)}')
        found |= within
    return found


def _roles(held: Flags, touchable: Flags) -> Roles:
    return np.where(held, HELD, np.where(touchable, TOUCHED, DEFORMS)).astype(np.uint8)


def _listed(regions: Regions) -> tuple[str | Selector, ...]:
    if not isinstance(regions, str | Selector | Sequence):
        raise BodyError(f'supports: regions are text such as "x < 1 mm", or a list of it, not {regions!r}')
    return (regions,) if isinstance(regions, str | Selector) else tuple(regions)
