"""File of a sweep: every cell comes back bit for bit, and a chunk that changed on the disk does not count as done."""

from __future__ import annotations

import zlib
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from palpate.errors import OutputError, PalpateError, PalpateWarning
from palpate.files.hdf5_input import read_seal
from palpate.sweeps import State, SweepError, merge, store, sweep
from palpate.sweeps.outcomes import QUANTITIES
from palpate.sweeps.plan import Plan
from palpate.sweeps.run import plan_of
from palpate.sweeps.store import FileStore, MemoryStore, read, tally
from resealed import reseal

SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "shape": "step", "force": ["-0.5 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "run": {"duration": "30 s"},
}


def plan(count: int = 250) -> Plan:
    """Return a plan of three chunks or more, the last of which is smaller."""
    over = {"object.damping": [0.0, 1.0], "object.stiffness": f"100 N/m..20 N/mm:{count}"}
    found = plan_of(SLIDER, over)
    assert found.chunks > 2
    assert found.count % found.chunk
    return found


def outcomes(of: Plan, seed: int = 0) -> dict[str, np.ndarray]:
    """Return random outcomes of all cells."""
    rng = np.random.default_rng(seed)
    return {
        name: rng.normal(size=(of.count, columns)[: 1 + (columns > 1)]) for name, (columns, _, _) in QUANTITIES.items()
    }


def chunk_of(of: Plan, chunk: int, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: rows[chunk * of.chunk : (chunk + 1) * of.chunk] for name, rows in values.items()}


def filled(path: Path, of: Plan, chunks: Any, values: dict[str, np.ndarray]) -> Path:
    with FileStore(path, of) as store:
        for chunk in chunks:
            store.put(chunk, chunk_of(of, chunk, values))
    return path


def test_cells_come_back_from_their_chunks_and_the_others_are_nan(tmp_path: Path) -> None:
    """In any order of the chunks, from a file or from memory, by name and by HDF5 itself."""
    of = plan()
    values, last = outcomes(of), of.chunks - 1
    path, memory = tmp_path / "a.h5", MemoryStore(of)
    filled(path, of, [last, 0], values)
    for chunk in (last, 0):
        memory.put(chunk, chunk_of(of, chunk, values))
    left = np.zeros(of.count, dtype=bool)
    left[of.chunk : last * of.chunk] = True
    same, stored, done = read(path)
    assert same.text() == of.text()
    assert done.tolist() == [True, *[False] * (last - 1), True]
    assert list(stored) == list(QUANTITIES)
    with h5py.File(path) as file:
        for name, rows in values.items():
            expected = rows.copy()
            expected[left] = np.nan
            for found in (stored[name].reshape(rows.shape), memory.values()[name], file[name][()]):
                np.testing.assert_array_equal(found, expected)
            assert stored[name].shape[:2] == of.shape
        assert np.count_nonzero(file["done"][()]) == 2
    assert memory.missing() == list(range(1, last))
    with FileStore(path, of) as store:
        assert store.missing() == list(range(1, last))


@pytest.mark.parametrize("name", list(QUANTITIES))
def test_a_chunk_that_changed_on_the_disk_is_found_and_run_again(name: str, tmp_path: Path) -> None:
    """One number of the second chunk: a read refuses the file, and the sweep goes on with that chunk alone."""
    of = plan()
    path = filled(tmp_path / "a.h5", of, range(of.chunks), outcomes(of))
    with h5py.File(path) as file:
        place = file[name].id.get_offset() + 8 * QUANTITIES[name][0] * (of.chunk + 1)
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    with pytest.raises(SweepError, match=f"1 of {of.chunks} chunks differ from their checksums, the first is 1; the "):
        read(path)
    with pytest.warns(PalpateWarning, match="1 chunks differ"), FileStore(path, of) as store:
        assert store.missing() == [1]
    assert read(path)[2].tolist() == [chunk != 1 for chunk in range(of.chunks)]


