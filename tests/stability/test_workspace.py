"""The workspace's map: each of its limits is the limit of that pose's own loop, and of the simulated one."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import devices, simulate
from palpate.cli.main import app
from palpate.control import Controller
from palpate.devices.device import Parameters
from palpate.errors import PoseError, StabilityError
from palpate.linear import HumanArm
from palpate.report import workspace_page
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.stability import Workspace, certify, stability_interval, workspace
from palpate.stability.counter_example import growth
from palpate.stability.maps.pose_loops import PoseLoops
from palpate.stability.maps.reachable_poses import reachable_poses
from palpate.stability.maps.zwidth_map import wall_loops
from typer.testing import CliRunner

SCENARIOS = Path(__file__).parents[2] / "scenarios"
ARM = devices.load("phantom-premium-1.5a")
HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
TISSUE = {"tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"}


def display(delay: int = 0, damping: float = 0.0, **tables: Any) -> dict[str, Any]:
    """The arm as an impedance display in a hand."""
    return {
        "device": {"name": "phantom-premium-1.5a", "delay": delay},
        "start": {"pose": ["0 rad", "0.3 rad", "0.2 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**HAND, **TISSUE},
        "object": {"kind": "wall", "stiffness": "1 N/m", "damping": f"{damping} N*s/m", "normal": [0, 0, 1]},
        **tables,
    }


def placed(tables: dict[str, Any], pose: np.ndarray, normal: np.ndarray, stiffness: float = 1.0) -> dict[str, Any]:
    """The same scenario begun at another pose, at a wall that faces another way."""
    wall = {**tables["object"], "stiffness": f"{float(stiffness)!r} N/m", "normal": normal.tolist()}
    return {**tables, "start": {"pose": [f"{float(angle)!r} rad" for angle in pose]}, "object": wall}


@pytest.fixture(scope="module")
def delayed() -> tuple[dict[str, Any], Workspace]:
    tables = display(delay=1, damping=1.5)
    return tables, workspace(tables, poses=120)


def test_the_poses_of_an_arm_that_points_ahead_are_their_own_mirror_image() -> None:
    for start in ([0.0, 0.3, 0.2], [0.0, 2.2305, 3.2776]):
        _, tips, _, _ = reachable_poses(ARM, np.array(start), 120)
        left, right = (np.round(1e6 * tips * [side, 1, 1]) for side in (-1, 1))
        assert {tuple(tip) for tip in left + 0.0} == {tuple(tip) for tip in right + 0.0}


def test_every_limit_is_that_of_the_pose_by_itself(delayed: tuple[dict[str, Any], Workspace]) -> None:
    """Against the loop of `certify`, built and searched one by one: equal to 1e-8."""
    tables, found = delayed
    rng = np.random.default_rng(0)
    for _ in range(12):
        i, j = int(rng.integers(len(found.poses))), int(rng.integers(found.stiffness.shape[1]))
        loop = scenario_loop(Scenario.from_dict(placed(tables, found.poses[i], found.directions[i, j])))
        damping = float(loop.damping[0, 0])
        limit = stability_interval(wall_loops(loop)[0], damping)
        assert found.stiffness[i, j] == pytest.approx(limit.stiffness, rel=1e-8)
        assert found.frequency[i, j] == pytest.approx(limit.frequency, rel=1e-6)


def test_the_certificate_at_a_pose_agrees() -> None:
    """Without damping `gain_margin` is the critical stiffness of a wall of 1 N/m."""
    tables = display()
    tables["run"] = {"duration": "0.02 s"}
    found = workspace(tables, poses=60)
    for i in (0, len(found.poses) // 2, found.least[0]):
        j = int(np.argmin(found.stiffness[i]))
        certificate = certify(placed(tables, found.poses[i], found.directions[i, j]))
        assert certificate.margin["gain_margin"] == pytest.approx(found.stiffness[i, j], rel=1e-7)


def test_the_simulated_arm_swings_where_the_map_says(delayed: tuple[dict[str, Any], Workspace]) -> None:
    """1 % under the critical stiffness of a pose a nudge dies, 1 % above it grows: the nonlinear arm in full."""
    tables, found = delayed
    places = [(int(np.argmin(found.stiffness[:, axis])), axis) for axis in range(3)]
    for i, axis in [*places, (len(found.poses) // 3, 2)]:
        for share, grows in ((0.99, False), (1.01, True)):
            pressed = placed(tables, found.poses[i], found.directions[i, axis])
            stiffness = share * float(found.stiffness[i, axis])
            held = {"stiffness": f"{stiffness!r} N/m", "damping": "1.5 N*s/m"}
            one = {key: [text if k == axis else f"0 {text.split()[1]}" for k in range(3)] for key, text in held.items()}
            pressed["object"] = {"kind": "spring", **one}  # held from both sides
            push = ["0.001 N" if k == axis else "0 N" for k in range(3)]
            pressed["operator"] = {**HAND, **TISSUE, "shape": "step", "force": push}
            pressed["run"] = {"duration": "2 s", "substeps": 4}
            trace = simulate(pressed)
            assert (not trace.completed or growth(trace["tip"], 3) > 1) is grows


def test_the_weakest_direction_is_found() -> None:
    """No random direction is weaker than the map's by more than 3 %."""
    rng = np.random.default_rng(1)
    found = workspace(display(), poses=60)
    law = Controller.gain(1.0, 1e-3)
    loops = PoseLoops.of(ARM, found.poses, law, 1e-3, 0, HumanArm(0.15, 4.5, 560, 500, 0.5))
    normals = rng.normal(size=(len(loops), 30, 3))
    normals /= np.linalg.norm(normals, axis=2)[:, :, None]
    searched = loops.critical_stiffness(normals, np.zeros((len(loops), 30)))[0].min(axis=1)
    assert np.all(searched > 0.97 * found.worst)


