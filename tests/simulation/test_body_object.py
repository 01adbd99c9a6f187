"""A body in a scenario: what is read, what is refused, and that the loop on it obeys the laws of simpler objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from one_node import one_node
from palpate import fem as bodies
from palpate import simulate
from palpate.errors import ScenarioError, StabilityError
from palpate.metrics import summarize
from palpate.metrics.body_contact import work_so_far
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.simulation.bodies import cache_path, depths_at_rest, scenario_body, tip_depths
from palpate.simulation.evidence import evidence
from palpate.simulation.simulator import build_simulation
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window
from palpate.stability import certify
from scipy.spatial.transform import Rotation

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"}


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 20 mm of 10 kPa, bonded below, touched on its top, with vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = bodies.block((0.04, 0.04, 0.02), (0.005, 0.005, 0.01))
    bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=10, output=path)
    return path


def tables(body: dict[str, Any], **other: Any) -> dict[str, Any]:
    """A press of 0.3 N along -z by a hand-held arm; `body` is [object.body], and tables lie over it."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.3 N"]},
        "operator": HAND,
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-0.5 mm"], "body": body},
        "run": {"duration": "0.25 s"},
        **other,
    }


def on(block: Path, **options: Any) -> dict[str, Any]:
    middle = ["20 mm", "20 mm", "20 mm"]
    return {"file": str(block), "origin": middle, "radius": "8 mm", "tip": "flat", **options}