def test_shards_make_the_file_that_one_run_makes(tmp_path: Path) -> None:
    of, values = plan(), outcomes(plan())
    whole = filled(tmp_path / "whole.h5", of, range(of.chunks), values)
    even = filled(tmp_path / "even.h5", of, range(0, of.chunks, 2), values)
    odd = filled(tmp_path / "odd.h5", of, range(1, of.chunks, 2), values)
    assert merge([even, odd], tmp_path / "all.h5").read_bytes() == whole.read_bytes()
    with pytest.raises(SweepError, match=f"{len(range(1, of.chunks, 2))} chunks are done in none of these files"):
        merge([even, even], tmp_path / "half.h5")
    other = filled(tmp_path / "other.h5", plan(251), [], values)
    with pytest.raises(SweepError, match=r"other\.h5 is of another sweep than .*even\.h5"):
        merge([even, odd, other], tmp_path / "none.h5")
    assert not (tmp_path / "half.h5").exists()
    assert not (tmp_path / "none.h5").exists()
    with pytest.raises(SweepError, match="no files to put together"):
        merge([], tmp_path / "none.h5")


def test_a_file_whose_seal_leaves_out_other_ranges_than_its_datasets_is_refused(tmp_path: Path) -> None:
    of = plan()
    path = filled(tmp_path / "a.h5", of, [0], outcomes(of))
    later = read_seal(path, SweepError, "sweep").later
    assert len(later) == len(QUANTITIES) + 1
    for ranges, refused in ((later, False), (later[::-1], False), (later[1:], True), (later[:-1], True), ((), True)):
        with h5py.File(path, "r+"):
            pass  # without its seal
        reseal(path, ranges)
        if refused:
            with pytest.raises(SweepError, match="its datasets have other sizes or places than those of its sweep"):
                read(path)
        else:
            read(path)


def test_a_file_is_flushed_after_sixteen_megabytes_and_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[int] = []
    of = plan()
    size = sum(8 * columns for columns, _, _ in QUANTITIES.values())
    values = outcomes(of)
    with FileStore(tmp_path / "a.h5", of) as open_file:
        assert open_file.path == tmp_path / "a.h5"
        monkeypatch.setattr("palpate.sweeps.store.os.fsync", flushed.append)
        assert store._SYNC == 2**24
        monkeypatch.setattr(store, "_SYNC", 2 * size * of.chunk)
        counts = []
        for chunk in (0, 1, 2, 0, 1, 2):
            open_file.put(chunk, chunk_of(of, chunk, values))
            counts.append(len(flushed))
        assert counts == [0, 0, 1, 1, 1, 2]
    assert len(flushed) == 3
    assert len(set(flushed)) == 1


def test_a_disk_that_refuses_is_one_sentence_and_keeps_what_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of, values = plan(), outcomes(plan())
    path = tmp_path / "a.h5"
    told = f"{path}: cannot be written: No space left on device; what is done is kept"

    def refuse(*_: object) -> int:
        raise OSError(28, "No space left on device")

    open_file = FileStore(path, of)
    open_file.put(0, chunk_of(of, 0, values))
    with monkeypatch.context() as patch:
        patch.setattr("palpate.sweeps.store.write_at", refuse)
        with pytest.raises(OutputError) as caught:
            open_file.put(1, chunk_of(of, 1, values))
        assert str(caught.value) == told
        patch.setattr("palpate.sweeps.store.os.fsync", refuse)
        with pytest.raises(OutputError) as caught:
            open_file.close()
        assert str(caught.value) == told
    with FileStore(path, of) as again:  # the handle was closed, and its lock with it
        assert again.missing() == list(range(1, of.chunks))
    monkeypatch.setattr("palpate.sweeps.store._structure", lambda _: (of, {}))
    monkeypatch.setattr("palpate.sweeps.store.os.open", refuse)
    for opening, says in ((lambda: FileStore(path, of), "cannot be written"), (lambda: read(path), "cannot be read")):
        with pytest.raises(PalpateError) as refused:
            opening()
        assert str(refused.value) == f"{path}: {says}: No space left on device"


def test_a_sweep_goes_on_only_with_the_files_it_began_with(tmp_path: Path) -> None:
    """The cells of an earlier device, body or mesh came back as those of the present one, without a warning."""
    device, other = tmp_path / "one.toml", tmp_path / "other.toml"
    text = files("palpate.devices").joinpath("slider.toml").read_text("utf-8")
    for file in (device, other):
        file.write_text(text, "utf-8")
    tables = {**SLIDER, "device": {"name": str(device)}, "run": {"duration": "10 ms"}}
    cells = {"object.stiffness": ["1 N/mm", "2 N/mm"]}
    named = {"device.name": [str(device), str(other)]}
    for out, over, changed in (("fixed.h5", cells, device), ("varied.h5", named, other)):
        device.write_text(text, "utf-8")
        first = sweep(tables, over, out=tmp_path / out)
        np.testing.assert_array_equal(sweep(tables, over, out=tmp_path / out)["steady_tip"], first["steady_tip"])
        changed.write_text(text + "\n# measured again\n", "utf-8")
        with pytest.raises(SweepError, match=rf"{out}: .*{changed.name} has changed since it was run: give another"):
            sweep(tables, over, out=tmp_path / out)


