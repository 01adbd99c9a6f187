"""Selectors of points in space: box, sphere, half space, or part of the surface, from numbers or text."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from palpate.arrays import Array, Flags
from palpate.fem.checks import length, lengths, positive
from palpate.fem.errors import BodyError
from palpate.units import parse_quantity

_AXES: Final = "xyz"
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_BEFORE_UNIT: Final = re.compile(r"(?<=[\d.])(?![eE][+-]?\d)(?=[A-Za-zµμ])")  # in "12mm", not in "1e-3"
_TYPED: Final = str.maketrans({",": " ", "−": "-", "≤": "<=", "≥": ">="})
_SIGN: Final = re.compile(r"[<>]=?")
_TOLERANCE: Final = 1e-9  # m; absorbs the rounding error of points on the plane of <= or >=
_EXAMPLES: Final = (
    '"box 0 0 -1 to 100 100 1 mm", "sphere 50 50 40 radius 7.5 mm", "z < 1 mm", "z <= 0 mm", or "surface" before them'
)


@dataclass(frozen=True)
class Selector:
    """Region of space.

    Attributes:
        text: form in which it is written.
        inside: maps points (n, 3), m, to whether they are inside (n,).
        surface: whether only points on the body's surface count.
    """

    text: str
    inside: Callable[[Array], Flags]
    surface: bool = False

    def __str__(self) -> str:
        return self.text


def box(low: Sequence[float | str], high: Sequence[float | str]) -> Selector:
    """Return the box between the corners `low` and `high` (3,), m or text.

    Raises:
        BodyError: a corner has not three numbers, or `low` exceeds `high`.
    """
    a, b = lengths(low, "box"), lengths(high, "box")
    if a.shape != (3,) or b.shape != (3,) or not (a <= b).all():
        raise BodyError(f"a box needs its lower and its upper corner (3 numbers each), not {a} and {b}")
    return Selector(f"box {_row(a)} to {_row(b)} mm", lambda x: np.asarray(((x >= a) & (x <= b)).all(axis=1)))


def sphere(center: Sequence[float | str], radius: float | str) -> Selector:
    """Return the sphere of `radius`, m or text, around `center` (3,), m or text.

    Raises:
        BodyError: the center is not three finite numbers, or the radius is not positive.
    """
    c, r = lengths(center, "sphere"), positive(radius, "m", "radius")
    if c.shape != (3,) or not np.isfinite(c).all():
        raise BodyError(f"a sphere has a center of three numbers, not {c}")
    return Selector(f"sphere {_row(c)} radius {1e3 * r:g} mm", lambda x: ((x - c) ** 2).sum(axis=1) <= r**2)


def half_space(axis: str, sign: str, value: float | str) -> Selector:
    """Return the half space on one side of an axis-normal plane.

    Args:
        axis: "x", "y" or "z".
        sign: "<", "<=", ">" or ">=".
        value: coordinate of the plane, m or text.

    Raises:
        BodyError: the axis, the sign or the value is invalid.
    """
    if axis not in tuple(_AXES) or sign not in ("<", "<=", ">", ">="):
        raise BodyError(f"a half space is an axis, a sign and a length: z < 1 mm, not {axis} {sign} {value}")
    plane, i, s = length(value, f"{axis} {sign}"), _AXES.index(axis), 1.0 if sign[0] == ">" else -1.0
    threshold = -_TOLERANCE if sign[1:] else 0.0
    return Selector(f"{axis} {sign} {1e3 * plane:g} mm", lambda x: s * (x[:, i] - plane) > threshold)


def on_surface(where: Selector | str) -> Selector:
    """Return the part of the region `where` that lies on the body's surface."""
    region = parse_selector(where)
    return Selector(f"surface {region.text}", region.inside, surface=True)


def parse_selector(text: str | Selector) -> Selector:
    """Parse a region from text such as "box 0 0 -1 to 100 100 1 mm".

    A number without a unit has the unit of the next number.

    Raises:
        BodyError: the text has another form.
    """
    if isinstance(text, Selector):
        return text
    if not isinstance(text, str):
        raise BodyError(f"{text!r} is no region; write {_EXAMPLES}")
    words = _BEFORE_UNIT.sub(" ", _SIGN.sub(r" \g<0> ", text.translate(_TYPED))).split()
    name, rest = (words or [""])[0].lower(), words[1:]
    if name == "surface" and rest and rest[0] != "surface":
        return on_surface(" ".join(rest))
    if name == "box" and "to" in rest:
        low, high = _groups(rest, "to", text)
        if len(low) == len(high) == 3:
            return box(low, high)
    if name == "sphere" and "radius" in rest:
        center, radius = _groups(rest, "radius", text)
        if len(center) == 3 and len(radius) == 1:
            return sphere(center, radius[0])
    if name in tuple(_AXES) and len(words) in (3, 4) and _SIGN.fullmatch(words[1]):
        _, value = _groups(words[2:], "", text)
        if len(value) == 1:
            return half_space(name, words[1], value[0])
    raise BodyError(f'"{text}" is no region; write {_EXAMPLES}')


def parse_selectors(regions: str | Selector | Sequence[str | Selector]) -> list[Selector]:
    """Return one or more regions, or their text, as a list. Raise as `parse_selector`."""
    if regions is None:
        return []
    each = regions if isinstance(regions, Sequence) and not isinstance(regions, str) else [regions]
    return [parse_selector(region) for region in each]


def _groups(words: list[str], between: str, text: str) -> tuple[list[float], list[float]]:
    """Return the lengths, m, before and after the word `between`."""
    before: list[float] = []
    after: list[float] = []
    unit, group = "", after
    for word in reversed(words):
        if word == between:
            group = before
        elif _NUMBER.fullmatch(word):
            group.insert(0, parse_quantity(f"{word} {unit}".rstrip(), "m", f'"{text}"', error=BodyError))
        else:
            unit = word
    return before, after


def _row(values: Array) -> str:
    return " ".join(f"{1e3 * value:g}" for value in values)
