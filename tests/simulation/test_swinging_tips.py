"""Verdicts of tips that still swing on a body, whose contact changes within the swing, and of tips that are held."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.errors import ScenarioError
from palpate.simulation.verdict import State
from palpate.stability import certify

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]


def tables(body: dict[str, Any], position: list[str], operator: dict[str, Any], **more: Any) -> dict[str, Any]:
    block = {"shape": "block", "size": ["40 mm", "40 mm", "20 mm"], "young": "100 kPa", "spacing": "5 mm"}
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display", "period": "1 ms"},
        "operator": operator,
        "object": {"kind": "body", "position": position, "body": {**block, "radius": "6 mm", **body}},
        **more,
    }


def arm(mass: float, damping: float, stiffness: float, force: list[float], **shape: str) -> dict[str, Any]:
    return {
        "kind": "arm", "mass": f"{mass} kg", "damping": f"{damping} N*s/m", "stiffness": f"{stiffness} N/m",
        "force": [f"{one} N" for one in force], **(shape or {"shape": "ramp", "rise": "0.1 s"}),
    }  # fmt: skip


@pytest.mark.parametrize("duration", [1.0, 2.0, 2.2, 3.0])
def test_a_swing_that_decays_is_never_unstable_where_the_contact_is_stiffer_at_its_deep_end(duration: float) -> None:
    """The rest has one node in contact and a stable loop, the deep half of the swing two and an unstable one."""
    hand = arm(0.0875786, 1.76573, 225.988, [-0.0248473, -0.0509004, -0.392516])
    place = ["-2.52215 mm", "-2.44908 mm", "-6.86968 mm"]
    body = {"stiffness_scale": 18.489271198505094, "kind": "signed_distance"}
    verdict = simulate(tables(body, place, hand, run={"duration": f"{duration} s"})).verdict
    assert verdict.state in (State.UNDECIDED, State.SETTLED)


@pytest.mark.parametrize("duration", [1.5, 2.0, 3.0])
def test_a_slow_decay_is_no_sustained_oscillation(duration: float) -> None:
    """It falls by 6 to 7 % per fifth of 2 s, and its certificate is stable."""
    hand = arm(0.217137, 0.127218, 183.128, [-0.0602073, 0.0621646, -0.627478])
    body = {"stiffness_scale": 0.3829488835369319, "kind": "compliance", "tip": "flat"}
    place = ["-3.13396 mm", "-1.95915 mm", "-0.421313 mm"]
    verdict = simulate(tables(body, place, hand, run={"duration": f"{duration} s"})).verdict
    assert verdict.state in (State.UNDECIDED, State.SETTLED)


@pytest.mark.parametrize("duration", [2.0, 3.0])
def test_impacts_that_swing_farther_in_each_fifth_grow(duration: float) -> None:
    """Their second differences grow by less than irregular impacts may; the loop later leaves the device's reach."""
    hand = arm(0.206936, 0.164204, 374.704, [0.158113, -0.144048, -0.849748])
    body = {"radius": "8 mm", "stiffness_scale": 1.0569136010689872, "kind": "compliance"}
    place = ["-2.56159 mm", "1.06675 mm", "-8.64853 mm"]
    servo = {"topology": "impedance_display", "period": "2 ms"}
    loop = tables(body | {"static_friction": 0.1463408989746692}, place, hand, run={"duration": f"{duration} s"})
    verdict = simulate({**loop, "servo": servo}).verdict
    assert verdict.state is State.UNSTABLE
    assert "grows by a factor" in verdict.reason


@pytest.mark.parametrize("duration", [1.2, 2.5, 8.0])
def test_a_tip_that_rests_between_the_nodes_of_a_body_has_lost_contact_however_long_it_rests(duration: float) -> None:
    hand = arm(0.252448, 1.1489, 481.478, [0.0758232, -0.124792, -0.487501])
    body = {"stiffness_scale": 0.18693285049565403, "kind": "mass_spring"}
    damping = {"rayleigh_alpha": "28.0262 1/s", "rayleigh_beta": "0.000582305 s"}
    loop = tables(body | damping, ["3.63167 mm", "3.22378 mm", "-6.85301 mm"], hand, run={"duration": f"{duration} s"})
    verdict = simulate({**loop, "servo": {"topology": "impedance_display", "period": "2 ms"}}).verdict
    assert verdict.state is State.CONTACT_LOST
    assert "it is between the nodes" in verdict.reason


@pytest.mark.parametrize("duration", [1.0, 2.5])
def test_the_bounces_of_an_impact_are_no_lost_contact_once_the_tip_stays(duration: float) -> None:
    hand = arm(0.270622, 2.81262, 448.291, [-0.0607972, 0.0194402, -0.795911])
    body = {"radius": "10 mm", "stiffness_scale": 3.6606956197459204, "kind": "modal", "modes": 20}
    damping = {"rayleigh_alpha": "25.1128 1/s", "rayleigh_beta": "0.00058332 s"}
    place = ["-2.00232 mm", "-3.03609 mm", "-10.335 mm"]
    loop = tables(body | damping, place, hand, run={"duration": f"{duration} s"})
    verdict = simulate({**loop, "servo": {"topology": "impedance_display", "period": "0.5 ms"}}).verdict
    assert verdict.state is State.SETTLED


