"""User interface of bodies: quantities as text, error messages, text representations."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from threading import Timer

import numpy as np
import pytest
import trimesh
from one_node import one_node
from palpate import fem as bodies
from palpate.cli.main import app
from palpate.contact.mesh import MeshError
from palpate.errors import PalpateError, PoseError
from palpate.fem import (
    Body,
    BodyError,
    HyperelasticModel,
    Material,
    QuasiStaticSolver,
    Region,
    SurfaceLayer,
    block,
    box,
    half_space,
    parse_selector,
    sphere,
)
from resealed import changed

from experiments.body_validation.__main__ import app as validation

MIDDLE = [0.02, 0.02, 0.02]
CUBE = block("20 mm", "10 mm")
TEXT = ["20 mm", "2 cm", "0.02 m"]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 20 mm of 10 kPa, bonded below, touched on its top, with vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = block(("40 mm", "40 mm", "20 mm"), "5 mm")
    bodies.build(volume, young="10 kPa", fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=10, output=path)
    return path


@pytest.fixture(scope="module")
def body(file: Path) -> Body:
    return bodies.load(file)


KINDS: dict[str, Callable[[Body], Body]] = {
    "compliance": lambda body: body,
    "modal": lambda body: body.modal("1 ms", rayleigh_beta="2 ms"),
    "viscoelastic": lambda body: body.viscoelastic("1 ms", instantaneous_ratio="1.5", retardation_time="50 ms"),
    "mass_spring": lambda body: body.mass_spring("1 ms", rayleigh_alpha="20 1/s"),
    "hyperelastic": lambda body: body.hyperelastic("1 ms", nodes_per_tip="16"),
}


def pressed() -> QuasiStaticSolver:
    """The cube of 5 kPa, bonded below."""
    return QuasiStaticSolver(HyperelasticModel(CUBE, Material("5 kPa"), "z < 0.001 mm"))


def dragged(body: Body) -> float:
    """Force along x of a flat end that is dragged along x, 1 mm deep, N."""
    way = np.linspace([0.015, 0.02, 0.019], [0.018, 0.02, 0.019], 60)
    body.core.reset()
    return float(body.simulate_path(way, "8 mm", outward=(0, 0, 1), tip="flat").friction[-1, 0])


@pytest.mark.parametrize("name", KINDS)
def test_friction_stays_when_a_kind_is_made_of_a_rough_body(body: Body, name: str) -> None:
    """Before or after the kind, the same friction; numbers of its own count more; `scaled_stiffness` keeps both."""
    make = KINDS[name]
    plain = make(body)
    rough = make(body.with_friction("0.5", 0.4))
    assert rough.kind.friction == (0.5, 0.4)
    assert dragged(rough) < -0.01
    assert dragged(rough) == dragged(plain.with_friction(0.5, 0.4))
    hard = rough.scaled_stiffness(2.0)
    assert dragged(hard) == pytest.approx(2.0 * dragged(rough), rel=0.05)
    assert hard.kind == rough.kind
    assert plain.kind.friction == (0.0, 0.0)
    if name == "modal":
        assert body.with_friction(0.5).modal("1 ms", static_friction=0.0).kind.friction == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("compliance", "compliance, friction 0.5, 0.4 sliding"),
        ("modal", "modal (period 1 ms, rayleigh_beta 2 ms), friction"),
        ("viscoelastic", "viscoelastic (period 1 ms, instantaneous_ratio 1.5, retardation_time 50 ms), friction"),
        ("mass_spring", "mass_spring (period 1 ms, rayleigh_alpha 20 1/s), friction"),
        ("hyperelastic", "hyperelastic (period 1 ms, neo-hookean, update_interval 20 ms, nodes_per_tip 16), friction"),
    ],
)
def test_a_body_says_what_it_is(body: Body, name: str, told: str) -> None:
    assert f"<Body: {told}" in repr(KINDS[name](body.with_friction(0.5, 0.4)))
    assert repr(body) == (
        "<Body: compliance, no friction; 81 contact nodes, 10 modes, 40 × 40 × 20 mm, source: block of 40 x 40 x 20 mm>"
    )


def test_quantities_are_text_or_si(body: Body) -> None:
    """The same body, place, material and press from text as from numbers."""
    assert Material("5 kPa", "0.3", "1 g/cm^3") == Material(5e3, 0.3, 1000.0)
    assert (
        Material(5e3, surface_layer="2 mm = 50 kPa").surface_layer
        == SurfaceLayer("2 mm", "50 kPa")
        == SurfaceLayer(2e-3, 50e3)
    )
    assert Region("z < 1 mm", "25 kPa").young == Region.parse("z < 1 mm = 25 kPa").young == 25e3
    assert str(Region.parse("z <= 1 mm = 25 kPa").where) == "z <= 1 mm"
    assert str(sphere(["1 cm", 0, 0], "5 mm")) == str(sphere((0.01, 0, 0), 5e-3)) == "sphere 10 0 0 radius 5 mm"
    assert str(box(["0 mm"] * 3, (0.01, "1 cm", "10 mm"))) == "box 0 0 0 to 10 10 10 mm"
    assert (
        str(half_space("z", "<", "1 mm"))
        == str(parse_selector("z < 1mm"))
        == str(parse_selector("Z<1e-3m"))
        == "z < 1 mm"
    )
    assert str(parse_selector("sphere 1 cm 0 mm 0 mm radius 5 mm")) == "sphere 10 0 0 radius 5 mm"
    felt, same = body.indent(TEXT, "8 mm", "1 mm", tip="flat"), body.indent(MIDDLE, 8e-3, 1e-3, tip="flat")
    assert felt.force == pytest.approx(same.force, rel=1e-12)
    assert np.array_equal(body.simulate_path([TEXT], "8 mm").force, body.simulate_path([MIDDLE], 8e-3).force)
    assert body.scaled_stiffness("2").contents.young[0] == pytest.approx(2e4)
    assert body.scaled_stiffness(4.0).scaled_stiffness(0.5).record["scaled_stiffness"] == 2.0
    solid = HyperelasticModel(block("20 mm", "10 mm"), Material("5 kPa"), "z < 0.001 mm")
    forces = [QuasiStaticSolver(solid).indent(at, 8e-3, 1e-4, outward=(0, 0, 2))[0] for at in (TEXT[:3], MIDDLE)]
    assert np.array_equal(*forces)
    assert repr(solid) == (
        "<HyperelasticModel: neo-hookean, of "
        "<Volume: 48 tetrahedra, 27 points, 20 × 20 × 20 mm, block of 20 x 20 x 20 mm>>"
    )


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda body: Material("5 mm"), 'young: "5 mm" is a length'),
        (lambda body: Material(np.nan), "young: nan is not a finite number"),
        (lambda body: Material(5e3, [0.3]), r"poisson: \[0.3\] is not a quantity"),
        (
            lambda body: SurfaceLayer.parse("2 mm"),
            'surface_layer: "2 mm" cannot be read; write for example "2 mm = 50 kPa"',
        ),
        (lambda body: Region.parse("z < 1 mm = "), 'region: "z < 1 mm = " cannot be read; write'),
        (lambda body: Region.parse("z <= 1 mm"), 'region: "z <= 1 mm" cannot be read; write'),
        (lambda body: bodies.load(None), "a file is named by text or a Path, not by None"),
        (lambda body: parse_selector("z < -12"), '"z < -12": "-12" has no unit.*write it as "-12 m"'),
        (lambda body: parse_selector("box 0 0 0 to 1 1 1"), '"1" has no unit'),
        (lambda body: parse_selector("z < 5 kPa"), '"z < 5 kPa": "5 kPa" is a pressure'),
        (lambda body: parse_selector("surface surface z < 1 mm"), "is no region; write"),
        (lambda body: parse_selector(3.0), "3.0 is no region; write"),
        (
            lambda body: bodies.phantom(spacing="60 mm"),
            "spacing: 60 mm exceeds the height of the block, 50 mm: use 5 mm",
        ),
        (lambda body: bodies.phantom(depth="10 cm"), "depth: 100 mm; the nodule lies between.*: from 2 to 35 mm"),
        (
            lambda body: bodies.phantom(diameter="49 mm"),
            "diameter: 49 mm; the nodule does not fit between",
        ),
        (lambda body: bodies.phantom(depth=np.nan), "depth: nan is not a finite number"),
        (lambda body: bodies.phantom(contrast=0.0), "contrast: 0 must be positive"),
        (lambda body: bodies.phantom(spacing=np.nan), "spacing: nan is not a finite number"),
        (lambda body: block((0.1, 0.1), 0.01), "size: a block needs three values, or one for all axes, not 2"),
        (lambda body: bodies.grid([[0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]), "three increasing lists"),
        (lambda body: bodies.build(block(0.02, 0.01), young=1e3, fixed="z < 1 mm", modes=2.5), "modes: 2.5 must be"),
        (lambda body: body.modal("1 ms", rayleigh_alpha="5 Pa"), 'rayleigh_alpha: "5 Pa" is a pressure'),
        (
            lambda body: body.modal("1 ms", instantaneous_ratio=0.5),
            "instantaneous_ratio: .* is 1 or more, not 0.5",
        ),
        (lambda body: body.mass_spring(True), "period: True is not a quantity"),
        (lambda body: body.with_friction(0.3, "0.4"), r"dynamic_friction: 0.4 must not exceed static_friction \(0.3\)"),
        (
            lambda body: body.hyperelastic("1 ms", nodes_per_tip=4.5),
            "nodes_per_tip: 4.5 must be a whole number, from 4 to 64",
        ),
        (lambda body: body.scaled_stiffness(-2.0), "stiffness_scale: -2 must be positive"),
        (lambda body: body.scaled_stiffness(1e300), "stiffness_scale: 1e.300 must be between"),
        (lambda body: body.indent(["20", "20", "20"], 8e-3, 1e-3), 'point: "20" has no unit'),
        (lambda body: body.indent("20 mm", 8e-3, 1e-3), "a point is three finite numbers"),
        (lambda body: body.indent(MIDDLE, [8e-3, 8e-3], 1e-3), "radius: .* is not a quantity"),
        (lambda body: body.indent(MIDDLE, np.array([8e-3, 8e-3]), 1e-3), "radius: array.* is not a quantity"),
        (lambda body: body.indent(MIDDLE, 8e-3, np.inf), "depth: inf is not a finite number"),
        (lambda body: body.indent(MIDDLE, 8e-3, "-3 mm"), 'depth: "-3 mm" points out of the body'),
        (
            lambda body: pressed().indent(MIDDLE, 8e-3, -1e-3, outward=(0, 0, 1)),
            "depth: -0.001 m points out of the body",
        ),
        (lambda body: body.indent(MIDDLE, 8e-3, 1.0), "depth: 1 m exceeds the body's extent"),
        (lambda body: body.indent(MIDDLE, 8e-3, 0.021), "depth: 21 mm exceeds the 20 mm of the body along the press"),
        (lambda body: body.indent(MIDDLE, 0.1, 1e-3), "radius: 0.1 m exceeds the body's extent"),
        (
            lambda body: body.indent([0.0, 0.02, 0.005], 8e-3, 1e-3),
            "the point lies 0 mm from a part of the surface that is not touched, and 15 mm from the contact surface",
        ),
        (lambda body: body.simulate_path([[0.0, 0.0], [0.0]], 8e-3), "path: its rows must have the same length"),
        (lambda body: body.simulate_path(MIDDLE, 8e-3), r"a path is \(m, 3\) numbers in m; this has shape \(3,\)"),
        (
            lambda body: body.simulate_path([MIDDLE, [0, 0, np.nan]], 8e-3),
            r"path: row 1 of 2 has .* not finite: \(0, 0, nan\)",
        ),
        (
            lambda body: body.simulate_path([[20.0, 20.0, 28.0]], 8e-3),
            "path: it stays 39.* m from the body, whose extent is .* m: lengths are in m",
        ),
        (
            lambda body: pressed().simulate_path([[20.0, 20.0, 28.0]], 8e-3, outward=(0, 0, 1)),
            "path: it stays 39.* m from the body",
        ),
        (
            lambda body: pressed().simulate_path([[0, np.inf, 0]], 8e-3, outward=(0, 0, 1)),
            "path: row 0 of 1 has .* not finite",
        ),
        (lambda body: body.simulate_path([MIDDLE], 8e-3, outward=(0, 0, 0)), "not all of them zero"),
        (lambda body: body.simulate_path([MIDDLE], 8e-3, outward="up"), "outward: a direction is three numbers"),
        (lambda body: body.indent(MIDDLE, 1e-12, 1e-3), "radius: 1e-12 m is less than a thousandth of the depth"),
        (lambda body: body.mass_spring(1e-300), "period: 1e-300 s; a tick lasts from 0.1 us to 100 s"),
        (lambda body: body.hyperelastic("1 ms", update_interval=1e9), "update_interval: it lasts a million ticks"),
        (lambda body: Material(1e300), "young: Young's modulus is positive"),
        (lambda body: Material(5e3, density=1e-300), "density: the density is positive"),
        (lambda body: Material(5e3, surface_layer=2e-3), "surface_layer: 0.002 is no layer; write"),  # type: ignore[arg-type]
        (lambda body: Material(5e3, regions=[("z < 1 mm", 5e3)]), "regions: .* is no region; write"),  # type: ignore[list-item]
        (lambda body: bodies.build([1], young=1e3, fixed=""), r"a Volume, a Mesh or a mesh file, not from \[1\]"),
        (lambda body: bodies.build(CUBE, young=1e3, fixed=0.001), "0.001 is no region"),
        (
            lambda body: bodies.build(CUBE, young=1e3, fixed="z < 1 m"),
            r"no contact node: all .* are fixed; the body extends from \(0, 0, 0\) to \(20, 20, 20\) mm$",
        ),
        (lambda body: bodies.Volume([["0 mm"] * 3] * 3 + [["1 s"] * 3], [[0, 1, 2, 3]]), 'points: "1 s" is a time'),
        (
            lambda body: bodies.Volume([[0, 0, 0], [1, np.nan, 0], [0, 1, 0], [0, np.inf, np.nan]], [[0, 1, 2, 3]]),
            r"these are \(4, 3\), 2 of them not finite, the first has index 1",
        ),
        (lambda body: bodies.Volume(np.eye(4, 3), [[0, 1, 2, -1]]), "has the point index -1; indices are 0 to 3"),
        (lambda body: bodies.fill(np.eye(3), [[0, 1, 9]], 0.1), "triangle 0 is"),
        (lambda body: HyperelasticModel(CUBE, 5e3, "z < 1 mm"), "a Volume and a Material, not of <Volume: 48"),
        (
            lambda body: HyperelasticModel(CUBE, Material(5e3), []),
            "nothing is fixed, so the body has rigid-body motions",
        ),
        (lambda body: QuasiStaticSolver(CUBE), "solid: a palpate.fem.HyperelasticModel is needed"),
        (
            lambda body: HyperelasticModel(CUBE, Material(5e3), "z < 1 mm").solve_equilibrium(
                0 * CUBE.points, max_steps=2.5
            ),
            "max_steps: 2.5 must be",
        ),
        (
            lambda body: HyperelasticModel(CUBE, Material(5e3), "z < 1 mm").solve_equilibrium("1 N"),
            "numbers are needed, three for each point",
        ),
    ],
)
def test_a_mistake_is_one_sentence(body: Body, wrong: Callable[[Body], object], sentence: str) -> None:
    with pytest.raises(PalpateError, match=sentence) as caught:
        wrong(body)
    assert isinstance(caught.value, BodyError | PoseError | MeshError)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("young", None, "not a complete body"),
        ("points", 3.0, "not a complete body: points has the shape"),
        ("normals", np.zeros((81, 3)), "it holds invalid numbers"),
        ("areas", np.zeros(81), "it holds invalid numbers"),
        ("record", "{}", "its record names no source"),
        ("record", "{", "record: not JSON"),
    ],
)
def test_a_file_that_holds_no_body_is_refused(
    file: Path, tmp_path: Path, name: str, value: object, sentence: str
) -> None:
    broken = Path(shutil.copy(file, tmp_path / "broken.h5"))
    with changed(broken) as store:
        if name == "record":
            store.attrs[name] = value
        else:
            del store[name]
            if value is not None:
                store[name] = value
    with pytest.raises(BodyError, match=f"broken.h5: {sentence}"):
        bodies.load(broken)


COMMANDS: list[tuple[str, str]] = [
    ("build none.stl --young 5kPa", "none.stl: there is no such file"),
    ("build folder --unit mm --young 5kPa", "folder: a folder; give the mesh's file"),
    ("build . --unit mm --young 5kPa", ".: a folder"),
    ("build block.h5 --unit mm --young 5kPa", "block.h5: not a mesh; if it is a body, show it by"),
    ("build ball.stl --young 5kPa --fixed z<1mm", "ball.stl: the file has no unit: give it"),
    ("build ball.stl --unit kPa --young 5kPa --fixed z<1mm", 'unit: "kPa" is not a unit of length'),
    ("build ball.stl --unit mm --young 5kPa", "nothing is fixed"),
    ("build ball.stl --unit mm --young 5kPa --fixed z<-12", 'no unit, and a length is needed; write it as "-12 m"'),
    ("build ball.stl --unit mm --young 5kPa --fixed z<nan", '"z<nan" is no region'),
    ("build ball.stl --unit mm --young 5kPa --fixed w<1mm", '"w<1mm" is no region'),
    ("build ball.stl --unit mm --young 5kPa --fixed z<1mm --surface-layer 2mm", 'write for example "2 mm = 50 kPa"'),
    ("build ball.stl --unit mm --young 5kPa --fixed z<1mm -o w.txt", "a body is an HDF5 file, named for example w.h5"),
    ("build ball.stl --unit mm --young 5kPa --fixed z<1mm -o folder.h5", "cannot be written: Is a directory"),
    ("build ball.stl --unit mm --young 5kPa --fixed z<1mm -o w.txt/b.h5", "w.txt is a file, not a folder"),
    ("build ball.stl --unit mm --young 5kPa --fixed z<1mm", "ball.stl: the file has no triangles that can be read"),
    (
        "build w.txt --unit mm --young 5kPa --fixed z<1mm",
        "w.txt: the suffix is not that of a mesh",
    ),
    ("build bad.msh --unit mm --young 5kPa --fixed z<1mm", "bad.msh: not a complete volume mesh that meshio can read"),
    ("phantom --depth nan", 'depth: "nan" is not a finite number'),
    ("phantom --depth inf", 'depth: "inf" is not a finite number'),
    ("phantom --contrast 0", "contrast: 0 must be positive"),
    ("phantom -o w.txt", "w.txt: a body is an HDF5 file"),
    (
        "show ball.stl",
        "a mesh, not a body; build a body from it, for example with: palpate body build ball.stl --unit mm",
    ),
    ("show folder", "folder: a folder; give the body's file"),
    ("show w.txt", "w.txt: not a body (.h5)"),
]


def test_a_command_ends_in_one_sentence_and_spoils_nothing(
    file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, the sentence, no file made or changed, and nothing else printed but stages."""
    monkeypatch.chdir(file.parent)
    Path("folder.h5").mkdir()
    Path("folder").mkdir()
    for name, text in (("w.txt", "notes"), ("ball.stl", "solid"), ("bad.msh", "$MeshFormat\n4.1 0 8\n")):
        Path(name).write_text(text)
    before = {path: path.stat().st_mtime_ns for path in file.parent.iterdir()}
    for command, sentence in COMMANDS:
        assert app(["body", *command.split()], standalone_mode=False) == 2
        said = " ".join(capfd.readouterr().err.split())
        assert sentence in said, said
        assert "Traceback" not in said
    assert {path: path.stat().st_mtime_ns for path in file.parent.iterdir()} == before


