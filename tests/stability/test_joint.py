"""Several devices on one body: their run, the response of the body to all tips, and the loops that it couples."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import fem, simulate
from palpate.errors import ScenarioError, StabilityError
from palpate.scenario import Scenario
from palpate.simulation.body_response import HeldTip, HeldTips, body_response
from palpate.simulation.joint_run import JointRun, simulate_together
from palpate.simulation.shared_body import SharedBody
from palpate.simulation.verdict import State, Verdict
from palpate.stability.joint import JointStability, joint_stability


def built(path: Path, size: tuple[float, float, float], fixed: str, touch: str) -> Path:
    """A block of 10 kPa, in cells of 4 mm."""
    fem.build(fem.block(size, 0.004), young=10e3, fixed=fixed, touch=touch, output=path)
    return path


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """48 x 32 x 16 mm, bonded below, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    return built(path, (0.048, 0.032, 0.016), fixed="z < 0.001 mm", touch="z > 15.9 mm")


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cantilever of 32 x 12 x 12 mm, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "beam.h5"
    return built(path, (0.032, 0.012, 0.012), fixed="x < 0.1 mm", touch="z > 11.9 mm")


def device(block: Path, x: float, press: float = 2.0, **body: Any) -> dict[str, Any]:
    """A device that presses the top of the block at x mm along it."""
    place = {"file": str(block), "kind": "signed_distance", "radius": "6 mm", "origin": [f"{x} mm", "16 mm", "16 mm"]}
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", f"{-press} N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-6.2 mm"], "body": {**place, **body}},
        "run": {"duration": "0.8 s"},
    }


def off(tables: dict[str, Any]) -> dict[str, Any]:
    """The same device far above the body."""
    return {**tables, "object": {**tables["object"], "position": ["0 mm", "0 mm", "-60 mm"]}}


@pytest.mark.parametrize("options", [{}, {"static_friction": 0.5}])
def test_a_device_beside_one_that_touches_nothing_runs_as_alone(block: Path, options: dict[str, Any]) -> None:
    """With friction each run is within 0.5 % of the largest value, where a tick of a moving tip may end."""
    own = device(block, 20.0, stiffness_scale=20.0, **options)
    alone = simulate(Scenario.from_dict(own))
    joint = simulate_together([own, off(device(block, 30.0, stiffness_scale=20.0, **options))])
    for channel in ("tip", "object_force", "command_force", "torque", "deflection"):
        allowed = 2 * 5e-3 * np.abs(alone[channel]).max() if options else 5e-6
        np.testing.assert_allclose(joint.traces[0][channel], alone[channel], rtol=1e-5, atol=allowed)
    np.testing.assert_allclose(joint.traces[0]["tip"], alone["tip"], atol=1e-6)
    assert alone["touching"][-1, 0] > 0.0
    assert not joint.traces[1]["touching"].any()


def test_the_order_of_the_devices_does_not_matter(block: Path) -> None:
    first, second = device(block, 18.0, 0.5), device(block, 28.0, 0.3)
    one, other = simulate_together([first, second]), simulate_together([second, first])
    for a, b in zip(one.traces, other.traces[::-1], strict=True):
        np.testing.assert_allclose(a["tip"], b["tip"], atol=1e-7)
        np.testing.assert_allclose(a["object_force"], b["object_force"], atol=2e-4)


def test_encoders_and_delay_reach_the_shared_body(block: Path) -> None:
    """The body is met where the servo reads the tip, whose counts are a hundred times coarser than the tolerance."""
    own = {**device(block, 20.0, stiffness_scale=20.0), "device": {"name": "phantom-premium-1.5a", "encoder": True}}
    own["device"]["delay"] = 1
    alone = simulate(Scenario.from_dict(own))
    joint = simulate_together([own, off(own)])
    np.testing.assert_allclose(joint.traces[0]["object_force"], alone["object_force"], rtol=1e-5, atol=1e-8)


def tips_of(traces: Any) -> np.ndarray:
    return np.stack([trace["tip"] for trace in traces], axis=1)


def test_the_response_of_one_tip_to_another_is_mutual(block: Path) -> None:
    """Betti (1872): without friction the stiffness between two tips is symmetric, in a frame of one's own each."""
    turned = device(block, 28.0, 0.5, rotation=["0 deg", "0 deg", "50 deg"])
    scenarios = [Scenario.from_dict(one) for one in (device(block, 18.0, 0.5), turned)]
    run = simulate_together(scenarios)
    held = HeldTips(SharedBody(scenarios), tips_of(run.traces))
    found = body_response(held)
    stiffness = found.frame @ found.static @ found.frame.T
    assert stiffness.shape == (6, 6)
    assert np.abs(stiffness[:3, 3:]).max() > 0.02 * np.abs(stiffness).max()
    np.testing.assert_allclose(stiffness[:3, 3:], stiffness[3:, :3].T, atol=2e-3 * np.abs(stiffness).max())


