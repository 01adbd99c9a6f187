"""Reading of text files from unknown sources: every fault is one sentence, quickly and in little memory."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import pytest
from palpate.devices import load
from palpate.devices.catalog import parse_device
from palpate.errors import DeviceError, PalpateError, ScenarioError, printable
from palpate.files import check_readable, find_line, load_toml, read_utf8
from palpate.files.json_text import load_json, load_table
from palpate.files.reading import begins_with, read_bytes
from palpate.scenario import Scenario
from palpate.units import parse_quantity

BASED = 'based_on = "slider"\n'
LINEAR = 20.0  # s: quadratic time would be minutes


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
    assert time.process_time() - began < LINEAR


@pytest.mark.parametrize(
    "line", ["a" * 100_000, '"' * 100_000, '"a' * 50_000, "[" + " " * 100_000, "a . " * 9 + " " * 100_000]
)
def test_a_long_line_costs_linear_time(line: str) -> None:
    began = time.process_time()
    with pytest.raises(ScenarioError):
        load_toml(line, ScenarioError, "file")
    find_line(line, ("a", "b"))
    assert time.process_time() - began < LINEAR


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
    assert time.process_time() - began < LINEAR


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
        ("a = [\n[1]", 1),
        ("a = [[\n1],", 1),
        ("a = [ # ]", 1),
        ('a = ["b", [', 2),
        ('a = [[""""""', 2),
        ("a = [''''''', [", 2),
        ("a = ['b', [", 2),
        ('a = ["]", {b = "]', 2),
        ("a = {b = 1, c = [1]}", 0),
        (r"a = '\\'", 0),
        (r'a = "x\\\"["', 0),
    ],
)
def test_a_key_is_found_on_the_first_line_after_the_brackets_before_it_are_closed(before: str, after: int) -> None:
    """Brackets in texts and comments do not count."""
    text = f"{before}\nc = 1\n" + (f"{']' * after}\nc = 2\n" if after else "")
    table = ("a",) if before.startswith("[a]") else ()
    begins = 2 + before.count("\n")
    assert find_line(text, (*table, "c")) == (begins + 2 if after else begins)


def test_a_line_of_text_between_triple_quotes_is_no_key() -> None:
    for fence in ('"""', "'''"):
        text = f"a = {fence}\n[b]\nc = 1\n{fence}\n[d]\nc = 2\n[[e]]\n[[e]]\nf.g = 3 # {fence}\n'h i' . j = 4"
        assert find_line(text, ("c",)) is None
        assert find_line(text, ("b",)) is None
        assert (find_line(text, ("a",)), find_line(text, ("d", "c")), find_line(text, ("e",))) == (1, 6, 7)
        assert (find_line(text, ("e", "f", "g")), find_line(text, ("e", 1, "h i", "j"))) == (9, 10)
        assert find_line(text, ("d", "x", "y")) == 5  # the table around a missing key
        assert find_line(text, ("d", "c", "y")) == 6
        assert find_line(text, ("x", "d")) is None
        assert find_line(text, ()) is None


REFUSED: list[tuple[object, str]] = [
    (3, "file: TOML text is needed, not '3'"),
    (b"x" * 70, f"file: TOML text is needed, not {str(b'x' * 70)[:60]!r}"),
    ("a = 1\nb = \n", "file, line 2: not valid TOML: invalid value"),
    ("a = ", "file: not valid TOML: invalid value"),  # the parser gives no line at the end
    ("a = 1\na = 2", "file: not valid TOML: cannot overwrite a value"),
    ("\n\n" + "a." * 16 + "a = 1", "file, line 3: not usable TOML: a dotted key of more than 16 parts"),
    ("x = " + "[" * 6000, "file: not usable TOML: nested too deeply"),
    ("x = " + "9" * 5000, "file: not usable TOML: an integer of thousands of digits"),
    (f"x = [{2**63}]", "file: not usable TOML: an integer of more than 64 bits"),
    (f"x = {{a = {-(2**63) - 1}}}", "file: not usable TOML: an integer of more than 64 bits"),
    (f"x = {'[' * 100}{']' * 100}", "file: not usable TOML: nested more than 100 deep"),
    ("[[a]]\n" * 20_001, "file: not usable TOML: more than 20000 tables"),
    ((("a" + ".b" * 15 + " = 1\n") * 3572)[:-1], "file: not usable TOML: more than 50000 dotted keys"),
    ("#" * 4_000_001, "file: 4000001 characters; TOML text has at most 4000000"),
]


