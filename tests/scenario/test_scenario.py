"""Scenario files: each mistake is one sentence with file, line and field; each choice survives the way to text."""

from __future__ import annotations

import functools
import math
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from palpate import Trace, simulate
from palpate.devices import load
from palpate.errors import DeviceError, PalpateError, ScenarioError
from palpate.files import find_line
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.scenario.body import KINDS, BodyChoice
from palpate.scenario.touched import MeshChoice

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))
TEXT = """\
title = "A cube"

[device]
name = "phantom-premium-1.5a"

[start]
pose = ["0 rad", "2.2305 rad", "3.2776 rad"]

[servo]
period = "0.5 ms"

[reference]
force = ["0 N", "0 N", "-2 N"]

[object]
stiffness = "3.5 N/mm"

[run]
duration = "0.1 s"
"""
ARM = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
BODY = {"kind": "body", "stiffness": None}
MESH = {"kind": "mesh", "stiffness": None, "mesh": {"shape": "box", "edge": "40 mm", "divisions": 2}}


def tables(**changes: Any) -> dict[str, Any]:
    """TEXT's tables; a change lays keys over a table; None removes a key or a table."""
    out: dict[str, Any] = tomllib.loads(TEXT)
    for name, change in changes.items():
        if change is None:
            out.pop(name, None)
        elif isinstance(change, dict):
            laid = {**out.get(name, {}), **change}
            out[name] = {key: value for key, value in laid.items() if value is not None}
        else:
            out[name] = change
    return out


def display(**changes: Any) -> dict[str, Any]:
    """The same arm as an impedance display."""
    return tables(**{"reference": None, "servo": {"topology": "impedance_display"}, **changes})


def message(text: str, name: str = "cube.toml") -> str:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_text(text, name)
    return str(caught.value)


def refusal(scenario: dict[str, Any]) -> str:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(scenario)
    return str(caught.value)


def test_values_are_si() -> None:
    """The reader converts: N/mm to N/m, ms to s; what is not said has its documented default."""
    scenario = Scenario.from_text(TEXT)
    assert scenario.object.stiffness == (3500.0,) * 3
    assert scenario.period == 5e-4
    assert tuple(scenario.start.pose) == (0.0, 2.2305, 3.2776)
    assert scenario.run.substeps == 2
    assert scenario.servo.gravity_compensation
    assert scenario.controller.kind == "none"
    assert scenario.device.model == "nonlinear"


