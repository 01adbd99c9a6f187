"""HDF5 files: written whole on any disk, checked before they are parsed, read within their own size."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from one_node import one_node
from palpate import fem
from palpate.errors import OutputError, PalpateError, RecordingError
from palpate.fem.errors import BodyError
from palpate.files import hdf5_input, hdf5_output
from palpate.files.hdf5_input import Hdf5Reader, check_hdf5, open_foreign, open_sealed, read_everything, read_seal
from palpate.identification.recording import Recording
from palpate.simulation.trace import Trace, TraceError
from palpate.sweeps import SweepError, merge, open_sweep
from palpate.sweeps.plan import Plan
from palpate.sweeps.run import plan_of
from palpate.sweeps.store import FileStore, tally
from resealed import changed, reseal

N = 60
SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "start": {"pose": ["0 m"]},
    "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "100 N/m"},
    "run": {"duration": "0.01 s"},
}


def trace() -> Trace:
    return Trace.of(np.arange(N) * 1e-3, {"tip": np.ones((N, 3))}, metadata={"version": "1"})


def recording() -> Recording:
    time, wave = np.arange(N) * 1e-3, np.sin(np.arange(N))
    return Recording(time, wave[:, None], wave[:, None])


def sweep_file(path: Path) -> Path:
    plan = plan_of(SLIDER, {"object.stiffness": [100.0, 200.0]})
    with FileStore(path, plan) as store:
        store.put(0, plan.run(0, 2))
    return path


WRITE: dict[str, Callable[[Path], object]] = {
    "trace": lambda path: trace().save(path),
    "recording": lambda path: recording().save(path),
    "body": lambda path: one_node(100.0, path),
    "sweep": sweep_file,
}
READ: dict[str, Callable[[Path], object]] = {
    "trace": Trace.load,
    "recording": Recording.load,
    "body": fem.load,
    "sweep": open_sweep,
}


@pytest.mark.parametrize("kind", WRITE)
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_the_nth_write_that_fails_is_one_sentence(
    kind: str, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever it is; the interpreter lives, no file is left, and the next attempt succeeds."""
    real, made, failing = os.pwrite, 0, 0

    def pwrite(handle: int, data: bytes, offset: int) -> int:
        nonlocal made
        made += 1
        if failing and made >= failing:
            raise OSError(number, os.strerror(number))
        return real(handle, data, offset)

    monkeypatch.setattr(os, "pwrite", pwrite)
    WRITE[kind](tmp_path / "a.h5")
    for failing in range(1, made + 1):  # noqa: B007
        made = 0
        (tmp_path / "a.h5").unlink(missing_ok=True)
        with pytest.raises(OutputError, match=rf"^[^\n]*a\.h5: cannot be written: {os.strerror(number)}[^\n]*$"):
            WRITE[kind](tmp_path / "a.h5")
        assert {file.name for file in tmp_path.iterdir()} <= ({"a.h5"} if kind == "sweep" else set())
    failing = 0
    WRITE[kind](tmp_path / "a.h5")
    READ[kind](tmp_path / "a.h5")