def test_turning_the_base_changes_nothing() -> None:
    """Gravity and the hand are the same all round: the yaw may turn if the wall turns with it."""
    law = Controller.gain(1.0, 1e-3)
    poses = np.array([[yaw, 0.3, 0.2] for yaw in np.linspace(-1.2, 1.2, 7)])
    loops = PoseLoops.of(ARM, poses, law, 1e-3, 1, HumanArm(0.15, 4.5, 560))
    turned = np.array([[np.sin(yaw), 0.0, np.cos(yaw)] for yaw in poses[:, 0]])[:, None, :]
    limits = loops.critical_stiffness(turned, np.full((7, 1), 2.0))[0]
    assert limits == pytest.approx(limits[0, 0], rel=1e-9)


def test_poses_lie_where_they_say(delayed: tuple[dict[str, Any], Workspace]) -> None:
    """Tips are the poses' own, sections are planes through the start, the least is the least."""
    _, found = delayed
    assert ARM.forward(found.poses) == pytest.approx(found.tips, abs=1e-9)
    assert found.tips[found.sections["y-z"]][:, 0] == pytest.approx(found.start[0], abs=1e-12)
    assert found.tips[found.sections["x-z"]][:, 1] == pytest.approx(found.start[1], abs=1e-12)
    assert found.stiffness[found.least] == found.stiffness.min()
    assert f"{found.stiffness.min():.5g} N/m" in str(found)
    written = re.search(r"with the normal \(([^)]*)\)", str(found))
    assert written
    i, j = found.least
    assert [float(one) for one in written[1].split(", ")] == pytest.approx(found.directions[i, j], abs=1e-3)
    assert "-0," not in f"{written[1]},"


def test_nobody_holds_a_device_that_tips_over() -> None:
    """A constant force holds the arm on a hilltop at most poses: no wall is stable there, and the map says so."""
    found = workspace(display(operator={"kind": "none"}), poses=50)
    assert found.falling > 0.5
    assert "tips over" in str(found)
    stiffness = found.stiffness.copy()
    stiffness[1::2] = 700.0
    assert "At the others the least limit in any direction is 700 N/m" in str(replace(found, stiffness=stiffness))
    assert "Hatched" in workspace_page(found).html()


