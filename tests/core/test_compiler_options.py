"""The headers compile without warnings, without exceptions and without run-time type information, by every compiler that is installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

INCLUDE = Path(__file__).parents[2] / "core" / "include"
COMPILERS = [name for name in ("g++", "clang++", "clang++-16", "clang++-14", "clang-14") if shutil.which(name)]
OPTIONS = "-x c++ -std=c++20 -fsyntax-only -fno-exceptions -fno-rtti -Wall -Wextra -Wconversion -Werror".split()


def headers(folder: str = "") -> list[str]:
    """The headers below a folder of the core, as programs include them."""
    return sorted(path.relative_to(INCLUDE).as_posix() for path in (INCLUDE / "palpate" / folder).rglob("*.hpp"))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_all_headers_compile_without_warnings_exceptions_and_type_information(compiler: str, tmp_path: Path) -> None:
    located = subprocess.run([sys.executable, "-m", "cmeel", "cmake"], capture_output=True, text=True, check=True)
    eigen = Path(located.stdout.strip().split(";")[0]) / "include" / "eigen3"
    source = tmp_path / "all.cpp"
    source.write_text("".join(f"#include <{header}>\n" for header in headers()), "utf-8")
    command = [compiler, *OPTIONS, "-I", INCLUDE, "-isystem", eigen, source]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