@pytest.mark.parametrize("kind", ["trace", "body"])
def test_a_write_that_fails_once_is_reported_although_all_later_ones_succeed(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first problem is the one that is reported, and no file with a gap is left."""
    real, made, failing = os.pwrite, 0, 0

    def pwrite(handle: int, data: bytes, offset: int) -> int:
        nonlocal made
        made += 1
        if made == failing:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return real(handle, data, offset)

    monkeypatch.setattr(os, "pwrite", pwrite)
    WRITE[kind](tmp_path / "a.h5")
    for failing in {1, made // 2, made - 1, made}:  # noqa: B007
        made = 0
        (tmp_path / "a.h5").unlink(missing_ok=True)
        with pytest.raises(OutputError, match=rf"a\.h5: cannot be written: {os.strerror(errno.EIO)}"):
            WRITE[kind](tmp_path / "a.h5")
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["trace", "body", "sweep"])
def test_a_changed_byte_anywhere_is_detected(kind: str, tmp_path: Path) -> None:
    """The seal covers every byte but the cells of a sweep, and each chunk of those has a checksum."""
    WRITE[kind](tmp_path / "a.h5")
    whole = (tmp_path / "a.h5").read_bytes()
    places = np.random.default_rng(5).choice(len(whole), 150, replace=False)
    for place in [*places.tolist(), 0, len(whole) - 1]:
        broken = bytearray(whole)
        broken[place] ^= 1 << (place % 8)
        (tmp_path / "b.h5").write_bytes(broken)
        with pytest.raises(PalpateError, match=r"^[^\n]+$"):
            READ[kind](tmp_path / "b.h5")
    for size in (0, 7, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "b.h5").write_bytes(whole[:size])
        with pytest.raises(PalpateError, match=r"^[^\n]+$"):
            READ[kind](tmp_path / "b.h5")


def test_a_damaged_chunk_is_run_again(tmp_path: Path) -> None:
    path = sweep_file(tmp_path / "a.h5")
    before = path.read_bytes()
    with h5py.File(path) as file:
        place = file["ripple"].id.get_offset()
    path.write_bytes(before[: place + 8] + b"\1" + before[place + 9 :])
    with pytest.raises(SweepError, match=r"1 of 1 chunks differ from their checksums"):
        open_sweep(path)
    with pytest.raises(SweepError, match="differ from their checksums"):
        merge([path], tmp_path / "b.h5")
    with pytest.warns(UserWarning, match="1 chunks differ from their checksums; they are run again"):
        palpate_sweep(path)
    assert path.read_bytes() == before


def palpate_sweep(path: Path) -> None:
    from palpate.sweeps import sweep

    sweep(SLIDER, {"object.stiffness": [100.0, 200.0]}, out=path)


Damage = Callable[[h5py.File], None]


def _replace(name: str, value: Any) -> Damage:
    def damage(file: h5py.File) -> None:
        if name in file:
            del file[name]
        if value is not None:
            file[name] = value

    return damage


def _attribute(key: str, value: Any) -> Damage:
    def damage(file: h5py.File) -> None:
        if key in file.attrs:
            del file.attrs[key]
        if value is not None:
            file.attrs[key] = value

    return damage


def _bomb(name: str) -> Damage:
    def damage(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape=(30000, 30000), chunks=(3000, 3000), compression="gzip", dtype="f8")

    return damage


def _external(name: str) -> Damage:
    def damage(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape=(100,), dtype="u1", external=[("/etc/passwd", 0, 100)])

    return damage


def _virtual(name: str) -> Damage:
    def damage(file: h5py.File) -> None:
        del file[name]
        layout = h5py.VirtualLayout((60, 3), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", (60, 3))
        file.create_virtual_dataset(name, layout)

    return damage


def _itself(name: str) -> Damage:
    def damage(file: h5py.File) -> None:
        del file[name]
        group = file.create_group(name)
        group[name.rsplit("/", maxsplit=1)[-1]] = group

    return damage


def _anywhere(name: str) -> list[tuple[str, Damage]]:
    """Return the damages that any data set may have."""
    return [
        *([(name, _replace(name, None))] if name not in ("channels/tip", "metadata/version") else []),
        (name, _replace(name, h5py.SoftLink("/elsewhere"))),
        (name, _replace(name, h5py.ExternalLink("/dev/zero", "/x"))),
        (name, _replace(name, h5py.Empty("f8"))),
        (name, _replace(name, "text")),
        (name, _replace(name, 3.0)),
        (name, _replace(name, np.zeros(3, dtype=[("a", "f8"), ("b", "i4")]))),
        (name, _replace(name, np.zeros((2, 2, 2)))),
        (name, _replace(name, np.zeros(3, dtype="c16"))),
        (name, _bomb(name)),
        (name, _external(name)),
        (name, _virtual(name)),
        (name, _itself(name)),
    ]


_PLAN = json.loads(plan_of(SLIDER, {"object.stiffness": [100.0, 200.0]}).text())
DAMAGES: list[tuple[str, str, Damage]] = [
    *(("trace", *damage) for name in ("time", "channels/tip", "metadata/version") for damage in _anywhere(name)),
    *(("body", *damage) for name in ("points", "compliance") for damage in _anywhere(name)),
    *(("recording", *damage) for name in ("time", "angle") for damage in _anywhere(name)),
    *(("sweep", *damage) for name in ("done", "verdict") for damage in _anywhere(name)),
    *(
        (kind, f"{key} = {str(value)[:20]}", _attribute(key, value))
        for kind, key, values in (
            ("trace", "format", (None, 3, h5py.Empty("S1"), np.zeros(3))),
            ("trace", "unstable_from", ("text", np.nan, np.zeros(3))),
            ("body", "record", (None, 3, "[]", "{}", "[" * 9999, '{"source": "x", "density_kg_per_m3": "heavy"}')),
            ("body", "record", ('{"source": 3}', '{"source": "x", "seconds": [1]}', '{"source": "x", "fixed": "y"}')),
            ("body", "version", (None, "text", 9)),
            ("recording", "period", ("text", np.nan, np.zeros(3))),
            ("recording", "metadata", ("[]", "{", '{"a": ' + "9" * 5000 + "}")),
            ("sweep", "sweep", (None, 3, "", "not JSON", "[]", "{}", '{"tables": {}, "over": []}', "[" * 9999)),
            ("sweep", "sweep", tuple(json.dumps({**_PLAN, key: None}) for key in _PLAN)),
            ("sweep", "sweep", (json.dumps({**_PLAN, "draws": 10**9}), json.dumps({**_PLAN, "over": [["a", "b"]]}))),
        )
        for value in values
    ),
]


@pytest.mark.parametrize(("kind", "_place", "damage"), DAMAGES)
def test_a_file_of_another_structure_is_refused(
    kind: str, _place: str, damage: Damage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Although its seal is right, so that HDF5 parses it. A process of its own would only hide a failure."""
    monkeypatch.setattr("palpate.files.hdf5_input._try_in_process", lambda *_args: None)
    path = tmp_path / "a.h5"
    WRITE[kind](path)
    with changed(path) as file:
        later = (
            ()
            if kind != "sweep"
            else [(file[name].id.get_offset(), file[name].id.get_storage_size()) for name in file if name != "over"]
        )
        damage(file)
    path.write_bytes(path.read_bytes().partition(hdf5_output.SEAL)[0])
    reseal(path, later)
    with pytest.raises(PalpateError, match=r"a\.h5"):
        READ[kind](path)


def test_only_files_that_a_digest_names_are_read_once_by_a_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file without a seal is read each time, and one whose digest leaves out cells too."""
    tried: list[str] = []
    monkeypatch.setattr("palpate.files.hdf5_input._try_in_process", lambda path, *_args: tried.append(path.name))
    monkeypatch.setattr("palpate.files.hdf5_input.known_digests", set())
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1.0
    for kind, name in (("trace", "sealed.h5"), ("sweep", "cells.h5")):
        WRITE[kind](tmp_path / name)
    tried.clear()
    for name in ("foreign.h5", "sealed.h5", "cells.h5"):
        for _ in range(3):
            open_foreign(tmp_path / name, OutputError, "thing").__exit__(None, None, None)
    assert [tried.count(name) for name in ("foreign.h5", "sealed.h5", "cells.h5")] == [3, 1, 3]


@pytest.mark.parametrize("name", ["data", "group/data"])
def test_a_damaged_chunk_is_found_in_a_group_too(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        data = file.create_dataset(name, data=np.arange(200.0), chunks=(200,), compression="gzip")
        place = data.id.get_chunk_info(0)
    assert read_everything(path) == ""
    whole = path.read_bytes()
    path.write_bytes(whole[: place.byte_offset] + bytes(place.size) + whole[place.byte_offset + place.size :])
    assert read_everything(path) != ""


def test_the_handles_of_files_are_closed(tmp_path: Path) -> None:
    def lowest() -> int:
        handle = os.open(tmp_path, os.O_RDONLY)
        os.close(handle)
        return handle

    trace().save(tmp_path / "a.h5")
    before = lowest()
    read_seal(tmp_path / "a.h5", OutputError, "trace")
    assert lowest() == before


def test_reserved_space_that_is_not_used_is_given_back(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file["x"] = np.arange(9.0)

    plain = hdf5_output.write_hdf5(tmp_path / "a.h5", fill).stat().st_size
    assert hdf5_output.write_hdf5(tmp_path / "b.h5", fill, reserve=1_000_000).stat().st_size == plain


def test_external_data_are_not_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("time", "angle", "torque"):
            data = file.create_dataset(name, shape=(100,), dtype="u1", external=[("/etc/passwd", 0, 100)])
            data.attrs["unit"] = {"time": "s", "angle": "rad", "torque": "N*m"}[name]
    with pytest.raises(RecordingError, match="time lies in another file"):
        Recording.load(tmp_path / "a.h5")


def test_a_recording_of_another_program_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, unit in (("time", "s"), ("angle", "rad"), ("torque", "N*m")):
            file[name] = np.arange(N) * 1e-3 if name == "time" else np.sin(np.arange(N))
            file[name].attrs["units"] = unit
    assert np.array_equal(Recording.load(tmp_path / "a.h5").angle[:, 0], np.sin(np.arange(N)))


@pytest.mark.parametrize(
    ("program", "sentence"),
    [
        ("while True: pass", "HDF5 can read: it took too long"),
        ("import os; os.abort()", "HDF5 can read: the process was killed by signal 6"),
    ],
)
def test_hdf5_that_hangs_or_crashes_is_one_sentence(
    program: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = np.arange(N)
    monkeypatch.setattr("palpate.files.hdf5_input._PROGRAM", program)
    monkeypatch.setattr("palpate.files.hdf5_input._SECONDS", 1)
    with pytest.raises(RecordingError, match=sentence):
        Recording.load(tmp_path / "a.h5")


def test_an_interrupt_within_hdf5_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It arrives after HDF5 has closed its file."""
    path = trace().save(tmp_path / "a.h5")
    before = path.read_bytes()

    def interrupted(*_args: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "pwrite", interrupted)
    with pytest.raises(KeyboardInterrupt):
        trace().save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.h5"]


def test_an_interpreter_lives_after_a_full_disk(tmp_path: Path) -> None:
    """The system refuses writes beyond 40 kB; HDF5 itself would crash when the interpreter ends."""
    code = (
        "import resource, signal, numpy as np\n"
        "from palpate.simulation.trace import Trace\n"
        "from palpate.errors import OutputError\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))\n"
        "values = np.random.default_rng(1).normal(size=(9999, 3))\n"
        "try: Trace.of(np.arange(9999.0), {'tip': values}).save('a.h5')\n"
        "except OutputError as problem: print(problem)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "a.h5: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_or_partial_file_does_not_hide_its_kind(tmp_path: Path) -> None:
    trace().save(tmp_path / "trace.h5")
    with pytest.raises(SweepError, match="is not the file of a sweep"):
        tally(tmp_path / "trace.h5")
    with pytest.raises(BodyError, match="not a body"):
        fem.load(tmp_path / "trace.h5")
    sweep_file(tmp_path / "sweep.h5")
    with pytest.raises(TraceError, match="not a trace"):
        Trace.load(tmp_path / "sweep.h5")
    with pytest.raises(SweepError, match="not JSON"):
        Plan.of_text("")


def test_a_reader_refuses_what_is_of_another_kind(tmp_path: Path) -> None:
    """Type, size of an element, dimensions, text and attributes; and reads what is right."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["numbers"] = np.arange(6.0).reshape(2, 3)
        file["letters"] = np.array([b"ab", b"cd"])
        file["wide"] = np.arange(3, dtype=np.longdouble)
        file["scalar"] = 3.0
        file["words"] = "Δ"
        file["chunked"] = h5py.Empty("f8")
        file.create_group("group")
        file.attrs.update({"text": "Δ", "number": 2, "truth": True, "list": [1.0, 2.0]})
    with Hdf5Reader(path, OutputError, "thing", "make it again") as reader:
        np.testing.assert_array_equal(reader.array("numbers", "f", 2), np.arange(6.0).reshape(2, 3))
        assert (reader.text("words"), reader.text_attribute("text"), reader.number_attribute("number")) == (
            "Δ",
            "Δ",
            2.0,
        )
        assert reader.text_attribute("none", default="d") == "d"
        assert (reader.has("numbers"), reader.has("group"), reader.has("none")) == (True, False, False)
        assert reader.names("none", optional=True) == []
        begin, size = reader.place("numbers", "<f8")
        assert path.read_bytes()[begin : begin + size] == np.arange(6.0).tobytes()
        wrong: list[tuple[Callable[[], object], str]] = [
            (lambda: reader.array("letters"), "letters has the type"),
            (lambda: reader.array("wide"), "wide has the type"),
            (lambda: reader.array("numbers", "i"), "numbers has the type float64"),
            (lambda: reader.array("numbers", "f", 1), r"numbers has the shape \(2, 3\)"),
            (lambda: reader.array("scalar"), r"scalar has the shape \(\)"),
            (lambda: reader.array("chunked"), "chunked has the shape None"),
            (lambda: reader.text("numbers"), "numbers is no text"),
            (lambda: reader.text("letters"), "letters is no text"),
            (lambda: reader.text_attribute("number"), "the attribute number of / is no text"),
            (lambda: reader.number_attribute("text"), "the attribute text of / is no number"),
            (lambda: reader.number_attribute("truth"), "the attribute truth of / is no number"),
            (lambda: reader.number_attribute("list"), "the attribute list of / has the shape"),
            (lambda: reader.names("numbers"), "numbers is no group"),
            (lambda: reader.names("none"), "none is missing"),
            (lambda: reader.place("numbers", "<f4"), "numbers is not contiguous, or not of the type <f4"),
        ]
        for read, says in wrong:
            with pytest.raises(OutputError, match=f"not a complete thing: {says}.*; make it again"):
                read()


@pytest.mark.parametrize(("options", "known"), [
    ({}, True), ({"compression": "gzip"}, True), ({"compression": "gzip", "shuffle": True, "fletcher32": True}, True),
    ({"compression": "lzf"}, False), ({"scaleoffset": 3}, False), ({"compression": "lzf", "shuffle": True}, False),
])  # fmt: skip
def test_data_compressed_by_other_filters_is_refused(options: dict[str, Any], known: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=np.arange(200.0), chunks=(100,), **options)
    with open_foreign(path, OutputError, "thing") as found:
        if known:
            np.testing.assert_array_equal(found.array("x"), np.arange(200.0))
        else:
            with pytest.raises(OutputError, match="x is compressed in an unknown way"):
                found.array("x")


def test_what_hdf5_writes_one_after_the_other_lies_one_after_the_other(tmp_path: Path) -> None:
    """A file that keeps its position, its size and its first failure; a read beyond the end is zero."""
    handle = os.open(tmp_path / "a", os.O_RDWR | os.O_CREAT)
    try:
        sink = hdf5_output._Sink(handle)
        assert sink.readable()
        assert sink.writable()
        assert sink.seekable()
        assert (sink.write(b"abc"), sink.write(np.arange(2, dtype="u1")), sink.tell(), sink.size) == (3, 2, 5, 5)
        assert (sink.seek(1), sink.seek(2, os.SEEK_CUR), sink.seek(-2, os.SEEK_END)) == (1, 3, 3)
        sink.seek(1)
        found = bytearray(3)
        assert (sink.readinto(found), sink.readinto(found[:0]), sink.tell()) == (3, 0, 4)
        assert bytes(found) == b"bc\0"
        assert sink.readinto(found) == 3
        assert bytes(found) == b"\1\0\0"
        assert (sink.seek(2), sink.truncate(), sink.size, sink.truncate(9), sink.size) == (2, 2, 2, 9, 9)
        assert sink.problem is None
    finally:
        os.close(handle)
    assert (sink.write(b"x"), sink.size) == (1, 9)
    first = sink.problem
    assert isinstance(first, OSError)
    sink.readinto(bytearray(1))
    assert sink.problem is first


def test_a_digest_covers_the_size_the_ranges_and_all_bytes_outside_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ranges may overlap, touch, be empty and come in any order; the seal states them."""
    monkeypatch.setattr(hdf5_output, "_BLOCK", 7)
    data = np.random.default_rng(0).bytes(100)
    (tmp_path / "a").write_bytes(data)
    handle = os.open(tmp_path / "a", os.O_RDONLY)
    try:
        for later in ([], [(0, 5)], [(95, 5)], [(50, 10), (20, 15), (55, 3)], [(10, 10), (20, 5), (30, 0)], [(0, 100)]):
            kept = np.ones(100, dtype=bool)
            for offset, length in later:
                kept[offset : offset + length] = False
            outside = np.frombuffer(data, dtype="u1")[kept].tobytes()
            expected = hashlib.sha256(repr((100, later)).encode() + outside).hexdigest()
            assert hdf5_output.digest(handle, 100, later) == expected
            ranges = ",".join(f"{one}+{two}" for one, two in later) or "-"
            assert hdf5_output.seal(handle, later) == f"\npalpate seal sha256 {expected} {ranges}\n".encode()
        assert hdf5_output.digest(handle, 101, []) == ""
    finally:
        os.close(handle)


def test_a_system_that_writes_few_bytes_at_a_time_writes_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda handle, data, offset: real(handle, data[:3], offset))
    handle = os.open(tmp_path / "a", os.O_RDWR | os.O_CREAT)
    try:
        hdf5_output.write_at(handle, 2, np.arange(5, dtype="<u2"))
    finally:
        os.close(handle)
    assert (tmp_path / "a").read_bytes() == b"\0\0" + np.arange(5, dtype="<u2").tobytes()


def test_space_is_reserved_from_the_beginning_and_the_digest_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, ...]] = []
    monkeypatch.setattr(os, "posix_fallocate", lambda _handle, *range_: asked.append(range_))

    def fill(file: Any) -> None:
        file["x"] = np.arange(9.0)

    path = hdf5_output.write_hdf5(tmp_path / "a.h5", fill)
    assert asked == []
    assert hdf5_output.write_hdf5(path, fill, reserve=5000) == path
    assert asked == [(0, 5000)]
    found = read_seal(path, OutputError, "thing")
    assert found.later == ()
    assert found.digest in hdf5_output.known_digests
    assert f" {found.digest} -\n".encode() == path.read_bytes()[-68:]