def test_the_validation_ends_in_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    assert validation(["--paths", "0"], standalone_mode=False) == 2
    assert "paths: 0 must be a whole number, 1 or more" in " ".join(capfd.readouterr().err.split())


def test_a_body_of_a_short_record_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that a program of its own wrote: what is not said there is not needed."""
    assert app(["body", "show", str(one_node(100.0, tmp_path / "ö β.h5"))], standalone_mode=False) in (None, 0)
    assert "one node: 1 tetrahedra, 4 vertices, 1 contact nodes" in capsys.readouterr().out


def test_ctrl_c_while_meshing_reaches_python() -> None:
    """fTetWild takes the signal for itself where it runs: here it would end the tests."""
    pytest.importorskip("pytetwild", exc_type=ImportError)
    sphere = trimesh.creation.icosphere(3, 0.02)
    timer = Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))

    def fill() -> None:
        timer.start()
        bodies.fill(sphere.vertices, sphere.faces, "1 mm", mesher="ftetwild")
        timer.join()  # on a quicker machine

    with pytest.raises(KeyboardInterrupt):
        fill()


def test_what_is_drawn_is_the_surface_with_its_fixed_vertices() -> None:
    """Nodes where the press has moved them, fixed vertices where they were, in the numbering of the triangles."""
    whole = bodies.build(block(("40 mm", "40 mm", "10 mm"), "10 mm"), young="5 kPa", fixed="z < 0.001 mm", order=1)
    moved = whole.surface.vertices + whole.on_surface(1e-3 * np.ones_like(whole.nodes))
    rest = whole.surface.vertices
    assert (rest[:, 2] == 0.0).any()
    assert np.array_equal(moved[rest[:, 2] == 0.0], rest[rest[:, 2] == 0.0])
    assert moved[rest[:, 2] > 0.0] == pytest.approx(rest[rest[:, 2] > 0.0] + 1e-3)
    felt = whole.indent(["20 mm", "20 mm", "10 mm"], "12 mm", "1 mm", tip="flat")  # on nodes inside the top only
    assert whole.on_surface(whole.pressure() * whole.contents.areas).sum() == pytest.approx(felt.force[2], rel=1e-6)
    with pytest.raises(BodyError, match=r"each of the 25 nodes is needed, not \(3,\)"):
        whole.on_surface([1.0, 2.0, 3.0])


def test_a_pressed_solid_refuses_what_is_no_tip() -> None:
    solid = QuasiStaticSolver(HyperelasticModel(block("20 mm", "10 mm"), Material("5 kPa"), "z < 0.001 mm"))
    for options, sentence in (
        ({"tip": "Flat"}, "not 'Flat'"),
        ({"outward": (0, 0)}, "three numbers"),
        ({"radius": ["8 mm"] * 2}, "2 values for 1 tips"),
        ({"every": 0}, "every: 0 must be a whole number, 1 or more"),
    ):
        with pytest.raises(PalpateError, match=sentence):
            solid.simulate_path([MIDDLE], **{"radius": "8 mm", "outward": (0, 0, 1), **options})
    with pytest.raises(BodyError, match="steps: 0"):
        solid.indent(MIDDLE, "8 mm", "1 mm", outward=(0, 0, 1), steps=0)
