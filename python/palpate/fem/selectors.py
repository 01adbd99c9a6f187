"""Where: the places that are fixed, of another stiffness, or touchable, in numbers or in a line of text."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from palpate.fem.checks import length, lengths, positive
from palpate.fem.errors import BodyError
from palpate.units import parse_quantity

__all__ = ["Selector", "box", "half_space", "on_surface", "parse_selector", "parse_selectors", "sphere"]

Array = NDArray[np.float64]
_AXES: Final = "xyz"
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_BEFORE_UNIT: Final = re.compile(r"(?<=[\d.])(?![eE][+-]?\d)(?=[A-Za-zµμ])")  # in "12mm", not in "1e-3"
_TYPED: Final = str.maketrans({",": " ", "−": "-", "≤": "<=", "≥": ">="})
_SIGN: Final = re.compile(r"[<>]=?")
_SLACK: Final = 1e-9  # m: a point that is said to be on the plane of <= may be off it by rounding
_EXAMPLES: Final = (
    '"box 0 0 -1 to 100 100 1 mm", "sphere 50 50 40 radius 7.5 mm", "z < 1 mm", "z <= 0 mm", or "surface" before them'
)


@dataclass(frozen=True)
class Selector:
    """Which of the points (n, 3), m, are inside (n,); `surface`: only those on the body's surface count."""

    text: str
    inside: Callable[[Array], NDArray[np.bool_]]
    surface: bool = False

    def __str__(self) -> str:
        return self.text


def box(low: Sequence[float | str], high: Sequence[float | str]) -> Selector:
    """Return the box between the corners `low` and `high` (3,), m or text."""
    a, b = lengths(low, "box"), lengths(high, "box")
    if a.shape != (3,) or b.shape != (3,) or not (a <= b).all():
        raise BodyError(f"a box goes from its lower to its upper corner (3 numbers each); this from {a} to {b}")
    return Selector(f"box {_row(a)} to {_row(b)} mm", lambda x: np.asarray(((x >= a) & (x <= b)).all(axis=1)))


def sphere(centre: Sequence[float | str], radius: float | str) -> Selector:
    """Return the sphere of `radius`, m or text, around `centre` (3,), m or text."""
    c, r = lengths(centre, "sphere"), positive(radius, "m", "radius")
    if c.shape != (3,) or not np.isfinite(c).all():
        raise BodyError(f"a sphere has a centre of three numbers, not {c}")
    return Selector(f"sphere {_row(c)} radius {1e3 * r:g} mm", lambda x: ((x - c) ** 2).sum(axis=1) <= r**2)


def half_space(axis: str, sign: str, value: float | str) -> Selector:
    """Return one side of a plane: `axis` "x", "y" or "z"; `sign` "<", "<=", ">" or ">="; `value`, m or text."""
    if axis not in tuple(_AXES) or sign not in ("<", "<=", ">", ">="):
        raise BodyError(f"one side of a plane is an axis, a sign and a length: z < 1 mm, not {axis} {sign} {value}")
    at, i, s = length(value, f"{axis} {sign}"), _AXES.index(axis), 1.0 if sign[0] == ">" else -1.0
    least = -_SLACK if sign[1:] else 0.0
    return Selector(f"{axis} {sign} {1e3 * at:g} mm", lambda x: s * (x[:, i] - at) > least)


def on_surface(where: Selector | str) -> Selector:
    """Return the part of `where` that lies on the body's surface."""
    whole = parse_selector(where)
    return Selector(f"surface {whole.text}", whole.inside, surface=True)


def parse_selector(text: str | Selector) -> Selector:
    """Read a place from text such as "box 0 0 -1 to 100 100 1 mm"; BodyError says how it is written.

    A number without a unit has that of the next one.
    """
    if isinstance(text, Selector):
        return text
    if not isinstance(text, str):
        raise BodyError(f"{text!r} is no place; write {_EXAMPLES}")
    words = _BEFORE_UNIT.sub(" ", _SIGN.sub(r" \g<0> ", text.translate(_TYPED))).split()
    name, rest = (words or [""])[0].lower(), words[1:]
    if name == "surface" and rest and rest[0] != "surface":
        return on_surface(" ".join(rest))
    if name == "box" and "to" in rest:
        low, high = _groups(rest, "to", text)
        if len(low) == len(high) == 3:
            return box(low, high)
    if name == "sphere" and "radius" in rest:
        centre, radius = _groups(rest, "radius", text)
        if len(centre) == 3 and len(radius) == 1:
            return sphere(centre, radius[0])
    if name in tuple(_AXES) and len(words) in (3, 4) and _SIGN.fullmatch(words[1]):
        _, value = _groups(words[2:], "", text)
        if len(value) == 1:
            return half_space(name, words[1], value[0])
    raise BodyError(f'"{text}" is no place; write {_EXAMPLES}')


def parse_selectors(given: str | Selector | Sequence[str | Selector]) -> list[Selector]:
    """Return one or more places, or texts of them, as a list; raises as `place`."""
    if given is None:
        return []
    each = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    return [parse_selector(one) for one in each]


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
