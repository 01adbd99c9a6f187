"""Modes, margins and runs of a contact with a mesh, on loops and paths whose answers are closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.contact_law import ContactLaw, closed_matrix
from palpate.simulation.trace import Trace
from palpate.stability import mesh_certificate as certificate
from palpate.stability.contact_run import _direction, _last_change, _slide
from palpate.stability.mesh_modes import ContactMode, SurfacePoint, friction_law
from palpate.stability.mesh_rest import no_rest
from palpate.stability.mode_stability import _sector, gain_margin, mode_stability, site_switching

PERIOD = 1e-3
UP = np.array([0.0, 0.0, 1.0])
SMOOTH = SurfacePoint(UP, 1000.0, 0.0, 0.0, 0.0, 0.0, PERIOD)


def site(a: float | Array, b: float = 1e-4, points: tuple[SurfacePoint, ...] = (), axes: int = 3) -> Any:
    """Return a place whose tip moves along the last axes by x <- a x - b f, each by itself."""
    n = np.asarray(a, dtype=float) * np.ones(axes)
    path = SimpleNamespace(A=np.diag(n), B=-b * np.eye(axes), C=np.eye(axes), nstates=axes)
    return SimpleNamespace(
        path=path, loop=SimpleNamespace(directions=np.eye(3)[:, 3 - axes :], period=PERIOD), points=points
    )


def pressed(stiffness: float, kind: str = "vertex") -> ContactMode:
    """Return a mode of the same stiffness along every axis."""
    return ContactMode(kind, f"{stiffness:g}", ContactLaw.stiffness(stiffness * np.eye(3)), UP)


def test_the_gain_margin_of_modes_is_that_of_the_worst() -> None:
    """x <- (a - s k b) x leaves the unit circle at s = (1 + a) / (k b)."""
    place = site(0.5)
    found = mode_stability(place, [pressed(k) for k in (500.0, 1000.0, 800.0)])
    assert [one.radius for one in found] == pytest.approx([0.45, 0.4, 0.42])
    for start in (1.0, 7.0):
        margin, worst = gain_margin(found, start=start)
        assert 15.0 <= margin <= 15.0 * 1.001
        assert worst.mode.name == "1000"
    assert gain_margin(mode_stability(place, [pressed(1.0)]))[0] == math.inf
    assert gain_margin(mode_stability(place, [pressed(3.0)]))[0] == pytest.approx(1.5 / 3e-4, rel=2e-3)


def test_a_mode_that_is_fast_at_first_and_the_first_to_become_unstable_is_found() -> None:
    """The mode nearest its limit is not the one of the least margin: the others are confirmed, and found."""
    slow = mode_stability(site(0.99), [pressed(10.0 + k) for k in range(3)])
    fast = mode_stability(site(0.5), [pressed(100.0), pressed(1000.0)])
    margin, worst = gain_margin([*slow, *fast], candidates=1)
    assert 15.0 <= margin <= 15.0 * 1.001
    assert worst.mode.name == "1000"


@pytest.mark.parametrize(
    ("value", "kind", "drifts"),
    [
        (1.0, "vertex", True),  # unfelt, at rest
        (1.0 + 5e-6, "sticking", True),
        (1.0 + 1e-4, "sticking", False),  # unfelt, but it grows
        (1.0 + 1e-4, "sliding", True),  # 0.1 rad/s along the surface, under a tip that slides
        (1.0 + 1e-4, "edge", True),
        (1.012, "sliding", True),  # 11.9 rad/s
        (1.013, "sliding", False),  # 12.9 rad/s, above 2 Hz
        (0.9, "sliding", False),  # not slow
    ],
)
def test_a_slow_motion_along_the_surface_that_the_contact_does_not_feel_is_a_drift(
    value: float, kind: str, drifts: bool
) -> None:
    """The tip moves along x with the eigenvalue; the contact presses along z with 0.5 - 0.1."""
    law = ContactLaw.stiffness(1000.0 * np.outer(UP, UP))
    one = mode_stability(site(np.array([value, 0.3, 0.5])), [ContactMode(kind, "", law, UP)])[0]
    assert one.drift == pytest.approx(value if drifts else 0.0)
    assert one.radius == pytest.approx(0.4 if drifts else value)
    assert one.stable == (one.radius < 1.0)
    assert one.slides_away == (not one.stable and kind in ("sliding", "edge"))


def test_a_slow_motion_out_of_the_surface_or_one_that_is_felt_is_no_drift() -> None:
    """Tilted by 20 degrees the motion leaves the surface by 0.342 of itself, by 21 degrees by 0.358: too much."""
    for degrees, drifts in ((20.0, True), (21.0, False)):
        tilted = np.array([math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))])
        law = ContactLaw.stiffness(1000.0 * np.outer([0.0, 1.0, 0.0], [0.0, 1.0, 0.0]))
        one = mode_stability(site(np.array([1.0 + 1e-4, 0.5, 0.3])), [ContactMode("sliding", "", law, tilted)])[0]
        assert (one.drift > 0.0) == drifts
    felt = ContactLaw.stiffness(np.diag([1e-5, 0.0, 1000.0]))  # 1e-8 of the stiffness, then 1e-5 of it
    assert mode_stability(site(np.array([1.0, 0.3, 0.5])), [ContactMode("vertex", "", felt, UP)])[0].drift > 0.0
    felt = ContactLaw.stiffness(np.diag([1e-2, 0.0, 1000.0]))
    assert mode_stability(site(np.array([1.0, 0.3, 0.5])), [ContactMode("vertex", "", felt, UP)])[0].drift == 0.0


@pytest.mark.parametrize(("friction", "drag"), [(0.0, 0.0), (0.3, 0.0), (0.3, 0.7), (0.0, 0.7)])
def test_a_sector_contains_the_loop_of_every_stiffness_and_friction_between_its_ends(
    friction: float, drag: float
) -> None:
    """At each stiffness and slip in the disk the sector is the loop with that friction law itself."""
    normal = np.array([0.36, 0.48, 0.8])
    group = [SurfacePoint(normal, k, 300.0, friction, drag, 0.5, PERIOD) for k in (900.0, 400.0, 600.0)]
    place = site(np.array([0.5, 0.7, 0.9]))
    sector = _sector(place, group)
    assert (sector.low, sector.high) == (400.0, 900.0)
    assert sector.name == "a face of normal (0.36, 0.48, 0.80)"
    for k, slip in ((400.0, [0.0, 0.0]), (700.0, [0.6, -0.3]), (900.0, [0.0, 1.0])):
        expected = closed_matrix(place.path, friction_law(replace(group[0], stiffness=k), np.array(slip)), np.eye(3))
        force = sector.normal * k + sector.tangent @ (sector.friction * k * np.array(slip))
        np.testing.assert_allclose(sector.base + np.outer(force, sector.row), expected, atol=1e-12)


def test_switching_is_proven_apart_where_the_tip_is_stable_alone_and_in_contact_where_it_is_not() -> None:
    """x <- (a - k b) x with 0 <= k <= 1000, or 500 <= k, and b = 1e-4: a lies from a - 0.1 to a or a - 0.05."""
    points = tuple(replace(SMOOTH, stiffness=k) for k in (500.0, 1000.0))
    for a, proof, separates in ((0.9, "common", True), (1.04, "common", False), (1.06, "undecided", False)):
        found = site_switching(site(a, points=points, axes=1))
        assert (found.proof, found.separates) == (proof, separates)
        assert math.isinf(found.dwell) == (proof == "undecided")
        if proof == "common":
            slowest = a if separates else a - 0.05
            assert 0.0 < found.decrease <= 1.0 - slowest**2 + 1e-9
    assert found.pair == ("a face of normal (0.00, 0.00, 1.00)",) * 2


def test_the_slide_of_a_proxy_is_its_mean_speed_in_a_fifth() -> None:
    """The speed differs from fifth to fifth; only that of the one asked for counts."""
    speeds, fifth = (0.1, 0.02, 0.3, 0.05, 0.4), 1000
    steps = PERIOD * np.repeat(speeds, fifth)
    proxy = np.cumsum(steps)[:, None] * np.array([0.6, 0.0, -0.8]) + 1.0
    for end, speed in enumerate(speeds, start=1):
        assert _slide(proxy, end, fifth, PERIOD) == pytest.approx(speed, rel=2.0 / fifth)


def test_a_push_goes_into_the_surface_and_to_both_sides() -> None:
    """It turns with the axes, has length 1, and none of its three parts is below a fifth."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        direction = _direction(normal)
        np.testing.assert_allclose(_direction(np.roll(normal, 1)), np.roll(direction, 1), atol=1e-12)
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        assert -direction @ normal > 0.2
        side = np.eye(3)[int(np.argmin(np.abs(normal)))]
        side = side - (side @ normal) * normal
        side /= np.linalg.norm(side)
        assert min(abs(direction @ side), abs(direction @ np.cross(normal, side))) > 0.2