def test_the_devices_own_period_and_rest_are_filled_in() -> None:
    """Left out, the servo period is the device's, and a slider starts at 0; both are in the text of the scenario."""
    scenario = Scenario.from_dict(
        {"device": {"name": "slider"}, "reference": {"force": "1 N"}, "object": {"stiffness": "1 N/mm"}}
    )
    assert scenario.period == 1e-3
    assert tuple(scenario.start.pose) == (0.0,)
    assert scenario.to_dict()["servo"] == {"period": "0.001 s"}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('stiffness = "3.5 N/mm"', 'stifness = "3.5 N/mm"',
         'cube.toml, line 16: unknown key "stifness" in [object]; did you mean stiffness?'),
        ("[object]", "[objekt]",
         'cube.toml, line 15: unknown key "objekt" in the scenario; did you mean object?'),
        ('"3.5 N/mm"', '"3.5 N"',
         'cube.toml, line 16: object.stiffness: "3.5 N" is a force [N]; a stiffness is needed, for example "3.5 N/mm"'),
        ('"3.5 N/mm"', "3500",
         'cube.toml, line 16: object.stiffness: 3500 has no unit, and a stiffness is needed; write it as "3500 N/m"'),
        ('"3.5 N/mm"', '"-3.5 N/mm"',
         'cube.toml, line 16: object.stiffness: "-3.5 N/mm" must not be negative'),
        ('"3.5 N/mm"', "nan",
         'cube.toml, line 16: object.stiffness: nan is not a finite number; write for example "3.5 N/mm"'),
        ('"0.1 s"', '"inf s"',
         'cube.toml, line 19: run.duration: "inf s" is not a finite number; write for example "0.5 ms"'),
        ('"0.1 s"', '"0 s"', 'cube.toml, line 19: run.duration: "0 s" must be positive'),
        ('"0.1 s"', '"0.1 ms"', "cube.toml, line 19: run.duration: shorter than one servo period"),
        ('"0.1 s"', '"1e9 s"',
         "cube.toml, line 19: run.duration: more than 20 million servo periods"),
        ('"0.1 s"', '"3000 s"',
         "cube.toml, line 19: run.duration: more than 5 million samples; raise run.record_every"),
        ('"2.2305 rad", ', "", "cube.toml, line 7: start.pose: 2 values, but phantom-premium-1.5a has 3 joints"),
        ('["0 rad", "2.2305 rad", "3.2776 rad"]', '["1 mm", "2 mm", "3 mm"]',
         "cube.toml, line 7: start.pose: the joints of phantom-premium-1.5a take angles, such as 2.2305 rad"),
        ('[servo]', 'tip = "1 mm"\n[servo]', "cube.toml, line 6: start: give pose or tip, not both"),
        ('name = "phantom-premium-1.5a"', 'name = "phantom-premium-15a"',
         "cube.toml, line 4: device.name: there is no device 'phantom-premium-15a' in the catalog "
         "(haply-2diy, phantom-premium-1.5a, phantom-premium-1.5a-rotors, slider); did you mean phantom-premium-1.5a? "
         "For your own, give the path of a .toml file"),
        ('name = "phantom-premium-1.5a"', 'name = "phantom-premium-1.5a"\nmodel = "non-linear"',
         'cube.toml, line 5: device.model: "non-linear" is not one of nonlinear, linear, experimental; '
         "did you mean nonlinear?"),
        ('name = "phantom-premium-1.5a"', 'name = "phantom-premium-1.5a"\ndelay = 65',
         "cube.toml, line 5: device.delay: 65 servo periods; it must be between 0 and 64"),
        ('name = "phantom-premium-1.5a"', 'name = "phantom-premium-1.5a"\nencoder = 1',
         "cube.toml, line 5: device.encoder: 1 is neither true nor false"),
        ('name = "phantom-premium-1.5a"', "",
         'cube.toml, line 3: device.name is missing; write for example name = "phantom-premium-1.5a"'),
        ('force = ["0 N", "0 N", "-2 N"]', "",
         'cube.toml, line 12: reference.force is missing; write for example force = ["0 N", "0 N", "-2 N"]'),
        ("[run]", "[run]\ncolour = 1", 'cube.toml, line 19: unknown key "colour" in [run]; there are'),
        ("[run]", "[run]\nsubsteps = 0", "cube.toml, line 19: run.substeps: 0; it must be between 1 and 10000"),
        ("[run]", "[run]\nsubsteps = 2.0", "cube.toml, line 19: run.substeps: 2.0 is not a whole number"),
        ("[run]", "[run\n", "cube.toml, line 18: not valid TOML"),
        ('title = "A cube"', "title = 3", "cube.toml, line 1: title: 3 must be text in quotation marks"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_file_line_field_and_remedy(old: str, new: str, says: str) -> None:
    """One clear sentence: what is wrong, where, what would be right."""
    assert TEXT.count(old) == 1
    told = message(TEXT.replace(old, new))
    assert told.startswith(says)
    assert "\n" not in told


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (display(operator={**ARM, "mass": "-1 kg"}), 'operator.mass: "-1 kg" must not be negative'),
        (display(operator={**ARM, "mass": "1 N"}), 'operator.mass: "1 N" is a force [N]; a mass is needed'),
        (display(operator={"kind": "arm", "mass": "1 kg"}), "damping is missing: an arm has mass, damping and"),
        (display(operator={**ARM, "tissue_damping": "1 N*s/m"}), "tissue_damping needs tissue_stiffness"),
        (display(operator={"kind": "fixed", "mass": "1 kg"}), 'mass has no meaning for kind = "fixed"'),
        (display(operator={"kind": "force", "force": "1 N", "mass": "1 kg"}), 'mass belongs to kind = "arm"'),
        (display(operator={"kind": "force"}), "force is missing"),
        (display(reference={"force": "1 N"}), "reference: an impedance_display has no reference force"),
        (tables(reference=None), "reference is missing: a force_tracking loop follows a force"),
        (tables(operator={"kind": "fixed"}), "operator: a force_tracking loop takes the operator's force as"),
        (tables(object={"kind": "wall"}), "a wall needs its outward normal, for example normal = [0, 0, 1]"),
        (tables(object={"kind": "wall", "normal": [0, 0, 0]}), "a normal must point somewhere"),
        (tables(object={"normal": [0, 0, 1]}), 'normal belongs to kind = "wall"'),
        (tables(object={"kind": "none"}), 'stiffness has no meaning for kind = "none"'),
        (tables(object=None), "the table [object] is missing"),
        (tables(object=3), "object must be a table, written [object]"),
        (tables(start=None), "start: pose or tip is missing"),
        (tables(device={"name": "slider", "model": "experimental"}, start=None), '"experimental" is the identified'),
        (tables(reference={"shape": "ramp"}), "a ramp needs rise"),
        (tables(reference={"frequency": "2 Hz"}), 'frequency belongs to shape = "sine", not to "step"'),
        (tables(reference={"start": "2 s", "stop": "1 s"}), "stop must be after start"),
        (tables(reference={"shape": "table", "table": [["0 s", "1 N", "0 N", "0 N"]]}), "at least two rows"),
        (tables(controller={"kind": "gain"}), "gain is missing; write for example gain = 2.0"),
        (tables(controller={"kind": "pid"}), '"pid" is not one of none, gain, lead_lag, lqg, state_space'),
        (tables(controller={"kind": "lqg", "integrator": True}), "did you mean integrators?"),
        (tables(controller={"kind": "lqg", "noise": "1 m"}), "is a length [m]; a force is needed"),
        (tables(controller={"kind": "state_space", "A": [[0.5]], "B": [[1.0]], "C": [[1.0]], "D": [[1.0]]}),
         "B is 1 x 1; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 1 x 6"),
        (tables(controller={"kind": "state_space", "A": [[1.0, 2.0], [3.0]]}), "the rows of a matrix must be equally"),
        (tables(controller={"kind": "state_space", "A": [[math.inf]]}), "finite"),
        (tables(object={**BODY, "body": {"file": "none.h5", "radius": "8 mm"}}),
         "none.h5: there is no such file; palpate body build or palpate body phantom makes one"),
        (tables(object={**BODY, "body": {"file": 300 * "x" + ".h5", "radius": "8 mm"}}), "x.h5: there is no such file"),
        (tables(object={**MESH,
                         "surface": {"stiffness": ["1 N/mm", "-1 N/mm"], "pattern": "stripes", "width": "1 mm"}}),
         "object.surface.stiffness: ['1 N/mm', '-1 N/mm'] must not be negative"),
        (tables(object={**MESH, "surface": {"stiffness": "1 N/mm", "shading": "86 deg"}}), "it must be at most 85 deg"),
    ],
)  # fmt: skip
def test_choices_that_do_not_go_together_are_refused(changed: dict[str, Any], says: str) -> None:
    """The tables of a scenario must make one experiment."""
    assert says in refusal(changed)


