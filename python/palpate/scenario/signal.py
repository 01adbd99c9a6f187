"""Force as a function of time: step, ramp, sine or table."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, PlainSerializer, model_validator

from palpate.scenario.fields import Duration, Force3, Frequency, Section, Time
from palpate.units import parse_quantity, write

Row = tuple[float, float, float, float]


def table_of(unit: str, name: str, shown: str) -> tuple[BeforeValidator, PlainSerializer]:
    """Return validator and serializer of a table with rows of a time, s, and three values in the SI unit `unit`.

    `name` is the plural of the values, and `shown` the unit of the example in messages.
    """
    example = f'["0.1 s", "1 {shown}", "0 {shown}", "0 {shown}"]'

    def read(value: object) -> tuple[Row, ...]:
        if not isinstance(value, (list, tuple)) or len(value) < 2:
            raise ValueError(f"a table needs at least two rows such as {example}")
        rows = []
        for number, row in enumerate(value, start=1):
            if not isinstance(row, (list, tuple)) or len(row) != 4:
                raise ValueError(f"row {number} must be a time and three {name}, {example}")
            x, y, z = parse_quantity(row[1:], unit, size=3)
            rows.append((parse_quantity(row[0], "s"), x, y, z))
            if number > 1 and rows[-1][0] <= rows[-2][0]:
                raise ValueError(f"the time of row {number} ({row[0]}) is not after that of the row before")
        return tuple(rows)

    def text(rows: tuple[Row, ...] | None) -> list[list[str]] | None:
        if rows is None:
            return None
        return [[write(row[0], "s"), *(write(value, unit) for value in row[1:])] for row in rows]

    return BeforeValidator(read), PlainSerializer(text)


ForceTable = Annotated[tuple[Row, ...], *table_of("N", "forces", "N")]


class Signal(Section):
    """Force at the tip as a function of time.

    Attributes:
        shape: "step", "ramp" (linear over `rise`, then constant), "sine" or "table".
        force: N per axis; the amplitude of a sine.
        start: s; the force is zero before.
        stop: s; the force is zero from then on; None for no end.
        rise: s, of a ramp.
        frequency: Hz, of a sine.
        table: rows (time s, Fx, Fy, Fz N), linear in between and constant outside.
    """

    shape: Literal["step", "ramp", "sine", "table"] = "step"
    force: Force3 | None = None
    start: Time = 0.0
    stop: Duration | None = None
    rise: Duration | None = None
    frequency: Frequency | None = None
    table: ForceTable | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.check_signal()
        return self

    def check_signal(self) -> None:
        """Raise ValueError unless the keys define one force."""
        needs: dict[str, str] = {"ramp": "rise", "sine": "frequency", "table": "table"}
        for shape, key in needs.items():
            given: Any = getattr(self, key)
            if self.shape == shape and given is None:
                raise ValueError(f"a {shape} needs {key}")
            if self.shape != shape and given is not None:
                raise ValueError(f'{key} belongs to shape = "{shape}", not to "{self.shape}"')
        if self.shape == "table":
            if self.force is not None:
                raise ValueError("a table carries its own forces; leave force out")
        elif self.force is None:
            raise ValueError('force is missing; write for example force = ["0 N", "0 N", "-2 N"]')
        if self.stop is not None and self.stop <= self.start:
            raise ValueError("stop must be after start")

    def values(self, time: ArrayLike) -> NDArray[np.float64]:
        """Return the force (n, 3), N, at `time` (n,), s."""
        t = np.atleast_1d(np.asarray(time, dtype=float))
        near = 1e-9  # s: a sample that rounding put just before `start` belongs to it
        if self.table is not None:
            rows = np.array(self.table)
            force = np.column_stack([np.interp(t, rows[:, 0], rows[:, axis]) for axis in (1, 2, 3)])
        else:
            since = t - self.start
            shape = np.ones_like(t)
            if self.rise is not None:
                shape = np.clip(since / self.rise, 0.0, 1.0)
            elif self.frequency is not None:
                shape = np.sin(2.0 * np.pi * self.frequency * since)
            force = shape[:, None] * np.array(self.force)
        force[t < self.start - near] = 0.0
        if self.stop is not None:
            force[t >= self.stop - near] = 0.0
        return np.asarray(force, dtype=float)
