"""Text with units: writing and reading are inverse, and a wrong dimension is refused."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from palpate import devices, units
from palpate.errors import DeviceError, ScenarioError
from palpate.units import UNITS, bounded_to_si, parse_quantity, to_si, write

finite = st.floats(allow_nan=False, allow_infinity=False)


@example(value=-0.0, unit="N")
@example(value=5e-324, unit="N/m")
@given(value=finite, unit=st.sampled_from(sorted(UNITS)))
def test_writing_and_reading_gives_the_same_bits(value: float, unit: str) -> None:
    """Round trip: a trace carries its scenario as text and must run it again bit for bit."""
    back = parse_quantity(write(value, unit), unit, "field")
    assert back == value
    assert math.copysign(1.0, back) == math.copysign(1.0, value)


@given(value=finite)
def test_a_plain_number_stays_as_it_is(value: float) -> None:
    """Where no unit belongs, a bare number and its text are the same."""
    assert parse_quantity(value, "") == parse_quantity(repr(value), "") == value


@pytest.mark.parametrize("value", ["0.3 mm", None, "nan", "a half", "1e999", "3 furlongz"])
def test_message_for_a_plain_number_gives_no_example(value: object) -> None:
    """The caller may want a count, or a value below 0.5: no example is right everywhere."""
    with pytest.raises(ValueError, match="a plain number") as caught:
        parse_quantity(value, "")
    assert "0.5" not in str(caught.value)


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_every_example_in_a_message_can_be_read(unit: str) -> None:
    """An error message gives a correct form as an example; that example must be valid."""
    assert math.isfinite(parse_quantity(UNITS[unit][1], unit))


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("3.5 N/mm", "N/m", 3500.0),
        ("3.5N/mm", "N/m", 3500.0),
        ("0.9 mm", "m", 0.0009),
        ("23 um", "m", 23e-6),
        ("23 µm", "m", 23e-6),  # micro sign
        ("23 μm", "m", 23e-6),  # Greek mu
        ("-36.8 mm", "m", -0.0368),
        ("20.2 g", "kg", 0.0202),
        ("1e-3 kg", "kg", 1e-3),
        (".5 ms", "s", 5e-4),
        ("0.5 kHz", "Hz", 500.0),
        ("180 deg", "rad", math.pi),
        ("0.05 N·m·s/rad", "N*m*s/rad", 0.05),
        ("1 mN*m", "N*m", 1e-3),
        ("9.81 m/s²", "m/s^2", 9.81),
        ("9.81 m/s**2", "m/s^2", 9.81),
        ("2.18 Ω", "ohm", 2.18),
        ("1 lbf", "N", 4.4482216152605),
    ],
)
def test_units_are_converted_to_si(text: str, unit: str, value: float) -> None:
    """Definitions of the SI: the double nearest to the exact conversion (pi and the pound to 1 ulp)."""
    assert parse_quantity(text, unit, "field") == pytest.approx(value, rel=3e-16)


@pytest.mark.parametrize(
    ("value", "unit", "says"),
    [
        ("3.5 N", "N/m", 'object.stiffness: "3.5 N" is a force [N]; a stiffness is needed, for example "3.5 N/mm"'),
        ("1 kg", "m", "is a mass"),
        ("1 N*s/m", "N/m", "is a damping"),
        ("1 Hz", "rad/s", "is a frequency"),
        ("1", "rad", "no unit, and an angle is needed"),
        ("2 %", "rad", "a plain number"),
        (3500, "N/m", '3500 has no unit, and a stiffness is needed; write it as "3500 N/m" or "3500 N/mm"'),
        ("8", "m", 'has no unit, and a length is needed; write it as "8 m" or "8 mm"'),
        ("3500", "N/m", "has no unit"),
        (math.nan, "N", "not a finite number"),
        (math.inf, "", "not a finite number"),
        ("nan N", "N", "not a finite number"),
        ("-inf N", "N", "not a finite number"),
        ("1e999 N", "N", "too large"),
        ("1 Newtun", "N", 'the unit "Newtun" is not known'),
        ("20 degC", "K", "not known"),
        ("3,5 N", "N", "write for example"),
        ("1.2.3 N", "N", "cannot be read"),
        ("", "N", "cannot be read"),
        ("N", "N", "cannot be read"),
        (True, "", "not a quantity; write a plain number"),
        ("0.3 mm", "", '"0.3 mm" is a length [m]; a plain number is needed'),
        ("8", "byte", 'has no unit, and an amount of memory is needed; write it as "8 GB"'),
        ("8 mm", "byte", 'an amount of memory is needed, for example "8 GB"'),
        (None, "N", "not a quantity"),
        ([1], "N", "not a quantity"),
    ],
)
def test_invalid_quantities_are_refused_with_a_sentence(value: object, unit: str, says: str) -> None:
    """The message names the field and shows the right form."""
    with pytest.raises(ScenarioError) as caught:
        parse_quantity(value, unit, "object.stiffness", error=ScenarioError)
    message = str(caught.value)
    assert message.startswith("object.stiffness: ")
    assert says in message
    assert "\n" not in message


@given(text=st.text(max_size=40), unit=st.sampled_from(["N/m", "rad", "s", ""]))
def test_any_text_is_a_finite_number_or_an_error(text: str, unit: str) -> None:
    """No text ends in another exception, nor in a number that is not finite."""
    try:
        value = parse_quantity(text, unit)
    except ValueError:
        return
    assert math.isfinite(value)


@pytest.mark.parametrize("text", ["1 __import__('os')", "1 N*(lambda: 0)()", "1 m**99999999", "1 m^9^9^9", "9**9**9 m"])
def test_text_is_never_evaluated(text: str) -> None:
    """An expression is not a unit, and a tower of powers is refused without evaluating it."""
    with pytest.raises(ScenarioError):
        parse_quantity(text, "m", "field", error=ScenarioError)


def test_one_value_stands_for_every_axis() -> None:
    """A vector is a list, or one value for all axes; another length is an error that counts."""
    assert parse_quantity("1 mm", "m", "f", size=3) == (1e-3, 1e-3, 1e-3)
    assert parse_quantity(["1 mm", "2 cm", "-3 m"], "m", "f", size=3) == (1e-3, 2e-2, -3.0)
    with pytest.raises(ScenarioError, match="f: 2 values where 3 are needed"):
        parse_quantity(["1 mm", "2 mm"], "m", "f", size=3, error=ScenarioError)


def test_the_caller_chooses_the_error() -> None:
    """A device file's mistake is a DeviceError."""
    with pytest.raises(DeviceError, match="mass"):
        parse_quantity("1 m", "kg", "mass.a", error=DeviceError)