def refusal(text: str, base: Path | None = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        simulate(Scenario.from_text(text, "press.toml", base))
    return str(caught.value)


def test_the_rounding_of_a_body_is_no_growing_oscillation(block: Path) -> None:
    """Its compliance has single precision: an oscillation below 1e-5 of the deflection is not evidence of growth."""
    scenario = Scenario.model_validate(tables(on(block)))
    run = simulate(scenario)
    count = len(run.time)
    deep = float(np.linalg.norm(run["deflection"][-1]))
    for share, seen in ((0.5e-5, False), (2e-5, True)):
        wave = share * deep * 4.0 ** np.linspace(-2.0, 0.0, count) * np.sin(0.7 * np.arange(count))
        moving = run["tip"][-1] + wave[:, None] * [1.0, 0.0, 0.0]
        held = {name: np.tile(run[name][-1], (count, 1)) for name in run.channels if name not in ("tip", "time")}
        found = evidence(
            Trace.of(1e-3 * np.arange(count), {**held, "tip": moving}), scenario, Window(0, count - 1), None
        )
        assert (found.late[0] > found.prior[0] > 0.0) == seen


@pytest.mark.parametrize("tip", ["flat", "sphere"])
@pytest.mark.parametrize("turn", [[], ["20 deg", "-15 deg", "40 deg"]])
def test_the_depth_of_a_tip_is_that_of_its_lowest_point_under_the_plane_at_rest(
    block: Path, tip: str, turn: list[str]
) -> None:
    """The top at rest is a plane, which the start tip is 0.5 mm above, whatever the body does."""
    turned = {"rotation": turn} if turn else {}
    run = simulate(Scenario.model_validate(tables(on(block, tip=tip, **turned))))
    normal = Rotation.from_euler("xyz", np.radians([20.0, -15.0, 40.0]) if turn else np.zeros(3)).as_matrix()[:, 2]
    top = run["tip"][0] + np.array([0.0, 0.0, -0.5e-3])
    lowest = (run["tip"] - top) @ normal - (8e-3 if tip == "sphere" else 0.0)
    depth = tip_depths(run)
    assert depth is not None
    np.testing.assert_allclose(depth, np.maximum(-lowest, 0.0), atol=1e-9)
    found = summarize(run)["palpation"]
    deepest = int(np.argmax(np.linalg.norm(run["deflection"], axis=1)))
    assert found["tip_depth_m"] == pytest.approx(depth[deepest])
    assert found["final_tip_depth_m"] == pytest.approx(depth[-101:].mean(), rel=1e-3)


def test_a_body_of_one_node_is_a_wall(tmp_path: Path) -> None:
    """The same run on a wall of the same stiffness: equal to rounding, tick by tick."""
    path = one_node(1024.0, tmp_path / "one.h5")
    on_body = simulate(tables({"file": str(path), "radius": "20 mm", "tip": "flat"}))
    wall = {"kind": "wall", "stiffness": "1024 N/m", "position": ["0 mm", "0 mm", "-0.5 mm"], "normal": [0, 0, 1]}
    on_wall = simulate({**tables({}), "object": wall})
    assert np.array_equal(on_body["touching"], on_wall["touching"])
    for channel in ("tip", "deflection", "object_force", "command_force"):
        np.testing.assert_allclose(on_body[channel], on_wall[channel], atol=1e-9)
    assert on_body["object_force"][-1, 2] < -0.1
    np.testing.assert_allclose(on_body["stored_energy"][:, 0], 512.0 * on_body["deflection"][:, 2] ** 2, atol=1e-9)
    assert set(on_body["contact_nodes"][:, 0]) == {0.0, 1.0}
    assert "only 1 node carries" in summarize(on_body)["verdict"]


@pytest.mark.parametrize("tip", ["sphere", "flat"])
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("compliance", {}),
        ("modal", {"rayleigh_beta": "1 ms"}),
        ("viscoelastic", {"instantaneous_ratio": 2.0, "retardation_time": "50 ms"}),
        ("modal", {"rayleigh_beta": "1 ms", "static_friction": 0.5}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "static_friction": 0.5, "dynamic_friction": 0.4}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "update_interval": "20 ms"}),
        ("modal", {"rayleigh_beta": "1 ms", "update_interval": "7 ms", "static_friction": 0.5}),
    ],
)
def test_the_loop_feels_what_the_body_answers(block: Path, tip: str, kind: str, options: dict[str, Any]) -> None:
    """The tip's way played to the body by itself, in the body's own turned frame, gives the loop's forces back."""
    chosen = on(block, kind=kind, rotation=["5 deg", "-10 deg", "40 deg"], **options) | {"tip": tip}
    scenario = Scenario.from_dict(tables(chosen))
    trace = simulate(scenario)
    turn = Rotation.from_euler("xyz", [5.0, -10.0, 40.0], degrees=True).as_matrix()
    anchor = trace["tip"][0] + [0.0, 0.0, -0.5e-3]
    path = (trace["tip"] - anchor) @ turn + [0.02, 0.02, 0.02]
    body = scenario_body(scenario)
    body.core.reset()
    felt = body.simulate_path(path, 8e-3, outward=[0, 0, 1], tip=tip)  # type: ignore[arg-type]
    assert felt.nodes.max() >= 3
    np.testing.assert_allclose(trace["object_force"], -felt.force @ turn.T, atol=1e-9)
    np.testing.assert_allclose(trace["deflection"], felt.deflection @ turn.T, atol=1e-12)
    np.testing.assert_array_equal(trace["contact_nodes"][:, 0], felt.nodes)


def test_the_same_scenario_gives_the_same_trace(block: Path) -> None:
    """Bit for bit, though the body has a state that a run leaves behind; and through the scenario's own text."""
    scenario = Scenario.from_dict(
        tables(on(block, kind="viscoelastic", instantaneous_ratio=3.0, retardation_time="20 ms"))
    )
    first, second = simulate(scenario), simulate(Scenario.from_dict(scenario.to_dict()))
    assert scenario.to_dict() == Scenario.from_dict(scenario.to_dict()).to_dict()
    for channel in first.channels:
        assert np.array_equal(first[channel], second[channel]), channel


def test_energy_is_accounted_for(block: Path) -> None:
    """Elastic: the tip's work is what the body stores. A standard linear solid keeps some of it; none is made."""
    table = [["0 s", "0 N", "0 N", "0 N"], ["0.1 s", "0 N", "0 N", "-0.4 N"], ["0.2 s", "0 N", "0 N", "0.3 N"]]
    out = {"reference": {"shape": "table", "table": table}}
    found = {}
    for kind, options in {
        "compliance": {},
        "viscoelastic": {"instantaneous_ratio": 3.0, "retardation_time": "20 ms"},
    }.items():
        trace = simulate(tables(on(block, kind=kind, **options), **out))
        found[kind] = summarize(trace)["palpation"]
        assert not trace["touching"][-1, 0]
        assert trace["touching"].any()
        assert trace["stored_energy"][-1, 0] == found[kind]["stored_J"]
    most = float(trace["stored_energy"].max())
    assert most > 1e-5
    assert found["compliance"]["stored_J"] == 0.0
    assert 0.0 < found["viscoelastic"]["stored_J"] < 1e-3 * most  # has yet to creep back
    assert abs(found["compliance"]["lost_J"]) < 1e-3 * most
    assert found["viscoelastic"]["lost_J"] > 0.05 * most


