"""Mesh files from unknown sources: documented formats only, and every fault is one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from palpate.contact.mesh import Mesh, MeshError
from palpate.fem.errors import BodyError
from palpate.fem.volume import read_volume
from palpate.files.isolated import IsolatedError, run_isolated


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
