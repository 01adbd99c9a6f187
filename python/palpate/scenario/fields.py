"""Types of scenario fields: text with a unit on the way in, SI floats inside, the same text on the way out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, PlainSerializer

from palpate.units import parse_quantity, write

_Axes = tuple[float, float, float]


class MistakesError(ValueError):
    """Several mistakes that one check has found, each a sentence that begins with its field."""

    def __init__(self, mistakes: Sequence[str]) -> None:
        super().__init__("\n".join(mistakes))
        self.mistakes = tuple(mistakes)

    @classmethod
    def collect(cls, *checks: Callable[[], object]) -> None:
        """Run every check, and raise the mistakes that they found, if any."""
        found: list[str] = []
        for check in checks:
            try:
                check()
            except cls as several:
                found += several.mistakes
            except ValueError as problem:
                found.append(str(problem))
        if found:
            raise cls(found)


class Section(BaseModel):
    """One table of a scenario: unknown keys are refused, values cannot change afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _scalar(unit: str) -> tuple[BeforeValidator, PlainSerializer]:
    return (
        BeforeValidator(lambda value: parse_quantity(value, unit)),
        PlainSerializer(lambda value: None if value is None else write(value, unit)),
    )


def _axes(unit: str) -> tuple[BeforeValidator, PlainSerializer]:
    return (
        BeforeValidator(lambda value: parse_quantity(value, unit, size=3)),
        PlainSerializer(lambda values: None if values is None else [write(value, unit) for value in values]),
    )


def _not_negative(value: Any) -> Any:
    if min(value if isinstance(value, tuple) else (value,)) < 0.0:
        raise ValueError("must not be negative")
    return value


def _positive(value: float) -> float:
    if value <= 0.0:
        raise ValueError("must be positive")
    return value


def _all_positive(values: _Axes) -> _Axes:
    if min(values) <= 0.0:
        raise ValueError("must be positive")
    return values


def _fraction(value: float) -> float:
    if not 0.0 <= value < 1.0:
        raise ValueError(f"{value:g}; it must be at least 0 and below 1")
    return value


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{value!r} is not a whole number; write it bare, for example 2")
    return value


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{value!r} is neither true nor false")
    return value


def _numbers(value: object) -> tuple[float, float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError(f"{value!r} is not a list of three plain numbers, such as [0, 0, 1]")
    x, y, z = (parse_quantity(entry, "") for entry in value)
    return x, y, z


def _matrix(value: object) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(row, (list, tuple)) for row in value):
        raise ValueError("a matrix is a list of rows of plain numbers, such as [[1.0, 0.0], [0.0, 1.0]]")
    rows = tuple(tuple(parse_quantity(entry, "") for entry in row) for row in value)
    if len({len(row) for row in rows}) > 1:
        raise ValueError(f"the rows of a matrix must be equally long; they have {[len(row) for row in rows]} entries")
    if not all(math.isfinite(entry) for row in rows for entry in row):
        raise ValueError("the entries of a matrix must be finite")
    return rows


Time = Annotated[float, *_scalar("s"), AfterValidator(_not_negative)]
Duration = Annotated[float, *_scalar("s"), AfterValidator(_positive)]
Frequency = Annotated[float, *_scalar("Hz"), AfterValidator(_positive)]
OneMass = Annotated[float, *_scalar("kg"), AfterValidator(_not_negative)]
OneStiffness = Annotated[float, *_scalar("N/m"), AfterValidator(_not_negative)]
OneDamping = Annotated[float, *_scalar("N*s/m"), AfterValidator(_not_negative)]

OneLength = Annotated[float, *_scalar("m"), AfterValidator(_not_negative)]
Length = Annotated[float, *_scalar("m"), AfterValidator(_positive)]
Pressure = Annotated[float, *_scalar("Pa"), AfterValidator(_positive)]
Number = Annotated[float, *_scalar(""), AfterValidator(_not_negative)]
Fraction = Annotated[float, *_scalar(""), AfterValidator(_fraction)]

Angle = Annotated[float, *_scalar("rad"), AfterValidator(_not_negative)]
Angle3 = Annotated[_Axes, *_axes("rad")]
Size3 = Annotated[_Axes, *_axes("m"), AfterValidator(_all_positive)]
Force3 = Annotated[_Axes, *_axes("N")]
Position3 = Annotated[_Axes, *_axes("m")]
Stiffness3 = Annotated[_Axes, *_axes("N/m"), AfterValidator(_not_negative)]
Damping3 = Annotated[_Axes, *_axes("N*s/m"), AfterValidator(_not_negative)]

Number3 = Annotated[_Axes, BeforeValidator(_numbers)]
Matrix = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_matrix)]
Whole = Annotated[int, BeforeValidator(_whole)]
Flag = Annotated[bool, BeforeValidator(_flag)]
