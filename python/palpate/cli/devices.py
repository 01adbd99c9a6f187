"""`palpate devices`: catalog of devices, and the numbers of a device."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from palpate.cli.console import output
from palpate.errors import printable


def devices(
    name: Annotated[str | None, typer.Argument(help="Catalog name, or the path of your own TOML file.")] = None,
) -> None:
    """List the devices, or the numbers of one device with their units and sources.

    Example: palpate devices phantom-premium-1.5a
    """
    from palpate.devices import load, names
    from palpate.devices.catalog import read_numbers

    if name is None:
        table = Table("name", "degrees of freedom", "description", box=None, pad_edge=False)
        for known in names():
            device = load(known)
            table.add_row(known, str(device.dof), escape(device.description))
        output.print(table)
        output.print("\nYour own is a TOML file of the same kind: palpate devices path/to/file.toml", style="dim")
        return
    device = load(name)
    numbers = read_numbers(name)
    sources = list(dict.fromkeys(number.source for number in numbers))
    table = Table("number", "value", "source", "note", box=None, pad_edge=False)
    for number in numbers:
        mark = f"[{sources.index(number.source) + 1}]"
        table.add_row(*(escape(printable(text)) for text in (number.key, number.text, mark, number.note)))
    output.print(f"[bold]{escape(device.name)}[/]: {escape(device.description)}\n")
    output.print(table)
    output.print()
    for index, source in enumerate(sources, start=1):
        output.print(f"[{index}] {source}", markup=False, style="dim")