def test_catalog_numbers_read_as_they_are_written() -> None:
    """The text of each number, read alone, is the device's value."""
    from palpate.devices.catalog import read_numbers

    for name in devices.names():
        for number in read_numbers(name):
            assert tuple(parse_quantity(text, number.unit) for text in number.text.split(", ")) == number.values


def test_a_bounded_number_is_finite_and_positive_or_zero() -> None:
    for value, expected in ((2.0, 2.0), ("2 ms", 0.002), (np.float32(0.5), 0.5), (5e-324, 5e-324)):
        assert bounded_to_si(value, "s", "it") == expected
    assert bounded_to_si(0.0, "s", "it", zero=True) == 0.0
    for value in (0.0, "0 s", -1.0, math.nan, math.inf, -math.inf):
        with pytest.raises(ScenarioError, match=r"^it must be positive and finite, not .* s$"):
            bounded_to_si(value, "s", "it")
        if value not in (0.0, "0 s"):
            with pytest.raises(ScenarioError, match=r"^it must be finite and not negative, not .* s$"):
                bounded_to_si(value, "s", "it", zero=True)


@pytest.mark.parametrize("value", [True, None, [1.0], np.zeros(2), {}, "2", "2 m"])
def test_what_is_no_number_of_a_unit_is_refused_by_name(value: Any) -> None:
    with pytest.raises(ScenarioError, match=r"^it"):
        to_si(value, "s", "it")


@pytest.mark.parametrize("text", ["5{}!", "5{}\n!", "{}5", "5 mm{}", "5{}\n", "nan{}\n1"])
def test_spaces_take_linear_time(text: str) -> None:
    """Quadratic time would be minutes."""
    with suppress(ValueError):
        assert parse_quantity(text.format(200_000 * " "), "m") == 0.005


@pytest.fixture
def new_tables() -> None:
    """Let the next unit be looked up in the table of pint, not in that of an earlier one."""
    units._look_up.cache_clear()
    units._names.cache_clear()


def refusal(value: object, unit: str) -> str:
    with pytest.raises(ValueError, match=r".") as caught:
        parse_quantity(value, unit)
    return str(caught.value)


@pytest.mark.usefixtures("new_tables")
def test_a_unit_is_read_in_itself_and_in_any_other_of_its_dimension() -> None:
    """Also units that no example has: both directions are exact."""
    for text, unit, value in (
        ("1 m", "mm", 1000.0),
        ("1 mm", "m", 1e-3),
        ("3 kg", "g", 3000.0),
        ("2 kg*m^2", "g*cm^2", 2e7),
        ("5 N*m", "N*m/rad", 5.0),
        ("5 N*m*s", "N*m*s/rad", 5.0),
        ("1 1/s", "Hz", 1.0),
        ("2.5 µm", "m", 2.5e-6),
        ("2.5 μm", "m", 2.5e-6),
        ("3 kΩ", "ohm", 3000.0),
        ("4 N·s/m", "N*s/m", 4.0),
        ("5 %", "", 0.05),
        ("5 %", "1", 0.05),
        ("3", "1", 3.0),
        ("3 furlongz", "furlongz", 3.0),
    ):
        assert parse_quantity(text, unit) == value
        assert parse_quantity(f"-{text}", unit) == -value
    for unit in UNITS:
        assert parse_quantity(f"3 {unit}", unit) == parse_quantity(f"3 {unit} ", f"{unit} ") == 3.0