def _sealed(path: Path, content: bytes, later: list[tuple[int, int]]) -> None:
    path.write_bytes(content)
    reseal(path, later)


def refused(read: Callable[[], object]) -> str:
    with pytest.raises(OutputError) as caught:
        read()
    return str(caught.value)


def test_a_seal_is_found_at_the_end_of_a_file_of_any_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has at most 4096 bytes; what it leaves out is told in its order."""
    path, later = tmp_path / "a", [(3, 2), (0, 1)]
    for content in (b"", b"x", b"x" * 4096, b"x" * 20_000):
        ranges = later if len(content) > 5 else []
        _sealed(path, content, ranges)
        assert read_seal(path, OutputError, "thing").later == tuple(ranges)
        path.write_bytes(path.read_bytes() + b"x")
        assert refused(lambda: read_seal(path, OutputError, "thing")) == (
            f"{path}: not a complete thing: no checksum at its end: truncated, changed by another program, or of "
            "another version"
        )
    _sealed(path, b"xxxx", [])
    path.write_bytes(b"y" + path.read_bytes()[1:])
    differs = f"{path}: not a complete thing: it is damaged: its content differs from its checksum"
    assert refused(lambda: read_seal(path, OutputError, "thing")) == differs
    assert refused(lambda: read_seal(path, OutputError, "thing", "make it")) == f"{differs}; make it"
    for size in (4096, 4097):
        left = size - len(hdf5_output.SEAL) - 64 - 1  # "1000+1," or "100+1," each, the last with a line feed
        count = -(-left // 7)
        many = [(100 if number < 7 * count - left else 1000, 1) for number in range(count)]
        _sealed(path, b"x" * 2000, many)
        assert path.stat().st_size == 2000 + size
        if size == 4096:
            assert read_seal(path, OutputError, "thing").later == tuple(many)
        else:
            assert "no checksum at its end" in refused(lambda: read_seal(path, OutputError, "thing"))

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    assert refused(lambda: read_seal(path, OutputError, "thing")) == f"{path}: cannot be read: Permission denied"


def test_a_process_that_reads_a_file_first_has_limits_that_grow_with_its_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """4 s and 1 GB, a second more for each 50 MB, and eight bytes for each of the file."""
    asked: list[Any] = []
    monkeypatch.setattr(hdf5_input, "try_isolated", lambda *what, **limits: asked.append((what, limits)))
    path = tmp_path / "a"
    path.touch()
    for size, seconds in ((0, 4), (49_999_999, 4), (120_000_000, 6)):
        os.truncate(path, size)
        hdf5_input._try_in_process(path, OutputError, "thing")
        limits = {"seconds": seconds, "memory": 1_000_000_000 + 8 * size}
        assert asked.pop() == ((hdf5_input._PROGRAM, str(path)), limits)


def test_a_file_of_another_kind_is_refused_before_hdf5_sees_it(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    for otherwise, end in (("", ""), ("make it", "; make it")):
        assert refused(lambda: check_hdf5(path, OutputError, "thing", otherwise)) == (  # noqa: B023
            f"{path}: there is no such file{end}"
        )
    path.write_bytes(b"")
    assert refused(lambda: check_hdf5(path, OutputError, "thing")) == f"{path}: an empty file, so not a thing"
    path.write_bytes(b"x")
    assert refused(lambda: check_hdf5(path, OutputError, "thing")) == f"{path}: not an HDF5 file, so not a thing"
    assert refused(lambda: check_hdf5(tmp_path, OutputError, "thing")) == (
        f"{tmp_path}: a folder; give the thing's file (.h5) in it"
    )
    with h5py.File(path, "w"):
        pass
    assert check_hdf5(path, OutputError, "thing") == path


def test_a_file_that_the_caller_has_open_with_locks_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(3.0)
    with h5py.File(path, "r"), Hdf5Reader(path, OutputError, "thing") as reader:
        assert reader.names() == ["x"]
        assert reader.later == ()
    with open_foreign(path, OutputError, "thing") as reader:
        assert reader.later == ()
    path.write_bytes(b"x" * 100)
    told = refused(lambda: Hdf5Reader(path, OutputError, "thing"))
    assert told.startswith(f"{path}: not a complete thing: Unable to")
    assert read_everything(path) == told.removeprefix(f"{path}: not a complete thing: ")


def test_what_a_reader_may_read_is_bounded_by_the_size_of_the_file(tmp_path: Path) -> None:
    """256 bytes of data for each byte of the file, and 16 MiB in any case; a chunk is read whole."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(6.0)
        file["half"] = np.arange(3, dtype="f4")
        file.create_dataset("chunked", data=np.arange(10.0), chunks=(100,), maxshape=(None,), compression="gzip")
        file.create_dataset("unwritten", shape=(100,), dtype="f8")
        file.create_dataset("none", data=np.empty((0, 3)))
    with Hdf5Reader(path, OutputError, "thing") as reader:
        assert reader._left == 2**24 + 256 * path.stat().st_size
        begins = f"{path}: not a complete thing: "
        for name, needed, size in (("x", 48, 48), ("half", 12, 12), ("chunked", 800, 80)):
            reader._left = needed
            reader.array(name)
            assert reader._left == 0
            reader._left = needed - 1
            told = refused(lambda: reader.array(name))  # noqa: B023
            assert told == f"{begins}{name} declares {size} bytes, far more than the file has"
        reader._left = 1000
        assert refused(lambda: reader.array("unwritten")) == f"{begins}unwritten declares 800 bytes and has 0"
        assert reader.array("none").shape == (0, 3)
        assert reader._left == 1000
        assert refused(lambda: reader.array("x/y")) == f"{begins}x/y is missing"
        assert refused(lambda: reader.array("/")) == f"{begins}/ is no data set"
        assert refused(lambda: reader.place("chunked", "<f8")) == (
            f"{begins}chunked is not contiguous, or not of the type <f8"
        )
        assert sorted(reader.names()) == ["chunked", "half", "none", "unwritten", "x"]
        assert reader.broken == ""