def test_a_run_that_begins_in_contact_ends_with_what_the_body_holds(block: Path) -> None:
    """2 mm deep at the start, let go: nothing is stored at the end; what came out was there at the first sample."""
    table = [["0 s", "0 N", "0 N", "0 N"], ["0.2 s", "0 N", "0 N", "1.5 N"]]
    scenario = tables(on(block), reference={"shape": "table", "table": table})
    scenario["object"]["position"] = ["0 mm", "0 mm", "2 mm"]
    trace = simulate(scenario)
    found = summarize(trace)["palpation"]
    assert not trace["touching"][-1, 0]
    assert found["at_start_J"] == trace["stored_energy"][0, 0] > 1e-5
    assert found["stored_J"] == 0.0
    assert found["work_J"] < 0.0
    assert abs(found["lost_J"]) < 2e-2 * found["at_start_J"]


def test_a_tip_that_begins_inside_of_the_body_is_refused(block: Path) -> None:
    """Its nodes face away from there, so it would not be held, and be thrown out somewhere; one radius is let pass."""
    inside = tables(on(block))
    inside["object"]["position"] = ["0 mm", "0 mm", "12 mm"]
    with pytest.raises(ScenarioError, match=r"object.position: the tip starts inside the body.*12 mm below"):
        build_simulation(inside)
    inside["object"]["position"] = ["0 mm", "0 mm", "18 mm"]  # 2 mm over the bonded bottom: what is felt is far
    with pytest.raises(ScenarioError, match=r"its center 18 mm below"):
        build_simulation(inside)
    inside["object"]["position"] = ["0 mm", "0 mm", "5 mm"]
    build_simulation(inside)


@pytest.mark.parametrize("tip", ["sphere", "flat"])
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("modal", {}),
        ("modal", {"rayleigh_beta": "2 ms", "static_friction": 0.5}),
        ("modal", {"rayleigh_alpha": "20 1/s", "instantaneous_ratio": 2.0, "retardation_time": "20 ms"}),
        ("viscoelastic", {"instantaneous_ratio": 3.0, "retardation_time": "20 ms"}),
        ("viscoelastic", {"instantaneous_ratio": 3.0, "retardation_time": "20 ms", "static_friction": 0.5}),
        ("mass_spring", {"rayleigh_beta": "2 ms"}),
    ],
)
def test_what_a_body_has_lost_it_does_not_give_back(block: Path, tip: str, kind: str, options: dict[str, Any]) -> None:
    """In, along and out: at every tick work = stored + lost, and the lost only grows; at last little is stored."""
    table = [["0 s", "0 N", "0 N", "0 N"], ["0.1 s", "0 N", "0 N", "-0.4 N"], ["0.15 s", "0.1 N", "0 N", "-0.4 N"],
             ["0.3 s", "0 N", "0 N", "0.4 N"], ["0.4 s", "0 N", "0 N", "0.4 N"]]  # fmt: skip
    moved = {"reference": {"shape": "table", "table": table}, "run": {"duration": "0.4 s"}}
    setup = tables(on(block, kind=kind, **options) | {"tip": tip}, **moved)
    if tip == "sphere":
        setup["object"]["position"][2] = "-8.5 mm"
    trace = simulate(setup)
    stored = trace["stored_energy"][:, 0]
    lost = work_so_far(trace) - stored
    most = stored.max()
    assert most > 1e-5
    assert np.diff(lost).min() > -1e-5 * most
    touched = trace["touching"][:, 0] > 0.0
    assert not touched[-50:].any()
    assert stored[touched].min() > 0.0
    found = summarize(trace)["palpation"]
    assert found["work_J"] == pytest.approx(found["stored_J"] + found["lost_J"])
    if options:
        assert stored[-1] < 1e-3 * most
        assert found["lost_J"] > 0.02 * most
    else:  # undamped, it rings on; lost is what steps of the force do to what has no inertia
        assert 0.0 < found["lost_J"] < 0.04 * most


