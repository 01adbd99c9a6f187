"""Designs from a specification: what is promised is simulated, and a refusal names the constraint with a remedy."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import palpate
import pytest
from nightly import NIGHTLY
from palpate.cli.design import summary
from palpate.cli.main import app
from palpate.control import workspace
from palpate.devices import load
from palpate.errors import DesignError, OutputError, PoseError
from palpate.linear import HumanArm
from palpate.stability.switching import has_solver
from palpate.stability.workspace_certificate import workspace_loops
from palpate.tuning import ControllerDesign
from palpate.tuning.designer import _Designer
from palpate.tuning.remedies import drive_remedies
from palpate.tuning.specification import specify
from typer.testing import CliRunner

NAME = "phantom-premium-1.5a"
ARM = load(NAME)


@pytest.fixture(scope="module")
def met() -> ControllerDesign:
    return palpate.design(NAME, "500 N/m..10 N/mm", "1 N", "30 ms", period="0.5 ms", against=[f"{NAME}-rotors"])


def test_a_design_that_is_met_promises_what_its_scenario_does(met: ControllerDesign, tmp_path: Path) -> None:
    assert met.feasible
    assert met.bound < max(met.settling.values()) <= 0.03
    assert met.overshoot <= 0.05
    assert met.controller is not None
    assert met.bound_direction is not None
    assert met.to_dict()["drive_bound_direction"] == met.bound_direction.tolist()
    path = met.save_scenario(tmp_path / "scenario.toml")
    trace = palpate.simulate(path)
    summary = palpate.summarize(trace)
    assert summary["verdict"].startswith("settled to 5 %")
    assert summary["magnitude"]["settling_5_percent_s"] <= max(met.settling.values())
    assert summary["magnitude"]["error_percent"] < 5.0
    written = palpate.Scenario.from_file(path).controller.options
    assert workspace(ARM, 5e-4, **written) == met.controller


@pytest.mark.parametrize("name", ["slider", "haply-2diy"])
def test_a_device_with_fewer_joints_is_designed_for(name: str) -> None:
    """Law: the promised settling is that of the scenario, and one matrix serves all poses of the plane or line."""
    found = palpate.design(name, "500 N/m..5 N/mm", "0.5 N", "30 ms", period="0.5 ms")
    assert found.feasible
    assert found.scenario is not None
    trace = palpate.simulate(found.scenario)
    assert trace.stable
    error = np.linalg.norm(trace["object_force"] - trace["reference_force"], axis=1)
    outside = np.flatnonzero(error > 0.05 * np.linalg.norm(trace["reference_force"][-1]))
    assert 5e-4 * (int(outside[-1]) + 1) <= max(found.settling.values()) + 5e-4
    if has_solver():
        assert found.certificate is not None
        assert found.certificate.matrix.shape == (5 * load(name).dof,) * 2


def test_the_certificate_is_verified_from_its_matrix_alone(met: ControllerDesign) -> None:
    if not has_solver():
        assert "Clarabel" in met.certificate_remark
        return
    assert met.certificate is not None
    assert met.controller is not None
    poses = np.array([[0.3, 1.9, 2.9], [-0.2, 2.0, 3.3]])
    for device in (ARM, load(f"{NAME}-rotors")):
        assert met.certificate.verify(workspace_loops(met.controller, poses, device)) < 1.0


def test_a_delayed_design_is_certified_with_its_delay() -> None:
    controller = workspace(ARM, 5e-4, bandwidth=280.0, observer=2.5, disturbance=0.03)
    pose = np.array([[0.0, 2.0, 3.0]])
    for delay in (0, 1, 3):
        loops = workspace_loops(controller, pose, delay=delay)
        assert loops.shape == (1, 15 + 3 * delay, 15 + 3 * delay)
    assert np.abs(np.linalg.eigvals(workspace_loops(controller, pose, delay=4))).max() < 1.0  # delay margin 5.2 samples
    assert np.abs(np.linalg.eigvals(workspace_loops(controller, pose, delay=6))).max() > 1.0


def test_a_range_beyond_the_drive_names_it_and_each_remedy_would_do() -> None:
    found = palpate.design(NAME, "50 N/m..10 N/mm", "1 N", "40 ms")
    assert not found.feasible
    assert (found.constraint, found.scenario) == ("drive limit", None)
    assert 0.04 < found.bound < max(found.settling.values())
    assert [remedy.partition(" ")[0] for remedy in found.remedies] == ["--settle", "--stiffness", "--force"]
    assert found.certificate_remark == "none: the specification is not met"
    tried = {"stiffness": "50 N/m..10 N/mm", "force": "1 N", "settle": "40 ms"}
    for remedy in found.remedies if NIGHTLY else ():
        key, _, value = remedy.removeprefix("--").partition(" ")
        assert palpate.design(NAME, **{**tried, key: value.strip('"')}).feasible
    with pytest.raises(OutputError, match="the specification is not met"):
        found.save_scenario("never.toml")


def test_a_settling_time_beyond_the_axis_names_the_encoder_or_the_sampling() -> None:
    found = palpate.design(NAME, "10 N/mm", "0.5 N", "10 ms", period="0.5 ms")
    assert found.constraint == "encoder"
    assert found.remedies == ('--settle "11 ms"', "an encoder with 2 times the counts")
    if NIGHTLY:
        late = palpate.design(NAME, "10 N/mm", "0.5 N", "12 ms", delay=2)
        assert late.constraint == "sampling"
        assert "--period" in late.remedies[-1]


def test_a_way_beyond_the_reach_names_the_range_of_stiffness() -> None:
    found = palpate.design(NAME, "10 N/m..10 N/mm", "5 N", "40 ms")
    assert found.constraint == "stiffness range"
    assert "500 mm" in found.reason
    assert found.remedies[0].startswith('--stiffness "')
    for share, said in ((0.0, []), (0.625, ["62.5 %"]), (1.0, [])):
        lines = [line for line in summary(replace(found, within_reach=share)) if line.startswith("ways within reach")]
        assert lines == [f"ways within reach on the softest object: {one}; there is no claim beyond" for one in said]


def test_the_ends_of_what_can_be_asked_for_are_allowed() -> None:
    """The motors' whole force and 16 samples of delay are; what is checked later may still refuse them."""
    force = ARM.peak_force
    asked = {"device": NAME, "stiffness": "50 N/m..10 N/mm", "settle": 0.025, "period": None, "pose": None, "tip": None}
    given = specify(**asked, force=force, delay=16, operators=(), against=(NAME,))
    assert (given.force, given.delay, given.stiffness) == (force, 16, (50.0, 1e4))
    assert given.period == ARM.servo_period
    assert given.objects == "50 to 10000 N/m"
    assert (
        specify(**{**asked, "stiffness": "1 N/mm"}, force=1.0, delay=0, operators=(), against=()).objects == "1000 N/m"
    )
    for wrong in (17, 1.0):
        with pytest.raises(DesignError, match=f"whole number of samples from 0 to 16 is needed, not {wrong}"):
            specify(**asked, force=1.0, delay=wrong, operators=(), against=())
    with pytest.raises(DesignError, match=r"but the motors of phantom-premium-1\.5a give at most 8\.5 N"):
        specify(**asked, force=1.001 * force, delay=0, operators=(), against=())


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"stiffness": "10 N/mm..50 N/m"}, DesignError, 'write the smaller value first, "50.0 N/m..10000.0 N/m"'),
        ({"stiffness": "50..10 N/mm"}, DesignError, 'has no unit, and a stiffness is needed; write it as "50 N/m"'),
        ({"stiffness": "1 N/mm..2 N/mm..3 N/mm"}, DesignError, "is no range"),
        ({"stiffness": "0 N/m..1 N/m"}, DesignError, "must be positive"),
        ({"force": "20 N"}, DesignError, "give at most 8.5 N"),
        ({"force": "1 mm"}, DesignError, "is a length"),
        ({"settle": "0 ms"}, DesignError, "settle must be positive"),
        ({"delay": -1}, DesignError, "whole number of samples from 0 to 16"),
        ({"tip": ["1 m", "0 m", "0 m"]}, PoseError, "the tip cannot be at"),
        ({"pose": ["0 rad", "1.5708 rad", "3.1416 rad"]}, PoseError, "singular"),
        ({"pose": ["0 rad", "1 rad"]}, DesignError, "3 finite values in rad"),
        ({"pose": [0, 0, 0], "tip": [0, 0, 0]}, DesignError, "either pose or tip"),
        ({"against": ["slider"]}, DesignError, "must have the mechanism of phantom-premium-1.5a"),
    ],
)
def test_a_mistake_is_one_sentence_with_the_remedy(change: dict[str, Any], error: type[Exception], says: str) -> None:
    asked = {"device": NAME, "stiffness": "50 N/m..10 N/mm", "force": "1 N", "settle": "25 ms", **change}
    with pytest.raises(error) as problem:
        palpate.design(**asked)
    assert says in str(problem.value)


