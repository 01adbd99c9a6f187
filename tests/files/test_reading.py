"""Reading of text files from unknown sources: every fault is one sentence, quickly and in little memory."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from palpate.devices import load
from palpate.devices.catalog import parse_device
from palpate.errors import DeviceError, PalpateError, ScenarioError, printable
from palpate.files import find_line, load_toml, read_utf8
from palpate.files.json_text import load_json
from palpate.scenario import Scenario
from palpate.units import parse_quantity

BASED = 'based_on = "slider"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = " + "[" * 6000, "nested too deeply"),
        ("x = " + "[" * 200 + "]" * 200, "nested more than 100 deep"),
        ("x = " + "9" * 5000, "an integer of thousands of digits"),
        ("x = " + "9" * 400, "an integer of more than 64 bits"),
        ("x = 0x" + "f" * 5000, "an integer of more than 64 bits"),
        ("a." * 20000 + "a = 1", "a dotted key of more than 16 parts"),
        ("[" + "a." * 20000 + "a]", "line 1: .* a dotted key of more than 16 parts"),
        ("x = {" + "a." * 20000 + "a = 1}", "a dotted key of more than 16 parts"),
        ('"a".' * 20000 + "a = 1", "a dotted key of more than 16 parts"),
        ("[[a]]\n" * 30000, "more than 20000 tables"),
        ("a = 1\n" * 700_000, "at most 4000000"),
        ("d = 2026-13-45", "not valid TOML"),
    ],
)
def test_toml_of_any_structure_is_refused_in_linear_time(text: str, sentence: str) -> None:
    began = time.process_time()
    with pytest.raises(ScenarioError, match=sentence):
        load_toml(text, ScenarioError, "file")
    assert time.process_time() - began < 1.0


@pytest.mark.parametrize(
    "line", ["a" * 100_000, '"' * 100_000, '"a' * 50_000, "[" + " " * 100_000, "a . " * 9 + " " * 100_000]
)
def test_a_long_line_costs_linear_time(line: str) -> None:
    began = time.process_time()
    with pytest.raises(ScenarioError):
        load_toml(line, ScenarioError, "file")
    find_line(line, ("a", "b"))
    assert time.process_time() - began < 1.0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[" * 100_000, "nested too deeply"),
        ("[" * 200 + "]" * 200, "nested more than 100 deep"),
        ("9" * 5000, "thousands of digits"),
        ("9" * 400, "more than 64 bits"),
        ("1e999", "not a finite number"),
        ("NaN", "not a finite number"),
        ("{", "not JSON"),
        (3, "not JSON text"),
    ],
)
def test_json_of_any_structure_is_refused(text: object, sentence: str) -> None:
    with pytest.raises(ScenarioError, match=sentence):
        load_json(text, ScenarioError, "file")


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    """A device never ends, and a pipe waits for a writer."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    for file in ("pipe.toml", "zero.toml"):
        with pytest.raises(ScenarioError, match="a device or a pipe"):
            Scenario.from_file(tmp_path / file)
        with pytest.raises(DeviceError, match="a device or a pipe"):
            load(tmp_path / file)
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_utf8("nul\0.toml", ScenarioError, kind="a file")


@pytest.mark.parametrize(
    "text", ["1 s^0", "1 m^0", "1 m()", "1 m^^2", "1 ()m", "1 %^0", 10**400, 1 << 20000], ids=range(8)
)
def test_text_that_is_no_unit_is_refused(text: object) -> None:
    for unit in ("", "s", "m"):
        with pytest.raises(ScenarioError, match="field: "):
            parse_quantity(text, unit, "field", error=ScenarioError)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (BASED + "sources = 3", "sources must be a table"),
        (BASED + "[sources]\na = 3", "sources must be a table of texts"),
        (BASED + "name = {a = 1}", "name is missing"),
        (BASED + 'name = ["a"]', "name is missing"),
        (BASED + "mechanism = {a = 1}", "mechanism is missing"),
        (BASED + "mass = 3", "unknown key mass"),
        (BASED + '[mass]\ntip = {value = "1 kg", source = [1]}', "source must be text"),
        (BASED + '[mass]\ntip = {value = "1e300 kg", source = "x"}', "which no device has"),
        ("based_on = [1]", "based_on must be a device"),
        (
            'based_on = "phantom-premium-1.5a"\n[geometry]\nl1 = {value = "1e300 m", source = "x"}',
            "which no device has",
        ),
    ],
)
def test_a_device_file_of_any_structure_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(DeviceError, match=sentence):
        parse_device(text, "file")


def test_a_thousand_misspelled_keys_are_refused_quickly() -> None:
    lines = "\n".join(f"k{i} = 1" for i in range(20_000))
    began = time.process_time()
    with pytest.raises(DeviceError, match="unknown key k0"):
        parse_device(BASED + lines, "file")
    with pytest.raises(ScenarioError, match='unknown key "k0"'):
        Scenario.from_text(lines)
    assert time.process_time() - began < 3.0


def test_control_characters_of_a_message_are_shown_escaped() -> None:
    """The title of a file must not set the title of the terminal's window."""
    assert str(PalpateError("a\x1b]0;PWN\x07\tb\nc\x9b\u202e\ud800é…")) == (
        "a\\x1b]0;PWN\\x07\tb\nc\\x9b\\u202e\\ud800é…"
    )
    assert printable("plain") == "plain"


def test_json_text_has_a_longest_length(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.files.json_text._LARGEST", 7)
    assert load_json("[1, 22]", ScenarioError, "file") == [1, 22]
    with pytest.raises(ScenarioError, match="file: 8 characters; JSON text has at most 7"):
        load_json("[1, 22] ", ScenarioError, "file")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("a = [1, 2]", 0),
        ("a = [1,", 1),
        ("a = [[1,", 2),
        ("a = { b = [", 2),
        ("a = 1]]", 0),
        ("a = '[' # [", 0),
        (r'a = "\"["', 0),
        (r"a = '\' # [", 0),
        (r'a = "\\" # [', 0),
        ("a = '''['''", 0),
        ('a = """[""" ', 0),
        ("[a] # [[", 0),
        ("a = ['''[''', [", 2),
        ('a = ["""]""", "]"', 1),
    ],
)
def test_a_key_is_found_on_the_first_line_after_the_brackets_before_it_are_closed(before: str, after: int) -> None:
    """Brackets in texts and comments do not count."""
    text = f"{before}\nc = 1\n" + (f"{']' * after}\nc = 2\n" if after else "")
    table = ("a",) if before.startswith("[a]") else ()
    assert find_line(text, (*table, "c")) == (4 if after else 2)