def test_a_table_of_forces_must_go_forward_in_time() -> None:
    rows = [["0 s", "0 N", "0 N", "0 N"], ["1 s", "1 N", "0 N", "0 N"], ["1 s", "0 N", "0 N", "0 N"]]
    assert "the time of row 3 (1 s) is not after that of the row before" in refusal(
        tables(reference={"shape": "table", "table": rows, "force": None})
    )


@pytest.mark.parametrize(
    ("tip", "says"),
    [
        ('["1 m", "0 m", "0 m"]', "mm from the shoulder, and the arm reaches 385.0 mm"),
        ('["0 m", "170 mm", "-190 mm"]', "mm from the shoulder, and the folded arm keeps 45.0 mm away"),
        ('["0 m", "370 mm", "-215 mm"]', "it lies on the yaw axis, where the base angle is not determined"),
    ],
)
def test_a_start_that_no_pose_reaches_says_why(tip: str, says: str) -> None:
    """The arm is 215 + 170 mm long and turns about its yaw axis: known before anything runs."""
    told = message(TEXT.replace('pose = ["0 rad", "2.2305 rad", "3.2776 rad"]', f"tip = {tip}"))
    assert told.startswith("cube.toml, line 7: start.tip: the tip cannot be at ")
    assert says in told


def test_a_missing_file_suggests_its_neighbour(tmp_path: Path) -> None:
    (tmp_path / "cube.toml").write_text(TEXT)
    with pytest.raises(ScenarioError, match=r"there is no such file; did you mean .*cube\.toml\?"):
        Scenario.from_file(tmp_path / "cubes.toml")
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="not UTF-8 text"):
        Scenario.from_file(tmp_path / "noise.toml")
    with pytest.raises(ScenarioError, match="cannot be read: File name too long"):
        Scenario.from_file("a" * 300)
    with pytest.raises(ScenarioError, match=r"a folder; give the scenario's file \(.toml\) in it"):
        Scenario.from_file(tmp_path)
    large = tmp_path / "liver.h5"
    with h5py.File(large, "w") as file:
        file["compliance"] = np.zeros(600_000)
    with pytest.raises(ScenarioError, match=r'HDF5 .* named as \[object.body\] file = "liver.h5"'):
        Scenario.from_file(large)
    with (tmp_path / "long.toml").open("wb") as file:
        file.truncate(5_000_000)
    with pytest.raises(ScenarioError, match="has at most 4 MB"):
        Scenario.from_file(tmp_path / "long.toml")