def test_the_command_writes_a_scenario_or_exits_with_1(tmp_path: Path) -> None:
    def run(*arguments: str) -> tuple[int, str]:
        done = CliRunner().invoke(app, ["design", *arguments])
        return done.exit_code, " ".join(done.output.split())

    common = (NAME, "--stiffness", "2 N/mm..10 N/mm", "--force", "1 N", "-o", str(tmp_path))
    code, text = run(*common, "--settle", "25 ms")
    assert code == 0, text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["design.json", "scenario.toml"]
    assert "of the optimal robustness" in text
    assert f"certificate: {json.loads((tmp_path / 'design.json').read_text('utf-8'))['certificate']}" in text
    limit, share = re.search(r"Above (\S+) N/m one encoder count is .*?, (\S+) % of the deflection", text).groups()  # type: ignore[union-attr]
    assert float(limit) * float(share) / 100 == pytest.approx(0.05 * 10e3, rel=0.01)
    code, text = run(*common, "--settle", "25")
    assert code == 2
    assert "has no unit" in text


def test_a_force_that_leaves_nothing_to_brake_is_a_drive_limit_and_exits_with_1(tmp_path: Path) -> None:
    arguments = [NAME, "--stiffness", "10 N/mm", "--force", "8.5 N", "--settle", "25 ms", "-o", str(tmp_path)]
    done = CliRunner().invoke(app, ["design", *arguments])
    assert done.exit_code == 1
    assert "Binding constraint: drive limit" in done.output
    assert "cannot brake" in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["design.json"]
    written = json.loads((tmp_path / "design.json").read_text("utf-8"))
    assert written["feasible"] is False
    assert written["drive_bound_s"] is None
    (remedy,) = written["remedies"]
    assert remedy.startswith('--force "')
    assert palpate.design(NAME, "10 N/mm", remedy.split('"')[1], "25 ms").feasible


