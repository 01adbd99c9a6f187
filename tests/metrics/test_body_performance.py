"""The loop response on a body: its dynamic stiffness from the body's states, in the device frame."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.metrics import body_performance
from palpate.metrics.body_performance import body_loop_response
from palpate.scenario import Scenario

BODY = {"shape": "block", "size": ["40 mm"] * 3, "young": "2 kPa", "spacing": "20 mm", "radius": "4 mm"}
TABLES: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a", "delay": 2},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "2 ms", "gravity_compensation": False},
    "reference": {"force": ["0 N", "0 N", "-0.1 N"]},
    "object": {"kind": "body", "body": BODY},
}


@pytest.mark.parametrize("states", [0, 1, 4])
@pytest.mark.parametrize("multirate", [False, True])
def test_the_stiffness_of_a_body_is_that_of_its_states_turned_into_the_device_frame(
    states: int, multirate: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(states)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    local = rng.normal(size=(3, 3))
    a = rng.normal(size=(states, states))
    a *= 0.9 / max(np.abs(np.linalg.eigvals(a)).max(initial=0.0), 0.1)
    system = control.StateSpace(a, rng.normal(size=(states, 3)), rng.normal(size=(3, states)), local, 2e-3)
    static = np.diag([123.0, 1.0, 2.0])
    response = SimpleNamespace(system=system, local=local, static=static, error=np.full((3, 3), 0.019 * 123.0))
    tip, angle = rng.normal(size=(10, 3)), rng.normal(size=(10, 3))
    run = SimpleNamespace(lasts=True, held=6, trace={"tip": tip, "angle": angle}, sentence="It bounced.")
    paths: list[Any] = []
    monkeypatch.setattr(body_performance, "observe", lambda _: run)
    monkeypatch.setattr(
        body_performance,
        "HeldTip",
        lambda _s, path: paths.append(path) or SimpleNamespace(multirate=multirate, frame=frame),
    )
    made = {False: "body_response", True: "multirate_response"}
    monkeypatch.setattr(body_performance, made[multirate], lambda _: response)
    monkeypatch.setattr(body_performance, made[not multirate], lambda _: pytest.fail("the other"))
    scenario = Scenario.from_dict(TABLES)
    found = body_loop_response(scenario)
    np.testing.assert_array_equal(paths[0], tip[:7] - tip[0])
    hertz = np.array([1.0, 30.0, 200.0])
    for f, got in zip(hertz, found.desired(hertz), strict=True):
        z = np.exp(2j * np.pi * f * 2e-3)
        own = static if multirate else system(z)
        np.testing.assert_allclose(got, frame @ own @ frame.T, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found.directions(), frame[None, :, 0])
    np.testing.assert_allclose(found.stiffness, 123.0 * np.outer(frame[:, 0], frame[:, 0]))
    assert (found.period, found.delay, found.coupling, found.gravity_compensation) == (2e-3, 2, "none", False)
    np.testing.assert_array_equal(found.damping, np.zeros((3, 3)))
    np.testing.assert_array_equal(found.pose, angle[6])
    response.error[0, 0] = 0.021 * 123.0
    if multirate:  # its stiffness is measured by a lasting displacement
        assert body_loop_response(scenario).stiffness.shape == (3, 3)
    else:
        with pytest.raises(StabilityError, match=r"known to 2\.6 N/m only, of 123 N/m: too little to measure"):
            body_loop_response(scenario)
    run.lasts = False
    with pytest.raises(StabilityError, match=r"a contact that lasts, and this one does not: it bounced; move the body"):
        body_loop_response(scenario)


def test_an_identified_model_and_a_normalizing_controller_have_no_such_response() -> None:
    measured = Scenario.from_dict({**TABLES, "device": {"name": "phantom-premium-1.5a", "model": "experimental"}})
    with pytest.raises(StabilityError, match='"experimental" has no motion between samples; use "nonlinear"'):
        body_loop_response(measured)
    controller = {"kind": "lqg", "stiffness": "1 N/mm", "normalize": True}
    with pytest.raises(StabilityError, match=r"controller\.normalize: it divides by the stiffness"):
        body_loop_response(Scenario.from_dict({**TABLES, "controller": controller}))
