"""Types of scenario fields: text with a unit in files, floats in SI inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, PlainSerializer

from palpate.units import parse_quantity, write

_Axes = tuple[float, float, float]


class MistakesError(ValueError):
    """Several mistakes found by one check, each a sentence that begins with its field."""

    def __init__(self, mistakes: Sequence[str]) -> None:
        super().__init__("\n".join(mistakes))
        self.mistakes = tuple(mistakes)

    @classmethod
    def collect(cls, *checks: Callable[[], object]) -> None:
        """Run every check; raise the mistakes that they find."""
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
    """Table of a scenario: frozen, without unknown keys."""

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


def must(fits: Callable[[Any], bool], problem: str) -> AfterValidator:
    """Return a validator that raises ValueError unless a number `fits`, or each of a tuple; {} in it is the value."""

    def check(value: Any) -> Any:
        if not all(fits(one) for one in (value if isinstance(value, tuple) else (value,))):
            raise ValueError(problem.format(value))
        return value

    return AfterValidator(check)


def between(low: int, high: int, name: str = "") -> AfterValidator:
    """Return a validator of whole numbers from `low` to `high`; `name` follows the number in messages."""
    return must(lambda value: low <= value <= high, f"{{}}{name}; it must be between {low} and {high}")


NOT_NEGATIVE: Final = must(lambda value: value >= 0, "must not be negative")
POSITIVE: Final = must(lambda value: value > 0, "must be positive")
POSITIVE_OR_FLAG: Final = must(lambda value: isinstance(value, bool) or value > 0, "must be positive")


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


Time = Annotated[float, *_scalar("s"), NOT_NEGATIVE]
Duration = Annotated[float, *_scalar("s"), POSITIVE]
Rate = Annotated[float, *_scalar("rad/s"), POSITIVE]
Frequency = Annotated[float, *_scalar("Hz"), POSITIVE]
OneMass = Annotated[float, *_scalar("kg"), NOT_NEGATIVE]
OneStiffness = Annotated[float, *_scalar("N/m"), NOT_NEGATIVE]
OneDamping = Annotated[float, *_scalar("N*s/m"), NOT_NEGATIVE]

OneLength = Annotated[float, *_scalar("m"), NOT_NEGATIVE]
Length = Annotated[float, *_scalar("m"), POSITIVE]
Pressure = Annotated[float, *_scalar("Pa"), POSITIVE]
Number = Annotated[float, *_scalar(""), NOT_NEGATIVE]
Fraction = Annotated[float, *_scalar(""), must(lambda x: 0.0 <= x < 1.0, "{:g}; it must be at least 0 and below 1")]

Angle = Annotated[float, *_scalar("rad"), NOT_NEGATIVE]
Angle3 = Annotated[_Axes, *_axes("rad")]
Size3 = Annotated[_Axes, *_axes("m"), POSITIVE]
Force3 = Annotated[_Axes, *_axes("N")]
Position3 = Annotated[_Axes, *_axes("m")]
Stiffness3 = Annotated[_Axes, *_axes("N/m"), NOT_NEGATIVE]
Damping3 = Annotated[_Axes, *_axes("N*s/m"), NOT_NEGATIVE]

Normalization = Annotated[
    bool | _Axes,
    BeforeValidator(lambda value: value if isinstance(value, bool) else parse_quantity(value, "N/m", size=3)),
    POSITIVE_OR_FLAG,
    PlainSerializer(lambda value: value if isinstance(value, bool) else [write(one, "N/m") for one in value]),
]

Number3 = Annotated[_Axes, BeforeValidator(_numbers)]
Matrix = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_matrix)]
Whole = Annotated[int, BeforeValidator(_whole)]
Flag = Annotated[bool, BeforeValidator(_flag)]
