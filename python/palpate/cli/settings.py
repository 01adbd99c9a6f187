"""The option --set KEY=VALUE of the commands that read a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from palpate.errors import ScenarioError
from palpate.files import load_toml

if TYPE_CHECKING:
    from palpate.scenario import Scenario

Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Use another value, as in object.stiffness="2 N/mm"; repeatable.'),
]


def load_scenario(path: Path, settings: Sequence[str] | None) -> Scenario:
    """Return the scenario of a file with the values of `settings`, "key=value", in place of its own.

    Raises:
        ScenarioError: as `Scenario.from_file`, or a setting has no "=".
    """
    from palpate.scenario import Scenario

    return Scenario.from_file(path, _values(settings or ()))


def _values(texts: Sequence[str]) -> dict[str, Any]:
    """Return the values by key: a number, list or flag of TOML, or else text."""
    settings: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ScenarioError(f'--set "{text}": write it as --set object.stiffness="2 N/mm"')
        try:
            settings[key.strip()] = load_toml(f"value = {value}", ScenarioError, "--set")["value"]
        except ScenarioError:
            settings[key.strip()] = value.strip()
    return settings
