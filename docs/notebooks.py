"""Write the tutorials as Jupyter notebooks.

    python docs/notebooks.py [FOLDER]

Each Python block of a page becomes a code cell, the text between blocks a Markdown cell. The pages are the source.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
_BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def notebook(page: Path) -> dict[str, Any]:
    """Return the notebook (format 4.5) of a Markdown page."""
    cells: list[dict[str, Any]] = []
    for index, part in enumerate(_BLOCK.split(page.read_text("utf-8"))):
        source = part.strip("\n")
        if source:
            cell = {"id": f"{page.stem}-{index}", "metadata": {}, "source": source.splitlines(keepends=True)}
            code = {"cell_type": "code", "execution_count": None, "outputs": []}
            cells.append((code if index % 2 else {"cell_type": "markdown"}) | cell)
    return {"cells": cells, "metadata": {"kernelspec": _KERNEL}, "nbformat": 4, "nbformat_minor": 5}


def write_notebooks(folder: Path) -> list[Path]:
    """Write the notebook of each tutorial that has Python blocks; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        if _BLOCK.search(page.read_text("utf-8")):
            paths.append(folder / f"{page.stem}.ipynb")
            paths[-1].write_text(json.dumps(notebook(page), indent=1, ensure_ascii=False) + "\n", "utf-8")
    return paths


if __name__ == "__main__":
    for path in write_notebooks(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "_build" / "notebooks"):
        print(path)