@pytest.mark.parametrize("wrong", [None, 3, [1]])
def test_what_is_no_scenario_is_refused(wrong: Any) -> None:
    """Neither a file, nor text, nor tables: one sentence."""
    for read, says in (
        (simulate, "a file is named"),
        (Scenario.from_text, "TOML, not"),
        (Scenario.from_dict, "by name"),
    ):
        with pytest.raises(ScenarioError, match=says):
            read(wrong)


def test_several_mistakes_are_told_together_in_the_files_order() -> None:
    """One message lists all of them."""
    told = message(TEXT.replace('"0.1 s"', '"1 N"').replace('"3.5 N/mm"', '"1 s"').replace('"0.5 ms"', '"1 m"'))
    assert [line.split(":")[0] for line in told.splitlines()] == [f"cube.toml, line {n}" for n in (10, 16, 19)]


def test_every_mistake_is_told_those_between_tables_too() -> None:
    wrong = dict.fromkeys(("duration",), "1 m") | dict.fromkeys(("substeps", "record_every"), 0)
    keys = "\n".join(f"{key} = {value!r}" for key, value in wrong.items()) + "\nseed = -1\nsed = 2\nsubstep = 3\n"
    told = message(TEXT.split("[run]", maxsplit=1)[0] + "[run]\n" + keys)
    assert [line.split(":")[0] for line in told.splitlines()] == [f"cube.toml, line {n}" for n in range(19, 25)]
    several = display(servo={"jitter": "3 ms", "topology": "force_tracking"}, run={"duration": "0.1 ms"})
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(several)
    assert [sentence.split(":")[1].strip().split(" ")[0] for sentence in str(caught.value).splitlines()] == [
        "reference",
        "run.duration",
        "servo.jitter",
    ]


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"object.stifness": "1 N/mm"}, 'settings: unknown key "stifness" in [object]; did you mean stiffness?'),
        ({"object.stiffness": "1 mm"}, 'settings: object.stiffness: "1 mm" is a length [m]; a stiffness is needed'),
        ({"object.stiffness": 1000}, 'write it as "1000 N/m"'),
        ({"title.size": 3}, "setting title.size: title is no table"),
        (
            {"object.position": [0, 0, 0], "object.position.w": 3},
            "varies one of its three numbers as object.position.x",
        ),
        ({"object.": 3}, "setting 'object.': a key has the form"),
        ({"obect.stiffness": "1 N/mm"}, 'settings: unknown key "obect" in the scenario; did you mean object?'),
    ],
)
def test_a_wrong_setting_is_told_as_one(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_text(TEXT, settings=settings)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_settings_replace_values_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "cube.toml"
    path.write_text(TEXT, "utf-8")
    scenario = Scenario.from_file(path, {"object.stiffness": "2 N/mm", "servo.period": "1 ms", "device.encoder": True})
    assert scenario.object.stiffness == (2000.0,) * 3
    assert scenario.period == 1e-3
    assert scenario.device.encoder
    assert Scenario.from_file(path).period == 5e-4


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_scenario_survives_the_way_to_text_and_back(path: Path) -> None:
    """to_dict carries every choice, exactly: the trace's copy runs the same experiment."""
    scenario = Scenario.from_file(path)
    again = Scenario.from_dict(scenario.to_dict())
    assert again.model_dump() == scenario.model_dump()
    assert again.to_dict() == scenario.to_dict()


def test_a_key_without_a_value_is_one_that_is_left_out() -> None:
    """TOML has no word for it."""
    without = {**tables()["object"], "normal": None}
    assert Scenario.from_dict({**tables(), "object": without}).to_dict() == Scenario.from_dict(tables()).to_dict()


def test_the_stiffnesses_of_a_pattern_may_be_zero_and_its_shading_85_deg() -> None:
    surface = {"stiffness": ["1 N/mm", "0 N/m"], "pattern": "stripes", "width": "5 mm", "shading": "85 deg"}
    read = Scenario.from_dict(tables(object={**MESH, "surface": surface})).object.surface
    assert read is not None
    assert (read.stiffness, read.shading) == ((1000.0, 0.0), pytest.approx(math.radians(85.0)))


positive = st.floats(min_value=1e-6, max_value=1e6)
any_force = st.floats(min_value=-1e6, max_value=1e6)


@given(force=st.tuples(any_force, any_force, any_force), k=st.tuples(positive, positive, positive), period=positive)
def test_any_numbers_survive_the_way_to_text_and_back(
    force: tuple[float, ...], k: tuple[float, ...], period: float
) -> None:
    """Bit for bit, whatever the decimals."""
    scenario = Scenario.from_dict(
        tables(
            reference={"force": [f"{entry!r} N" for entry in force]},
            object={"stiffness": [f"{entry!r} N/m" for entry in k]},
            servo={"period": f"{period!r} s"},
            run={"duration": f"{10 * period!r} s"},
        )
    )
    assert scenario.reference is not None
    assert scenario.reference.force == force
    assert scenario.object.stiffness == k
    assert Scenario.from_dict(scenario.to_dict()) == scenario


@given(
    junk=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=10),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
        max_leaves=6,
    ),
    where=st.sampled_from(
        ["device", "start", "servo", "reference", "object", "operator", "controller", "run", "title"]
    ),
)
def test_whatever_stands_there_is_a_scenario_or_a_scenario_error(junk: Any, where: str) -> None:
    """Bad input never ends in another exception."""
    try:
        read = Scenario.from_dict({**tables(), where: junk})
    except ScenarioError:
        return
    assert Scenario.from_dict(read.to_dict()).to_dict() == read.to_dict()


