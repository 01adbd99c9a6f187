"""[object.body.tool]: motion of a tool's contact points over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, PlainSerializer, model_validator

from palpate import _core
from palpate.arrays import Array
from palpate.checks import closest_tips
from palpate.scenario.fields import Position3, Section
from palpate.scenario.frame import AngleTable
from palpate.units import parse_quantity, write

_PARALLEL = 1e-9  # distance of two unit vectors below which they are parallel
_EXAMPLE = '[["0 s", 1.0], ["1 s", 0.5]]'


def _openings(value: object) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, (list, tuple)) or len(value) < 2:
        raise ValueError(f"a table needs at least two rows, such as {_EXAMPLE}")
    rows: list[tuple[float, float]] = []
    for number, row in enumerate(value, start=1):
        if not isinstance(row, (list, tuple)) or len(row) != 2:
            raise ValueError(f"row {number} must be a time and a number from 0 (closed) to 1 (open), as in {_EXAMPLE}")
        time, opening = parse_quantity(row[0], "s"), parse_quantity(row[1], "")
        if rows and time <= rows[-1][0]:
            raise ValueError(f"the time of row {number} ({row[0]}) is not after that of the row before")
        if not 0.0 <= opening <= 1.0:
            raise ValueError(f"the opening of row {number} is {opening:g}; it is from 0 (closed) to 1 (open)")
        rows.append((time, opening))
    return tuple(rows)


def _text(rows: tuple[tuple[float, float], ...] | None) -> list[list[str | float]] | None:
    return None if rows is None else [[write(time, "s"), opening] for time, opening in rows]


OpeningTable = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_openings), PlainSerializer(_text)]


def turned(vector: ArrayLike, angles: ArrayLike) -> Array:
    """Return a vector (3,) turned by angles about x, then y, then z (n, 3), rad: (n, 3)."""
    points, each = np.array([vector], dtype=float), np.array(angles, dtype=float)
    ticks = np.arange(len(each), dtype=float)
    motion = _core.ToolMotion(points, points, np.column_stack([ticks, each, np.ones_like(ticks)]))
    return np.asarray(motion.places(ticks)[:, 0])


class ToolMotion(Section):
    """[object.body.tool]: a tool that turns about the device's tip, and a gripper that opens and closes.

    Between rows the motion is linear, before the first and after the last it rests.

    Attributes:
        rotation: rows (time s, angles about x, then y, then z of the device, rad).
        closed_points: the contact points at the opening 0, without rotation; `contact_points` are those at 1.
        opening: rows (time s, opening).
    """

    rotation: AngleTable | None = None
    closed_points: tuple[Position3, ...] = ()
    opening: OpeningTable | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.opening is not None and not self.closed_points:
            raise ValueError("closed_points is missing; opening needs the contact points of the closed tool")
        return self

    def check(self, open_points: Sequence[Sequence[float]], radius: float, axis: ArrayLike | None) -> None:
        """Raise ValueError unless the motion fits a tool.

        Args:
            open_points: the tips at the opening 1 (k, 3), m.
            radius: of the tips, m.
            axis: of flat tips (3,), device frame, which the tool cannot tilt; None of spheres.
        """
        if not open_points:
            raise ValueError("contact_points is missing; they are the tips of the tool")
        if axis is not None and self._tilts(np.array(axis)):
            raise ValueError("rotation: flat tips do not tilt with the tool; write several spheres as contact_points")
        if not self.closed_points:
            return
        if len(self.closed_points) != len(open_points):
            raise ValueError(f"closed_points: {len(self.closed_points)} points for {len(open_points)} contact_points")
        least = min((row[1] for row in self.opening or ()), default=1.0)
        if self.opening is None:
            least = 0.0  # a loop may close it
        if pair := closest_tips(open_points, self.closed_points, least, radius):
            raise ValueError(
                f"closed_points: tips {pair[0]} and {pair[1]} come to the same place, or nearer than a tenth of their "
                "radius; keep them apart"
            )

    def _tilts(self, axis: Array) -> bool:
        return bool(np.abs(turned(axis, self.rows()[:, 1:4]) - axis).max() > _PARALLEL)

    def core(self, open_points: ArrayLike) -> _core.ToolMotion:
        """Return the motion for the core, of a tool's points at the opening 1 (k, 3), m."""
        points = np.array(open_points, dtype=float)
        return _core.ToolMotion(points, np.array(self.closed_points or points), self.rows())

    def places(self, open_points: ArrayLike, times: ArrayLike) -> Array:
        """Return the centers of the tips less the device's tip at times (n,), s: (n, k, 3), m."""
        return self.core(open_points).places(np.ascontiguousarray(times, dtype=float))

    def following(self, rows: Array) -> Self:
        """Return the same tool with a motion as of `rows`."""
        turning = tuple(tuple(row) for row in rows[:, :4].tolist())
        opening = tuple(tuple(row) for row in rows[:, [0, 4]].tolist()) if self.closed_points else None
        return self.model_copy(update={"rotation": turning, "opening": opening})

    def rows(self) -> Array:
        """Return the motion as rows (n, 5): time, s; angles, rad; opening."""
        turning = np.zeros((1, 4)) if self.rotation is None else np.array(self.rotation)
        opening = np.array(self.opening or ((0.0, 1.0),))
        times = [table[:, 0] for table in (turning, opening) if len(table) > 1]
        time = np.unique(np.concatenate(times)) if times else np.zeros(1)
        angles = [np.interp(time, turning[:, 0], turning[:, axis]) for axis in (1, 2, 3)]
        return np.column_stack([time, *angles, np.interp(time, opening[:, 0], opening[:, 1])])
