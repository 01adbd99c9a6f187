"""Building a body: its mesh, its elements, its file, and what is refused."""

from __future__ import annotations

import signal
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import BodyError, BodyWarning, Volume, block, dense
from palpate.fem.condensation import Condensation, check_memory
from palpate.fem.dissection import _vertex_cover, nested_dissection
from palpate.fem.elements import Elements
from palpate.fem.material import Material, Region, SurfaceLayer
from palpate.fem.multifrontal import MultifrontalSolver, _contribution_bytes, _operations, _pivot_bytes
from palpate.fem.selectors import box, half_space, parse_selector, sphere
from scipy import sparse
from scipy.sparse.linalg import splu

BOTTOM = half_space("z", "<", 1e-9)


@pytest.fixture(scope="module")
def small() -> Elements:
    return Elements(block((0.03, 0.03, 0.02), 0.01), Material(5e3, 0.45), [BOTTOM], order=2)


@pytest.fixture(scope="module")
def body() -> bodies.Body:
    return bodies.build(block((0.03, 0.03, 0.02), 0.01), young="5 kPa", fixed=BOTTOM)


def test_a_block_fills_its_box_and_its_surface_faces_outward() -> None:
    """Volume by tetrahedra; volume by the divergence theorem over the surface; layers are planes of points."""
    volume = block((0.1, 0.08, 0.05), (0.02, 0.02, 0.01), layers=["2 mm"])
    assert volume.size == pytest.approx(4e-4, rel=1e-12)
    a, b, c = (volume.points[volume.surface[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(4e-4, rel=1e-12)
    assert np.isclose(volume.points[:, 2], 0.048).any()


@pytest.mark.parametrize("order", [1, 2])
def test_patch_test_holds_to_rounding(order: int) -> None:
    """A linear displacement is an equilibrium with the energy of Hooke's law, on shaken, irregular elements."""
    rng = np.random.default_rng(5)
    start = block((0.04, 0.03, 0.03), 0.01)
    points = start.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), np.unique(start.surface))
    points[inner] += rng.uniform(-2e-3, 2e-3, (len(inner), 3))
    elements = Elements(Volume(points, start.tetrahedra), Material(5e3, 0.45), [BOTTOM], order=order)
    slope = rng.normal(size=(3, 3)) * 1e-2
    u = elements.nodes @ slope.T
    force = (elements.stiffness @ u.ravel()).reshape(-1, 3)
    scale = np.abs(force).max()
    assert np.abs(force[~elements.surface_nodes]).max() < 1e-12 * scale
    strain = 0.5 * (slope + slope.T)
    lame, shear = 5e3 * 0.45 / (1.45 * 0.1), 5e3 / 2.9
    energy = 0.5 * (lame * np.trace(strain) ** 2 + 2 * shear * (strain**2).sum()) * start.size
    assert 0.5 * u.ravel() @ elements.stiffness @ u.ravel() == pytest.approx(energy, rel=1e-11)


def test_rigid_motion_costs_nothing_and_mass_is_density_times_volume(small: Elements) -> None:
    x = small.nodes
    for motion in (np.tile([1.0, 2.0, 3.0], (len(x), 1)), np.cross([0.3, -0.5, 0.8], x)):
        assert (
            np.abs(small.stiffness @ motion.ravel()).max() < 1e-11 * abs(small.stiffness).max() * np.abs(motion).max()
        )
    ones = np.tile([0.0, 1.0, 0.0], len(x))
    assert ones @ small.mass @ ones == pytest.approx(1000.0 * small.volume.size, rel=1e-12)


def bent(nu: float, order: int) -> float:
    """Deflection of a slender clamped bar under an even end load, over Timoshenko's P L^3 / 3EI + P L / (kappa G A)."""
    length, side, young = 0.2, 0.02, 20e3
    volume = block((length, side, side), 0.01)
    end = half_space("x", ">", length - 1e-9)
    elements = Elements(volume, Material(young, nu), [half_space("x", "<", 1e-9)], touch=end, order=order)
    solve = splu(elements.stiffness[elements.free][:, elements.free].tocsc()).solve
    share = elements.areas / elements.areas.sum()
    load = np.zeros((len(elements.nodes), 3))
    load[:, 2] = elements.load @ share
    u = np.zeros(load.size)
    u[elements.free] = solve(load.reshape(-1, 1)[elements.free]).ravel()
    inertia, area, shear = side**4 / 12, side**2, young / (2 * (1 + nu))
    kappa = 10 * (1 + nu) / (12 + 11 * nu)  # Cowper 1966
    beam = length**3 / (3 * young * inertia) + length / (kappa * shear * area)
    return float(share @ (elements.load.T @ u.reshape(-1, 3)[:, 2])) / beam


def test_a_cantilever_bends_as_a_beam() -> None:
    """Exact without lateral contraction; with it, the clamp, which beam theory leaves free to contract, stiffens."""
    assert bent(0.0, order=2) == pytest.approx(1.0, abs=5e-4)
    assert bent(0.3, order=2) == pytest.approx(1.0, abs=0.015)


def test_quadratic_elements_do_not_lock_and_linear_ones_do() -> None:
    """Near nu = 0.5 linear elements of the same size bend ten times too little."""
    assert bent(0.49, order=2) == pytest.approx(1.0, abs=0.05)
    assert bent(0.49, order=1) < 0.2


def test_compliance_is_reciprocal_and_positive_definite(body: bodies.Body) -> None:
    c = body.compliance.astype(float)
    assert np.array_equal(c, c.T)
    assert np.linalg.eigvalsh(c).min() > 1e-4 * np.trace(c) / len(c)


def test_compliance_is_the_inverse_stiffness_seen_from_the_surface(small: Elements, body: bodies.Body) -> None:
    """Another road: dense inverse of the whole stiffness, one load at a time."""
    dense = np.linalg.inv(small.stiffness[small.free][:, small.free].toarray())
    load = sparse.kron(small.load, sparse.eye(3)).tocsr()[small.free]
    expected = load.T @ dense @ load.toarray()
    assert body.compliance == pytest.approx(expected, rel=1e-5, abs=1e-6 * expected.max())


def test_the_factor_solves_as_superlu_does_for_any_fronts(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    matrix = small.stiffness[small.free][:, small.free]
    right = np.random.default_rng(1).normal(size=(len(small.free), 3))
    expected = splu(matrix.tocsc()).solve(right)
    for leaf in (10_000, 96, 12):
        monkeypatch.setattr("palpate.fem.dissection._LEAF", leaf)
        factor = Condensation(small).factor()
        assert factor.solve(right) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
        assert matrix @ factor.solve(right[:, :1]) == pytest.approx(right[:, :1], abs=1e-9)


def test_regions_and_skin_stiffen_where_they_are() -> None:
    material = Material(5e3, regions=[Region(sphere((0, 0, 0), 0.01), 25e3)], surface_layer=SurfaceLayer(2e-3, 50e3))
    x = np.array([[0, 0, 0], [0, 0, 0.02], [0, 0, 0.03]], dtype=float)
    assert material.young_at(x, lambda p: np.array([1.0, 1.0, 1e-3])).tolist() == [25e3, 5e3, 50e3]


@pytest.mark.parametrize("order", [1, 2])
def test_what_is_stiffer_anywhere_makes_a_body_stiffer_everywhere(order: int) -> None:
    """Monotony: no load gives more energy, wherever a small ball in an element is stiff, a hundred times as stiff too.

    A rule of integration with a negative weight has it softer where that point is stiff, and not definite at last.
    """
    volume = block((0.03, 0.03, 0.02), 0.01)
    corners = volume.points[volume.tetrahedra[7]]
    soft = Condensation(Elements(volume, Material(5e3, 0.45), [BOTTOM], order=order)).compliance().astype(float)
    felt = 0
    for share in ([0.25, 0.25, 0.25, 0.25], [0.1, 0.1, 0.1, 0.7], [0.4, 0.4, 0.1, 0.1]):
        for times in (5.0, 100.0):
            region = Region(sphere(np.asarray(share) @ corners, 2e-3), 5e3 * times)
            elements = Elements(volume, Material(5e3, 0.45, regions=[region]), [BOTTOM], order=order)
            try:
                elements.young  # noqa: B018
            except BodyError:  # no point of integration lies there
                continue
            felt += 1
            stiff = Condensation(elements).compliance().astype(float)
            assert np.linalg.eigvalsh(soft - stiff)[0] > -1e-6 * np.abs(soft).max()
            assert np.trace(stiff) < np.trace(soft)
    assert felt >= 2


def test_a_skin_that_the_mesh_does_not_resolve_is_told() -> None:
    volume = block((0.03, 0.03, 0.02), 0.01)
    with pytest.raises(BodyError, match=r"surface_layer 0.01 mm = 1000 kPa: no quadrature point lies in it"):
        Elements(volume, Material(5e3, surface_layer="0.01 mm = 1 MPa"), [BOTTOM]).young  # noqa: B018
    hidden = Material(5e3, regions="z > -1 mm = 9 kPa", surface_layer="5 mm = 1 kPa")
    with pytest.raises(BodyError, match=r"surface_layer 5 mm = 1 kPa: regions, which replace it, contain all of it"):
        Elements(volume, hidden, [BOTTOM]).young  # noqa: B018
    with pytest.warns(
        BodyWarning, match=r"0.5 mm = 50 kPa: the cells at the surface are 10 mm high: use at least one cell"
    ):
        Elements(volume, Material(5e3, surface_layer="0.5 mm = 50 kPa"), [BOTTOM], parse_selector("z > 19 mm")).young  # noqa: B018
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for touch in (parse_selector("z > 19 mm"), parse_selector("box 9 9 19 to 21 21 21 mm"), None):
            Elements(volume, Material(5e3, surface_layer="10 mm = 50 kPa"), [BOTTOM], touch).young  # noqa: B018


def test_places_are_read_from_text() -> None:
    x = np.array([[0, 0, 0], [0, 0, 2e-3], [5e-3, 0, 0]])
    assert parse_selector("z < 1 mm").inside(x).tolist() == [True, False, True]
    assert parse_selector("box -1 -1 -1 to 1, 1, 3 mm").inside(x).tolist() == [True, True, False]
    assert parse_selector("surface sphere 5 0 0 radius 1 mm").inside(x).tolist() == [False, False, True]
    assert parse_selector("surface z > 1 mm").surface
    for text in ("z <= 0 mm", "z<=0mm", "z ≤ −0 mm", "z <= -0.0000001 mm"):  # its own plane too, and rounding
        assert parse_selector(text).inside(x).tolist() == [True, False, True]
    assert parse_selector("x >= 5 mm").inside(x).tolist() == [False, False, True]
    for text in ("", "z < 1", "z = 1 mm", "z =< 1 mm", "sphere 0 0 radius 1 mm", "everything"):
        with pytest.raises(BodyError, match=r"region|unit"):
            parse_selector(text)


def test_a_file_comes_back_as_it_was_written(body: bodies.Body, tmp_path: Path) -> None:
    path = body.save(tmp_path / "b.h5")
    again = bodies.load(path)
    assert np.array_equal(again.compliance, body.compliance)
    assert np.array_equal(again.nodes, body.nodes)
    assert again.record == body.record
    assert again.record["young_Pa"] == 5000.0
    assert "scikit-fem" in again.record["versions"]


def test_a_truncated_or_foreign_file_is_refused(body: bodies.Body, tmp_path: Path) -> None:
    import h5py

    whole = body.save(tmp_path / "b.h5").read_bytes()
    for size, sentence in ((0, "empty file"), (6, "not a body"), (100, "truncated"), (len(whole) - 10, "truncated")):
        (tmp_path / "cut.h5").write_bytes(whole[:size])
        with pytest.raises(BodyError, match=sentence):
            bodies.load(tmp_path / "cut.h5")
    with h5py.File(tmp_path / "trace.h5", "w") as store:
        store["time"] = [0.0, 1.0]
    with pytest.raises(BodyError, match="changed by another program"):
        bodies.load(tmp_path / "trace.h5")
    with pytest.raises(BodyError, match="no such file"):
        bodies.load(tmp_path / "none.h5")


def test_a_killed_build_leaves_nothing_that_loads(tmp_path: Path) -> None:
    """Killed in the longest stage, by the operating system: no file under the name, and the next build starts clean."""
    code = (
        "import os, signal, sys\nfrom palpate import fem as bodies\n"
        "def stop(text, part):\n    'condensing' in text and os.kill(os.getpid(), signal.SIGKILL)\n"
        "bodies.build(bodies.block((0.03, 0.03, 0.02), 0.01), young=5e3, fixed='z < 0.1 mm', output=sys.argv[1], "
        "progress=stop)"
    )
    file = tmp_path / "b.h5"
    assert subprocess.run([sys.executable, "-c", code, str(file)], check=False).returncode == -signal.SIGKILL
    assert list(tmp_path.iterdir()) == []
    bodies.build(block((0.03, 0.03, 0.02), 0.01), young=5e3, fixed=BOTTOM, output=file)
    assert bodies.load(file).record["young_Pa"] == 5000.0
    assert list(tmp_path.iterdir()) == [file]


def test_fronts_give_what_columns_give(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two roads to the compliance: elimination front by front, however often halved, and columns solved one by one."""
    elements = Elements(block((0.05, 0.04, 0.03), 0.01), Material(5e3, 0.49), [BOTTOM], parse_selector("z > 29 mm"))
    load = sparse.kron(elements.load, sparse.eye(3)).tocsr()[elements.free].toarray()
    expected = load.T @ splu(elements.stiffness[elements.free][:, elements.free].tocsc()).solve(load)
    for leaf in (10_000, 96, 12):
        monkeypatch.setattr("palpate.fem.dissection._LEAF", leaf)
        monkeypatch.setattr("palpate.fem.dissection._LARGE", 3 * leaf)
        assert np.abs(Condensation(elements).compliance() - expected).max() < 1e-6 * expected.max()


def test_threads_share_the_fronts_and_change_nothing(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit: remainders are added in the order of the fronts, whichever thread is first."""
    monkeypatch.setattr("palpate.fem.dissection._LEAF", 12)
    found = []
    for count in (1, 2, 5):
        monkeypatch.setattr("palpate.fem.dense.threads", lambda count=count: count)
        with dense.one_thread():
            found.append(Condensation(small).compliance())
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_a_front_that_fails_in_a_thread_ends_the_build(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiffness that is not positive definite is noticed wherever its front lies."""
    monkeypatch.setattr("palpate.fem.dissection._LEAF", 12)
    monkeypatch.setattr("palpate.fem.dense.threads", lambda: 4)
    count = len(Condensation(small)._solver._fronts)
    for last in (0, count // 3, count - 2):
        condense = Condensation(small)
        for solve in (condense.compliance, condense.factor):
            calls = iter(range(count))
            monkeypatch.setattr("palpate.fem.dense.potrf", lambda a, calls=calls, last=last: next(calls) != last)
            with pytest.raises(BodyError, match="not positive definite"):
                solve()


def test_dissection_parts_what_it_halves(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every node comes once, and no front touches one that is neither below it nor on its way to the root."""
    monkeypatch.setattr("palpate.fem.dissection._LEAF", 20)
    graph = abs(small.stiffness[::3][:, ::3])
    order, fronts = nested_dissection(graph, small.nodes)
    assert np.array_equal(np.sort(order), np.arange(len(small.nodes)))
    parent = {child: number for number, front in enumerate(fronts) for child in front.children}
    front_of = np.empty(len(order), dtype=int)
    for number, front in enumerate(fronts):
        front_of[order[front.begin : front.end]] = number

    def way(number: int) -> set[int]:
        return {number} | (way(parent[number]) if number in parent else set())

    ways = [way(number) for number in range(len(fronts))]
    pairs = graph.tocoo()
    assert len(fronts) > 6
    for i, j in zip(front_of[pairs.row].tolist(), front_of[pairs.col].tolist(), strict=True):
        assert i in ways[j] or j in ways[i]


def test_a_separator_is_a_smallest_vertex_cover() -> None:
    """Of every choice of the left nodes, with the neighbors of those left out."""
    rng = np.random.default_rng(4)
    for _ in range(30):
        n = 5
        between = rng.random((n, n)) < 0.3
        between[0, rng.integers(n)] = True
        graph = sparse.csr_matrix(np.block([[np.zeros((n, n)), between], [between.T, np.zeros((n, n))]]))
        cover = _vertex_cover(graph, np.repeat([0, 1], n).astype(np.int8))
        covered = np.isin(np.arange(2 * n), cover)
        assert not (between & ~covered[:n, None] & ~covered[n:]).any()
        chosen = np.array(list(np.ndindex(*[2] * n)), dtype=bool)
        sizes = chosen.sum(axis=1) + ((~chosen).astype(int) @ between > 0).sum(axis=1)
        assert len(cover) == sizes.min()


def test_a_compliance_that_rounding_has_spoiled_is_refused(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trial loads, carried through in double precision, notice an error of a ten-thousandth in the loads' part."""
    monkeypatch.setattr("palpate.fem.multifrontal._single", lambda a: (1.0002 * a).astype(np.float32, order="F"))
    with pytest.raises(BodyError, match=r"the rounding error of the compliance is"):
        Condensation(small).compliance()


def test_memory_is_checked_before_anything_is_solved(small: Elements) -> None:
    """The file's size is known, the fronts' are counted; what is refused is refused with a proposal."""
    condensation = Condensation(small)
    gradients = sum(field[0].grad.size for field in small._basis.basis) * 8.0
    assert gradients < small.memory < 10.0 * gradients
    assert condensation.memory > 12 * (3 * len(small.contact_nodes)) ** 2
    assert f"condensing to {len(small.contact_nodes)} contact nodes" in str(condensation)
    check_memory(len(small.contact_nodes), condensation.memory, "1 GB")
    with pytest.raises(BodyError, match=r"over the budget of 0.01 MB.*coarser mesh, a smaller contact surface"):
        check_memory(len(small.contact_nodes), condensation.memory, "10 kB")
    with pytest.raises(BodyError, match=r"compliance of 1000 nodes alone takes 36 MB:"):  # 3000^2 numbers of 4 bytes
        check_memory(1000, 1e9, "10 kB")


def test_the_memory_counts_the_compliance_and_its_factor_if_the_fronts_need_less(
    small: Elements, monkeypatch: pytest.MonkeyPatch
) -> None:
    def counted(fronts: float) -> float:
        solver = SimpleNamespace(memory=fronts, operations=1.0)
        monkeypatch.setattr("palpate.fem.condensation.MultifrontalSolver", lambda *_: solver)
        return Condensation(small).memory

    pair = 2 * np.empty((3 * len(small.contact_nodes),) * 2, dtype=np.float32).nbytes
    assert counted(0.0) == counted(0.9 * pair) == pytest.approx(counted(1.5 * pair) - 0.5 * pair, rel=1e-12)


def test_the_bytes_of_a_front_are_those_of_its_arrays(small: Elements, monkeypatch: pytest.MonkeyPatch) -> None:
    real = MultifrontalSolver._eliminate

    def eliminate(solver: Any, index: Any, blocks: Any) -> Any:
        found = real(solver, index, blocks)
        arrays = (found.stiffness, found.load, found.compliance)
        assert _contribution_bytes(*solver._fronts[index].sizes) == sum(array.nbytes for array in arrays)
        return found

    monkeypatch.setattr(MultifrontalSolver, "_eliminate", eliminate)
    monkeypatch.setattr("palpate.fem.dissection._LEAF", 12)
    Condensation(small).compliance()


def test_expected_memory_is_what_the_system_counts() -> None:
    """Peak resident memory of a build of its own, 9,400 unknowns, against what was said beforehand."""
    # Not getrusage: what it counts begins with the size of the program that started this one.
    code = (
        "from pathlib import Path\nfrom palpate import fem as bodies\n"
        "made = bodies.build(bodies.block((0.08, 0.08, 0.05), 0.01), young=5e3, fixed='z < 0.1 mm')\n"
        "status = Path('/proc/self/status').read_text()\n"
        "print(made.record['memory_bytes'], 1024 * int(status.split('VmHWM:')[1].split()[0]))"
    )
    if sys.platform != "linux":
        pytest.skip("only Linux has /proc")
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    expected, peak = (float(word) for word in done.stdout.split())
    assert 0.7 * peak < expected < 1.5 * peak


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fixed": []}, "nothing is fixed"),
        ({"fixed": "z < -5 mm"}, "no node of the body lies in"),
        ({"fixed": "box 0 0 0 to 0 0 20 mm"}, "on one line"),
        ({"poisson": 0.5}, "Poisson's ratio is below 0.5"),
        ({"young": "-5 kPa"}, "Young's modulus is positive"),
        ({"young": "5 mm"}, "pressure"),
        ({"density": 0.0}, "density is positive"),
        ({"regions": ["z < 1 mm = -2 kPa"]}, "Young's modulus is positive"),
        ({"regions": ["sphere 100 0 0 radius 5 mm = 25 kPa"]}, "no quadrature point lies in it"),
        ({"touch": "z > 50 mm"}, "the body has no contact node"),
        ({"order": 3}, "order 1"),
        ({"memory": "1 kB"}, "over the budget"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    arguments: dict[str, object] = {"young": 5e3, "fixed": BOTTOM, **changes}
    with pytest.raises(BodyError, match=message):
        bodies.build(block((0.03, 0.03, 0.02), 0.01), **arguments)  # type: ignore[arg-type]


def test_a_piece_that_floats_is_named() -> None:
    one = block((0.01, 0.01, 0.01), 0.01)
    points = np.concatenate([one.points, one.points + np.array([0, 0, 0.02])])
    two = Volume(points, np.concatenate([one.tetrahedra, one.tetrahedra + len(one.points)]))
    with pytest.raises(BodyError, match="a piece of the body is not fixed"):
        bodies.build(two, young=5e3, fixed=BOTTOM)


def test_flat_tetrahedra_are_refused_and_turned_ones_are_turned() -> None:
    one = block((0.01, 0.01, 0.01), 0.01)
    assert Volume(one.points, one.tetrahedra[:, [0, 2, 1, 3]]).size == pytest.approx(1e-6)
    flat = one.points * [1, 1, 0]
    with pytest.raises(BodyError, match="have no volume"):
        Volume(flat, one.tetrahedra)


@pytest.mark.parametrize(("unit", "told"), [("m", "197 m"), ("um", "0.197 mm"), ("mm", None), ("cm", None)])
def test_a_body_of_a_wrong_unit_is_warned_of(unit: str, told: str | None) -> None:
    """Hundreds of metres, or less than a millimetre, are no organ; 20 cm and 2 m may be one."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        block((f"150 {unit}", f"100 {unit}", f"80 {unit}"), f"50 {unit}")
    assert [str(warning.message).partition(":")[0] for warning in warned] == (
        [f"the body has an extent of {told}"] if told else []
    )


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"young": 5}, 'young: 5 Pa is softer than any tissue; for a value in kPa, write "5 kPa"'),
        ({"young": "0.02 kPa"}, "young: 20 Pa is softer"),
        ({"young": 5e3, "surface_layer": "2 mm = 40 Pa"}, "surface_layer: 40 Pa is softer"),
        ({"young": 5e3, "regions": "z < 1 mm = 25 Pa"}, "region z < 1 mm: 25 Pa is softer"),
        ({"young": 50.0}, None),
    ],
)
def test_a_modulus_that_was_meant_in_kpa_is_warned_of(given: dict[str, Any], told: str | None) -> None:
    """In Pa no tissue has a number that small: who gives one has thought in kPa."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        bodies.Material(**given)
    assert [told in str(warning.message) for warning in warned if told] == ([True] if told else [])
    assert all(issubclass(warning.category, BodyWarning) for warning in warned)
    assert len(warned) == bool(told)


def test_a_mesh_of_too_many_tetrahedra_is_refused_before_it_is_made() -> None:
    """A surface in mm read as m, and a spacing a hundred times too fine: both would run for hours, out of memory."""
    import trimesh

    with pytest.raises(BodyError, match="tetrahedra: use a larger spacing"):
        block((0.06, 0.06, 0.03), 1e-4)
    sphere = trimesh.creation.icosphere(2, 40.0)
    with pytest.raises(BodyError, match="check size, spacing and unit") as refusal:
        bodies.fill(sphere.vertices, sphere.faces, 0.01)
    regular = 0.01**3 / (6.0 * 2.0**0.5)  # volume of a regular tetrahedron
    assert f"would need about {sphere.volume / regular:.1g} tetrahedra" in str(refusal.value)


def test_tetrahedra_come_from_a_file(tmp_path: Path) -> None:
    import meshio

    volume = block((0.03, 0.03, 0.02), 0.01)
    meshio.write_points_cells(tmp_path / "b.vtk", volume.points * 1e3, [("tetra", volume.tetrahedra)])
    found = bodies.read_volume(tmp_path / "b.vtk", unit="mm")
    assert found.size == pytest.approx(volume.size, rel=1e-6)
    (tmp_path / "text.msh").write_text("no mesh at all")
    with pytest.raises(BodyError, match="not a complete volume mesh"):
        bodies.read_volume(tmp_path / "text.msh", unit="mm")
    meshio.write_points_cells(tmp_path / "s.vtk", volume.points, [("triangle", volume.surface)])
    with pytest.raises(BodyError, match="no tetrahedra"):
        bodies.read_volume(tmp_path / "s.vtk", unit="m")


def test_a_closed_surface_is_filled_and_an_open_one_refused() -> None:
    import trimesh
    from palpate import Mesh
    from palpate.fem.builder import volume_of

    sphere = trimesh.creation.icosphere(2, 0.04)
    with pytest.raises(BodyError, match="edges at a border"):
        volume_of(Mesh(sphere.vertices, sphere.faces[sphere.triangles_center[:, 2] < 0.02], open=True))
    filled = volume_of(Mesh(sphere.vertices, sphere.faces), spacing="12 mm")
    assert filled.size == pytest.approx(sphere.volume, rel=0.04)


def test_the_phantom_is_softer_without_its_nodule() -> None:
    """Pressed above the nodule; a nodule outside of the block is refused."""
    felt = {}
    for contrast in (1.0, 5.0):
        body = bodies.phantom(contrast=contrast, depth=5e-3, spacing=0.02)
        middle = int(np.argmin(np.linalg.norm(body.nodes - [0.05, 0.05, 0.05], axis=1)))
        felt[contrast] = float(body.compliance[3 * middle + 2, 3 * middle + 2])
    assert felt[5.0] < 0.97 * felt[1.0]
    assert body.record["regions"] == ["sphere 50 50 37.5 radius 7.5 mm = 50 kPa"]  # its top is 5 mm deep
    with pytest.raises(BodyError, match="nodule lies between"):
        bodies.phantom(depth=0.04)


def test_the_command_builds_a_body_and_shows_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import meshio
    from palpate.cli.main import app

    volume = block((0.03, 0.03, 0.02), 0.01)
    meshio.write_points_cells(tmp_path / "b.vtk", volume.points * 1e3, [("tetra", volume.tetrahedra)])
    words = ["body", "build", str(tmp_path / "b.vtk"), "--unit", "mm", "--young", "5 kPa"]
    words += ["--surface-layer", "10 mm = 50 kPa", "--fixed", "z < 0.1 mm"]
    assert app(words, standalone_mode=False) in (None, 0)
    assert app(["body", "show", str(tmp_path / "b.h5")], standalone_mode=False) in (None, 0)
    told = capsys.readouterr().out
    for line in ("size        30 × 30 × 20 mm, 18 cm³", "Young's modulus 50 kPa", "quadratic"):
        assert line in told
    for line in ("layer       10 mm = 50 kPa", "fixed       z < 0.1 mm"):
        assert line in told
    assert "{" not in told
    assert "[" not in told
    assert app([*words[:-2]], standalone_mode=False) == 2


def test_box_refuses_turned_corners() -> None:
    with pytest.raises(BodyError, match="its lower and its upper corner"):
        box((1, 1, 1), (0, 0, 0))


def test_the_progress_of_a_build_rises_within_its_whole() -> None:
    told: list[tuple[str, float]] = []
    bodies.build(
        block((0.02, 0.02, 0.01), 0.01), young=1e4, fixed="z < 0.001 mm", touch="z > 9.9 mm", order=1,
        progress=lambda text, share: told.append((text, share)),
    )  # fmt: skip
    shares = [share for _, share in told]
    assert len(shares) >= 3
    assert shares == sorted(shares)
    assert min(shares) >= 0.0
    assert max(shares) < 1.0
    assert all(text for text, _ in told)
    assert "assembling 24 tetrahedra, 18 vertices" in [text for text, _ in told]


@pytest.mark.parametrize(("s", "r", "m"), [(3, 0, 0), (30, 12, 0), (30, 12, 9), (6, 90, 30)])
def test_a_front_counts_its_arrays_and_the_products_of_its_elimination(s: int, r: int, m: int) -> None:
    """A pivot in double precision with its copy in single; q^2 products at each step of the remaining size q."""
    arrays = [np.zeros((s, s)), np.zeros((r, s)), np.zeros((m, s), np.float32)]
    copies = [one.astype(np.float32) for one in arrays[:2]]
    assert _pivot_bytes(s, r, m) == sum(one.nbytes for one in (*arrays, *copies))
    left = s * (np.arange(1000) + 0.5) / 1000
    assert _operations(s, r, m) == pytest.approx(s * np.mean((left + r + m) ** 2), rel=1e-6)