def test_with_the_others_off_the_body_a_tip_has_its_own_response(block: Path) -> None:
    """A second tip of the tool's size 25 mm away changes the stiffness by the little that it couples."""
    scenarios = [Scenario.from_dict(device(block, x, 0.5, stiffness_scale=10.0)) for x in (10.0, 38.0)]
    run = simulate_together(scenarios)
    held = HeldTips(SharedBody(scenarios), tips_of(run.traces))
    found = body_response(held).of_tip(0, 1)
    tip = run.traces[0]["tip"]
    alone = body_response(HeldTip(scenarios[0], tip - tip[0]))
    np.testing.assert_allclose(found.static[0, 0], alone.static[0, 0], rtol=0.03)
    np.testing.assert_allclose(found.frame[:, 0], alone.frame[:, 0], atol=0.02)


def test_two_devices_oscillate_on_a_body_on_which_each_rests_alone(beam: Path) -> None:
    """The body couples the loops: the joint margin is smaller than that of each, and the runs show it.

    Near the limit a run may oscillate too slowly to be judged, so that one of several stiffnesses must show it.
    """

    def pair(scale: float) -> list[dict[str, Any]]:
        place = {"radius": "4 mm", "stiffness_scale": scale}
        found = [device(beam, x, 1.0, **place, origin=[f"{x} mm", "6 mm", "12 mm"]) for x in (20.0, 29.0)]
        return [
            {**one, "object": {**one["object"], "position": ["0 mm", "0 mm", "-4.2 mm"]}, "run": {"duration": "1.5 s"}}
            for one in found
        ]

    soft = joint_stability(pair(300.0))
    assert soft.state is State.STABLE, str(soft)
    assert soft.together.stiffness_margin < 0.95 * min(one.stiffness_margin for one in soft.each)
    decided = []
    for scale in (560.0, 580.0, 600.0, 620.0):
        stiff = pair(scale)
        if all(simulate(Scenario.from_dict(one)).verdict.settled for one in stiff):
            found = joint_stability(stiff)
            assert found.together.radius > 1.0
            assert found.state in (State.UNSTABLE, State.UNDECIDED), str(found)
            decided += [found] if found.state is State.UNSTABLE else []
    assert decided


def test_devices_whose_swing_goes_from_one_to_the_other_and_decays_do_not_fail(block: Path) -> None:
    """The swing of one device grows while all together decay: it was unstable at 0.6 s, and oscillated at 0.8 s."""

    def pair(duration: str) -> list[dict[str, Any]]:
        found = []
        for x, press, radius in ((14.8, 1.54, 8.7), (22.5, 2.2, 9.6)):
            one = device(block, x, press, radius=f"{radius} mm", stiffness_scale=123.2)
            place = {**one["object"], "position": ["0 mm", "0 mm", f"{-radius - 0.2} mm"]}
            found.append({**one, "object": place, "run": {"duration": duration}})
        return found

    for duration in ("0.6 s", "0.8 s"):
        short = simulate_together(pair(duration)).verdict
        assert short.state is State.UNDECIDED
        assert "the oscillation of all tips together decays" in short.reason
    assert all(trace.verdict.settled for trace in simulate_together(pair("3 s")).traces)


def test_a_joint_verdict_is_that_of_every_tick(block: Path) -> None:
    pair = [device(block, 14.0, 0.6), device(block, 30.0, 1.2)]
    whole = simulate_together(pair)
    assert whole.settled
    for every in (2, 7):
        run = {"duration": "0.8 s", "record_every": every}
        thinned = simulate_together([{**one, "run": run} for one in pair])
        assert thinned.verdict == whole.verdict
        for trace, own in zip(thinned.traces, whole.traces, strict=True):
            np.testing.assert_array_equal(trace["tip"], own["tip"][::every])
            assert trace.scenario["run"]["record_every"] == every


def test_a_joint_verdict_that_the_run_contradicts_is_undecided(block: Path) -> None:
    pair = [device(block, 18.0, 0.5), device(block, 28.0, 0.5)]
    short = [{**one, "run": {"duration": "0.06 s"}} for one in pair]
    found = joint_stability(short)
    assert found.together.state is State.STABLE
    assert not found.run.settled
    assert found.state is State.UNDECIDED
    assert "Undecided" in str(found)


def test_a_tip_off_the_body_has_no_joint_loop(block: Path) -> None:
    with pytest.raises(StabilityError, match="device 2 does not touch the body"):
        joint_stability([device(block, 18.0, 0.5), off(device(block, 28.0))])