@pytest.mark.usefixtures("new_tables")
def test_every_quantity_is_named_with_its_first_unit() -> None:
    for unit, (measure, text) in UNITS.items():
        if unit == "byte":
            continue  # pint counts it as a number
        wanted = "m" if unit == "kg" else "kg"
        article = "an" if measure[0] in "aeiou" else "a"
        needed = f'a {UNITS[wanted][0]} is needed, for example "{UNITS[wanted][1]}"'
        assert refusal(text, wanted) == f'"{text}" is {article} {measure} [{unit}]; {needed}'
    a_mass = 'a mass is needed, for example "0.15 kg"'
    assert refusal("2 N*m*s", "kg") == f'"2 N*m*s" is a rotary damping [N*m*s/rad]; {a_mass}'  # nothing else is one
    assert refusal("2 N*m", "kg") == f'"2 N*m" is a torque [N*m]; {a_mass}'
    assert refusal("2 m^3", "kg") == f'"2 m^3" is in m^3; {a_mass}'
    assert refusal("2 %", "kg") == f'"2 %" is a plain number; {a_mass}'
    assert refusal("2 deg", "kg") == f'"2 deg" is an angle [rad]; {a_mass}'
    assert refusal("2 g", "mm^3") == '"2 g" is a mass [kg]; a value in mm^3 is needed, for example "1 mm^3"'
    assert refusal("2 g", "") == '"2 g" is a mass [kg]; a plain number is needed'


@pytest.mark.usefixtures("new_tables")
def test_an_angle_and_its_rate_state_their_radian() -> None:
    for text, unit in (("1 Hz", "rad/s"), ("1 %", "rad"), ("1 rad^2", "rad"), ("1 rad^0.5", "rad"), ("1", "rad")):
        assert refusal(text, unit).startswith(f'"{text}" ')
    assert refusal("1 rad^0.5", "rad") == '"1 rad^0.5" is an angle [rad]; an angle is needed, for example "30 deg"'
    assert parse_quantity("1 deg/s", "rad/s") == parse_quantity("1 deg", "rad")


@pytest.mark.usefixtures("new_tables")
def test_what_is_no_unit_is_not_known() -> None:
    """A temperature has an offset, also in a product; long powers and long texts are not looked up."""
    most = f"m*m{' ' * 55}/m"
    assert len(most) == 60
    assert parse_quantity(f"2 {most}", "m") == 2.0
    assert refusal(f"2 {most.replace('/', ' /')}", "m").startswith('"2 m*m')
    assert 'is not known; write for example "10 mm"' in refusal(f"2 {most.replace('/', ' /')}", "m")
    for text, unit in (("20 degC", "K"), ("20 J/degC", "J/K"), ("20 J/degF", "J/K"), ("3 m^100", "m"), ("3 m?", "m")):
        written = text.partition(" ")[2]
        expected = f'"{text}": the unit "{written}" is not known; write for example "{UNITS[unit][1]}"'
        assert refusal(text, unit) == expected
    assert refusal("1 m", "furlongz") == 'the requested unit "furlongz" is not known'
    assert refusal("1 " + 50 * "q", "m").startswith(f'"1 {50 * "q"}": the unit "{40 * "q"}" is not known')


def test_a_message_shows_a_value_of_60_characters_whole() -> None:
    """Quotes count; a longer one ends after 57."""
    remedy = "; write a plain number"
    assert refusal("x" * 58, "") == f'"{"x" * 58}" cannot be read as a plain number{remedy}'
    assert refusal("x" * 59, "") == f'"{"x" * 56}..." cannot be read as a plain number{remedy}'
    assert refusal("x", "m") == '"x" cannot be read as a number with a unit; write for example "10 mm"'
    assert refusal(None, "furlongz") == 'None is not a quantity; write for example "1 furlongz"'


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "byte"])
def test_a_value_of_another_quantity_is_named_by_its_own(unit: str) -> None:
    """Also where only a radian tells two apart: 3 Hz is a frequency, 3 rad/s an angular velocity."""
    wanted = "m" if unit == "kg" else "kg"
    with pytest.raises(ScenarioError, match=re.escape(f"{UNITS[unit][0]} [{unit}]; a")):
        to_si(f"3 {unit}", wanted, "x")