def test_a_trace_of_fewer_samples_tells_the_same_work(block: Path) -> None:
    """Forces of a body that holds them over a tick belong half a tick before: a fourth of two ticks, not half."""
    press = tables(on(block, kind="viscoelastic", instantaneous_ratio=3.0, retardation_time="20 ms"))
    work = [summarize(simulate({**press, "run": {"duration": "0.25 s", "record_every": n}}))["palpation"]["work_J"]
            for n in (1, 2)]  # fmt: skip
    assert work[1] == pytest.approx(work[0], rel=5e-3)


def test_the_summary_says_how_the_press_ended(block: Path) -> None:
    summary = summarize(simulate(tables(on(block), run={"duration": "0.8 s"})))
    pressed = summary["palpation"]
    assert summary["stable"]
    assert summary["verdict"].startswith("settled: presses the body in by")
    assert pressed["settled"]
    assert pressed["touches"] == 1
    assert pressed["held_J"] >= 0.0
    assert pressed["stiffness_N_per_m"] == pytest.approx(pressed["final_force_N"] / pressed["final_deflection_m"], 0.02)
    deep = {**tables(on(block)), "object": {"kind": "body", "position": ["0 mm", "0 mm", "2 mm"], "body": on(block)}}
    assert "it began 2 mm deep in the body" in summarize(simulate(deep))["verdict"]
    far = {**tables(on(block)), "object": {"kind": "body", "position": ["0 mm", "0 mm", "-90 mm"], "body": on(block)}}
    assert "never touches the object" in summarize(simulate(far))["verdict"]


def test_a_flat_end_that_sinks_deeper_than_its_radius_by_signed_distance_has_not_settled(block: Path) -> None:
    """Its force falls from 1.5 to 0.2 N on the way, and the arm alone holds it. The compliance has half the depth."""
    verdicts = {}
    for kind in ("signed_distance", "compliance"):
        press = tables(
            on(block, kind=kind),
            servo={"period": "1 ms", "topology": "impedance_display"},
            operator={**HAND, "shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-4 N"]},
            object={"kind": "body", "position": ["0 mm"] * 3, "body": on(block, kind=kind)},
            run={"duration": "1 s"},
        )
        del press["reference"]
        verdicts[kind] = simulate(press).verdict
    assert verdicts["compliance"].state is State.SETTLED
    assert verdicts["signed_distance"].state is State.UNDECIDED
    assert "mm deep, more than its radius of 8 mm" in verdicts["signed_distance"].reason


def test_the_error_by_the_mesh_is_known_for_resolved_tips_on_quadratic_elements(block: Path, tmp_path: Path) -> None:
    path, volume = tmp_path / "quadratic.h5", bodies.block((0.04, 0.04, 0.02), (0.005, 0.005, 0.01))
    bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", output=path)

    def stated(file: Path, radius: str) -> float | None:
        at = {"kind": "body", "position": ["0 mm", "0 mm", f"-{radius}"]}
        body = on(file, tip="sphere", radius=radius)
        trace = simulate(tables(body, object={**at, "body": body}, run={"duration": "80 ms"}))
        error = summarize(trace)["palpation"]["mesh_error"]
        file.rename(file.with_suffix(".away"))
        assert summarize(trace)["palpation"]["mesh_error"] is None
        file.with_suffix(".away").rename(file)
        return None if error is None else float(error)

    assert stated(path, "6 mm") is not None
    assert stated(path, "4 mm") is None
    assert stated(block, "6 mm") is None


def test_a_tip_pushed_through_the_surface_is_still_held(block: Path) -> None:
    """A flat end goes in by more than twice its radius, and the force grows with it."""
    hard = {"shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-2.5 N"]}
    trace = simulate(tables(on(block) | {"radius": "3 mm"}, reference=hard, run={"duration": "0.6 s"}))
    force, deep = -trace["object_force"][:, 2], -trace["deflection"][:, 2]
    assert trace["touching"][-100:].all()
    assert deep[-100:].min() > 6.5e-3
    assert force[-100:].min() > 4.0 * force[np.argmax(deep > 1e-3)]


