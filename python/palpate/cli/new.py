"""`palpate new`: commented templates that load and run unchanged."""

from __future__ import annotations

import keyword
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import Annotated, Final

import typer

from palpate.cli.console import output
from palpate.errors import OutputError
from palpate.files import write_text


class Template(StrEnum):
    """What `palpate new` writes."""

    device = "device"
    scenario = "scenario"
    controller = "controller"


_FILES: Final = {
    Template.device: ("device.toml", ".toml", "palpate devices {file}"),
    Template.scenario: ("scenario.toml", ".toml", "palpate run {file}"),
    Template.controller: ("controller.txt", ".py", "python {file}"),
}


def new(
    kind: Annotated[Template, typer.Argument(help="What to write.")],
    name: Annotated[str, typer.Argument(help="Name of the device, scenario or controller, with or without a folder.")],
) -> None:
    """Write a commented template that works unchanged: NAME.toml, or NAME.py for a controller.

    Example: palpate new device my-slider
    """
    template, suffix, use = _FILES[kind]
    path = Path(name)
    path = path if path.suffix == suffix else path.with_name(path.name + suffix)
    stem = path.name.removesuffix(suffix)
    if not stem.replace("-", "").replace("_", "").replace(".", "").replace(" ", "").isalnum():
        raise OutputError(f"{name!r}: a name has letters, digits, spaces, '-', '_' and '.'")
    if kind is Template.controller and (not stem.isidentifier() or keyword.iskeyword(stem)):
        raise OutputError(f"{stem!r}: a controller is a Python module; use letters, digits and '_'")
    if path.exists():
        raise OutputError(f"{path}: a file of that name is there; choose another name, or delete it")
    text = resources.files("palpate.cli").joinpath("templates", template).read_text("utf-8")
    text = text.replace("{name}", stem).replace("{file}", str(path))
    write_text(path, text)
    output.print(f"{path}: try it with", use.format(file=path), markup=False, soft_wrap=True)
