"""The table of files by term in the architecture page names files that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_file_of_the_table_exists() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    table = page[page.index("Files by term") : page.index("Two concepts separate")]
    files = re.findall(r"^\| .+ \| `(\S+)` \|$", table, re.MULTILINE)
    assert len(files) >= 10
    folders = {".hpp": ROOT / "core" / "include" / "palpate", ".py": ROOT / "python" / "palpate"}
    assert [file for file in files if not (folders[Path(file).suffix] / file).is_file()] == []