@pytest.mark.parametrize(("text", "says"), REFUSED, ids=range(len(REFUSED)))
def test_a_refusal_of_toml_is_this_sentence(text: object, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_toml(text, ScenarioError, "file")
    assert str(caught.value) == says


def test_toml_up_to_its_limits_is_read() -> None:
    deep = f"x = {'[' * 99}{']' * 99}"  # in the table of the text
    for text, keys in (
        (deep, 1),
        (f"x = {2**63 - 1}\ny = {-(2**63)}", 2),
        ("#" * 4_000_000, 0),
        ("".join(f"a{k}" + ".b" * 15 + " = 1\n" for k in range(3571)) + "z.b.b.b.b.b.b.b = 1", 3572),
    ):
        assert len(load_toml(text, ScenarioError, "file")) == keys
    assert len(load_toml("[[a]]\n" * 20_000, ScenarioError, "file")["a"]) == 20_000


JSON: list[tuple[object, str]] = [
    (None, "file: not JSON text"),
    ("{", "file: not JSON (Expecting property name enclosed in double quotes)"),
    ("[" * 100_000, "file: not usable JSON (nested too deeply)"),
    ("9" * 5000, "file: not usable JSON (an integer of thousands of digits)"),
    (f"{'1' * 30}e999", f"file: not usable JSON ({'1' * 20} is not a finite number)"),
    ("[-Infinity]", "file: not usable JSON (-Infinity is not a finite number)"),
    ("[" * 100 + "]" * 100, "file: not usable JSON (nested more than 100 deep)"),
    ('{"a": {"b": 9223372036854775808}}', "file: not usable JSON (an integer of more than 64 bits)"),
    ("[1, -9223372036854775809]", "file: not usable JSON (an integer of more than 64 bits)"),
    ("1" + " " * 16_000_000, "file: 16000001 characters; JSON text has at most 16000000"),
]


@pytest.mark.parametrize(("text", "says"), JSON, ids=range(len(JSON)))
def test_a_refusal_of_json_is_this_sentence(text: object, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_json(text, ScenarioError, "file")
    assert str(caught.value) == says


def test_json_up_to_its_limits_is_read() -> None:
    values: list[Any] = [9223372036854775807, -9223372036854775808, [{"a": 1.5}], True, None, "9" * 30]
    assert (
        load_json(str(values).replace("'", '"').replace("True", "true").replace("None", "null"), ScenarioError, "f")
        == values
    )
    deepest = load_json("[" * 99 + "]" * 99, ScenarioError, "file")
    for _ in range(98):
        deepest = deepest[0]
    assert deepest == []
    assert load_json("1" + " " * 15_999_999, ScenarioError, "file") == 1
    assert load_table('{"a": 1}', ScenarioError, "file") == {"a": 1}
    with pytest.raises(ScenarioError, match=r"^file: a JSON object is expected$"):
        load_table("[1]", ScenarioError, "file")


def said(read: Any, *arguments: Any, **options: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        read(*arguments, **options)
    return str(caught.value)


def test_what_cannot_be_read_is_named_with_its_fault_and_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, missing, pipe, folder = (tmp_path / name for name in ("a", "missing", "pipe", "folder"))
    file.write_bytes(b"12\r\n5\r6")
    os.mkfifo(pipe)
    folder.mkdir()
    assert check_readable(str(file), ScenarioError, kind="the file") == file
    for limit in (7, 8, None):
        assert check_readable(file, ScenarioError, kind="the file", limit=limit) == file
    told = said(check_readable, file, ScenarioError, kind="the file", limit=6)
    assert told == f"{file}: 7e-06 MB; the file has at most 6e-06 MB"
    for options, end in (({}, ""), ({"otherwise": "make it"}, "; make it")):
        told = said(check_readable, missing, ScenarioError, kind="the file", **options)
        assert told == f"{missing}: there is no such file{end}"
    assert said(check_readable, pipe, ScenarioError, kind="the file") == (
        f"{pipe}: a device or a pipe; give the file, a regular file"
    )
    assert said(check_readable, folder, ScenarioError, kind="the file") == f"{folder}: a folder; give the file in it"
    assert said(check_readable, 3, ScenarioError, kind="the file") == "a file is named by text or a Path, not by 3"
    name = "n" * 300
    assert said(check_readable, name, ScenarioError, kind="x") == f"{name}: cannot be read: File name too long"
    assert "null" in said(check_readable, "a\0b", ScenarioError, kind="x").partition("cannot be read: ")[2]
    assert read_bytes(file, ScenarioError, kind="the file", limit=7) == b"12\r\n5\r6"
    assert read_utf8(file, ScenarioError, kind="the file") == "12\n5\r6"
    (tmp_path / "latin").write_bytes(b"\xe9")
    assert said(read_utf8, tmp_path / "latin", ScenarioError, kind="the file") == (
        f"{tmp_path / 'latin'}: not UTF-8 text; give the file"
    )
    (tmp_path / "large").write_bytes(b"")
    os.truncate(tmp_path / "large", 4_000_000)
    assert len(read_utf8(tmp_path / "large", ScenarioError, kind="the file")) == 4_000_000
    os.truncate(tmp_path / "large", 4_000_001)
    assert said(read_utf8, tmp_path / "large", ScenarioError, kind="the file") == (
        f"{tmp_path / 'large'}: 4 MB; the file has at most 4 MB"
    )

    def refuse(*_: object, **__: object) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert said(read_bytes, file, ScenarioError, kind="x", limit=9) == f"{file}: cannot be read: Permission denied"
    assert begins_with(file, b"12") is False


def test_a_file_begins_with_its_first_bytes(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    for signature, true in ((b"", True), (b"ab", True), (b"abc", True), (b"b", False), (b"abcd", False)):
        assert begins_with(tmp_path / "a", signature) is true
    assert begins_with(tmp_path, b"") is begins_with(tmp_path / "b", b"") is begins_with(Path("a\0b"), b"") is False
