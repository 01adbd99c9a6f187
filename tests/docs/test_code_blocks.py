"""Every Python block of README.md and docs/ runs, page by page from top to bottom; every complete C++ program compiles.

A page is one program: its blocks share their names. It runs in an empty folder, without a network, and shows no
figure.
Pages in SLOW run in `make nightly` only (PALPATE_NIGHTLY=1).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from nightly import NIGHTLY
from scripts import run_program

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts)]
SLOW_PROGRAMS = {"docs/how-to/run-in-cpp.md"}
NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


def blocks(page: Path, language: str) -> list[tuple[int, str]]:
    """The code blocks of a page in a language, each with the line of the page at which its code begins."""
    text = page.read_text("utf-8")
    found = re.finditer(rf"^( *)```{language}\n(.*?)^\1```", text, re.MULTILINE | re.DOTALL)
    return [(text.count("\n", 0, match.start(2)) + 1, textwrap.dedent(match[2])) for match in found]


def program(page: Path) -> str:
    """The blocks of a page as one program, its lines at the lines of the page so that a traceback names them."""
    lines: list[str] = []
    for first, code in blocks(page, "python"):
        lines += [""] * (first - 1 - len(lines)) + code.splitlines()
    return "\n".join(lines)


def tabled(page: Path) -> list[str]:
    """The numbers in the columns of a page's tables whose head has a unit in parentheses."""
    found = []
    for head, rows in re.findall(r"^(\|.*)\n\|[-|]+\|\n((?:\|.*\n)+)", page.read_text("utf-8"), re.MULTILINE):
        columns = [i for i, cell in enumerate(head.split("|")) if "(" in cell]
        cells = [row.split("|")[i].strip() for row in rows.splitlines() for i in columns]
        found += [cell for cell in cells if re.fullmatch(NUMBER, cell)]
    return found


def half_digit(number: str) -> float:
    """Half a unit in the last digit of a number, and its rounding."""
    return 0.501 * 10.0 ** -len(number.partition(".")[2])


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=name)
def test_python_blocks_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And a tutorial prints every number of its tables with a unit in the head, to the last digit shown."""
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    run_program(program(page), str(page), tmp_path, monkeypatch)
    if page.parent.name == "tutorials":
        printed = [float(one) for one in re.findall(NUMBER, capsys.readouterr().out)]
        missing = [x for x in tabled(page) if not any(abs(y - float(x)) <= half_digit(x) for y in printed)]
        assert missing == []


PROGRAMS = [(page, line, code) for page in PAGES for line, code in blocks(page, "cpp") if "int main(" in code]


@pytest.mark.parametrize(("page", "line", "code"), PROGRAMS, ids=[f"{name(page)}:{line}" for page, line, _ in PROGRAMS])
def test_complete_cpp_programs_compile(page: Path, line: int, code: str, tmp_path: Path) -> None:
    if name(page) in SLOW_PROGRAMS and not NIGHTLY:
        pytest.skip("slow program: PALPATE_NIGHTLY=1 compiles it")
    source = tmp_path / "page.cpp"
    source.write_text(f'#line {line} "{page}"\n{code}', "utf-8")
    located = subprocess.run([sys.executable, "-m", "cmeel", "cmake"], capture_output=True, text=True, check=True)
    eigen = Path(located.stdout.strip().split(";")[0]) / "include" / "eigen3"
    options = [
        "-std=c++20",
        "-fsyntax-only",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-I",
        ROOT / "core" / "include",
        "-isystem",
        eigen,
    ]
    done = subprocess.run([os.environ.get("CXX", "c++"), *options, source], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