def test_the_file_tells_other_programs_what_it_holds(tmp_path: Path) -> None:
    """Axes with their units and places in the shape, and the meaning of every data set."""
    tables = {**SLIDER, "title": "it"}
    of = plan_of(tables, {"object.coupling": ["backward", "bilinear"], "object.stiffness": [1.0, 2.0, 3.0]}, draws=2)
    path = filled(tmp_path / "a.h5", of, [], {})
    with h5py.File(path) as file:
        assert (file.attrs["sweep"], file.attrs["title"]) == (of.text(), "it")
        assert file.attrs["shape"].tolist() == [2, 3, 2]
        words, numbers = file["over/object.coupling"], file["over/object.stiffness"]
        assert [word.decode() for word in words[()]] == ["backward", "bilinear"]
        assert numbers[()].tolist() == [1.0, 2.0, 3.0]
        assert [(one.attrs["unit"], int(one.attrs["dimension"])) for one in (words, numbers)] == [("", 0), ("N/m", 1)]
        for name, (columns, unit, meaning) in QUANTITIES.items():
            data = file[name]
            assert (data.attrs["unit"], data.attrs["meaning"]) == (unit, meaning)
            assert data.shape == ((12, columns) if columns > 1 else (12,))
            assert np.isnan(data[()]).all()
        assert file["done"][()].tolist() == [0]
        assert file["done"].attrs["meaning"].startswith("of each chunk of cells: 0 not run, else 2^32 plus")
    for name in ("over", "done"):
        with pytest.raises(KeyError):
            read(path)[1][name]
    assert len(read(path)[1]) == len(QUANTITIES)


def test_the_mark_of_a_chunk_is_2_to_the_32_plus_the_crc_of_its_number_and_cells(tmp_path: Path) -> None:
    of, values = plan(), outcomes(plan())
    path = filled(tmp_path / "a.h5", of, [1], values)
    crc = zlib.crc32(b"1")
    for name in QUANTITIES:
        crc = zlib.crc32(np.ascontiguousarray(chunk_of(of, 1, values)[name], dtype="<f8").tobytes(), crc)
    with h5py.File(path) as file:
        assert file["done"][()].tolist() == [0, 2**32 + crc, *[0] * (of.chunks - 2)]


def test_the_states_of_a_file_are_counted(tmp_path: Path) -> None:
    of, values = plan(), outcomes(plan())
    values["verdict"] = np.arange(of.count) % 5 * 1.0
    path = filled(tmp_path / "a.h5", of, [0], values)
    counted = [int(np.count_nonzero(values["verdict"][: of.chunk] == state.value)) for state in State]
    assert tally(path) == counted
    assert sum(counted) == of.chunk


def test_space_for_all_cells_is_reserved_before_the_first_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    real = store.write_hdf5
    monkeypatch.setattr(store, "write_hdf5", lambda path, fill, reserve: asked.append(reserve) or real(path, fill))
    of = plan()
    filled(tmp_path / "a.h5", of, [], {})
    numbers = sum(columns for columns, _, _ in QUANTITIES.values())
    assert asked == [8 * numbers * of.count + 8 * of.chunks + 2 * len(of.text()) + 65536]
    assert (tmp_path / "a.h5").stat().st_size < asked[0]


def test_a_system_without_locks_writes_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of = plan()
    monkeypatch.setattr(store, "fcntl", None)
    with FileStore(tmp_path / "a.h5", of), FileStore(tmp_path / "a.h5", of) as other:
        assert other.missing() == list(range(of.chunks))

    def unsupported(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(store, "fcntl", SimpleNamespace(flock=unsupported, LOCK_EX=2, LOCK_NB=4))
    with FileStore(tmp_path / "a.h5", of) as alone:
        assert len(alone.missing()) == of.chunks