def test_dry_friction_is_named_where_only_stiff_objects_do_not_settle() -> None:
    found = palpate.design(f"{NAME}-rotors", "1 N/mm..10 N/mm", "2 N", "40 ms")
    assert found.constraint == "dry friction"
    assert found.settling[1000.0] <= 0.04 < found.settling[10000.0]
    (remedy,) = found.remedies
    assert remedy.startswith('--stiffness "1000 N/m..')


def test_a_weaker_force_on_the_stiffest_object_is_the_remedy_where_nothing_less_helps() -> None:
    """Presses settle on 1000 N/m alone, with up to 0.5 N of the 1 N asked for."""
    asked: Any = SimpleNamespace(stiffness=(100.0, 1000.0), force=1.0, settle=0.04)
    trial: Any = SimpleNamespace(specification=asked, settles=lambda force, k: k == 1000.0 and force <= 0.5)
    assert drive_remedies(trial, {100.0: np.inf, 1000.0: np.inf}) == ('--force "0.5 N" --stiffness "1000 N/m"',)
    asked.stiffness = (1000.0, 1000.0)
    assert drive_remedies(trial, {1000.0: 0.0412}) == ('--settle "41.2 ms"', '--force "0.5 N"')


@pytest.mark.parametrize(("hold", "told"), [(0.25, True), (0.0, False), (np.inf, False)])
def test_a_press_that_never_settles_says_how_long_the_motors_hold_it(hold: float, told: bool) -> None:
    asked = specify("slider", "1 N/mm", "0.5 N", "40 ms", None, 0, None, None, (), ())
    trial: Any = SimpleNamespace(specification=asked, hold=lambda _force, _k: hold, settles=lambda _force, _k: False)
    axis: Any = SimpleNamespace(settling=0.01)
    worst: Any = SimpleNamespace(bound=0.05)
    found = _Designer(asked, lambda _text, _share: None)._judged(axis, trial, {1000.0: np.inf}, worst)
    assert found[0] == "drive limit"
    held = ", and cold motors hold the force for 0.25 s" if told else ""
    assert found[1] == (
        f"The motors need at least 50 ms at the worst pose on 1000 N/m{held}; the controller does not settle."
    )