def test_nothing_in_a_scenario_is_executed(tmp_path: Path) -> None:
    """Scenario files are data: code stays text in a title, and is refused where a quantity or a device belongs."""
    witness = tmp_path / "witness"
    code = f"__import__('pathlib').Path('{witness}').touch()"
    scenario = Scenario.from_dict(tables(title=code, description=f"{{{code}}} ${{HOME}} $(touch {witness})"))
    assert scenario.title == code
    assert scenario.description.startswith("{__import__")
    for change in ({"object": {"stiffness": code}}, {"device": {"name": code}}, {"controller": {"kind": code}},
                   {"controller": {"kind": "gain", "gain": code}}, {"run": {"substeps": code}}):  # fmt: skip
        with pytest.raises(PalpateError):
            Scenario.from_dict(tables(**change))
    assert not witness.exists()


def test_a_devices_path_is_relative_to_the_scenarios_file(tmp_path: Path) -> None:
    """A folder with a device and its scenarios can be moved, and run from anywhere."""
    own = 'name = "own"\nbased_on = "slider"\n[mass]\ntip = { value = "100 g", source = "scale" }\n'
    (tmp_path / "own.toml").write_text(own)
    (tmp_path / "push.toml").write_text(
        '[device]\nname = "own.toml"\n[reference]\nforce = "1 N"\n[object]\nstiffness = "1 N/mm"\n'
    )
    scenario = Scenario.from_file(tmp_path / "push.toml")
    assert scenario.source == str(tmp_path / "push.toml")
    assert scenario.load_device().mass_matrix([0.0]) == pytest.approx(0.1)
    assert Scenario.from_dict(scenario.to_dict()).load_device().name == "own"


