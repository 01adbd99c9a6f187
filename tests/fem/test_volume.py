"""Tetrahedral meshes: what a block, a grid and given tetrahedra hold, and where each of them is refused."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate.contact.simplices import volumes
from palpate.fem import BodyError, BodyWarning, Volume, block
from palpate.fem import volume as module
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.volume import _check_count, _not_finite, check_mesher, fill, fill_surface, grid, read_volume
from palpate.fem.winding_number import WindingNumber

CORNERS = np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0.02, 0], [0, 0, 0.03]])


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 4), (5, 1, 2)])
def test_each_cell_of_a_block_is_six_congruent_tetrahedra(shape: tuple[int, int, int]) -> None:
    steps = (0.01, 0.02, 0.005)
    sides = [n * step for n, step in zip(shape, steps, strict=True)]
    made = block(sides, steps)
    cells = int(np.prod(shape))
    assert made.points.shape == (int(np.prod([n + 1 for n in shape])), 3)
    assert len(made.tetrahedra) == 6 * cells
    np.testing.assert_allclose(volumes(made.points, made.tetrahedra), np.prod(steps) / 6.0, rtol=1e-9)
    assert made.size == pytest.approx(np.prod(sides))
    assert made.extent == pytest.approx(np.linalg.norm(sides))
    nx, ny, nz = shape
    assert len(made.surface) == 4 * (nx * ny + ny * nz + nz * nx)
    a, b, c = (made.points[made.surface[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(made.size)  # outward
    assert made.parts.tolist() == [0] * len(made.points)
    assert made.source == f"block of {' x '.join(f'{1e3 * side:g}' for side in sides)} mm"
    assert repr(made).startswith(f"<Volume: {6 * cells} tetrahedra, {len(made.points)} points, ")


def test_a_layer_is_a_plane_of_points_below_the_top_and_the_spacing_holds_on_both_sides() -> None:
    for spacing, layers, expected in (
        (0.01, [], [0.0, 10.0, 20.0, 30.0]),
        (0.01, [0.002], [0.0, 28 / 3, 56 / 3, 28.0, 30.0]),
        (0.01, ["2 mm", 0.002, "16 mm"], [0.0, 14.0, 28.0, 30.0]),
        (0.01, [0.0, 0.03], [0.0, 10.0, 20.0, 30.0]),
        (0.2, [], [0.0, 30.0]),
    ):
        made = block((0.02, 0.02, 0.03), spacing, layers=layers)
        np.testing.assert_allclose(1e3 * np.unique(made.points[:, 2].round(12)), expected, atol=1e-9)


@pytest.mark.parametrize("layers", [[-1e-6], [0.0300001], [0.01, 0.05], [-0.01, 0.01]])
def test_a_layer_outside_of_its_block_is_refused(layers: list[float]) -> None:
    with pytest.raises(BodyError, match=r"layers: their depths lie between 0 and the block's height of 0\.03 m"):
        block((0.02, 0.02, 0.03), 0.01, layers=layers)


@pytest.mark.parametrize(
    "lines",
    [([0, 1], [0, 1]), ([0, 1], [0, 1], [0, 1], [0, 1]), ([0, 1], [0], [0, 1]), ([0, 1], [0, 1], [1, 0]),
     ([0, 1], [0, 1, 1], [0, 1])],
)  # fmt: skip
def test_a_grid_has_three_increasing_lists(lines: Any) -> None:
    with pytest.raises(BodyError, match="a grid needs three increasing lists of two coordinates or more, in m"):
        grid([0.01 * np.array(line, dtype=float) for line in lines])


def test_a_grid_of_unequal_cells_fills_its_box() -> None:
    lines = [np.array([0.0, 0.01, 0.04]), np.array([-0.02, 0.0]), np.array([0.0, 0.01, 0.02, 0.05])]
    made = grid(lines)
    assert made.source == "grid"
    cells = volumes(made.points, made.tetrahedra).reshape(6, -1)  # six paths over all cells
    expected = np.einsum("i,j,k->ijk", *[np.diff(line) for line in lines]).ravel() / 6.0
    np.testing.assert_allclose(cells, np.tile(expected, (6, 1)), rtol=1e-9)


def test_given_tetrahedra_are_turned_and_lose_unused_points() -> None:
    points = np.vstack([[9.0, 9.0, 9.0], CORNERS, [8.0, 8.0, 8.0]])
    for cell in ([1, 2, 3, 4], [1, 3, 2, 4]):
        made = Volume(points, np.array([cell]))
        assert made.points.shape == (4, 3)
        assert made.size == pytest.approx(0.01 * 0.02 * 0.03 / 6.0)
        assert volumes(made.points, made.tetrahedra).min() > 0.0


@pytest.mark.parametrize(
    ("points", "cells", "said"),
    [
        (CORNERS[:, :2], [[0, 1, 2, 3]], "(n, 3) finite numbers in m; these are (4, 2)"),
        (np.vstack([CORNERS[:1], [[0.01, np.nan, 0.0]], CORNERS[2:3], [[np.inf, 0.0, 0.0]]]), [[0, 1, 2, 3]],
         "these are (4, 3), 2 of them not finite, the first has index 1"),
        (CORNERS, [[0, 1, 2]], "tetrahedra are (m, 4) point indices, at least one row; these are (1, 3)"),
        (CORNERS, np.empty((0, 4), dtype=int), "these are (0, 4)"),
        (CORNERS, [[0.0, 1.0, 2.0, 3.0]], "tetrahedra are (m, 4) point indices"),
        (CORNERS, [0, 1, 2, 3], "these are (4,)"),
        (CORNERS, [[0, 1, 2, 4]], "a tetrahedron has the point index 4; indices are 0 to 3"),
        (CORNERS, [[0, 1, 2, -1]], "a tetrahedron has the point index -1; indices are 0 to 3"),
        (np.vstack([CORNERS, [[0.01, 0.02, 0.0]]]), [[0, 1, 2, 3], [0, 1, 2, 4]],
         "1 tetrahedra have no volume, the first has index 1: mesh again"),
    ],
)  # fmt: skip
def test_what_is_no_tetrahedron_is_refused(points: Any, cells: Any, said: str) -> None:
    with pytest.raises(BodyError, match=re.escape(said)):
        Volume(np.asarray(points), np.asarray(cells))


def test_a_flat_tetrahedron_is_below_a_billionth_of_the_cube_of_its_longest_edge() -> None:
    for height, flat in ((5.9e-9, True), (6.1e-9, False)):
        points = 0.01 * np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1.0, 0], [0.5, 0.3, height * 1.25**1.5]])
        if flat:
            with pytest.raises(BodyError, match="no volume"):
                Volume(points, np.array([[0, 1, 2, 3]]))
        else:
            Volume(points, np.array([[0, 1, 2, 3]]))


def test_a_face_of_three_tetrahedra_is_an_overlap() -> None:
    points = np.vstack([CORNERS, [[0.01, 0.02, 0.04], [0.0, 0.01, -0.02]]])
    with pytest.raises(BodyError, match="more than two tetrahedra share a face"):
        _ = Volume(points, np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]])).surface


def test_parts_are_numbered_by_what_is_connected() -> None:
    points = np.vstack([CORNERS, CORNERS + 0.1])
    made = Volume(points, np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))
    assert made.parts.tolist() == [0] * 4 + [1] * 4
    assert len(made.surface) == 8


def test_a_size_or_a_spacing_is_one_or_three_lengths() -> None:
    assert len(block(0.01, 0.01).points) == len(block((0.01,) * 3, "10 mm").points) == 8
    for wrong in ([0.01, 0.01], [0.01] * 4):
        with pytest.raises(BodyError, match="a block needs three values, or one for all axes, not"):
            block(wrong, 0.01)
    with pytest.raises(BodyError, match="size"):
        block((0.01, 0.0, 0.01), 0.01)


def test_twenty_million_tetrahedra_are_the_most() -> None:
    _check_count(2e7, "it")
    with pytest.raises(BodyError, match=r"spacing: it would need about 2e\+07 tetrahedra: use a larger spacing"):
        _check_count(2.1e7, "it")
    assert _not_finite(np.array(1.0)) == ""
    assert _not_finite(np.zeros((2, 3))) == ""


def box(side: float = 0.02, gap: float = 0.0) -> ClosedSurface:
    """One or two cubes."""
    made = block((side,) * 3, side)
    points, faces = made.points, made.surface
    if gap:
        points, faces = (
            np.vstack([points, points + np.array([side + gap, 0.0, 0.0])]),
            np.vstack([faces, faces + len(points)]),
        )
    return ClosedSurface(points, faces)


def filled(surface: ClosedSurface, step: float, size: float, pieces: int, monkeypatch: pytest.MonkeyPatch) -> Volume:
    """Fill a surface by a mesher that makes tetrahedra of a total size, m^3, in some pieces."""
    side = (size / pieces) ** (1 / 3)
    made = block((side,) * 3, side)
    points = np.vstack([made.points + np.array([k, 0.0, 0.0]) for k in range(pieces)])
    cells = np.vstack([made.tetrahedra + 8 * k for k in range(pieces)])
    monkeypatch.setattr(module, "_stuffed", lambda *_: (points, cells))
    return fill_surface(surface, step, mesher="stuffing", source="a box")


def test_a_filled_surface_has_its_volume_within_a_tenth(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, whole = box(), 0.02**3
    for share in (0.901, 1.0, 1.099):
        assert filled(surface, 0.005, share * whole, 1, monkeypatch).size == pytest.approx(share * whole)
    for share in (0.899, 1.101):
        with pytest.raises(
            BodyError, match=r"spacing: a box: the surface encloses 8 cm\^3 but tetrahedra of 5 mm"
        ) as e:
            filled(surface, 0.005, share * whole, 1, monkeypatch)
        assert f"fill {8 * share:.4g} cm^3" in str(e.value)
        assert "such as 2.5 mm" in str(e.value)  # half of the spacing, which is less than the thickness


def test_a_filled_surface_has_no_more_pieces_than_the_surface_has_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = box(), box(gap=0.01)
    filled(one, 0.005, 0.02**3, 1, monkeypatch)
    filled(two, 0.005, 2 * 0.02**3, 2, monkeypatch)
    with pytest.raises(BodyError, match="do not resolve 1 of the 2 parts and cavities"):
        filled(two, 0.005, 2 * 0.02**3, 1, monkeypatch)
    with pytest.raises(BodyError, match=r"tetrahedra of 5 mm fill 2 pieces of a surface of 1 part: .* such as 2.5 mm"):
        filled(one, 0.005, 0.02**3, 2, monkeypatch)
    with pytest.raises(BodyError, match="fill 3 pieces of a surface of 2 parts: it is too thin in places"):
        filled(two, 0.005, 2 * 0.02**3, 3, monkeypatch)


def test_a_spacing_is_at_most_1_3_mean_thicknesses(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = box()
    filled(surface, 1.299 * surface.thickness, 0.02**3, 1, monkeypatch)
    said = f"the body is {1e3 * surface.thickness:.2g} mm thick on average, too thin for a spacing of"
    with pytest.raises(BodyError, match=said):
        filled(surface, 1.301 * surface.thickness, 0.02**3, 1, monkeypatch)
    with pytest.raises(BodyError, match='mesher: "stuffing" or "ftetwild", not \'other\''):
        check_mesher("other")


@pytest.mark.parametrize("block_size", [5, 2_000_000])
def test_winding_numbers_of_several_shells_add_up(block_size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of random tetrahedra, some of them turned inside out, by their barycentric coordinates."""
    monkeypatch.setattr("palpate.fem.winding_number._BLOCK", block_size)
    rng = np.random.default_rng(0)
    shells = rng.normal(size=(20, 4, 3))
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    points = rng.normal(scale=0.7, size=(150, 3))
    expected = np.zeros(len(points))
    for shell in shells:
        edges = (shell[1:] - shell[0]).T
        weights = np.linalg.solve(edges, (points - shell[0]).T)
        expected += np.sign(np.linalg.det(edges)) * ((weights > 0).all(axis=0) & (weights.sum(axis=0) < 1))
    triangles = np.concatenate([faces + 4 * k for k in range(len(shells))])
    found = WindingNumber(shells.reshape(-1, 3), triangles)
    np.testing.assert_array_equal(found(points), expected)
    assert len(np.unique(expected)) > 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert found(np.empty((0, 3))).shape == (0,)