def test_a_body_made_on_the_spot_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second run reads what the first one made; another recipe has another name; half a file is not read."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    made = {"shape": "block", "size": ["30 mm", "30 mm", "10 mm"], "young": "5 kPa", "spacing": "10 mm"}
    scenario = Scenario.from_dict(tables({**made, "radius": "10 mm", "tip": "flat"}))
    first = simulate(scenario)
    assert scenario.object.body is not None
    path = cache_path(scenario.object.body)
    assert path.parent == tmp_path / "palpate" / "bodies"
    begun = path.stat().st_mtime_ns
    again = simulate(scenario)
    assert path.stat().st_mtime_ns == begun
    assert np.array_equal(first["tip"], again["tip"])
    stiffer = Scenario.from_dict(tables({**made, "young": "6 kPa", "radius": "10 mm"})).object.body
    assert stiffer is not None
    assert cache_path(stiffer) != path
    # the middle of its top lies at the object's position
    felt = first["touching"][:, 0] > 0.0
    assert first["tip"][felt][0, 2] == pytest.approx(first["tip"][0, 2] - 0.5e-3, abs=2e-5)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(ScenarioError, match="build it again: delete that file, and it is built again"):
        simulate(scenario)


HEAD = """
[device]
name = "phantom-premium-1.5a"
[start]
pose = ["0 rad", "2.2305 rad", "3.2776 rad"]
[reference]
force = ["0 N", "0 N", "-1 N"]
[object]
kind = "body"
"""
ON = '[object.body]\nfile = "block.h5"\nradius = "8 mm"\n'
BLOCK = (
    '[object.body]\nshape = "block"\nsize = ["30 mm", "30 mm", "10 mm"]\nyoung = "5 kPa"\nspacing = "10 mm"\n'
    'radius = "8 mm"\n'
)


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ('stiffness = "1 N/m"\n[object.body]\nshape = "phantom"\nradius = "8 mm"', "line 10: object.stiffness has no"),
        ("", "object.body is missing; write a table [object.body]"),
        ('[object.body]\nfile = "no.h5"\nradius = "8 mm"', "line 11: object.body.file: "),
        ('[object.body]\nfile = "other.h5"\nradius = "8 mm"', "line 11: object.body.file: "),
        ('[object.body]\nshape = "block"\nradius = "8 mm"', "line 10: object.body.size is missing"),
        ('[object.body]\nfile = "block.h5"', 'object.body.radius is missing; write for example radius = "8 mm"'),
        ('[object.body]\nfile = "block.h5"\nradius = "0 mm"', "line 12: object.body.radius: \"0 mm\" must be positive"),
        ('[object.body]\nfile = "block.h5"\nradius = "8 mm"\nkind = "modall"', "line 13: object.body.kind: \"modall\""),
        (ON + 'kind = "viscoelastic"', "instantaneous_ratio is missing: viscoelastic needs"),
        (
            '[object.body]\nfile = "block.h5"\nradius = "8 mm"\nretardation_time = "2 s"',
            'line 13: unknown key "retardation_time"',
        ),
        ('[object.body]\nfile = "block.h5"\nradius = "8 mm"\nnodes_per_tip = 8', "only neo-hookean, corot"),
        ('[object.body]\nfile = "block.h5"\nradius = "8 mm"\nyoung = "2 kPa"', "line 13: object.body.young has no mea"),
        (
            ON + 'kind = "viscoelastic"\ninstantaneous_ratio = 0.5\nretardation_time = "1 s"',
            "line 14: object.body.instantaneous_ratio: 0.5 must be 1 or more",
        ),
        ('[object.body]\nshape = "phantom"\ndepth = "1 m"\nradius = "8 mm"', "line 12: object.body.depth: 1000 mm; "),
        (ON + 'kind = "neo-hookean"\nnodes_per_tip = 4.5', "line 14: object.body.nodes_per_tip: 4.5 must be a whole"),
        (ON + 'kind = "neo-hookean"\nupdate_interval = "0.1 ms"', "line 14: object.body.update_interval: it lasts one"),
        (ON + "static_friction = 0.3\ndynamic_friction = 0.4", "line 14: object.body.dynamic_friction: 0.4 must"),
        (ON + "friction = 0.4", 'line 13: unknown key "friction" in [object.body]; did you mean static_friction?'),
        (ON + "stiffness_scale = 0", "line 13: object.body.stiffness_scale: 0 must be positive"),
        (ON + "stiffness_scale = -2", "line 13: object.body.stiffness_scale: -2 must "),
        (ON + "stiffness_scale = 1e300", "line 13: object.body.stiffness_scale: 1e+300 must be between"),
        (ON + "kind = ['modal']", "line 13: object.body.kind: ['modal'] must be text"),
        (ON + "options = 3", "line 13: object.body.options: 3 is not a table"),
        (BLOCK + 'kind = "modal"', "line 16: object.body.kind: the body was built without modes"),
        (BLOCK + "modes = 100000", "line 16: object.body.modes: a body of "),
        (BLOCK + "poisson = 0.5", "line 16: object.body.poisson: 0.5 must be below 0.5"),
        ('[object.body]\nfile = "mesh.stl"\nradius = "8 mm"', "mesh.stl: a mesh, not a body; build a body from it"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_its_line(
    block: Path, monkeypatch: pytest.MonkeyPatch, lines: str, sentence: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(block.parent))
    (block.parent / "other.h5").write_bytes(b"not a body")
    (block.parent / "mesh.stl").write_bytes(b"solid")
    found = refusal(HEAD + lines, block.parent)
    assert sentence in found, found


def test_what_judges_one_loop_says_why_a_body_has_none(block: Path) -> None:
    with pytest.raises(StabilityError, match="has states of its own and no one stiffness"):
        scenario_loop(Scenario.from_dict(tables(on(block))))


def test_the_depth_of_a_sphere_in_a_block_is_that_of_the_closed_form_beside_edges_and_corners_too() -> None:
    size, radius = np.array([0.04, 0.04, 0.02]), 4e-3
    block = bodies.build(bodies.block(tuple(size), 0.005), young=1e4, fixed=bodies.half_space("z", "<", 1e-9), order=1)
    centers = np.random.default_rng(1).uniform(-0.03, size + 0.03, (2000, 3))
    beside = np.linalg.norm(np.maximum(np.maximum(-centers, centers - size), 0.0), axis=1)
    within = np.minimum(centers, size - centers).min(axis=1)
    expected = np.maximum(radius + np.where(within > 0.0, within, -beside), 0.0)
    assert depths_at_rest(block, centers, radius) == pytest.approx(expected, abs=1e-9)


def pressed_far(block: Path, force: float, stiffness: float, **body: Any) -> dict[str, Any]:
    """A slider that an arm's spring stops, behind the block if it does not resist; its top faces the slider."""
    hand = {"kind": "arm", "mass": "0.1 kg", "damping": "12 N*s/m", "stiffness": f"{stiffness} N/m"}
    return {
        "device": {"name": "slider"},
        "start": {"pose": ["0 mm"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "controller": {"kind": "none"},
        "operator": {**hand, "shape": "ramp", "rise": "0.5 s", "force": [f"{-force} N", "0 N", "0 N"]},
        "object": {"kind": "body", "body": on(block, rotation=["0 deg", "90 deg", "0 deg"], **body)},
        "run": {"duration": "4 s"},
    }


def test_a_flat_end_far_behind_a_body_is_not_settled(block: Path) -> None:
    """It was settled 65 mm below the top of a block of 20 mm, its rod in the nodes beside it."""
    trace = simulate(pressed_far(block, 6.5, 100.0, kind="signed_distance"))
    assert trace["tip"][-1, 0] < -0.04
    assert trace.verdict.state is State.CONTACT_LOST
    assert certify(pressed_far(block, 6.5, 100.0, kind="signed_distance")).verdict.state is State.UNDECIDED


@pytest.mark.parametrize("kind", ["compliance", "modal"])
def test_a_body_pressed_through_its_fixed_part_is_not_settled(block: Path, kind: str) -> None:
    """With contact at the nodes' normals the body yields on: 30 mm and more into a block of 20 mm."""
    scenario = pressed_far(block, 12.0, 20.0, kind=kind)
    trace = simulate(scenario)
    assert np.linalg.norm(trace["deflection"][-1]) > 0.02
    assert trace.verdict.state is State.UNDECIDED
    assert "through its fixed or stiff part" in trace.verdict.reason
    assert certify(scenario).verdict.state is State.UNDECIDED


@pytest.mark.parametrize("held", [{"held": ["z < 0.1 mm"]}, {"supports": [{"at": "0.1 s", "held": ["z < 0.1 mm"]}]}])
def test_a_body_pressed_through_a_part_that_a_support_holds_is_not_settled(
    held: dict[str, Any], tmp_path: Path
) -> None:
    solid = bodies.block((0.04, 0.04, 0.02), 0.004)
    bodies.build(solid, young=1e4, fixed="x < 0.1 mm", output=tmp_path / "block.h5")
    trace = simulate(pressed_far(tmp_path / "block.h5", 12.0, 20.0, kind="compliance", **held))
    assert trace.verdict.state is State.UNDECIDED
    assert "through its fixed or stiff part" in trace.verdict.reason


@pytest.mark.parametrize("options", [{}, {"update_interval": "10 ms"}])
def test_a_run_whose_tip_inverts_tetrahedra_of_springs_is_not_settled(options: dict[str, Any]) -> None:
    """Springs hold inverted cells at rest: the run was "settled" and its loop "stable" there."""
    body = {"shape": "block", "size": ["40 mm", "40 mm", "20 mm"], "young": "10 kPa", "poisson": 0.25}
    body |= {"spacing": "6 mm", "radius": "8 mm", "kind": "mass_spring", **options}
    states = []
    for force in ("-0.5 N", "-2.5 N"):
        push = {"shape": "ramp", "rise": "0.3 s", "force": ["0 N", "0 N", force]}
        place = {"kind": "body", "position": ["0 mm", "0 mm", "-8.5 mm"], "body": body}
        run = simulate(tables(body, reference=push, object=place, run={"duration": "1.5 s"}))
        states.append((run.verdict.state, "it inverts tetrahedra of the body" in run.verdict.reason))
    assert states == [(State.SETTLED, False), (State.UNDECIDED, True)]


def held_below(**body: Any) -> dict[str, Any]:
    """An arm presses with 1.5 N on a block whose surface is held around the tip."""
    shape = {"shape": "block", "size": ["40 mm", "40 mm", "20 mm"], "spacing": "4 mm", "young": "20 kPa"}
    push = {"shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-1.5 N"]}
    touched = {"kind": "signed_distance", "radius": "8 mm", **shape, **body}
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m", **push},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-8.2 mm"], "body": touched},
        "run": {"duration": "1.5 s"},
    }