@pytest.mark.parametrize(
    ("signal", "at", "x"),
    [
        ({"force": "2 N"}, [0.0, 1.0], [2.0, 2.0]),
        ({"force": "2 N", "start": "0.3 s", "stop": "0.6 s"}, [0.299, 0.3, 0.599, 0.6], [0.0, 2.0, 2.0, 0.0]),
        ({"shape": "ramp", "force": "2 N", "start": "1 s", "rise": "4 s"}, [0.5, 1.0, 2.0, 5.0, 9.0],
         [0.0, 0.0, 0.5, 2.0, 2.0]),
        ({"shape": "sine", "force": "2 N", "frequency": "1 Hz"}, [0.0, 0.25, 0.75], [0.0, 2.0, -2.0]),
        ({"shape": "table", "table": [["1 s", "1 N", "0 N", "0 N"], ["2 s", "3 N", "0 N", "0 N"]]},
         [0.0, 1.5, 5.0], [1.0, 2.0, 3.0]),
    ],
)  # fmt: skip
def test_a_force_in_time_is_what_its_shape_says(signal: dict[str, Any], at: list[float], x: list[float]) -> None:
    """Definitions of step, ramp, sine and table, with start and stop."""
    scenario = Scenario.from_dict({**tables(), "reference": signal})
    assert scenario.reference is not None
    np.testing.assert_allclose(scenario.reference.values(at)[:, 0], x, atol=1e-12)


def test_the_line_of_a_field_is_found_behind_lists_texts_and_comments() -> None:
    """What looks like a header or a key inside a text, a list or a comment is none."""
    text = '''\
note = """
[object]
stiffness = 1
"""
# [object]
[reference]   # stiffness = 2
table = [
  ["0 s", "[object]"],
]
[ object ]
damping = "1 N*s/m"
"stiffness" = "a # b"
'''
    assert find_line(text, ("object", "stiffness")) == 12
    assert find_line(text, ("object", "position")) == 10
    assert find_line(text, ("reference", "table", 0)) == 7
    assert find_line(text, ("servo", "period")) is None


@functools.cache
def run(path: Path) -> Trace:
    return simulate(path)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_example_runs_with_a_finite_trace(path: Path) -> None:
    """What the README tells a newcomer to run, runs, and says something."""
    trace = run(path)  # a trace refuses what is not finite
    assert summarize(trace)["title"] == tomllib.loads(path.read_text("utf-8"))["title"]
    assert len(trace) > 100