PRESS: dict[str, Any] = {
    "device": {"name": "slider", "saturation": False},
    "servo": {"topology": "force_tracking", "period": "1 ms"},
    "controller": {"kind": "lqg", "stiffness": "1 N/mm"},
    "reference": {"force": ["-1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "run": {"duration": "1 s", "record_every": 2},
}


def scenario(**tables: Any) -> Scenario:
    return Scenario.from_dict({**PRESS, **tables})


def test_forces_stop_changing_with_the_last_of_their_ends_and_those_of_a_sine_never_do() -> None:
    force = ["-1 N", "0 N", "0 N"]
    arm = {"kind": "arm", "mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "200 N/m"}
    ramp = {"shape": "ramp", "force": force, "start": "30 ms", "rise": "200 ms"}
    assert _last_change(scenario()) == 0.0
    assert _last_change(scenario(reference=ramp)) == pytest.approx(0.23)
    assert _last_change(scenario(operator={**arm, "force": force, "start": "0.4 s"}, reference=ramp)) == 0.4
    assert _last_change(scenario(operator={**arm, "force": force, "stop": "0.5 s"}, reference=ramp)) == 0.5
    sine = {"shape": "sine", "force": force, "frequency": "2 Hz"}
    assert _last_change(scenario(reference=sine)) is None
    assert _last_change(scenario(reference={**sine, "stop": "0.7 s"})) == 0.7
    assert _last_change(scenario(operator=arm, reference=ramp)) == pytest.approx(0.23)


def contact(radius: float, resting: float | None = None, **changes: Any) -> Any:
    """Return a contact with a slowest mode where it rests, and a slower one elsewhere."""
    there, rest = object(), object()
    found = [SimpleNamespace(site=there, radius=3.0), *(SimpleNamespace(site=rest, radius=r) for r in (0.1, radius))]
    at_rest = SimpleNamespace(radius=radius if resting is None else resting)
    at_rest.stable = at_rest.radius < 1.0
    given = {"found": found, "sites": [there, rest], "resting": at_rest, "scenario": scenario()}
    return SimpleNamespace(**{**given, **changes})


def test_a_pushed_run_is_watched_for_six_time_constants_and_an_undecided_one_held_for_four() -> None:
    """Of the slowest mode where the run rests, whether it decays or grows, within bounds."""
    for tau, watched, held in ((0.5, 3.0, 20.0), (8.0, 8.0, 32.0), (1e-3, 0.5, 20.0), (1e9, 8.0, 60.0)):
        for sign in (-1.0, 1.0):
            one = contact(math.exp(sign * PERIOD / tau))
            assert certificate._watch(one) == pytest.approx(watched)
            assert certificate._hold(one) == pytest.approx(held)


def test_a_pushed_run_is_judged_by_the_slowest_mode_unless_another_than_its_own_is_unstable() -> None:
    assert certificate._judged_radius(contact(0.9, resting=0.5)) == 0.9
    assert certificate._judged_radius(contact(1.2, resting=1.1)) == 1.1
    assert math.isnan(certificate._judged_radius(contact(1.2, resting=0.5)))


def test_a_counter_example_lasts_as_long_as_the_run_that_shows_it() -> None:
    for rest, expected in ((500, "1 s"), (1500, "1.5 s")):
        tables = certificate._lasting(scenario(), SimpleNamespace(rest=rest))  # type: ignore[arg-type]
        again = Scenario.from_dict(tables)  # type: ignore[arg-type]
        assert tables["run"]["duration"] == expected  # type: ignore[index]
        assert again.run.record_every == 2
        assert again.reference == scenario().reference


def slope(
    degrees: float, friction: float, *, touching: bool = True, speed: float = 2e-3, rows: int = 1000, **tables: Any
) -> str:
    """Return why a tip cannot rest that is pressed with 1 N at an angle to the normal, in the last half of a run."""
    surface = {"stiffness": "400 N/m", "static_friction": friction, **tables.pop("surface", {})}
    s = Scenario.from_dict(
        {
            **PRESS,
            "device": {"name": "phantom-premium-1.5a", "saturation": False},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "object": {"kind": "mesh", "mesh": {"shape": "box", "edge": "80 mm", "divisions": 1}, "surface": surface},
            **tables,
        }
    )
    turn = math.radians(degrees) * np.r_[np.full(rows // 2, 0.0), np.full(rows - rows // 2, 1.0)]
    normal = np.stack([np.sin(turn), 0.0 * turn, np.cos(turn)], axis=1)
    trace = {
        "touching": np.ones((rows, 1)),
        "reference_force": np.tile([0.0, 0.0, -1.0], (rows, 1)),
        "normal": normal,
        "proxy": speed * PERIOD * np.arange(rows)[:, None] * np.array([0.6, 0.8, 0.0]),
    }
    trace = {name: np.vstack([values, values[-1:]]) for name, values in trace.items()}
    trace["reference_force"][-1] = 9.0  # after the rest the force changes, and no longer counts
    observed = SimpleNamespace(trace=Trace.of(PERIOD * np.arange(rows + 1), trace), rest=rows - 1)
    return no_rest(SimpleNamespace(scenario=s, observed=observed, touching=touching))  # type: ignore[arg-type]


def test_a_tip_cannot_rest_on_a_slope_steeper_than_friction_holds() -> None:
    """Friction of 0.2 holds atan 0.2 = 11.3 degrees; the faces of the first half do not count."""
    said = slope(12.0, 0.2)
    assert "which is 12 degrees or more from the normal of every face crossed from t = 0.5 s on" in said
    assert "and friction holds 11.3 degrees; at t = 0.999 s" in said
    assert "the tip slides on at 2 mm/s. Give more friction" in said
    assert "the tip is off the mesh. Give" in slope(12.0, 0.2, touching=False, speed=0.0)
    assert slope(11.0, 0.2) == ""
    assert "friction holds 0 degrees" in slope(1.0, 0.2, surface={"tangential": "0 N/m"})
    assert "which is 100 degrees" in slope(100.0, 0.2)  # pulled away: no friction holds


def test_without_a_proof_nothing_is_said_about_rest() -> None:
    """The tip hardly moves, friction has no limit, or what the proof assumes is missing."""
    assert slope(12.0, 0.2, speed=0.9e-4) == ""
    assert slope(12.0, 0.2, speed=1.2e-4) != ""
    assert slope(12.0, 0.2, controller={"kind": "lead_lag", "stiffness": "1 N/mm"}) == ""
    assert slope(12.0, 0.2, surface={"shading": "30 deg"}) == ""
    assert slope(12.0, 0.2, device={"name": "phantom-premium-1.5a", "saturation": True}) == ""