@pytest.mark.parametrize(
    "body",
    [
        {"held": ["sphere 20 20 20 radius 8 mm"], "spacing": "5 mm"},
        {"supports": [{"at": "10 ms", "held": ["sphere 20 20 20 radius 12 mm"]}, {"at": "0.8 s", "held": []}]},
    ],
)
def test_a_tip_in_a_body_that_grazes_a_node_is_not_settled(body: dict[str, Any]) -> None:
    """It was settled 7 mm deep, on one node with less than 2 mN of the 1.5 N, and certified stable."""
    trace = simulate(held_below(**body))
    assert np.linalg.norm(trace["object_force"][-1]) < 2e-3
    assert trace["touching"][-1, 0] > 0.0
    assert trace.verdict.state is State.UNDECIDED
    assert "does not push back" in trace.verdict.reason or "a support was released under it" in trace.verdict.reason
    assert certify(held_below(**body)).verdict.state is State.UNDECIDED


@pytest.mark.parametrize(
    "body",
    [
        {
            "held": ["sphere 20 20 20 radius 8 mm"],
            "contact_points": [["-3 mm", "0 mm", "0 mm"], ["3 mm", "0 mm", "0 mm"]],
        },
        {"held": ["x > 34 mm"], "tip": "flat", "origin": ["41 mm", "20 mm", "20 mm"]},
        {"held": ["sphere 20 20 20 radius 7.5 mm"], "tip": "flat"},
    ],
    ids=["two tips", "flat end beyond the edge", "held under most of a flat end"],
)
def test_tips_on_a_surface_that_does_not_push_back_are_not_settled(body: dict[str, Any]) -> None:
    scenario = held_below(**body)
    if body.get("tip") == "flat":
        scenario["object"]["position"] = ["0 mm", "0 mm", "-0.2 mm"]
    trace = simulate(scenario)
    assert trace.verdict.state is State.UNDECIDED
    assert "fixed, held or not touched" in trace.verdict.reason