@pytest.mark.parametrize("duration", [1.4, 2.0])
def test_a_limit_cycle_beside_a_stable_linear_loop_is_no_rest(duration: float) -> None:
    """Its amplitude is 2.6 % of the deflection, and is reached from above."""
    hand = arm(0.173638, 1.34971, 192.401, [-0.157677, -0.120989, -1.73277])
    body = {"stiffness_scale": 4.45059659473998, "kind": "mass_spring"}
    damping = {"rayleigh_alpha": "19.775 1/s", "rayleigh_beta": "6.71433e-05 s"}
    place = ["-3.35943 mm", "-0.0882857 mm", "-6.96163 mm"]
    loop = tables(body | damping, place, hand, run={"duration": f"{duration} s"})
    verdict = simulate({**loop, "servo": {"topology": "impedance_display", "period": "2 ms"}}).verdict
    assert verdict.state is (State.UNDECIDED if duration < 2.0 else State.BOUNDED_OSCILLATION)


@pytest.mark.parametrize("duration", [0.7, 1.0, 1.4])
def test_a_slow_swing_is_neither_unstable_nor_sustained_by_its_phase(duration: float) -> None:
    """A sideways swing of 0.23 s that decays, in fifths of less than a period or little more; so is its certificate."""
    operator = {"kind": "arm", "mass": "0.227215 kg", "damping": "0.210747 N*s/m", "stiffness": "308.921 N/m"}
    loop = tables(
        {"radius": "10 mm", "stiffness_scale": 14.249062856561117, "kind": "signed_distance"},
        ["-2.51346 mm", "-0.287837 mm", "-10.6654 mm"],
        operator,
        reference={"shape": "ramp", "rise": "0.1 s", "force": ["0.176871 N", "0.131859 N", "-1.81506 N"]},
        controller={"kind": "lead_lag", "stiffness": "1 N/mm"},
        run={"duration": f"{duration} s"},
    )
    loop["device"] = {"name": "phantom-premium-1.5a", "delay": 1}
    loop["servo"] = {"topology": "force_tracking", "period": "0.5 ms"}
    assert simulate(loop).verdict.state is State.UNDECIDED
    assert certify(loop).verdict.state is State.UNDECIDED


def test_a_fixed_tip_that_begins_inside_a_body_without_contact_is_off_it() -> None:
    body = {"kind": "signed_distance"}
    trace = simulate(tables(body, ["0 mm", "0 mm", "4 mm"], {"kind": "fixed"}, run={"duration": "0.1 s"}))
    assert not trace["object_force"].any()
    assert trace.verdict.state is State.CONTACT_LOST
    assert "starts inside the body" in trace.verdict.reason


def test_a_tip_larger_than_its_body_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"exceeds the body's extent of 0\.06 m: use a smaller tip"):
        simulate(tables({"radius": "1 m"}, ["0 mm", "0 mm", "-1 m"], {"kind": "fixed"}, run={"duration": "0.1 s"}))


def test_a_certificate_gives_the_factor_at_which_the_tip_slides_aside() -> None:
    """A body so many times as stiff, pressed as deep at the same place: the tip stays below it and leaves above it."""
    scale, force = 0.4613834638790022, np.array([0.0147043581, -0.197345748, -1.10244366])
    place = ["7.87688389e-05 m", "-0.00105714887 m", "-0.00381137095 m"]

    def loop(factor: float, duration: float) -> dict[str, Any]:
        hand = arm(0.248101, 5.07065, 256.605, list(pull(factor)), shape="step")
        stiff = {"kind": "compliance", "stiffness_scale": factor * scale}
        found = tables(stiff, place, hand, run={"duration": f"{duration} s"})
        return {**found, "servo": {"topology": "impedance_display", "period": "2 ms"}}

    def pull(factor: float) -> np.ndarray[Any, Any]:  # the arm's share stays, the body's is scaled
        return force if factor == 1.0 else force + (factor - 1.0) * held

    at_rest = simulate({**tables({"kind": "compliance", "stiffness_scale": scale}, place,
                                 arm(0.248101, 5.07065, 256.605, list(force), shape="step"), run={"duration": "4 s"}),
                        "servo": {"topology": "impedance_display", "period": "2 ms"}})  # fmt: skip
    held = at_rest["object_force"][-1]
    found = certify(loop(1.0, 4.0))
    assert found.verdict.state is State.STABLE
    assert "slides across" in found.verdict.reason
    margin = found.margin["slide_margin"]
    for share, leaves in ((0.9, False), (1.1, True)):
        tip = simulate(loop(share * margin, 20.0))["tip"]
        assert (float(np.linalg.norm(tip[-1] - at_rest["tip"][-1])) > 5e-4) is leaves