def test_a_block_counts_six_tetrahedra_for_each_cell_before_it_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "grid", lambda lines, _source: [len(line) for line in lines])
    made: Any = block((1.0, 2.0, 3.0), (1.0 / 150, 2.0 / 148, 3.0 / 150))  # 19.98 million
    assert made == [151, 149, 151]
    with pytest.raises(BodyError, match="the block"):
        block((1.0, 2.0, 3.0), (1.0 / 150, 2.0 / 149, 3.0 / 150))  # 20.1 million


def test_a_reader_of_meshes_has_a_minute_and_2_gb_and_more_for_larger_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, limits = tmp_path / "body.msh", dict[str, float]()

    def read(_code: str, given: dict[str, Any], **options: float) -> dict[str, Any]:
        assert given == {"path": str(file)}
        limits.update(options)
        return {"points": np.column_stack([1e3 * CORNERS, [9, 9, 9, 9]]), "cells": np.arange(4)[None], "other": []}

    monkeypatch.setattr(module, "run_isolated", read)
    file.write_bytes(b"x" * 100_000)
    np.testing.assert_allclose(read_volume(file, unit="mm").points, CORNERS)
    assert limits == {"seconds": pytest.approx(61.0), "memory": 2_010_000_000}


def test_a_grid_is_refused_by_the_count_of_its_tetrahedra(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[tuple[float, str]] = []
    monkeypatch.setattr(module, "_check_count", lambda count, what: counts.append((count, what)))
    made = grid([0.01 * np.arange(n) for n in (3.0, 5.0, 7.0)], "tall")
    assert counts == [(len(made.tetrahedra), "tall")]


@pytest.mark.parametrize(
    ("points", "cells"),
    [(np.zeros(12), [[0, 1, 2, 3]]), (np.zeros((4, 2)), [[0, 1, 2, 3]]), (CORNERS, np.zeros((0, 4), dtype=int))],
)
def test_a_file_without_points_in_space_or_cells_has_no_tetrahedra(
    points: Any, cells: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "body.msh"
    file.write_bytes(b"x")
    monkeypatch.setattr(module, "run_isolated", lambda *_, **__: {"points": points, "cells": cells})
    with pytest.raises(BodyError, match="the file has no tetrahedra"):
        read_volume(file, unit="mm")


def boxes(*limits: tuple[list[float], list[float]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the surfaces of boxes between corners, mm: vertices, m, and triangles."""
    vertices, faces = [], []
    for low, high in limits:
        made = block(tuple(1e-3 * (np.array(high) - low)), tuple(1e-3 * (np.array(high) - low)))
        faces.append(made.surface + 8 * len(vertices))
        vertices.append(made.points + 1e-3 * np.array(low))
    return np.vstack(vertices), np.vstack(faces)


@pytest.mark.parametrize(
    ("shells", "coarse", "fine"),
    [
        ([([0, 0, 0], [8, 16, 32]), ([9.5, 0, 0], [17.5, 16, 32])], 3.0, 1.6),
        ([([0, 0, 0], [40, 40, 20]), ([8, 8, 14], [32, 32, 16])], 6.0, 2.5),
        ([([0, 0, 0], [8, 16, 32]), ([9.5, 0, 0], [17.5, 16, 32]), ([-4, 8, 8], [2, 24, 24])], 3.0, 1.6),
    ],
)
def test_a_gap_or_a_cavity_thinner_than_the_cells_is_not_filled_silently(
    shells: list[tuple[list[float], list[float]]], coarse: float, fine: float
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(BodyError, match=r"spacing: .* do not resolve 1 of the [23] parts and cavities"):
            fill(*boxes(*shells), 1e-3 * coarse)
        made = fill(*boxes(*shells), 1e-3 * fine)
    expected = sum(
        np.prod(np.subtract(high, low)) * (-1) ** (k * (high[2] < 20)) for k, (low, high) in enumerate(shells)
    ) - 2 * 8 * 16 * (len(shells) == 3)  # of the overlap of the first and the third
    assert made.size == pytest.approx(1e-9 * expected, rel=0.05)


@pytest.mark.parametrize(
    ("shells", "expected"),
    [
        ([([0, 0, 0], [20, 20, 20]), ([18, 0, 0], [40, 20, 20]), ([8, 8, 8], [32, 12, 12])], 40 * 20 * 20),
        (
            [([0, 0, 0], [40, 40, 40]), ([8, 8, 8], [24, 24, 24]), ([16, 16, 16], [32, 32, 32])],
            40**3 - 2 * 16**3 + 8**3,
        ),
    ],
)
def test_parts_hidden_in_others_and_cavities_that_overlap_are_filled(
    shells: list[tuple[list[float], list[float]]], expected: float
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert fill(*boxes(*shells), 4e-3).size == pytest.approx(1e-9 * expected, rel=0.02)


def shifted(one: Volume, by: list[float]) -> Volume:
    """Two copies of a mesh, the second one moved."""
    points = np.vstack([one.points, one.points + np.array(by)])
    return Volume(points, np.vstack([one.tetrahedra, one.tetrahedra + len(one.points)]))


def test_parts_that_overlap_are_refused_and_parts_that_touch_cause_a_warning() -> None:
    one = block((0.02, 0.02, 0.01), 0.005)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one.check_joints()
        shifted(one, [0.0, 0.0, 0.0101]).check_joints()
    for by in ([0.0, 0.0, 0.0], [0.007, 0.001, 0.0]):
        with pytest.raises(BodyError, match="parts of the mesh overlap each other"):
            shifted(one, by).check_joints()
    with pytest.warns(BodyWarning, match="touch each other at 64 triangles, whose points they do not share"):
        shifted(one, [0.0, 0.0, 0.01]).check_joints()
    for by in ([0.0013, 0.0021, 0.01], [0.0013, 0.0021, 0.0099]):  # with other triangles; a hundredth deep
        with pytest.warns(BodyWarning, match="touch each other at"):
            shifted(one, by).check_joints()


@pytest.mark.parametrize(("kind", "corners"), [("hexahedron", 8), ("wedge", 6), ("pyramid", 5)])
def test_a_file_with_other_cells_besides_tetrahedra_is_refused(kind: str, corners: int, tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    points = np.random.default_rng(1).uniform(size=(12, 3))
    mesh = meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3]])), (kind, np.arange(corners)[None] + 4)])
    mesh.write(tmp_path / "mixed.vtu")
    with pytest.raises(BodyError, match=rf"1 cells of another kind \({kind}\) besides tetrahedra"):
        read_volume(tmp_path / "mixed.vtu", unit="mm")