def test_devices_that_cannot_share_a_body_are_refused(block: Path) -> None:
    own = device(block, 20.0)
    two = device(block, 28.0)
    cases: list[tuple[list[dict[str, Any]], str]] = [
        ([own], "1 scenarios; 2 to 8 devices share a body"),
        ([own, {**two, "servo": {"period": "0.5 ms"}}], "one period, 1 ms"),
        ([own, device(block, 28.0, stiffness_scale=2.0)], "stiffness_scale: differs"),
        ([own, {**two, "object": {"kind": "spring", "stiffness": "1 N/mm"}}], 'write kind = "body"'),
        ([own, device(block, 28.0, kind="compliance")], "contact by signed distance"),
        ([own, device(block, 28.0, tip="flat")], "takes spheres"),
        ([own, device(block, 28.0, contact_points=[["0 mm"] * 3, ["9 mm"] * 3])], "each device has one tip"),
        ([own, {**two, "servo": {"period": "1 ms", "jitter": "0.1 ms"}}], "sampled together"),
        ([own, two, own], "tips 1 and 3 start in the same place of the body: move one of them"),
    ]
    for scenarios, text in cases:
        with pytest.raises(ScenarioError, match=text):
            simulate_together(scenarios)
    for value in (None, 3, "one.toml", own):
        for call in (simulate_together, joint_stability):
            with pytest.raises(ScenarioError, match="scenarios: a list with one scenario for each device is needed"):
                call(value)  # type: ignore[arg-type]


@pytest.mark.parametrize("settled", [(True, True), (True, False), (False, False)])
def test_a_joint_run_has_settled_if_every_device_has(settled: tuple[bool, ...]) -> None:
    states = (State.SETTLED if one else State.UNDECIDED for one in settled)
    traces: Any = tuple(SimpleNamespace(verdict=Verdict(state, "")) for state in states)
    assert JointRun(traces, ()).settled == all(settled)


def test_devices_whose_tips_overlap_are_undecided(block: Path) -> None:
    """Spheres of 6 mm, 5 and 14 mm apart: the elastic problem has a solution for both, rigid tips for one only."""
    far, near = ([device(block, 18.0, 0.5), device(block, 18.0 + gap, 0.5)] for gap in (14.0, 5.0))
    assert joint_stability(far).state is State.STABLE
    found = joint_stability(near)
    assert all(trace.verdict.settled for trace in found.run.traces)
    assert found.state is State.UNDECIDED
    assert str(found).startswith("Undecided: the tips of devices 1 and 2 overlap by 7")


def test_a_linear_loop_that_no_run_shows_to_oscillate_is_not_unstable() -> None:
    """The run had not settled after 0.6 s, where its loop was unstable; it settled, and was stable, after 2 s."""
    loop: Any = SimpleNamespace(state=State.UNSTABLE, stiffness_margin=np.nan, radius=1.004)
    for state, joint in ((State.UNDECIDED, State.UNDECIDED), (State.BOUNDED_OSCILLATION, State.UNSTABLE)):
        run = JointRun((SimpleNamespace(verdict=Verdict(state, "")),) * 2, ())  # type: ignore[arg-type]
        assert JointStability(loop, (loop, loop), run).state is joint


@pytest.mark.parametrize(
    ("verdicts", "state", "reason"),
    [
        ([Verdict(State.SETTLED, "a")] * 2, State.SETTLED, "all devices rest"),
        ([Verdict(State.SETTLED, "a"), Verdict(State.UNDECIDED, "b")], State.UNDECIDED, "device 2: b"),
        (
            [Verdict(State.UNDECIDED, "a"), Verdict(State.CONTACT_LOST, "b", 0.4), Verdict(State.UNSTABLE, "c", 0.2)],
            State.CONTACT_LOST,
            "device 2: b; device 3: unstable: c",
        ),
    ],
)
def test_the_verdict_of_a_joint_run_is_that_of_the_first_device_that_failed(
    verdicts: list[Verdict], state: State, reason: str
) -> None:
    run = JointRun(tuple(SimpleNamespace(verdict=one) for one in verdicts), ())  # type: ignore[misc, arg-type]
    assert (run.verdict.state, run.verdict.reason) == (state, reason)
    assert run.verdict.since == (0.2 if state is State.CONTACT_LOST else None)


def test_a_contact_that_a_run_loses_outlasts_a_stable_loop() -> None:
    """The loop at the end of the run does not describe a tip that was off the body on the way."""
    settled, lost = Verdict(State.SETTLED, "rests"), Verdict(State.CONTACT_LOST, "is off the object", 0.4)
    run = JointRun(tuple(SimpleNamespace(verdict=one) for one in (settled, lost)), ())  # type: ignore[misc, arg-type]
    loop: Any = SimpleNamespace(state=State.STABLE, stiffness_margin=2.0, radius=0.9)
    found = JointStability(loop, (loop, loop), run)
    assert found.state is State.CONTACT_LOST
    assert str(found).splitlines()[:2] == [
        "Contact lost: device 2: is off the object",
        "  all devices together: small motions are stable (spectral radius 0.9), 2 times the body's stiffness before "
        "it oscillates",
    ]
