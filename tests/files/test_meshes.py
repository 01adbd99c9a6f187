"""Mesh files from unknown sources: documented formats only, and every fault is one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import trimesh
from palpate.contact.mesh import Mesh, MeshError
from palpate.fem.errors import BodyError
from palpate.fem.volume import read_volume
from palpate.files import isolated
from palpate.files.isolated import IsolatedError, run_isolated, try_isolated


@pytest.mark.parametrize("suffix", ["zip", "svg", "3mf", "dae", "gltf", "vtk", "xml", "tar.gz", "npz", ""])
def test_other_formats_are_refused(suffix: str, tmp_path: Path) -> None:
    """An archive of 0.6 MB may need gigabytes, and a .gltf names other files."""
    path = tmp_path / f"mesh.{suffix}"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mesh.stl", "solid")
    with pytest.raises(MeshError, match="not a known format: STL, OBJ, PLY, OFF and GLB are read"):
        Mesh.load(path, unit="mm")


def test_an_obj_reads_no_second_file(tmp_path: Path) -> None:
    """A material library would be opened, and a pipe in its place would wait for ever."""
    os.mkfifo(tmp_path / "pipe.mtl")
    box = trimesh.creation.box()
    lines = ["mtllib pipe.mtl", "usemtl x", *(f"v {x} {y} {z}" for x, y, z in box.vertices)]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in box.faces]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    assert len(Mesh.load(tmp_path / "a.obj", unit="mm").triangles) == 12


@pytest.mark.parametrize("suffix", ["xdmf", "h5m", "cgns", "exo", "zip"])
def test_other_formats_of_tetrahedra_are_refused(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a.{suffix}").write_text("<Xdmf/>")
    with pytest.raises(BodyError, match="the suffix is not that of a mesh"):
        read_volume(tmp_path / f"a.{suffix}", unit="mm")


def test_tetrahedra_are_read_in_a_process_of_their_own(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9.0]])
    meshio.write_points_cells(tmp_path / "a.vtk", points, [("tetra", np.array([[0, 1, 2, 3]]))])
    assert np.array_equal(read_volume(tmp_path / "a.vtk", unit="mm").points, points * 1e-3)
    meshio.write_points_cells(tmp_path / "b.vtk", points, [("tetra", np.array([[0, 1, 2, 2]]))])
    with pytest.raises(BodyError, match=r"b\.vtk: 1 tetrahedra have no volume"):
        read_volume(tmp_path / "b.vtk", unit="mm")


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("while True: pass", "did not end within 1 s"),
        ("import os; os.abort()", "killed by signal 6"),
        ("raise ValueError('a b')", "^ValueError: a b$"),
        ("import numpy; numpy.empty(10**10)", "Unable to allocate"),
        ("print('said')", "^said$"),
    ],
)
def test_a_program_that_fails_gives_its_reason(program: str, reason: str) -> None:
    with pytest.raises(IsolatedError, match=reason):
        run_isolated(program, {}, seconds=1.0 if "while" in program else None, memory=1 << 31)


def test_a_broken_mesh_prints_no_traceback(tmp_path: Path) -> None:
    """A library that logs one would print it beside the sentence."""
    (tmp_path / "a.stl").write_bytes(b"solid" + b"\0" * 79)
    code = (
        "from palpate.contact.mesh import Mesh, MeshError\n"
        "try: Mesh.load('a.stl', unit='mm')\nexcept MeshError: print('refused')"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("refused\n", "")


def test_a_program_gets_its_inputs_and_returns_its_arrays() -> None:
    program = "import numpy as np\nx = np.load('inputs.npz')\nnp.savez('result.npz', twice=2 * x['a'], text=x['b'])"
    found = run_isolated(program, {"a": np.arange(3), "b": "word"})
    assert sorted(found) == ["text", "twice"]
    np.testing.assert_array_equal(found["twice"], [0, 2, 4])
    assert str(found["text"]) == "word"


def test_a_program_without_a_word_or_with_many_gives_its_last_300() -> None:
    for program, says in (
        ("import sys; sys.exit(1)", "no message"),
        (f"import sys; print('first'); print('{'x' * 400}'); sys.exit(3)", "x" * 300),
        ("import sys; print('out'); sys.exit('err')", "err"),
    ):
        with pytest.raises(IsolatedError) as caught:
            try_isolated(program, "argument", seconds=9, memory=1 << 31)
        assert str(caught.value) == says


def test_a_program_is_limited_in_computing_memory_and_time_on_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[list[str], dict[str, Any]]] = []
    done = SimpleNamespace(returncode=0, stdout="a\nb\n", stderr="")
    monkeypatch.setattr(isolated.subprocess, "run", lambda words, **options: asked.append((words, options)) or done)
    try_isolated("program", "argument", seconds=3, memory=77)
    words, options = asked.pop()
    assert words[:2] == [sys.executable, "-c"]
    assert words[3] == "argument"
    assert words[2].endswith("program")
    assert words[2].index("RLIMIT_AS, (77, resource") < words[2].index("RLIMIT_CPU, (3, resource")
    assert options["timeout"] == 24.0
    assert options["env"]["OPENBLAS_NUM_THREADS"] == "1"
    with pytest.raises(IsolatedError, match=r"^b$"):
        run_isolated("program", {}, seconds=5.0)  # it makes no result
    words, options = asked.pop()
    assert words == [sys.executable, "-c", "program"]
    assert options["timeout"] == 5.0
    assert not Path(options["cwd"]).exists()
    for code, says in ((-11, "the process was killed by signal 11"), (-24, "it took too long"), (1, "b")):
        done.returncode = code
        with pytest.raises(IsolatedError) as caught:
            try_isolated("program", "argument", seconds=3, memory=77)
        assert str(caught.value) == says


def test_a_process_that_cannot_be_started_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/no/such/program")
    with pytest.raises(IsolatedError, match=r"^no process can be started: No such file or directory$"):
        try_isolated("", "", seconds=1, memory=1 << 31)
