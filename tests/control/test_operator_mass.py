"""Contact of the workspace controller along a normal: a hand's mass and force, and changes of the stiffness."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import palpate
import pytest
from nightly import NIGHTLY
from normal_axis import Hand, axis_depth
from palpate.arrays import Array
from palpate.control import closed_loop, workspace
from palpate.control.stability_margins import spectral_radius
from palpate.devices import load
from palpate.errors import DesignError
from palpate.linear.discretization import rendering_plant
from palpate.simulation.trace import Trace
from workspace_loops import OTHER, PERIOD, POSE, axis_loop, mass, slide, tables

ARM = load("phantom-premium-1.5a")
ORGAN = {"shape": "bumpy_ellipsoid", "size": ["90 mm", "70 mm", "50 mm"], "bump": 0.06, "divisions": 4}
FACETS = 30e-6  # m: what the turns of the normal between facets add to the depth
CUBE = {"shape": "box", "edge": "80 mm", "divisions": 16}


def led(known: float, **object_: Any) -> dict[str, Any]:
    """Return a slide with 1 N, led by 0.15 kg, whose controller knows a mass, kg."""
    tables_ = slide(0.0, False, True)
    controller = tables_["controller"] | {"operator_mass": f"{known} kg"}
    return tables_ | {"object": {"kind": "mesh", **object_}, "controller": controller}


def contact(trace: Trace) -> tuple[int, int, Array, Array]:
    """Return the first tick in contact, the ticks off the object after it, depth (n,), m, and stiffness (n,), N/m."""
    touching = trace["touching"][:, 0] > 0.0
    first = int(np.argmax(touching))
    return first, int((~touching[first:]).sum()), trace["depth"][:, 0], trace["surface_stiffness"][:, 0]


@pytest.mark.parametrize("pose", [POSE, OTHER, np.array([0.0, 1.0, 2.42])])
def test_the_linear_model_has_the_mass_that_the_core_has(pose: Array) -> None:
    force, law = 1e-4, workspace(ARM, PERIOD, operator_mass="0.05 kg")
    plant = rendering_plant(ARM, pose, stiffness=1000.0, period=PERIOD)
    ticks = np.arange(100)
    linear = control.forced_response(
        closed_loop(law.linearized(pose), plant), ticks * PERIOD, force * np.ones((3, len(ticks)))
    ).y[:3]
    pressed, still = (
        palpate.simulate(tables(pose, 1000.0, f) | {"run": {"duration": "0.05 s"}}, law)["object_force"][: len(ticks)]
        for f in (force, 0.0)
    )
    assert np.abs(pressed - still - linear.T).max() < 2e-2 * force
    bare = palpate.simulate(tables(pose, 1000.0, force) | {"run": {"duration": "0.05 s"}})["object_force"][: len(ticks)]
    assert np.abs(bare - pressed).max() > 0.05 * force


def test_a_bare_tip_is_stable_up_to_the_largest_gain() -> None:
    """Without the operator the gain is 1 + operator_mass/mass, at most 8.04."""
    for share, stable in ((7.03, True), (7.06, False)):
        law = workspace(mass(), PERIOD, operator_mass=0.1 * share)
        assert (spectral_radius(axis_loop(law)) < 1.0) is stable
    with pytest.raises(DesignError, match="operator_mass must be finite and not negative"):
        workspace(ARM, PERIOD, operator_mass=-0.1)


@pytest.mark.parametrize("known", [0.0, 0.05, 0.15])
@pytest.mark.parametrize(("soft", "stiff"), [(300.0, 3000.0), (300.0, 10000.0), (100.0, 3000.0)])
def test_a_rise_of_the_stiffness_ends_the_contact_only_by_the_overshoot_of_an_unknown_mass(
    soft: float, stiff: float, known: float
) -> None:
    """Law: the tip rises by F (1/soft - 1/stiff); it leaves the surface if it overshoots by more than F/stiff."""
    mesh = {"shape": "box", "edge": "200 mm", "divisions": 8}
    surface = {"stiffness": [f"{stiff} N/m", f"{soft} N/m"], "pattern": "stripes", "width": "25 mm"}
    trace = palpate.simulate(led(known, mesh=mesh, surface=surface | {"tangential": "0 N/m"},
                                 position=["10 mm", "0 mm", "0 mm"]))  # fmt: skip
    first, apart, depth, k = contact(trace)
    rise = first + int(np.argmax(k[first:] == stiff)) - 1
    assert depth[rise] == pytest.approx(1.0 / soft, rel=0.02)
    inverse = np.linalg.inv(ARM.jacobian(trace["angle"][rise]))
    inertia = 1.0 / np.linalg.inv(inverse.T @ ARM.mass_matrix(trace["angle"][rise]) @ inverse)[2, 2]
    law = workspace(ARM, PERIOD, normal_only=True, operator_mass=known)
    path = np.repeat([soft, stiff], [1, 400])
    expected = axis_depth(law, inertia, path, np.ones(401), Hand(0.15, 4.5, 200.0), (1.0 / soft, 0.0)).min()
    least = depth[rise + 1 : rise + 401].min()
    assert (apart > 0) == (expected < 0.0)
    assert least == pytest.approx(max(expected, 0.0), abs=4e-3 / soft)
    assert known < 0.15 or least > 0.99 / stiff


def crossing(seed: int, known: float, mesh: dict[str, Any], friction: bool) -> Trace:
    """Slide over polygons of random stiffness, 50 N/m to 10 N/mm."""
    count = 20 * 4 ** mesh["divisions"] if mesh["shape"] != "box" else 12 * mesh["divisions"] ** 2
    stiffness = np.exp(np.random.default_rng(seed).uniform(np.log(50.0), np.log(1e4), count))
    surface: dict[str, Any] = {"stiffness": [f"{k:.4g} N/m" for k in stiffness], "pattern": "listed"}
    surface |= {"static_friction": 0.2, "tangential": "1 N/mm"} if friction else {"tangential": "0 N/m"}
    return palpate.simulate(led(known, mesh=mesh, surface=surface))


@pytest.mark.parametrize("seed", range(1, 41) if NIGHTLY else (1, 3, 6))
def test_random_stiffness_ends_no_contact_if_the_mass_is_known(seed: int) -> None:
    """Law: in contact at every tick, and at most 1.05 F/K_min deep, 50 N/m to 10 N/mm from polygon to polygon.

    The law holds as long as the drive is within its limit and the pose is regular.
    """
    mesh, friction = (CUBE, True) if seed % 3 == 0 else (ORGAN, bool(seed % 2))
    trace = crossing(seed, 0.15, mesh, friction)
    first, apart, depth, k = contact(trace)
    touched = k[first:][k[first:] > 0.0]
    assert len(np.unique(touched)) >= 5
    assert touched.max() > 20.0 * touched.min()
    conditions = [np.linalg.cond(ARM.jacobian(q)) for q in trace["angle"][::20]]
    if trace["saturated"].mean() < 0.05 and max(conditions) < 12.0:
        assert apart == 0
        assert depth.max() <= 1.05 / touched.min()
    else:
        assert seed not in (1, 3, 6)


def test_an_unknown_mass_loses_the_contact_and_the_verdict_says_so() -> None:
    trace = crossing(6, 0.0, CUBE, True)
    _, apart, _, _ = contact(trace)
    assert apart > 10
    assert f"contact lost for {1e3 * apart * PERIOD:.4g} ms on the way" in str(trace.verdict)
    kept = crossing(6, 0.15, CUBE, True)
    assert contact(kept)[1] == 0
    assert "contact lost" not in str(kept.verdict)


def along_normal(trace: Trace, known: float) -> tuple[int, Array]:
    """Return the first tick, and the depth (n,) that one axis has under the recorded force of the hand."""
    first, _, depth, k = contact(trace)
    touched = np.maximum.accumulate(np.where(k > 0.0, np.arange(len(k)), first))
    normal, angle = trace["normal"].reshape(len(k), 3)[touched], trace["angle"]
    jacobian, inertia = np.asarray(ARM.jacobian(angle)), np.asarray(ARM.mass_matrix(angle))
    mobility = jacobian @ np.linalg.inv(inertia) @ np.swapaxes(jacobian, 1, 2)
    along = np.einsum("ti,tij->tj", normal, mobility)
    tip = 1.0 / np.einsum("ti,ti->t", along, normal)
    hand = -tip * np.einsum("ti,ti->t", along, trace["operator_force"])
    press = -np.einsum("ti,ti->t", normal, trace["reference_force"])
    law, after = workspace(ARM, PERIOD, normal_only=True, operator_mass=known), slice(first, None)
    start = float(depth[first]), float(depth[first + 1] - depth[first]) / PERIOD
    return first, axis_depth(law, tip[after], k[touched][after], press[after], hand[after], start)


@pytest.mark.parametrize("known", [0.0, 0.15])
def test_the_depth_under_the_hand_is_that_of_one_axis_under_its_normal_force(known: float) -> None:
    """Law: on one stiffness the deviation follows from the hand's normal force; facets add 30 um at most."""
    own = led(
        known, mesh=ORGAN, surface={"stiffness": "1 N/mm", "tangential": "0 N/m"}, position=["15 mm", "5 mm", "2.9 mm"]
    )
    trace = palpate.simulate(own)
    first, apart, depth, _ = contact(trace)
    start, expected = along_normal(trace, known)
    assert apart == 0
    assert np.abs(depth[start + 400 : -1] - expected[400:-1]).max() < FACETS
    swing = np.ptp(depth[first + 400 :])
    assert (swing > 0.2 / 1000.0) == (known == 0.0)


