"""Reading of a scenario's TOML, with a sentence for each mistake: file, line, field and remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from palpate.errors import ScenarioError, shorten
from palpate.files import HDF5_SIGNATURE, as_path, begins_with, find_line, load_toml, read_utf8
from palpate.scenario.fields import MistakesError

Model = TypeVar("Model", bound=BaseModel)
_MOST_MISTAKES: Final = 50  # that are reported
_FIELD_FIRST: Final = re.compile(r"([A-Za-z_]+(?:\.[A-Za-z_]+)*)(?=: | is missing| has no meaning)")
_UNKNOWN: Final = re.compile(r'unknown key "([^"]*)"')


class ScenarioText(NamedTuple):
    """The text of a scenario file."""

    text: str
    name: str  # of the file, for messages
    base: Path  # folder of relative paths


def read_file(path: str | Path) -> ScenarioText:
    """Return the text of a scenario file.

    Raises:
        ScenarioError: it cannot be read, or is no text.
    """
    file = as_path(path, ScenarioError)
    if begins_with(file, HDF5_SIGNATURE):
        raise ScenarioError(
            f"{file}: HDF5 (a body, a trace or a sweep), no scenario; a scenario is a TOML file, in which a body is "
            f'named as [object.body] file = "{file.name}"'
        )
    text = read_utf8(file, ScenarioError, kind="the scenario's file (.toml)", otherwise=_similar_file(file))
    return ScenarioText(text, str(file), file.parent)


def read_text(text: str, name: str) -> dict[str, Any]:
    """Return the tables of TOML text; `name` is that of the file in messages.

    Raises:
        ScenarioError: it is not TOML.
    """
    if not isinstance(text, str):
        raise ScenarioError(f"a scenario's text is TOML, not {text!r}")
    return load_toml(text, ScenarioError, name)


def lay_settings(tables: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables with settings in place of their values, by dotted key such as "object.stiffness".

    Raises:
        ScenarioError: a key leads through what is no table.
    """
    out = dict(tables)
    for key, value in settings.items():
        *path, last = key.split(".")
        table = out
        for depth, part in enumerate(path, start=1):
            below = table.get(part, {})
            if not isinstance(below, Mapping):
                name = ".".join(path[:depth])
                vector = isinstance(below, (list, tuple)) and len(below) == 3
                rest = f"; a sweep varies one of its three numbers as {name}.x, .y or .z" if vector else ""
                raise ScenarioError(f"setting {key}: {name} is no table{rest}")
            table[part] = dict(below)
            table = table[part]
        if not all((*path, last)):
            raise ScenarioError(f'setting {key!r}: a key has the form "object.stiffness"')
        table[last] = value
    return out


def validate(
    model: type[Model],
    tables: Mapping[str, Any],
    name: str,
    text: str | None,
    base: str | Path | None,
    settings: Collection[str] = (),
) -> Model:
    """Return the model of a scenario's tables.

    Args:
        model: of a scenario.
        tables: with the structure of the file.
        name: of the file, for messages.
        text: of the file, in which lines are found; None if there is none.
        base: folder of relative paths.
        settings: dotted keys that were not read from the file.

    Raises:
        ScenarioError: the tables have mistakes; the message has a line for each, in the order of the file.
    """
    if not isinstance(tables, Mapping):
        raise ScenarioError(f"a scenario's tables are a mapping of them by name, not {tables!r}")
    if "device" not in tables and isinstance(tables.get("mechanism", tables.get("based_on")), str):
        raise ScenarioError(
            f'{name}: a device file; a scenario names it as [device] name = "{Path(name).name}" (palpate new scenario '
            "writes a scenario)"
        )
    context = {"base": None if base is None else str(base)}
    try:
        return model.model_validate(dict(tables), context=context)
    except ValidationError as problems:
        sentences: dict[tuple[int, str], None] = {}
        errors = problems.errors()[:_MOST_MISTAKES]
        meant = {_meant(model, error["loc"]) for error in errors if error["type"] == "extra_forbidden"}
        for error in errors:
            if error["type"] == "missing" and error["loc"] in meant:
                continue  # misspelled
            for field, sentence in _sentences(model, error):
                line = find_line(text, field) if text is not None else None
                dotted = ".".join(str(part) for part in field)
                own = any(f"{dotted}.".startswith(f"{key}.") for key in settings)
                own = own or (line is None and any(key.startswith(f"{dotted}.") for key in settings))
                line = None if own else line
                place = "settings" if own else name if line is None else f"{name}, line {line}"
                sentences[line or 0, f"{place}: {shorten(sentence)}"] = None
        raise ScenarioError("\n".join(sentence for _, sentence in sorted(sentences))) from None


