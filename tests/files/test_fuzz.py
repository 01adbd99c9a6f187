"""Fuzzing of every reader: a seeded part of `make fuzz`, and the files that once failed."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz import SHARES, run_case
from palpate.errors import PalpateError
from readers import Reader, readers

CORPUS = Path(__file__).parents[1] / "corpus"
FILES = sorted(file.relative_to(CORPUS) for file in CORPUS.rglob("*") if file.is_file())


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reader]:
    return readers(tmp_path_factory.mktemp("seeds"))


@pytest.mark.parametrize("file", FILES, ids=str)
def test_a_file_that_once_failed_is_read_or_refused(file: Path, known: dict[str, Reader]) -> None:
    sentence = "read"
    try:
        known[file.parts[0]].use(CORPUS / file)
    except PalpateError as problem:
        sentence = str(problem)
    assert sentence
    assert "\x1b" not in sentence
    assert file.suffix != ".h5" or "HDF5 can read" in sentence  # so a process with limits stood for this one


def test_a_mutated_file_is_read_or_refused(
    known: dict[str, Reader], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both happen, so the mutations are neither harmless nor hopeless."""
    monkeypatch.setattr("palpate.files.hdf5_input._try_in_process", lambda *_args: None)
    results: dict[str, set[str]] = {}
    for name, reader in known.items():
        for case in range(6 * SHARES.get(name, 1)):
            result = run_case(reader, tmp_path, f"20 {case}")
            assert result in ("read", "refused"), f"{name}, case {case}: {result}"
            results.setdefault(name, set()).add(result)
            for file in tmp_path.iterdir():
                file.unlink()
    assert set.union(*results.values()) == {"read", "refused"}
    assert results["scenario"] == results["device"] == {"read", "refused"}
