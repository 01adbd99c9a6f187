"""The folders of the core's tests mirror those of its headers."""

from __future__ import annotations

from pathlib import Path

import pytest

CORE = Path(__file__).parents[2] / "core"
HEADERS = CORE / "include" / "palpate"
SOURCES = sorted(path.relative_to(CORE / "tests").as_posix() for path in (CORE / "tests").rglob("*_test.cpp"))


def headers_of(source: str) -> list[str]:
    """Return the headers that a test file is named after: `mesh/proxy_random_test.cpp` tests `mesh/proxy.hpp`."""
    folder, stem = HEADERS / Path(source).parent, Path(source).stem
    return [path.name for path in folder.glob("*.hpp") if stem.startswith(path.stem + "_")]


@pytest.mark.parametrize("source", SOURCES)
def test_a_test_file_lies_in_the_folder_of_its_header(source: str) -> None:
    assert headers_of(source)


def test_every_test_file_is_built() -> None:
    built = (CORE / "tests" / "CMakeLists.txt").read_text("utf-8").replace(")", " ").split()
    assert [source for source in SOURCES if source not in built] == []


def test_a_file_in_another_folder_is_found() -> None:
    assert headers_of("mesh/proxy_random_test.cpp") == ["proxy.hpp"]
    assert headers_of("object/proxy_random_test.cpp") == []
