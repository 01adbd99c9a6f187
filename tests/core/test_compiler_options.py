"""The headers compile without warnings, exceptions and run-time type information, by every installed compiler."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

INCLUDE = Path(__file__).parents[2] / "core" / "include"
HEADERS = sorted(path.relative_to(INCLUDE).as_posix() for path in INCLUDE.rglob("*.hpp"))
NAMES = ("g++", "g++-14", "g++-13", "g++-12", "clang++", "clang++-18", "clang++-16", "clang++-14", "clang-14")
# One name for each program: clang++ and clang-14 may be the same.
COMPILERS = sorted({Path(path).resolve(): name for name in reversed(NAMES) if (path := shutil.which(name))}.values())
OPTIONS = ["-x", "c++", "-std=c++20", "-fsyntax-only", "-fno-exceptions", "-fno-rtti"]
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]


@pytest.mark.parametrize("compiler", COMPILERS)
def test_all_headers_compile_without_warnings_exceptions_and_type_information(compiler: str, tmp_path: Path) -> None:
    located = subprocess.run([sys.executable, "-m", "cmeel", "cmake"], capture_output=True, text=True, check=True)
    eigen = Path(located.stdout.strip().split(";")[0]) / "include" / "eigen3"
    source = tmp_path / "all.cpp"
    source.write_text("".join(f"#include <{header}>\n" for header in HEADERS), "utf-8")
    command = [compiler, *OPTIONS, *WARNINGS, "-I", INCLUDE, "-isystem", eigen, source]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