def _meant(scenario: type[BaseModel], field: tuple[str | int, ...]) -> tuple[str | int, ...] | None:
    """Return the known field that is closest to a misspelled one, if any."""
    close = difflib.get_close_matches(str(field[-1]), _keys_of(scenario, field[:-1]), 1)
    return (*field[:-1], close[0]) if close else None


def _sentences(scenario: type[BaseModel], error: Any) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield the field and the sentence of each mistake in an error."""
    found = error.get("ctx", {}).get("error")
    for one in found.mistakes if isinstance(found, MistakesError) else [found]:
        yield _sentence(scenario, error if one is None else {**error, "ctx": {"error": one}})


def _sentence(scenario: type[BaseModel], error: Any) -> tuple[tuple[str | int, ...], str]:
    """Return the field of an error, and its sentence."""
    field: tuple[str | int, ...] = tuple(error["loc"])
    kind, value, message = error["type"], error.get("input"), str(error["msg"])
    if kind == "value_error":
        message = str(error["ctx"]["error"])
    if not field or kind == "value_error":
        # The message of a check of several fields begins with its field.
        if first := _FIELD_FIRST.match(message):
            field = (*field, *first[1].split("."))
            rest = message[first.end() :]
            message = rest[2:] if rest.startswith(": ") else rest.lstrip()
        elif unknown := _UNKNOWN.match(message):
            table = ".".join(map(str, field))
            return (*field, unknown[1]), message.replace(unknown[0], f"{unknown[0]} in [{table}]", 1)
    dotted = ".".join(str(part) for part in field if isinstance(part, str))
    if kind == "extra_forbidden":
        keys = _keys_of(scenario, field[:-1])
        close = difflib.get_close_matches(str(field[-1]), keys, 1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(keys)}"
        table = f"[{'.'.join(map(str, field[:-1]))}]" if len(field) > 1 else "the scenario"
        return field, f'unknown key "{field[-1]}" in {table}; {hint}'
    if kind == "missing":
        if len(field) == 1:
            return field, f"the table [{dotted}] is missing"
        example = "".join(f"; write for example {field[-1]} = {text}" for text in _examples_of(scenario, field))
        return field, f"{dotted} is missing{example}"
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", str(error["ctx"]["expected"]))
        close = difflib.get_close_matches(str(value), choices, 1)
        hint = f"; did you mean {close[0]}?" if close else ""
        return field, f'{dotted}: "{value}" is not one of {", ".join(choices)}{hint}'
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return field, f"{dotted} must be a table, written [{dotted}]"
    if kind in ("tuple_type", "list_type"):
        example = "".join(f"; write for example {field[-1]} = {text}" for text in _examples_of(scenario, field))
        return field, f"{dotted}: {value!r} must be a list in brackets{example}"
    if kind == "string_type":
        return field, f"{dotted}: {value!r} must be text in quotation marks"
    if message.startswith("must "):
        shown = f'"{value}"' if isinstance(value, str) else repr(value)
        message = f"{shown} {message}"
    return field, f"{dotted} {message}" if message.startswith(
        ("is missing", "has no meaning")
    ) else f"{dotted}: {message}"


def _keys_of(scenario: type[BaseModel], field: Sequence[str | int]) -> list[str]:
    """Return the keys that the table at `field` may have."""
    model = _model_at(scenario, field)
    return [] if model is None else [key for key in model.model_fields if key != "options"]


def _examples_of(scenario: type[BaseModel], field: Sequence[str | int]) -> list[str]:
    """Return examples of a key's value, from its model."""
    model = _model_at(scenario, field[:-1])
    info = None if model is None else model.model_fields.get(str(field[-1]))
    return [] if info is None else [str(text) for text in info.examples or ()]


def _model_at(scenario: type[BaseModel], field: Sequence[str | int]) -> type[BaseModel] | None:
    """Return the model of the table at `field`, or None if there is none."""
    model: type[BaseModel] | None = scenario
    named = False  # whether the part is the name of one of several tables
    for part in field:
        if named or isinstance(part, int):  # of a list
            named = False
            continue
        info = None if model is None else model.model_fields.get(str(part))
        kinds = [] if info is None else list(_kinds_in(info.annotation))
        model = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)
        named = str in kinds and model is not None
    return model


def _kinds_in(annotation: Any) -> Iterator[Any]:
    """Yield the types that make up an annotation."""
    yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _kinds_in(inner)


def _similar_file(file: Path) -> str:
    try:
        beside = [entry.name for entry in file.parent.glob("*.toml")]
    except OSError:
        return ""
    close = difflib.get_close_matches(file.name, beside, 1)
    return f"did you mean {file.with_name(close[0])}?" if close else ""