@pytest.mark.parametrize("ratio", [3.0, 15.0])
def test_a_press_on_a_coarse_relaxing_body_is_settled(ratio: float) -> None:
    """The mean displacement of its contact excludes a part of the layer that grows with the ratio."""
    kind = {"kind": "viscoelastic", "contact": "signed_distance", "retardation_time": "50 ms"}
    scenario = held_below(**kind, instantaneous_ratio=ratio, spacing="8 mm")
    scenario["operator"]["force"] = ["0 N", "0 N", "-0.4 N"]
    assert simulate(scenario).verdict.state is State.SETTLED


def test_a_tip_that_leaves_one_body_of_a_scene_inside_has_lost_it() -> None:
    """It rests on the wall below: settled, where the body alone said contact lost."""
    tables_ = held_below(held=["sphere 20 20 20 radius 12 mm"])
    body = tables_.pop("object")
    wall = {"kind": "wall", "normal": [0, 0, 1], "stiffness": "0.5 N/mm", "position": ["0 mm", "0 mm", "-5 mm"]}
    trace = simulate({**tables_, "objects": {"one": body, "two": wall}})
    assert trace["two_touching"][-1, 0] > 0.0
    assert trace.verdict.state is State.CONTACT_LOST
    assert 'the tip is in the body "one" without contact, 5.5 mm' in trace.verdict.reason