@pytest.mark.parametrize(("press", "lost"), [(0.3, True), (1.0, False)])
def test_a_stiff_hand_on_a_steep_slope_lifts_a_light_press_off_as_one_axis_predicts(press: float, lost: bool) -> None:
    """Law: the contact ends where the hand's normal force takes the depth F/K from one axis."""
    own = led(0.15, mesh=ORGAN | {"divisions": 5}, surface={"stiffness": "3 N/mm", "static_friction": 0.2})
    own["reference"] = {"shape": "ramp", "force": ["0 N", "0 N", f"{-press} N"], "rise": "0.1 s"}
    own["operator"] = own["operator"] | {"mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "500 N/m"}
    own["operator"]["table"] = [["0 s", *["0 N"] * 3], ["0.2 s", *["0 N"] * 3], ["0.6 s", "-0.4 N", "-10 N", "0 N"]]
    trace = palpate.simulate(own)
    first, apart, _, _ = contact(trace)
    start, expected = along_normal(trace, 0.15)
    assert (apart > 0) == lost
    assert not trace["saturated"].any()
    if lost:
        ends = first + int(np.argmin(trace["touching"][first:, 0]))
        assert abs(expected[ends - start]) < FACETS
        assert expected[200:-1].min() < -FACETS
        assert "contact lost" in str(trace.verdict)
    else:
        assert expected[200:-1].min() > FACETS  # after the press