def test_the_softest_stable_wall_is_that_of_the_pose_by_itself() -> None:
    """An arm that tips over is held by walls above a stiffness alone: the limit of its loop, searched one by one."""
    hand = {"kind": "arm", "mass": "0.05 kg", "damping": "1 N*s/m", "stiffness": "1 N/m"}
    poses = np.array([[0.0, 0.9, -0.3], [0.0, 0.9, 0.6], [0.5, 1.2, 0.4]])
    normals = np.array([[0.0, 0.6, 0.8], [0.0, 0.8, -0.6], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    loops = PoseLoops.of(ARM, poses, Controller.gain(1.0, 1e-3), 1e-3, 0, HumanArm(0.05, 1.0, 1.0))
    critical, _, softest = loops.critical_stiffness(np.tile(normals, (3, 1, 1)), np.zeros((3, 4)))
    assert np.sum((softest > 0) & (critical > softest)) >= 2
    for (i, j), lower in np.ndenumerate(softest):
        loop = wall_loops(scenario_loop(Scenario.from_dict(placed(display(operator=hand), poses[i], normals[j]))))[0]
        assert lower == pytest.approx(stability_interval(loop).min_stable_stiffness, rel=1e-5)


def test_walls_that_are_too_soft_to_hold_the_arm_are_not_called_stable(
    delayed: tuple[dict[str, Any], Workspace],
) -> None:
    """The claim begins at the softest stable wall, and is none where that is stiffer than the least limit."""
    _, found = delayed
    assert found.stable
    assert 'verdict good"' in workspace_page(found).html()
    softest = np.zeros_like(found.softest)
    for lower, tone, says in (
        (20.0, "note", f"Walls from 20 N/m up to {found.worst.min():.5g} N/m are stable"),
        (2 * float(found.worst.min()), "bad", "No stiffness is stable at each of"),
    ):
        softest[5, 2] = lower
        held = replace(found, softest=softest)
        assert not held.stable
        assert str(held).startswith(says)
        assert f"below {lower:.5g} N/m are unstable too" in str(held)
        assert f'verdict {tone}"' in workspace_page(held).html()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"operator": {"kind": "fixed"}}, "keeps the tip still"),
        ({"device": {"name": "phantom-premium-1.5a", "model": "linear"}, "operator": {"kind": "none"}}, "nonlinear"),
        (
            {"servo": {"topology": "force_tracking"}, "operator": {"kind": "none"}, "reference": {"force": "1 N"}},
            "impedance_display",
        ),
        ({"device": {"name": "slider"}, "start": {"pose": ["0 m"]},
          "object": {"kind": "spring", "stiffness": "1 N/m"}}, "has 1 of the three joints"),
        ({"device": {"name": "haply-2diy"}, "start": {"pose": ["120 deg", "60 deg"]},
          "object": {"kind": "spring", "stiffness": "1 N/m"}}, "has 2 of the three joints"),
    ],
)  # fmt: skip
def test_what_has_no_workspace_is_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(StabilityError, match=says):
        workspace(display(**change), poses=60)


def test_workspace_from_the_command_line(tmp_path: Path) -> None:
    """A device by its name; the page has its maps, the file every number; an unknown device gives an error message."""
    runner = CliRunner()
    asked = ["workspace", "phantom-premium-1.5a-rotors", "--poses", "60", "--out", str(tmp_path / "out")]
    done = runner.invoke(app, asked)
    assert done.exit_code == 0, done.output
    assert "through fingertip tissue" in done.output
    written = json.loads((tmp_path / "out" / "workspace.json").read_text("utf-8"))
    assert written["least"]["stiffness_N_per_m"] == min(min(row) for row in written["stiffness_N_per_m"])
    html = (tmp_path / "out" / "workspace.html").read_text("utf-8")
    assert html.count("<svg") == 2
    assert runner.invoke(app, ["workspace", "phantm", "--out", str(tmp_path / "none")]).exit_code == 2
    assert not (tmp_path / "none").exists()