def test_a_group_has_a_thousand_names_at_most(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for number in range(1000):
            file.create_group(f"most/{number:04}")
        for number in range(1001):
            file.create_group(f"more/{number:04}")
    with Hdf5Reader(path, OutputError, "thing") as reader:
        assert reader.names("most") == [f"{number:04}" for number in range(1000)]
        assert refused(lambda: reader.names("more")) == f"{path}: not a complete thing: more has 1001 entries"
        assert refused(lambda: reader.names("none", optional=False)).endswith("none is missing")


def test_an_attribute_is_a_text_or_a_number_of_bounded_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1.0
        for key, value in (("bytes", np.bytes_(b"ab\xff")), ("real", np.float32(0.5)), ("whole", np.int8(3))):
            file["x"].attrs[key] = value
        file["x"].attrs["truth"] = np.bool_(True)
        file["x"].attrs["letters"] = np.bytes_(b"123456")
    with Hdf5Reader(path, OutputError, "thing") as reader:
        assert reader.text_attribute("bytes", "x") == "ab\ufffd"
        assert (reader.number_attribute("real", "x"), reader.number_attribute("whole", "x")) == (0.5, 3.0)
        assert reader.number_attribute("none", "x", 7) == 7.0
        begins = f"{path}: not a complete thing: "
        for read, says in (
            (lambda: reader.number_attribute("truth", "x"), "the attribute truth of x is no number"),
            (lambda: reader.number_attribute("bytes", "x"), "the attribute bytes of x is no number"),
            (lambda: reader.number_attribute("none", "x"), "the attribute none of x is missing"),
            (lambda: reader.text_attribute("none", "y", "default"), "y is missing"),
        ):
            assert refused(read) == begins + says
        monkeypatch.setattr(hdf5_input, "_TEXT_LIMIT", 6)
        assert reader.text_attribute("letters", "x") == "123456"
        monkeypatch.setattr(hdf5_input, "_TEXT_LIMIT", 5)
        assert refused(lambda: reader.text_attribute("letters", "x")) == (
            f"{begins}the attribute letters of x has the shape ()"
        )


def test_every_object_is_read_first_within_the_limit_of_a_file(tmp_path: Path) -> None:
    """Each anew, so that a damaged one behind others of the same size is found."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for number in range(9):
            file[f"zeros{number}"] = np.zeros(2**18)  # 2 MiB of a file of 18 MiB
        options: dict[str, Any] = {"chunks": (200,), "compression": "gzip"}
        data = file.create_dataset("zzz/last", data=np.arange(200.0), **options)
        place = data.id.get_chunk_info(0)
    whole = path.read_bytes()
    path.write_bytes(whole[: place.byte_offset] + bytes(place.size) + whole[place.byte_offset + place.size :])
    assert read_everything(path) != ""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hdf5_input, "_EXPANSION", 0)
        patch.setattr(hdf5_input, "_ALWAYS", 2**21)
        assert read_everything(path) != ""
        patch.setattr(hdf5_input, "_ALWAYS", 1599)
        assert read_everything(path) == ""
    with pytest.raises(OutputError, match="HDF5 can read"):
        open_foreign(path, OutputError, "thing")
    with pytest.raises(OutputError, match="no checksum at its end"):
        open_sealed(path, OutputError, "thing")


def test_every_attribute_that_a_reader_takes_is_read_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the file, and those of each data set of the file and of its groups."""
    asked: list[tuple[str, str]] = []
    monkeypatch.setattr(Hdf5Reader, "text_attribute", lambda _reader, key, of="/": asked.append((key, of)))
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1.0
        file["group/y"] = 2.0
        file["group/deep/z"] = 2.0
    assert read_everything(path) == ""
    keys = ("format", "version", "record", "sweep", "metadata", "period", "unstable_from")
    own = ("unit", "units", "description")
    places = ("/group", "/x", "/group/deep", "/group/y")
    assert asked == [*((key, "/") for key in keys), *((key, place) for place in places for key in own)]
