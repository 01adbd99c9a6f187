"""Where: the places that are fixed, of another stiffness, or touchable, in numbers or in a line of text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.bodies.errors import BodyError
from palpate.units import quantity

__all__ = ["Place", "ball", "beyond", "box", "on_surface", "place"]

Array = NDArray[np.float64]
_AXES = "xyz"
_EXAMPLES = (
    '"box 0 0 -1 to 100 100 1 mm", "sphere 50 50 40 radius 7.5 mm", "z < 1 mm", or "surface" before one of these'
)


@dataclass(frozen=True)
class Place:
    """Which of the points (n, 3), m, are inside (n,); `surface`: only those on the body's surface count."""

    text: str
    inside: Callable[[Array], NDArray[np.bool_]]
    surface: bool = False

    def __str__(self) -> str:
        return self.text


def box(low: Sequence[float], high: Sequence[float]) -> Place:
    """Return the box between the corners `low` and `high` (3,), m."""
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if a.shape != (3,) or b.shape != (3,) or not (a <= b).all():
        raise BodyError(f"a box goes from its lower to its upper corner (3 numbers each); this from {a} to {b}")
    return Place(f"box {_row(a)} to {_row(b)} m", lambda x: np.asarray(((x >= a) & (x <= b)).all(axis=1)))


def ball(centre: Sequence[float], radius: float) -> Place:
    """Return the sphere of `radius`, m, around `centre` (3,), m."""
    c = np.asarray(centre, dtype=float)
    if c.shape != (3,) or not radius > 0:
        raise BodyError(f"a sphere has a centre of three numbers and a positive radius, not {c} and {radius}")
    return Place(f"sphere {_row(c)} radius {radius:g} m", lambda x: ((x - c) ** 2).sum(axis=1) <= radius**2)


def beyond(axis: str, sign: str, value: float) -> Place:
    """Return one side of a plane: `axis` "x", "y" or "z"; `sign` "<" or ">"; `value`, m."""
    if axis not in tuple(_AXES) or sign not in ("<", ">"):
        raise BodyError(f"one side of a plane is an axis, a sign and a length: z < 1 mm, not {axis} {sign} {value}")
    i, s = _AXES.index(axis), 1.0 if sign == ">" else -1.0
    return Place(f"{axis} {sign} {value:g} m", lambda x: s * (x[:, i] - value) > 0)


def on_surface(where: Place) -> Place:
    """Return the part of `where` that lies on the body's surface."""
    return Place(f"surface {where.text}", where.inside, surface=True)


def place(text: str | Place) -> Place:
    """Read a place from text such as "box 0 0 -1 to 100 100 1 mm"; BodyError says how it is written."""
    if isinstance(text, Place):
        return text
    words = text.replace(",", " ").replace("<", " < ").replace(">", " > ").split()
    try:
        if words[0] == "surface":
            return on_surface(place(" ".join(words[1:])))
        if words[0] == "box" and len(words) == 9 and words[4] == "to":
            return box(_metres(words[1:4], words[8]), _metres(words[5:8], words[8]))
        if words[0] == "sphere" and len(words) == 7 and words[4] == "radius":
            return ball(_metres(words[1:4], words[6]), _metres(words[5:6], words[6])[0])
        if len(words) == 4 and words[1] in ("<", ">"):
            return beyond(words[0], words[1], _metres(words[2:3], words[3])[0])
    except IndexError:
        pass
    raise BodyError(f'"{text}" is no place; write {_EXAMPLES}')


def _metres(numbers: Sequence[str], unit: str) -> list[float]:
    return [quantity(f"{number} {unit}", "m", "place", error=BodyError) for number in numbers]


def _row(values: Array) -> str:
    return " ".join(f"{value:g}" for value in values)
