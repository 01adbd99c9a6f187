"""HDF5 files: written whole on any disk, checked before they are parsed, read within their own size."""

from __future__ import annotations

import errno
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
from palpate.files import hdf5_output
from palpate.files.hdf5_input import Hdf5Reader, open_foreign, read_everything, read_seal
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
