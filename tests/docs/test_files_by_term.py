"""The architecture page names files, types, packages and dependencies as they are."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

from tests.test_import_graph import ORDER

ROOT = Path(__file__).parents[2]


def test_every_file_of_the_table_exists() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    table = page[page.index("Files by term") : page.index("Two concepts separate")]
    files = re.findall(r"^\| .+ \| `(\S+)` \|$", table, re.MULTILINE)
    assert len(files) >= 10
    folders = {".hpp": ROOT / "core" / "include" / "palpate", ".py": ROOT / "python" / "palpate"}
    assert [file for file in files if not (folders[Path(file).suffix] / file).is_file()] == []


PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
CORE = ROOT / "core" / "include" / "palpate"


def test_the_packages_are_in_the_order_of_their_imports() -> None:
    table = PAGE[PAGE.index("| package | contents |") : PAGE.index("A package imports only")]
    named = [
        name for cell in re.findall(r"^\| (`.+?`) \|", table, re.MULTILINE) for name in re.findall(r"`(\w+)`", cell)
    ]
    assert named == [name for name in ORDER if not name.startswith("_")]


def test_a_folder_of_the_core_includes_only_those_with_an_arrow_to_it() -> None:
    text = PAGE[PAGE.index("Allowed dependencies") :].split("```")[1]
    allowed: dict[str, set[str]] = {folder.name: set() for folder in CORE.iterdir() if folder.is_dir()}
    everything = set(allowed)
    for line in text.splitlines()[1:]:
        for before, after in pairwise(re.split(r" → ", line)):
            allowed[after.strip()] |= everything if "all of these" in before else set(re.findall(r"\w+", before))
    for _ in allowed:  # what a folder includes may include others
        allowed = {name: own.union(*(allowed[other] for other in own)) for name, own in allowed.items()}
    for path in CORE.glob("*/**/*.hpp"):
        folder = path.relative_to(CORE).parts[0]
        included = set(re.findall(r"#include [<\"]palpate/(\w+)/", path.read_text("utf-8")))
        assert included <= {folder, *allowed[folder]}, path.name


def test_the_types_of_a_folder_are_declared_in_it() -> None:
    rows = re.findall(r"^\| `([a-z_/]+)/` \| \w+ \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) >= 15
    for folder, types in rows:
        text = "\n".join(path.read_text("utf-8") for path in (CORE / folder).glob("*.hpp"))
        missing = [
            name for name in re.findall(r"`(\w+)`", types) if not re.search(rf"\b{name}\b *[;{{(:=<]|\b{name}$", text)
        ]
        assert missing == [], folder