def test_the_examples_show_what_their_comments_promise() -> None:
    """Each comment's "What to look for", by number."""
    runs = {path.stem: run(path) for path in SCENARIOS}
    summaries = {name: summarize(trace) for name, trace in runs.items()}
    errors = {
        name: max(abs(row["error_percent"]) for row in summary["axes"].values())
        for name, summary in summaries.items()
        if name in ("press-stiff-cube-lqg", "press-soft-cube-lead-lag", "identified-model")
    }
    assert errors["press-stiff-cube-lqg"] < 0.01
    assert errors["press-soft-cube-lead-lag"] < 0.3
    assert errors["identified-model"] < 1.0
    assert summaries["identified-model"]["axes"]["y"]["settling_5_percent_s"] > 5 * 0.05

    assert summaries["slider-wall-stable"]["stable"]
    assert "decays" in summaries["slider-wall-stable"]["verdict"]
    assert not summaries["slider-wall-unstable"]["stable"]
    assert "grows by a factor" in summaries["slider-wall-unstable"]["verdict"]

    guarded = runs["guarded-stiff-wall"]
    assert summaries["guarded-stiff-wall"]["state"] == "settled"
    assert np.ptp(guarded["tip"][-300:, 2]) < 20e-6
    assert 0.2 < guarded["guarded"].mean() < 0.5
    bare = Scenario.from_file(next(path for path in SCENARIOS if path.stem == "guarded-stiff-wall")).to_dict()
    assert np.ptp(simulate({**bare, "guard": {"kind": "none"}})["tip"][-300:, 2]) > 2e-3
    led = runs["slide-slope-by-hand"]
    assert led["touching"][10:, 0].all()
    assert len(np.unique(led["surface_stiffness"][10:, 0])) == 2

    leaning = runs["arm-through-tissue-on-a-wall"]
    touching = leaning["touching"][:, 0] > 0
    assert touching.any()
    assert not touching[0]
    assert not touching[-1]
    assert leaning["object_force"][:, 2].max() == 0.0
    assert summaries["arm-through-tissue-on-a-wall"]["state"] == "settled"
    assert 1e-3 < summaries["arm-through-tissue-on-a-wall"]["peak_deflection_m"] < 10e-3

    driven = runs["drive-limits-and-encoder"]
    at = np.searchsorted(driven.time, [0.5, 3.9])
    assert np.abs(driven["deflection"][at[0], 2]) == pytest.approx(5e-3, rel=0.05)
    assert np.linalg.norm(driven["command_force"][at[0]]) == pytest.approx(5.0, rel=0.05)
    assert np.linalg.norm(driven["command_force"][at[1]]) < 1.6
    assert driven["object_force"][at[1], 2] < -10.0
    assert summaries["drive-limits-and-encoder"]["state"] == "drive limit exceeded"

    chattering = {
        grip: np.ptp(simulate(_gripped(grip))["object_force"][500:1100, 2]) for grip in ("tissue", "rigid")
    }  # N, while the force is constant
    assert chattering["tissue"] > 10.0
    assert chattering["rigid"] < 0.1

    held = runs["hold-inside-a-wall"]
    np.testing.assert_allclose(held["operator_force"], [[0.0, -6.0, 0.0]] * len(held), atol=1e-12)
    np.testing.assert_allclose(held["command_force"], [[0.0, 6.0, 0.0]] * len(held), atol=1e-12)
    assert not np.any(held["velocity"])


def _gripped(grip: str) -> dict[str, Any]:
    """The arm on a stiff wall without damper, as its "What to try" says."""
    path = next(path for path in SCENARIOS if path.stem == "arm-through-tissue-on-a-wall")
    changed = tomllib.loads(path.read_text("utf-8"))
    changed["object"].update(stiffness="3 N/mm", damping="0 N*s/m")
    if grip == "rigid":
        del changed["operator"]["tissue_stiffness"], changed["operator"]["tissue_damping"]
    return changed


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_body_needs_the_options_without_a_default(kind: str) -> None:
    """A missing one is named with an example that is accepted; other kinds need none."""
    options: dict[str, Any] = {}
    if kind == "viscoelastic":
        options = {"instantaneous_ratio": 2.0, "retardation_time": "20 s"}
    assert [key for key, option in KINDS[kind].items() if option.needed] == list(options)
    BodyChoice(kind=kind, shape="phantom", radius="3 mm", options=options)
    for key in options:
        rest = {name: value for name, value in options.items() if name != key}
        with pytest.raises(ValueError, match=f"{key} is missing: {kind} needs it, for example {key} = "):
            BodyChoice(kind=kind, shape="phantom", radius="3 mm", options=rest)


