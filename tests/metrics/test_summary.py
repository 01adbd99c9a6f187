"""Summaries: every number is finite, or None where it overflowed or cannot be known."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.metrics import summarize
from palpate.metrics.body_contact import PalpationMetrics
from palpate.metrics.mesh_contact import _ripple_power, sliding_metrics
from palpate.metrics.summary import _magnitude, _one_step, _plain
from palpate.simulation.trace import TraceError
from readers import SLIDER


def test_a_ripple_above_half_the_sampling_rate_is_unknown() -> None:
    """Samples 1 s apart show no vibration from 20 Hz on; nor do two samples."""
    assert math.isnan(_ripple_power(np.ones((9, 3)), 1.0))
    assert math.isnan(_ripple_power(np.ones((99, 3)), 1.0 / 30.0))  # shows 15 Hz at most
    assert math.isnan(_ripple_power(np.ones((1, 3)), 1e-3))
    assert _ripple_power(np.ones((99, 3)), 1e-3) == 0.0


def test_a_number_that_is_not_finite_is_none() -> None:
    found = _plain({"a": math.inf, "b": [math.nan, {"c": -math.inf}], "d": 1.5, "e": None, "f": "inf", "g": True})
    assert found == {"a": None, "b": [None, {"c": None}], "d": 1.5, "e": None, "f": "inf", "g": True}
    json.dumps(found, allow_nan=False)


def test_a_trace_without_a_channel_of_every_run_is_refused() -> None:
    """A file may lack one although it was sealed."""
    whole = simulate(SLIDER)
    for name in whole.channels:
        lacking = replace(
            whole,
            channels={key: one for key, one in whole.channels.items() if key != name},
            metadata={key: value for key, value in whole.metadata.items() if key != "verdict"},
        )
        with suppress(TraceError):
            json.dumps(summarize(lacking), allow_nan=False)
    with pytest.raises(TraceError, match="not complete, so it cannot be judged: "):
        summarize(replace(whole, channels={"tip": whole.channels["tip"], "touching": whole.channels["touching"]}))


def test_a_force_on_several_axes_settles_as_its_magnitude_in_any_frame() -> None:
    scenario = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "step", "force": ["0.2 N", "0.9 N", "-0.3 N"]},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "controller": {"kind": "lqg"},
        "run": {"duration": "0.4 s"},
    }
    trace = simulate(scenario)
    turned = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    deflection, force = trace["deflection"], np.array([0.2, 0.9, -0.3])
    channels = {**trace.channels, "deflection": replace(trace.channels["deflection"], values=deflection @ turned.T)}
    found = summarize(trace)["magnitude"]
    again = _magnitude(replace(trace, channels=channels), (turned @ force / 1000.0).tolist(), 0.0)
    assert again == pytest.approx((found["settling_5_percent_s"], found["error_percent"]), rel=1e-9)
    along = np.linalg.norm(deflection - deflection[-1], axis=1) > 0.05 * np.linalg.norm(force) / 1000.0
    assert found["settling_5_percent_s"] == pytest.approx(trace.time[np.flatnonzero(along)[-1] + 1], abs=2e-3)


def test_a_verdict_begins_with_its_reason_unless_the_run_settled() -> None:
    """And the settling time of a run that did not settle is not told in place of it."""
    settled = simulate({**SLIDER, "object": {**SLIDER["object"], "damping": "5 N*s/m"}, "run": {"duration": "2 s"}})
    assert settled.stable
    assert summarize(settled)["verdict"].startswith("settled to 5 % in")
    bare = replace(settled, metadata={"verdict": settled.verdict.to_dict()})  # no scenario says how it was pushed
    assert summarize(bare)["verdict"].startswith(str(settled.verdict))
    swinging = simulate({**SLIDER, "run": {"duration": "2 s"}})
    assert not swinging.stable
    assert summarize(swinging)["verdict"].startswith(str(swinging.verdict))


@pytest.mark.parametrize(("normal", "warned"), [([0, 0, 1], True), ([0, 1, 0], False)])
def test_a_wall_across_the_plane_of_a_planar_device_is_warned_of(normal: list[int], warned: bool) -> None:
    scenario = {
        "device": {"name": "haply-2diy"},
        "start": {"pose": ["60 deg", "120 deg"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.1 kg", "damping": "5 N*s/m", "stiffness": "200 N/m"},
        "object": {"kind": "wall", "normal": normal, "stiffness": "200 N/m"},
        "run": {"duration": "50 ms"},
    }
    found = summarize(simulate(scenario))["warnings"]
    assert any("cannot move along the wall's normal" in sentence for sentence in found) is warned


def test_a_response_that_returns_settles_to_a_share_of_its_peak() -> None:
    """A spring that begins taut moves the tip until a ramp of force holds it where it began."""
    tables = {
        **SLIDER,
        "operator": {"kind": "force", "shape": "ramp", "rise": "0.1 s", "force": ["-1 N", "0 N", "0 N"]},
        "object": {
            "kind": "spring",
            "stiffness": "100 N/m",
            "damping": "3 N*s/m",
            "position": ["10 mm", "0 mm", "0 mm"],
        },
        "run": {"duration": "1 s"},
    }
    found = summarize(simulate(tables))
    assert found["axes"]["x"]["overshoot_percent"] is None
    assert found["verdict"].startswith("settled to 5 % of its peak in")


@pytest.mark.parametrize("start", ["0 s", "50 ms"])
def test_settling_counts_from_the_end_of_a_ramp(start: str) -> None:
    force = {"kind": "force", "shape": "ramp", "rise": "0.2 s", "start": start, "force": ["-1 N", "0 N", "0 N"]}
    trace = simulate(
        {**SLIDER, "operator": force, "object": {**SLIDER["object"], "damping": "3 N*s/m"}, "run": {"duration": "1 s"}}
    )
    found, x = summarize(trace), trace["deflection"][:, 0]
    outside = np.flatnonzero(np.abs(x - x[-1]) > 0.05 * np.abs(x[-1]))[-1]
    end = 0.2 + (0.0 if start == "0 s" else 0.05)
    assert trace.time[outside] > end
    settling = found["axes"]["x"]["settling_5_percent_s"]
    assert settling == pytest.approx(trace.time[outside + 1] - end, abs=2e-3)
    assert found["verdict"] == f"settled to 5 % in {1e3 * settling:.3g} ms after the end of the ramp"


def test_a_ramp_so_slow_that_the_response_follows_it_is_settled_at_its_end() -> None:
    force = {"kind": "force", "shape": "ramp", "rise": "1 s", "force": ["-1 N", "0 N", "0 N"]}
    tables = {**SLIDER, "operator": force, "object": {**SLIDER["object"], "damping": "3 N*s/m"}}
    found = summarize(simulate(tables | {"run": {"duration": "1.5 s"}}))
    assert found["axes"]["x"]["settling_5_percent_s"] == 0.0
    assert found["verdict"].startswith("settled to 5 % by the end of the ramp")


def test_the_shortest_run_has_a_response() -> None:
    """A servo period has two samples."""
    tables = {key: table for key, table in SLIDER.items() if key != "operator"}
    tables |= {"servo": {"period": "1 ms"}, "reference": {"force": ["1 N", "0 N", "0 N"]}, "run": {"duration": "1 ms"}}
    trace = simulate(tables)
    assert len(trace) == 2
    assert summarize(trace)["axes"]["x"]["expected_deflection_m"] == pytest.approx(1.0 / 100.0)


def test_a_palpation_settles_with_a_swing_of_1_percent_of_its_force_or_1_mn() -> None:
    none = dict.fromkeys((one.name for one in fields(PalpationMetrics)), 0.0)
    for force, most in ((0.02, 1e-3), (0.5, 5e-3)):
        for swing, settled in ((0.99 * most, True), (1.01 * most, False)):
            values: Any = {**none, "final_force": force, "final_swing": swing, "touching_at_end": True}
            assert PalpationMetrics(**values).settled is settled
            assert not PalpationMetrics(**{**values, "touching_at_end": False}).settled


def test_metrics_of_a_slide_are_found_a_second_way() -> None:
    """A point pressed on the top of a box with two stiffnesses: from the channels, tick by tick."""
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0.05 N", "0.02 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "40 N/m"},
        "object": {
            "kind": "mesh",
            "position": ["0.3 mm", "0.2 mm", "-0.4 mm"],
            "mesh": {"shape": "box", "edge": "40 mm", "divisions": 10, "rotation": ["0 deg", "0 deg", "0 deg"]},
            "surface": {"stiffness": "150 N/m", "static_friction": 0.2, "dynamic_friction": 0.1},
        },
        "run": {"duration": "0.3 s"},
    }
    trace = simulate(tables)
    found = sliding_metrics(trace)
    assert found is not None
    touching = trace["touching"][:, 0] > 0.0
    first = int(np.flatnonzero(touching)[0])
    path = crossing = elsewhere = 0.0
    for k in range(first + 1, len(trace.time)):
        step = float(np.linalg.norm(trace["object_force"][k] - trace["object_force"][k - 1]))
        both = touching[k] and touching[k - 1]
        path += float(np.linalg.norm(trace["proxy"][k] - trace["proxy"][k - 1])) if both else 0.0
        if both and trace["triangle"][k, 0] != trace["triangle"][k - 1, 0]:
            crossing = max(crossing, step)
        else:
            elsewhere = max(elsewhere, step)
    assert (found.path, found.step_at_crossing, found.step_elsewhere) == pytest.approx((path, crossing, elsewhere))
    assert found.lost_ticks == np.count_nonzero(~touching[first:])
    late = trace.time >= trace.time[-1] - 0.1
    pressed = -trace["reference_force"][:, 2] / 150.0
    deflection, wanted = trace["depth"][late, 0].mean(), pressed[late].mean()
    assert (found.deflection, found.expected_deflection) == pytest.approx((deflection, wanted))
    assert found.deflection_error_percent == pytest.approx(100.0 * (deflection - wanted) / wanted)
    rms = np.sqrt(np.mean((trace["depth"][touching, 0] - pressed[touching]) ** 2))
    assert found.deflection_rms_error == pytest.approx(rms)
    force = trace["object_force"][late]
    assert found.final_force == pytest.approx(np.linalg.norm(force, axis=1).mean())
    assert found.final_swing == pytest.approx((force.max(axis=0) - force.min(axis=0)).max())
    assert found.touching_at_end == touching[late].all()
    assert abs(found.energy_generated) < 1e-3 * found.energy_dissipated
    still = simulate(tables | {"reference": {"shape": "step", "force": "1 mN"}, "run": {"duration": "20 ms"}})
    assert sliding_metrics(still) is None


def test_without_a_crossing_its_step_is_zero() -> None:
    tables = {
        "device": {"name": "slider"},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "ramp", "rise": "0.2 s", "force": ["-0.5 N", "0 N", "0 N"]},
        "object": {
            "kind": "mesh",
            "position": ["1 mm", "1 mm", "2 mm"],
            "mesh": {
                "shape": "box",
                "edge": "40 mm",
                "divisions": 4,
                "rotation": ["0 deg", "-90 deg", "0 deg"],
                "radius": "2 mm",
            },
            "surface": {"stiffness": "100 N/m"},
        },
        "run": {"duration": "0.3 s"},
    }
    found = sliding_metrics(simulate(tables))
    assert found is not None
    assert found.step_at_crossing == 0.0
    assert found.step_elsewhere is not None
    assert 0.0 < found.step_elsewhere < 0.1


@pytest.mark.parametrize(("above", "remark"), [("3 mm", True), ("0.05 mm", False), ("-1 mm", False)])
def test_a_free_tip_that_begins_deep_in_a_wall_is_remarked(above: str, remark: bool) -> None:
    """A wall whose surface lies over the tip throws it out; where nothing can move it is a test of statics."""
    scenario = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"tip": ["10 mm", "-20 mm", "40 mm"]},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {"kind": "wall", "stiffness": "1 N/mm", "position": ["0 mm", above, "0 mm"], "normal": [0, 1, 0]},
        "controller": {"kind": "none"},
        "run": {"duration": "0.1 s"},
    }
    told = "it began 3 mm deep in the wall; check object.position"
    assert (told in summarize(simulate(scenario))["verdict"]) is remark
    held = {**scenario, "operator": {"kind": "fixed"}}
    assert summarize(simulate(held))["verdict"].endswith("there is no loop that could oscillate")


@pytest.mark.parametrize("period", [1e-3, 0.5e-3])
@pytest.mark.parametrize(("frequency", "seen"), [(100.0, True), (5.0, False)])
def test_the_power_of_a_ripple_is_half_the_square_of_its_amplitude(period: float, frequency: float, seen: bool) -> None:
    """Of each axis: 0.3 N and 0.4 N are 0.125 N^2; the constant part and slow motions do not count."""
    wave = np.sin(2.0 * np.pi * frequency * period * np.arange(round(2.0 / period)))
    force = 5.0 + wave[:, None] * np.array([0.3, 0.0, 0.4])
    assert _ripple_power(force, period) == pytest.approx(0.125 if seen else 0.0, rel=0.02, abs=2e-3)


def test_a_settling_time_is_told_in_milliseconds_below_a_second() -> None:
    """5 % are left after three time constants of 12 N s/m over 30 N/m, 1.2 s."""
    for damping, unit in ((12.0, "s"), (3.0, "ms")):
        force = {"kind": "force", "shape": "step", "force": ["-1 N", "0 N", "0 N"]}
        spring = {**SLIDER["object"], "stiffness": "30 N/m", "damping": f"{damping} N*s/m"}
        found = summarize(simulate({**SLIDER, "operator": force, "object": spring, "run": {"duration": "4 s"}}))
        time = found["axes"]["x"]["settling_5_percent_s"]
        assert (time < 1.0) is (unit == "ms")
        told = f"{time:.3g} s" if unit == "s" else f"{1e3 * time:.3g} ms"
        assert found["verdict"].startswith(f"settled to 5 % in {told}")


def test_a_channel_without_a_scenario_counts_as_one_step() -> None:
    assert _one_step(None)
