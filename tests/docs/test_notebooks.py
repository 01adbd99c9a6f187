"""The notebooks of the tutorials hold the pages: their code, which test_code_blocks.py runs, and their text."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(path for path in (DOCS / "tutorials").glob("*.md") if "```python" in path.read_text("utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("notebooks")
    subprocess.run([sys.executable, DOCS / "notebooks.py", folder], check=True, stdout=subprocess.DEVNULL)
    return folder


def read(folder: Path, page: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / f"{page.stem}.ipynb").read_text("utf-8"))
    return found


def test_every_tutorial_with_code_has_a_notebook(folder: Path) -> None:
    assert sorted(path.stem for path in folder.iterdir()) == [page.stem for page in PAGES]
    assert len(PAGES) >= 6


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_cells_in_order_are_the_page(folder: Path, page: Path) -> None:
    found = read(folder, page)
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    cells = found["cells"]
    assert len({cell["id"] for cell in cells}) == len(cells)
    pieces = []
    for cell in cells:
        text = "".join(cell["source"])
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
            compile(text, cell["id"], "exec")
            text = f"```python\n{text}\n```"
        pieces.append(text)
    assert "\n\n".join(pieces).split() == page.read_text("utf-8").split()


def test_a_notebook_runs_cell_by_cell(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shortest tutorial; all pages run in test_code_blocks.py."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    for cell in read(folder, DOCS / "tutorials" / "stability-of-a-wall.md")["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert len(names) > 2