def test_no_pose_of_a_map_is_beyond_the_limits_of_a_joint() -> None:
    start = np.array([0.0, 0.3, 0.2])
    low, high = start - [0.4, 0.3, 0.5], start + np.array([0.2, 0.4, 0.3])
    limits = {"limits.lower": tuple(low), "limits.upper": tuple(high)}
    limited = devices.Device(ARM.name, "", ARM.mechanism, Parameters({**ARM.parameters.values, **limits}))
    poses, free = (reachable_poses(device, start, 500)[2] for device in (limited, ARM))
    within = free[np.all((free >= low) & (free <= high), axis=1)]
    assert 5 < len(poses) < len(free) / 2
    assert poses == pytest.approx(within, abs=0.0)


def test_a_map_from_a_singular_start_is_refused() -> None:
    with pytest.raises(PoseError, match="workspace: the Jacobian is singular"):
        workspace(display(start={"pose": ["0 rad", "2.2305 rad", f"{2.2305 + np.pi / 2} rad"]}), poses=50)


def made(stiffness: list[list[float]], softest: list[list[float]]) -> Workspace:
    """A map of three poses and two directions of which the limits are given."""
    tips = np.array([[0.01, 0.02, -0.03], [0.1, -1e-5, 0.0], [0.0, -0.2, 0.0]])
    directions = np.tile([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8]], (3, 1, 1))
    frequency = np.array([[10.0, 20.0], [30.0, 40.0], [50.0, 60.0]])
    sections: dict[str, Any] = {}
    return Workspace("a title", "a loop", tips, np.zeros((3, 3)), directions, np.array(stiffness), frequency,
                     np.array(softest), np.zeros(3), np.zeros(3), sections, 0.01)  # fmt: skip


def test_a_map_says_its_least_limit_where_it_is_and_what_is_soft() -> None:
    whole = made([[300.0, 200.0], [500.0, 100.0], [400.0, 900.0]], [[0.0, 0.0]] * 3)
    assert (whole.least, whole.falling, whole.least_stable, whole.stable) == ((1, 1), 0.0, 0.0, True)
    assert whole.worst.tolist() == [200.0, 100.0, 400.0]
    assert str(whole) == (
        "Walls up to 100 N/m are stable at each of 3 poses in every direction (2 tested at each pose). The minimum is "
        "at (100, 0, 0) mm with the normal (0, 0.6, -0.8), where the loop oscillates at 40 Hz. The median is 200 N/m."
    )
    soft = made([[300.0, 200.0], [500.0, 100.0], [400.0, 900.0]], [[0.0, 7.0], [0.0, 0.0], [3.0, 0.0]])
    assert (soft.least_stable, soft.stable) == (7.0, False)
    assert str(soft).startswith("Walls from 7 N/m up to 100 N/m are stable at each of 3 poses")
    assert str(soft).endswith(
        "200 N/m. At 2 poses the device is unstable without a wall. At the worst of them walls below 7 N/m are "
        "unstable too."
    )
    none = made([[300.0, 200.0], [500.0, 100.0], [400.0, 900.0]], [[0.0, 100.0], [0.0, 0.0], [3.0, 0.0]])
    assert (none.least_stable, none.stable) == (100.0, False)
    assert str(none).startswith(
        "No stiffness is stable at each of 3 poses in every direction. The least limit is 100 N/m at (100, 0, 0) mm"
    )
    falls = made([[0.0, 200.0], [500.0, 100.0], [400.0, 900.0]], [[0.0, 0.0], [0.0, 0.0], [3.0, 0.0]])
    assert (falls.least, falls.falling, falls.least_stable, falls.stable) == ((0, 0), 1 / 3, 3.0, False)
    said = str(falls)
    assert said.startswith("At 1 of 3 poses no wall of any stiffness is stable: the device tips over there")
    assert "At the others the least limit in any direction is 100 N/m, the median 250 N/m." in said
    nothing = made([[0.0, 0.0]] * 3, [[0.0, 5.0]] * 3)
    assert (nothing.falling, nothing.least_stable, nothing.stable) == (1.0, 0.0, False)
    assert "At 3 of 3 poses" in str(nothing)
    assert "others" not in str(nothing)