def test_a_run_whose_body_is_no_longer_there_is_not_settled(tmp_path: Path) -> None:
    """Its depth in the body is not known any more: a run that was undecided by its depth read back as settled."""
    solid = bodies.block((0.04, 0.04, 0.02), 0.005)
    bodies.build(solid, young=1e4, fixed="z < 0.1 mm", touch="z > 19.9 mm", order=1, output=tmp_path / "block.h5")
    scenario = tables(on(tmp_path / "block.h5"), run={"duration": "1 s"})
    assert simulate(scenario).verdict.state is State.SETTLED
    trace = simulate(scenario)
    (tmp_path / "block.h5").unlink()
    assert trace.verdict.state is State.UNDECIDED
    assert "the scenario of the run cannot be read any more" in trace.verdict.reason


def test_the_depth_beside_the_touched_part_is_that_below_the_whole_surface() -> None:
    shape = bodies.block((0.04, 0.04, 0.02), 5e-3)
    body = bodies.build(shape, young=1e4, fixed="z < 0.1 mm", touch="box 0 0 19.9 to 15 40 21 mm")
    whole = bodies.build(shape, young=1e4, fixed="z < 0.1 mm", touch="z > 19.9 mm")
    centers = np.array(
        [[x, 0.02, z] for x in (5e-3, 14e-3, 16e-3, 22e-3, 35e-3) for z in (0.015, 0.0185, 0.021, 0.026)]
    )
    assert depths_at_rest(body, centers, 4e-3) == pytest.approx(depths_at_rest(whole, centers, 4e-3), abs=1e-12)


def test_a_press_that_begins_on_a_beam_finds_every_force(tmp_path: Path) -> None:
    """The first depths are below a nanometer. Their energies are rounding errors, so no tick found a force."""
    beam = bodies.block((0.06, 0.012, 0.012), 3e-3)
    bodies.build(beam, young=5e3, fixed="x < 0.001 mm", touch="z > 11.99 mm", output=tmp_path / "beam.h5")
    scenario = pressed_far(tmp_path / "beam.h5", 5e-3, 5.0, kind="signed_distance")
    scenario["object"]["body"] |= {"origin": ["52 mm", "6 mm", "12 mm"], "radius": "7 mm"}
    trace = simulate(scenario)
    assert trace["solved"].all()
    assert trace["object_force"][-1, 0] != 0.0
    assert trace.verdict.state is not State.CONTACT_LOST