@pytest.mark.parametrize(
    ("slow", "soft", "bound", "axis", "coulomb", "constraint", "says"),
    [
        (0.04, 0.03, 0.04, 0.04, 0.1, "", ""),  # the wanted time itself is met
        (0.0401, 0.03, 0.02, 0.0401, 0.1, "its limit",
         "Without limits of the drive a step settles in 40.1 ms: a reason."),
        (0.03, 0.03, 0.05, np.nan, 0.1, "its limit", "a step settles in more than 500 ms: a reason."),
        (0.0567, 0.04, 0.04, 0.04, 0.1, "dry friction",
         "Dry friction holds the tip short of a stiff object's target: it needs 56.7 ms."),
        (np.inf, 0.04, 0.04, 0.04, 0.1, "dry friction", "target: it does not settle."),
        (0.0567, 0.04, 0.04, 0.04, 0.0, "sampling", "The nonlinear press on a stiffer object needs 56.7 ms."),
        (0.0567, 0.0401, 0.04, 0.04, 0.1, "drive limit",
         "The motors need at least 40 ms at the worst pose on 100 N/m; the controller needs 56.7 ms."),
        (0.03, 0.03, 0.0401, 0.04, 0.1, "drive limit", "at least 40.1 ms at the worst pose on 100 N/m"),
        (0.03, 0.03, np.inf, 0.04, 0.1, "drive limit",
         "The motors give 8.5 N at the tip and hold 2 N and the weight: they cannot brake the press; the controller"),
    ],
)  # fmt: skip
def test_the_binding_constraint_is_that_which_is_missed_first(
    slow: float, soft: float, bound: float, axis: float, coulomb: float, constraint: str, says: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """The axis without limits of the drive, then presses on the stiffer objects alone, then the drive."""
    designer: Any = _Designer.__new__(_Designer)
    device = SimpleNamespace(peak_force=8.5, coulomb=np.array([0.0, coulomb]))
    designer.s, designer.data = SimpleNamespace(settle=0.04, stiffness=(100.0, 1000.0), force=2.0, device=device), None
    asked: list[Any] = []
    for name in ("sampling_remedies", "drive_remedies", "friction_remedies"):
        monkeypatch.setattr(f"palpate.tuning.designer.{name}", lambda *given, n=name: (asked.append(given[-1]), n)[1:])
    settling = {100.0: soft, 316.0: slow, 1000.0: 0.01}
    tuned, worst = SimpleNamespace(settling=axis, limit="its limit", reason="a reason"), SimpleNamespace(bound=bound)
    trial = SimpleNamespace(hold=lambda _force, _k: np.inf)
    found = designer._judged(tuned, trial, settling, worst)
    assert found[0] == constraint
    assert says in found[1]
    assert bool(found[1]) is bool(says)
    if found[0] == "its limit":
        assert (found[2], asked) == (("sampling_remedies",), [max(slow, soft)])
    elif constraint:
        expected = "drive_remedies" if constraint == "drive limit" else "friction_remedies"
        assert (found[2], asked) == ((expected,), [settling])
    else:
        assert found[2] == ()


@pytest.mark.parametrize(
    ("judged", "lost", "expected"),
    [
        (("", "", ()), "", ("", "")),
        (("", "", ()), "unstable at 3 deg", ("operator", "The whole arm is unstable at 3 deg.")),
        (("encoder", "too coarse", ()), "unstable at 3 deg", ("encoder", "too coarse")),
    ],
)
def test_a_lost_operator_is_the_constraint_of_a_design_that_is_met_otherwise(
    judged: Any, lost: str, expected: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = specify("slider", "1 N/mm", "0.5 N", "40 ms", None, 0, None, None, (), ())
    tuned = SimpleNamespace(options={"bandwidth": 200.0})
    none = SimpleNamespace(overshoot=np.zeros(1), times=np.zeros(1))
    monkeypatch.setattr("palpate.tuning.designer.tune_axis", lambda *_: tuned)
    monkeypatch.setattr("palpate.tuning.designer.Trial.run", lambda *_: none)
    designer: Any = _Designer(asked, lambda _text, _share: None)
    designer._judged, designer._lost_operator = (lambda *_: judged), (lambda _: lost)
    designer._result = lambda *given: given
    assert designer.run()[3:5] == expected


TIP_DEVICE = """
name = "own"
description = "three sliding axes"
mechanism = "tip_device"
servo_period = { value = "1 ms", source = "own" }
[sources]
own = "an example"
[mass]
apparent = { value = ["80 g", "80 g", "120 g"], source = "own" }
[friction]
viscous = { value = ["0.1 N*s/m", "0.1 N*s/m", "0.1 N*s/m"], source = "own" }
[drive]
encoder_step = { value = ["10 um", "10 um", "10 um"], source = "own" }
peak_force = { value = "9 N", source = "own" }
[limits]
lower = { value = ["-50 mm", "-50 mm", "-50 mm"], source = "own" }
upper = { value = ["50 mm", "50 mm", "50 mm"], source = "own" }
"""


def test_your_own_device_of_three_axes_is_designed_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scenario names the device file in full, so it runs from another folder."""
    (tmp_path / "own.toml").write_text(TIP_DEVICE)
    monkeypatch.chdir(tmp_path)
    found = palpate.design("own.toml", "500 N/m..10 N/mm", "3 N", "40 ms")
    assert found.feasible
    assert found.bound == pytest.approx(palpate.tuning.drive_bound(load("own.toml"), [0, 0, 0], [0, 0, 1], 3.0, 500.0))
    (tmp_path / "other").mkdir()
    written = found.save_scenario(tmp_path / "other" / "scenario.toml")
    assert palpate.summarize(palpate.simulate(written))["verdict"].startswith("settled")


def test_an_operator_who_is_lost_on_the_whole_arm_is_named() -> None:
    """The check of the arm finds what the eigenvalues of the axis find: a mass far beyond the tolerated ratio."""
    s = specify(NAME, "1 N/mm", "1 N", "40 ms", None, 0, None, None, (HumanArm(20.0, 0.0, 0.0),), ())
    designer = _Designer(s, lambda _text, _fraction: None)
    fast = workspace(ARM, s.period, bandwidth=258.5, observer=2.5, disturbance=0.03)
    assert "unstable at" in designer._lost_operator(fast)
    assert "20 kg" in designer._lost_operator(fast)
    light = specify(NAME, "1 N/mm", "1 N", "40 ms", None, 0, None, None, (HumanArm(0.15, 4.5, 560.0),), ())
    assert _Designer(light, lambda _text, _fraction: None)._lost_operator(fast) == ""