@pytest.mark.parametrize(("shape", "most"), [("box", 500), ("bumpy_ellipsoid", 7)])
def test_the_divisions_of_a_mesh_are_bounded(shape: str, most: int) -> None:
    """A mesh of 4^8 times as many triangles would exhaust the memory."""
    size = {"edge": "80 mm"} if shape == "box" else {"size": ["90 mm", "70 mm", "60 mm"], "bump": 0.06}
    for divisions in (1, most):
        assert MeshChoice(shape=shape, divisions=divisions, **size).divisions == divisions
    for divisions in (-1, 0, most + 1):
        with pytest.raises(ValueError, match=f"divisions: {divisions}; it must be between 1 and {most}"):
            MeshChoice(shape=shape, divisions=divisions, **size)


@pytest.mark.parametrize(
    ("shape", "needed"),
    [("file", {"file", "unit"}), ("box", {"edge", "divisions"}), ("bumpy_ellipsoid", {"size", "bump", "divisions"})],
)
def test_a_shape_of_a_mesh_has_its_own_keys_only(shape: str, needed: set[str]) -> None:
    values: dict[str, Any] = {"file": "liver.stl", "unit": "mm", "edge": "80 mm", "divisions": 2, "bump": 0.06}
    values["size"] = ["90 mm", "70 mm", "60 mm"]
    own = {key: values[key] for key in needed}
    MeshChoice(shape=shape, **own)
    for key in needed:
        with pytest.raises(ValueError, match=f"{key} is missing; write for example {key} = "):
            MeshChoice(shape=shape, **{name: value for name, value in own.items() if name != key})
    for key in values.keys() - needed:
        with pytest.raises(ValueError, match=f'{key} has no meaning for shape = "{shape}"'):
            MeshChoice(shape=shape, **own, **{key: values[key]})


def test_the_normal_of_a_wall_is_of_unit_length() -> None:
    wall = {"kind": "wall", "stiffness": "1 N/mm", "normal": [3.0, 0.0, 4.0]}
    assert Scenario.from_dict(display(object=wall)).object.normal == (0.6, 0.0, 0.8)
    for far in (1e-150, 1e150):
        normal = Scenario.from_dict(display(object={**wall, "normal": [0.0, far, 0.0]})).object.normal
        assert normal == (0.0, 1.0, 0.0)
    with pytest.raises(ScenarioError, match="a normal must point somewhere"):
        Scenario.from_dict(display(object={**wall, "normal": [0.0, 0.0, 0.0]}))


@pytest.mark.parametrize(("table", "key"), [("servo", "period"), ("run", "duration")])
def test_a_time_of_zero_is_refused(table: str, key: str) -> None:
    """The smallest that the limits of the loop allow is another matter."""
    with pytest.raises(ScenarioError, match=rf'{table}.{key}: "0 s" must be positive'):
        Scenario.from_dict(display(**{table: {key: "0 s"}}))


def test_a_display_does_not_divide_by_the_stiffness() -> None:
    with pytest.raises(ScenarioError, match=r"controller.normalize: in an impedance_display"):
        Scenario.from_dict(display(controller={"kind": "none", "normalize": "1 N/mm"}))


@pytest.mark.parametrize("head", ['name = "mine"\nmechanism = "slider"', 'based_on = "slider"'])
def test_a_device_file_in_place_of_a_scenario_is_recognized(tmp_path: Path, head: str) -> None:
    """And a scenario in place of a device file: one sentence, not one for each key."""
    file = tmp_path / "mine.toml"
    file.write_text(f'{head}\n[friction]\nviscous = "1 N*s/m"\n', "utf-8")
    with pytest.raises(ScenarioError, match=r'mine\.toml: a device file; .* \[device\] name = "mine\.toml"') as refusal:
        Scenario.from_file(file)
    assert "\n" not in str(refusal.value)
    other = tmp_path / "scenario.toml"
    other.write_text('title = "t"\n[device]\nname = "slider"\n', "utf-8")
    with pytest.raises(DeviceError, match=r"scenario\.toml: a scenario; its device"):
        load(other)
