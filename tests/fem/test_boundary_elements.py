"""Boundary elements: exact fields, agreement with finite elements, and bodies without tetrahedra."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from nightly import NIGHTLY
from palpate import fem
from palpate.cli.main import app
from palpate.contact import Mesh
from palpate.contact.mesh import MeshError
from palpate.errors import PalpateError
from palpate.fem import storage
from palpate.fem.boundary_elements import BoundaryElements
from palpate.simulation import simulate
from typer.testing import CliRunner

SIZE = (0.04, 0.04, 0.02)
TOP, BOTTOM = "z > 19.9 mm", "z < 0.001 mm"


def surface(spacing: float, turn: np.ndarray | None = None) -> Mesh:
    volume = fem.block(SIZE, spacing)
    points = volume.points if turn is None else volume.points @ turn.T
    used, faces = np.unique(volume.surface, return_inverse=True)
    return Mesh(points[used], faces.reshape(-1, 3))


@pytest.fixture(scope="module")
def block() -> fem.Body:
    return fem.build_boundary(surface(0.01), young=10e3, fixed=BOTTOM, touch=TOP, poisson=0.3)


@pytest.mark.parametrize("order", [1, 2])
def test_a_rigid_rotation_needs_no_traction_and_c_is_the_solid_angle(order: int) -> None:
    mesh = surface(0.01)
    everything = np.ones(len(mesh.triangles), dtype=bool)
    fixed = mesh.vertices[:, 2] < 1e-6
    elements = BoundaryElements(mesh.vertices, mesh.triangles.astype(np.int64), everything, fixed, 10e3, 0.3, order)
    t, load, reaction = elements._integrals(np.unique(elements.elements[elements.fixed_triangles]))
    assert t.nbytes + load.nbytes + reaction.nbytes < elements.memory - 0.4e9  # the factor and the right side besides
    assert elements.memory - 0.4e9 < t.nbytes + 3.0 * load.nbytes + 2.0 * reaction.nbytes
    count = len(elements.nodes)
    shares = np.einsum("iaia->i", t.reshape(count, 3, count, 3)) / 3.0  # of a sphere, at corners, edges and faces
    assert {round(float(share), 4) for share in shares} == {0.125, 0.25, 0.5}
    for axis in np.eye(3):
        turned = np.cross(axis, elements.nodes)
        assert np.abs(t @ turned.ravel()).max() < 1e-5 * np.abs(turned).max()


def test_the_widest_angle_is_that_of_the_cosine_rule() -> None:
    """Of a pyramid on an equilateral base: its sides have the sides 1, s and s."""
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    everything = np.ones(4, dtype=bool)
    base = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.75**0.5, 0]])
    for height in (2.0**0.5 / 3.0**0.5, 0.2):
        points = 0.01 * np.vstack([base, [0.5, 0.75**0.5 / 3.0, height]])
        side = 1.0 / 3.0 + height**2  # squared
        elements = BoundaryElements(points, faces, everything, everything, 10e3, 0.3, 1)
        expected = max(60.0, np.degrees(np.arccos(1.0 - 0.5 / side)))
        assert elements._widest_angle() == pytest.approx(expected)


def test_a_column_without_lateral_contraction_shortens_as_hooke_says() -> None:
    """Exact before the mean of the compliance and its transpose, which are not the same by collocation."""
    volume = fem.block((0.01, 0.01, 0.04), 0.005)
    used, faces = np.unique(volume.surface, return_inverse=True)
    mesh = Mesh(volume.points[used], faces.reshape(-1, 3))
    body = fem.build_boundary(mesh, young=10e3, fixed=BOTTOM, touch="z > 39.9 mm", poisson=0.0)
    pressure = 100.0  # Pa
    load = np.outer(body.contents.areas, [0.0, 0.0, -pressure])
    assert -load.sum() == pytest.approx(pressure * 1e-4)
    moved = (body.compliance.astype(float) @ load.ravel()).reshape(-1, 3)
    shortening = pressure / 10e3 * 0.04
    np.testing.assert_allclose(moved, np.tile([0.0, 0.0, -shortening], (len(moved), 1)), atol=5e-3 * shortening)


@pytest.mark.parametrize("poisson", [0.3, 0.49] if NIGHTLY else [0.49])
def test_compliance_is_that_of_finer_finite_elements_within_four_percent(poisson: float) -> None:
    """Finite elements of a third of the spacing, under the same hat functions of the coarse surface."""
    coarse = fem.build_boundary(surface(0.01), young=10e3, fixed=BOTTOM, touch=TOP, poisson=poisson)
    fine = fem.build(fem.block(SIZE, 0.01 / 3), young=10e3, fixed=BOTTOM, touch=TOP, poisson=poisson)
    expand = np.kron(_hats(coarse, fine), np.eye(3))
    reference = expand.T @ fine.compliance.astype(float) @ expand
    off = coarse.compliance - reference
    assert np.linalg.norm(off) < 0.04 * np.linalg.norm(reference)
    assert coarse.record["asymmetry"] < 0.06
    assert coarse.record["unknowns"] == 3 * coarse.record["nodes"]
    assert coarse.record["tetrahedra"] == coarse.record["modes"] == 0


def _hats(coarse: fem.Body, fine: fem.Body) -> np.ndarray:
    """Return the share of each fine node in a unit force on each coarse node (fine, coarse)."""
    faces = coarse.triangles[coarse.contents.contact_triangles]
    weight = np.zeros((len(fine.nodes), len(coarse.points)))
    for face in faces:
        a, b, c = coarse.points[face][:, :2]
        one, two = np.linalg.solve(np.stack([b - a, c - a], axis=1), (fine.nodes[:, :2] - a).T)
        shares = np.stack([1.0 - one - two, one, two], axis=1)
        inside = (shares > -1e-9).all(axis=1)
        weight[inside] = 0.0
        weight[np.ix_(inside, face)] = shares[inside]
    weight = weight[:, coarse.contents.nodes] * fine.contents.areas[:, None]
    return np.asarray(weight / weight.sum(axis=0))


def test_stiffness_follows_a_rotation_of_the_body(block: fem.Body) -> None:
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # z becomes x
    other = fem.build_boundary(surface(0.01, turn), young=10e3, fixed="x < 0.001 mm", touch="x > 19.9 mm", poisson=0.3)
    order = [int(np.argmin(np.linalg.norm(other.nodes - turn @ node, axis=1))) for node in block.nodes]
    rows = (3 * np.array(order)[:, None] + np.arange(3)).ravel()
    expand = np.kron(np.eye(len(order)), turn)
    back = expand.T @ other.compliance.astype(float)[np.ix_(rows, rows)] @ expand
    assert np.abs(back - block.compliance).max() < 1e-3 * np.abs(block.compliance).max()


def test_doubled_lengths_halve_the_compliance(block: fem.Body) -> None:
    mesh = surface(0.01)
    large = fem.build_boundary(
        Mesh(2.0 * mesh.vertices, mesh.triangles), young=10e3, fixed=BOTTOM, touch="z > 39.8 mm", poisson=0.3
    )
    np.testing.assert_allclose(large.compliance, block.compliance / 2.0, rtol=1e-4, atol=1e-6)


def test_a_body_in_a_file_runs_in_a_scenario(block: fem.Body, tmp_path: Path) -> None:
    path = block.save(tmp_path / "block.h5")
    for kind in ("compliance", "signed_distance"):
        trace = simulate(
            {
                "device": {"name": "phantom-premium-1.5a"},
                "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
                "servo": {"period": "1 ms"},
                "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
                "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.3 N"]},
                "object": {
                    "kind": "body",
                    "position": ["0 mm", "0 mm", "-6 mm"],
                    "body": {"file": str(path), "kind": kind, "origin": ["20 mm", "20 mm", "20 mm"], "radius": "6 mm"},
                },
                "run": {"duration": "0.3 s"},
            }
        )
        assert trace.completed
        assert np.linalg.norm(trace["object_force"][-1]) > 0.01
    assert fem.load(path).record["method"] == "boundary elements"


@pytest.mark.filterwarnings("ignore:.*nodes")
@pytest.mark.parametrize("kind", ["compliance", "signed_distance"])
def test_a_press_needs_the_force_of_the_finite_elements_within_five_percent(block: fem.Body, kind: str) -> None:
    solid = fem.build(fem.block(SIZE, 0.01), young=10e3, fixed=BOTTOM, touch=TOP, poisson=0.3)
    forces = []
    for body in (block, solid):
        model = body if kind == "compliance" else body.signed_distance()
        forces.append([model.indent(at, 0.006, 0.003).force[2] for at in ((0.02, 0.02, 0.02), (0.017, 0.022, 0.02))])
    np.testing.assert_allclose(forces[0], forces[1], rtol=0.05)
    assert np.all(np.array(forces) > 0.05)


def test_a_point_is_in_the_body_if_it_is_in_the_block(block: fem.Body) -> None:
    random = np.random.default_rng(3)
    for point in random.uniform(-0.01, 0.05, (100, 3)):
        assert block.contains(point) == bool(((point > 0.0) & (point < SIZE)).all())


def test_what_needs_tetrahedra_says_so(block: fem.Body) -> None:
    with pytest.raises(fem.BodyError, match="from its surface alone: build it by finite elements"):
        block.mass_spring("1 ms")
    with pytest.raises(fem.BodyError, match="from its surface alone"):
        block.hyperelastic("1 ms")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fixed": "sphere 0 0 0 radius 1 mm"}, "no whole triangle of the surface is fixed"),
        ({"touch": "z > 90 mm"}, "no contact node"),
        ({"memory": "1 MB"}, "over the budget"),
        ({"order": 3}, "of order 1"),
        ({"poisson": 0.5}, "poisson"),
    ],
)
def test_a_refusal_names_its_reason(change: dict[str, object], message: str) -> None:
    inputs = {"young": 10e3, "fixed": BOTTOM, "touch": TOP, **change}
    with pytest.raises(PalpateError, match=message):
        fem.build_boundary(surface(0.01), **inputs)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("offset", "message"),
    [
        (None, "boundary elements need a clean surface, oriented outward"),  # one block, turned inside out
        ((0.0173, 0.0071, 0.0), "boundary elements need a clean surface"),
        ((0.02, 0.01, 0.0), "the surface overlaps or touches itself at"),  # edges meet edges: no edge cuts a triangle
        (
            (0.04, 0.0, 0.0),
            r"the surface overlaps or touches itself at \(40, [\d.]+, [\d.]+\) mm",
        ),  # side by side, not united
    ],
)
def test_a_surface_without_an_exact_inside_is_refused(offset: tuple[float, ...] | None, message: str) -> None:
    """Blocks that overlap would count their common part twice, and each would ignore the other."""
    mesh = surface(0.01)
    points, faces = mesh.vertices, mesh.triangles
    if offset is None:
        faces = faces[:, ::-1]
    else:
        points, faces = np.vstack([points, points + np.array(offset)]), np.vstack([faces, faces + len(points)])
    with pytest.raises(fem.BodyError, match=message):
        fem.build_boundary(Mesh(points, faces, repair=False), young=10e3, fixed=BOTTOM, touch=TOP)


def test_a_cavity_that_is_not_fixed_is_refused() -> None:
    outer, inner = surface(0.02), surface(0.02)
    hole = 0.25 * (inner.vertices - np.array(SIZE) / 2) + np.array(SIZE) / 2
    both = Mesh(
        np.vstack([outer.vertices, hole]),
        np.vstack([outer.triangles, inner.triangles[:, ::-1] + len(outer.vertices)]),
        repair=False,
    )
    with pytest.raises(fem.BodyError, match="a piece or a cavity of the surface has no fixed triangle"):
        fem.build_boundary(both, young=10e3, fixed=BOTTOM)


def test_the_command_builds_by_boundary_elements_and_refuses_what_they_do_not_know(tmp_path: Path) -> None:
    mesh, source = surface(0.02), tmp_path / "block.stl"
    trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles).export(source)
    words = ["body", "build", str(source), "--unit", "mm", "--young", "10 kPa", "--fixed", BOTTOM, "--boundary"]
    assert CliRunner().invoke(app, words).exit_code == 0
    shown = CliRunner().invoke(app, ["body", "show", str(tmp_path / "block.h5")]).output
    assert "boundary elements, quadratic" in shown
    refused = CliRunner().invoke(app, [*words, "--modes", "5"])
    assert refused.exit_code == 2
    assert "leave out --region" in " ".join(refused.output.split())


def test_a_unit_that_makes_a_body_of_light_years_is_refused(tmp_path: Path) -> None:
    mesh, source = surface(0.02), tmp_path / "block.stl"
    trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles).export(source)
    with pytest.raises(fem.BodyError, match="give the unit of its coordinates"):
        fem.build_boundary(source, young=10e3, fixed=BOTTOM, unit="parsec")
    with pytest.raises(fem.BodyError, match="give the unit of its coordinates"):
        fem.build(source, young=10e3, fixed=BOTTOM, unit="parsec")


def test_a_truncated_surface_is_refused_in_one_sentence(tmp_path: Path) -> None:
    mesh, source = surface(0.005), tmp_path / "block.stl"
    data = trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles).export(file_type="stl")
    source.write_bytes(data[:3000])
    with pytest.raises(MeshError, match=r"not a readable stl file|no triangles that can be read") as found:
        fem.build_boundary(source, young=10e3, fixed=BOTTOM, unit="mm")  # trimesh reads it as text with chardet, if any
    assert "module" not in str(found.value)


def test_the_reference_lists_the_arrays_of_the_file() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "body-file.md").read_text("utf-8")
    table = text.split("## Arrays")[1].split("## Regions")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == [*storage._ARRAYS, *storage._SPRINGS]
    assert f"`version = {storage.VERSION}`" in table


def test_tetrahedra_are_not_a_surface(tmp_path: Path) -> None:
    (tmp_path / "block.msh").write_text("")
    with pytest.raises(fem.BodyError, match=r"block.msh: boundary elements need a closed surface, one of .stl"):
        fem.build_boundary(tmp_path / "block.msh", young=10e3, fixed=BOTTOM, unit="mm")
