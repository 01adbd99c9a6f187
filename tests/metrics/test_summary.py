"""Summaries: every number is finite, or None where it overflowed or cannot be known."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from palpate import simulate
from palpate.metrics import summarize
from palpate.metrics.mesh_contact import _ripple_power
from palpate.metrics.summary import _magnitude, _plain
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
