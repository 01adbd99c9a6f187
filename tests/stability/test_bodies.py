"""Loops on deformable bodies: verdicts agree with the run, a body of one node is a wall, and doubt is admitted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from nightly import NIGHTLY, nightly, some
from one_node import one_node
from palpate import fem, simulate
from palpate.errors import StabilityError
from palpate.metrics import measure_performance, summarize
from palpate.report.zwidth import zwidth_page
from palpate.scenario import Scenario
from palpate.simulation.observed_run import observe
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import OSCILLATES, State
from palpate.stability import certify, contact_stability, zwidth
from palpate.stability.body.certificate import _assumptions
from palpate.stability.contact_loop import contact_at

HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"}


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same block with cells of 8 mm, for kinds that take long."""
    path = tmp_path_factory.mktemp("body") / "coarse.h5"
    shape = fem.block((0.04, 0.04, 0.02), (0.008, 0.008, 0.01))
    fem.build(shape, young=20e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=6, output=path)
    return path


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 20 mm of 20 kPa, bonded below, touched on its top, with 20 vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.04, 0.04, 0.02), 0.005)
    fem.build(shape, young=20e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=20, output=path)
    return path


def press(block: Path, kind: str, scale: float, **options: Any) -> dict[str, Any]:
    """A hand presses a flat end of 12 mm on the block with 1 N at 1 kHz."""
    body = {
        "file": str(block), "origin": ["20 mm", "20 mm", "20 mm"], "kind": kind, "stiffness_scale": scale,
        "tip": "flat", "radius": "12 mm", **options,
    }  # fmt: skip
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**HAND, "shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-1 N"]},
        "controller": {"kind": "none"},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "0 mm"], "body": body},
        "run": {"duration": "1 s"},
    }


@pytest.mark.parametrize(
    ("kind", "scale"),
    [("modal", 8), ("modal", 12), ("modal", 16), ("mass_spring", 4), ("mass_spring", 16)]
    + [("mass_spring", scale) for scale in (1, 2, 8) if NIGHTLY],
)
def test_inertia_is_no_stiffness_of_a_wall(block: Path, kind: str, scale: float) -> None:
    """These loops rest, though a wall of the stiffness within one tick would be unstable."""
    trace = simulate(press(block, kind, scale, rayleigh_beta="1 ms"))
    found = contact_stability(trace)
    assert summarize(trace)["palpation"]["settled"]
    assert found.one_tick_stiffness > 1.3 * found.static_stiffness
    assert found.state is State.STABLE
    assert found.doubt < 0.5


@nightly
def test_a_coarse_lattice_of_32_times_the_stiffness_rests(coarse: Path) -> None:
    test_inertia_is_no_stiffness_of_a_wall(coarse, "mass_spring", 32)


def test_a_block_too_stiff_for_the_hand_bounces(block: Path) -> None:
    """At 6 times the stiffness the loop is stable, at 12 times it bounces; the margin says where between."""
    soft, stiff = (certify(press(block, "compliance", scale)) for scale in (6, 12))
    assert soft.stable
    assert 1.0 < soft.margin["gain_margin"] < 2.0
    assert stiff.verdict.state is State.UNSTABLE
    assert stiff.counter_example is not None
    assert stiff.counter_example.scenario == stiff.scenario
    assert set(soft.criteria) == {"eigenvalues", "Jury", "Routh", "Lyapunov", "Nyquist"}
    assert soft.margin["static_stiffness_N_per_m"] == pytest.approx(soft.margin["one_tick_stiffness_N_per_m"])
    json.dumps(soft.to_dict(), allow_nan=False)


def test_a_body_of_one_node_has_the_map_and_performance_of_a_wall(tmp_path: Path) -> None:
    path = one_node(512.0, tmp_path / "one.h5")
    tables = press(path, "compliance", 1.0)
    tables["object"]["body"] = {"file": str(path), "radius": "20 mm", "tip": "flat"}
    wall = {**tables, "object": {"kind": "wall", "stiffness": "512 N/m", "normal": [0, 0, 1]}}
    told: list[float] = []
    ours, exact = zwidth(tables, progress=lambda _, share: told.append(share)), zwidth(wall, simulated=False)
    assert told == sorted(told)
    assert 0.0 <= told[0] <= told[-1] <= 1.0
    assert len(ours.curves) >= 2
    for name, curve in ours.curves.items():
        assert curve.stiffness[0] == pytest.approx(exact.curves[name].stiffness[0], rel=2e-2)
        assert curve.damping.max() == pytest.approx(exact.curves[name].damping.max(), rel=2e-2)
    assert ours.here == (0.0, pytest.approx(512.0, rel=1e-6))
    assert ours.simulated is None
    assert "palpate certify tests other depths" in ours.not_simulated
    assert ours.not_simulated in zwidth_page(ours).html()
    assert exact.not_simulated == "it was not asked for"
    felt, expected = (measure_performance(one).along[0] for one in (tables, wall))
    assert felt.static_stiffness == pytest.approx(expected.static_stiffness, rel=1e-2)
    assert felt.transparency_bandwidth == pytest.approx(expected.transparency_bandwidth, rel=0.1)
    assert felt.bandwidth == pytest.approx(expected.bandwidth, rel=0.05)


def test_a_tip_that_is_off_its_body_when_it_would_be_pushed_is_judged_by_its_bounces(tmp_path: Path) -> None:
    """It is not pushed then, and its last half has some ten contacts."""
    tables = press(one_node(22e3, tmp_path / "one.h5"), "compliance", 1.0)
    tables["object"]["body"].pop("origin")
    tables["operator"] |= {"rise": "20 ms"}
    tables["run"] = {"duration": "0.2 s"}
    runs = [observe(Scenario.from_dict(tables), 100, hold) for hold in (1.5, 1.505, 1.51)]
    off = [one for one in runs if not one.trace["touching"][one.held, 0]]
    assert off
    for one in off:
        assert len(one.trace) == one.held + 1
        assert one.verdict.state is State.BOUNDED_OSCILLATION
        assert one.verdict.reason.startswith("the tip bounces")


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_contact_is_scaled_in_every_direction_in_which_friction_holds_it(friction: float, tmp_path: Path) -> None:
    """At the margin a root of the loop is on the circle; and only without friction the operator holds the tip."""
    tables = press(one_node(512.0, tmp_path / "one.h5"), "compliance", 1.0, static_friction=friction)
    tables["object"]["body"].pop("origin")
    tables["operator"] |= {"rise": "20 ms"}
    tables["run"] = {"duration": "0.1 s"}
    found = contact_stability(simulate(tables))
    assert len(found.loop.normal) == (3 if friction else 1)
    assert found.loop.radius(found.stiffness_margin) == pytest.approx(1.0, abs=1e-8)
    said = "Without friction the operator controls motions along the surface."
    assert said not in _assumptions(Scenario.from_dict(tables))
    pushed = {**tables, "operator": {"kind": "force", "force": ["0 N", "0 N", "-1 N"]}}
    assert (said in _assumptions(Scenario.from_dict(pushed))) is (friction == 0.0)


def test_runs_at_the_depth_of_the_map_decay_below_its_undamped_limit_and_oscillate_above(block: Path) -> None:
    """The force grows with the stiffness, so that the tip rests at the same depth with the same nodes in contact."""
    tables = press(block, "compliance", 6.0)
    found = zwidth(tables)
    stiffness, hand = found.here[1], float(HAND["stiffness"].split()[0])
    limit = float(next(iter(found.curves.values())).stiffness[0])
    settled = []
    for share in (0.9, 1.1):
        scaled = press(block, "compliance", 6.0 * share * limit / stiffness)
        force = (share * limit + hand) / (stiffness + hand)
        scaled["operator"] = {**scaled["operator"], "force": ["0 N", "0 N", f"{-force} N"]}
        settled.append(observe(Scenario.from_dict(scaled)).rests)
    assert settled == [True, False]


def test_the_slowest_updates_of_a_hyperelastic_body_are_reported(coarse: Path) -> None:
    certificate = certify(press(coarse, "neo-hookean", 1.0, update_interval="60 ms"))
    assert certificate.stable
    assert certificate.margin["slowest_update_s"] >= 0.06
    assert "update of 60 ticks" in certificate.method[0]
    assert certificate.margin["one_tick_stiffness_N_per_m"] == pytest.approx(
        certificate.margin["static_stiffness_N_per_m"], rel=0.1
    )


def test_what_cannot_be_decided_is_said(coarse: Path) -> None:
    undamped = certify(press(coarse, "modal", 1.0))
    assert undamped.verdict.state is State.UNDECIDED
    released = press(coarse, "compliance", 1.0)
    released["operator"] |= {"stop": "0.5 s", "force": ["0 N", "0 N", "-1 N"]}
    released["object"]["position"] = ["0 mm", "0 mm", "-1 mm"]
    found = certify(released)
    assert found.verdict.state is State.UNDECIDED
    assert "off the object" in found.claim
    far = press(coarse, "compliance", 1.0)
    far["object"]["position"] = ["0 mm", "0 mm", "-90 mm"]
    assert "does not touch the body" in certify(far).claim
    with pytest.raises(StabilityError, match="keeps the tip still"):
        certify({**press(coarse, "compliance", 1.0), "operator": {"kind": "fixed"}})


def test_a_margin_without_friction_is_that_of_motions_along_the_normal(block: Path) -> None:
    """At a depth that the run only passes, nothing holds the tip across the contact. Runs check the margin."""
    tables = press(block, "signed_distance", 0.4, radius="8 mm")
    tables |= {"reference": {"force": ["0 N", "0 N", "-0.6 N"]}, "run": {"duration": "3 s"}}
    del tables["operator"], tables["controller"], tables["servo"]["topology"]
    certificate = certify(tables)
    assert certificate.verdict.state is State.STABLE
    assert "the tip would slide across the contact" in certificate.verdict.reason
    margin = min(certificate.margin["gain_margin"], certificate.margin["least_gain_margin_of_depths"])
    assert 1.0 < margin < 3.0
    for share, oscillates in ((0.9, False), (1.1, True)):
        tables["object"]["body"]["stiffness_scale"] = 0.4 * share * margin
        assert (simulate(tables).verdict.state in OSCILLATES) is oscillates


def test_a_trace_of_some_ticks_only_is_run_again(block: Path) -> None:
    tables = press(block, "compliance", 2.0)
    every = contact_stability(simulate(tables), -1)
    some = contact_stability(simulate({**tables, "run": {"duration": "1 s", "record_every": 10}}), -1)
    assert some.radius == pytest.approx(every.radius, abs=1e-12)


def test_a_wrong_object_is_refused() -> None:
    wall = press(Path("none"), "compliance", 1.0) | {
        "object": {"kind": "wall", "stiffness": "500 N/m", "normal": [0, 0, 1]}
    }
    with pytest.raises(StabilityError, match="needs a scenario with a body"):
        contact_stability(simulate(Scenario.from_dict(wall)))


def held_on_a_block(path: Path, modes: int = 0, **kind: Any) -> Trace:
    """Return the run of a tip that an arm holds on a block of 40 x 40 x 20 mm, by signed distance."""
    block = fem.block((0.04, 0.04, 0.02), 0.004)
    fem.build(block, young=10e3, fixed="z < 0.1 mm", touch="z > 19.9 mm", modes=modes, output=path)
    return simulate({
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m",
            "shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-1 N"],
        },
        "object": {
            "kind": "body", "position": ["0 mm", "0 mm", "-8 mm"],
            "body": {
                "file": str(path), "origin": ["20 mm"] * 3, "radius": "8 mm", **kind,
            },
        },
        "run": {"duration": "4 s"},
    })  # fmt: skip


def relaxing(time: str, **options: Any) -> dict[str, Any]:
    return {
        "kind": "viscoelastic",
        "contact": "signed_distance",
        "instantaneous_ratio": 2.5,
        "retardation_time": time,
        **options,
    }


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 x 9 x 9 mm of 20 kPa, held at one end, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "beam.h5"
    shape = fem.block((0.06, 0.009, 0.009), 0.0045)
    fem.build(shape, young=20e3, fixed="x < 0.1 mm", touch="z > 8.9 mm", order=1, output=path)
    return path


def press_beam(beam: Path, kind: str, scale: float, force: float) -> dict[str, Any]:
    """A hand presses a sphere of 6 mm on the beam, off its end, with a force, N."""
    tables = press(beam, kind, scale, tip="sphere", radius="6 mm", origin=["45 mm", "4.5 mm", "9 mm"])
    tables["object"]["position"] = ["0 mm", "0 mm", "-6.3 mm"]
    tables["operator"]["force"] = ["0 N", "0 N", f"{-force:g} N"]
    return tables


@pytest.mark.parametrize("kind", some(["compliance", "neo-hookean"], 1))
def test_the_zwidth_of_a_beam_without_friction_ends_where_the_tip_slides_aside(kind: str, beam: Path) -> None:
    """A stiffer beam pushes the tip off its bent surface. The curve ended 1.1 to 14 times beyond that stiffness."""
    tables = press_beam(beam, kind, 20.0, 0.5)
    margin = certify(tables).margin
    assert margin["slide_margin"] < 0.9 * margin["gain_margin"]
    curve = next(iter(zwidth(tables).curves.values()))
    limit = margin["slide_margin"] * margin["static_stiffness_N_per_m"]
    assert curve.stiffness[0] == pytest.approx(limit, rel=1e-6)
    assert curve.damping[0] == 0.0


def test_a_tip_slides_off_a_hyperelastic_beam_that_is_stiffer_than_its_slide_margin(beam: Path) -> None:
    """The margin of motions along the normal is ten times as large. The hand adds what the stiffer beam takes."""

    def run(factor: float) -> tuple[Scenario, Trace]:
        tables = press_beam(beam, "neo-hookean", 50.0 * factor, 1.83 + 0.173 * factor)
        tables["run"]["duration"] = "2 s"
        scenario = Scenario.from_dict(tables)
        return scenario, simulate(scenario)

    scenario, trace = run(1.0)
    found = contact_at(scenario, trace, len(trace) - 1)
    assert found.slide_margin < 0.15 * found.stiffness_margin
    assert [run(k * found.slide_margin)[1].verdict.state is State.SETTLED for k in (0.9, 1.2)] == [True, False]


@pytest.mark.parametrize("time", some(["0.5 s", "2 s", "20 ms", "0.1 s", "5 s"], 2))
def test_the_static_stiffness_of_a_relaxing_body_does_not_depend_on_its_time(time: str, tmp_path: Path) -> None:
    """By signed distance each displacement leaves a constant, whose sum over a slow response was half its stiffness."""
    path = tmp_path / "block.h5"
    trace = held_on_a_block(path, **relaxing(time))
    depth = trace["tip"][0, 2] - trace["tip"][-1, 2]
    body = fem.load(path).signed_distance()
    soft, stiff = (body.indent([0.02] * 3, 8e-3, depth + step).force[2] for step in (-5e-5, 5e-5))
    assert contact_stability(trace).static_stiffness == pytest.approx((stiff - soft) / 1e-4, rel=0.05)


@pytest.mark.parametrize(("time", "friction"), some([("0.1 s", 0.5), ("0.5 s", 2.0), ("20 ms", 0.5), ("5 s", 0.5)], 2))
def test_a_relaxing_body_with_friction_has_the_static_stiffness_of_the_elastic_one(
    time: str, friction: float, tmp_path: Path
) -> None:
    """The layer creeps in shear as well: a tip that sticks meets the stiffness of the long term."""
    path = tmp_path / "block.h5"
    elastic = contact_stability(held_on_a_block(path, kind="signed_distance", static_friction=friction))
    found = contact_stability(held_on_a_block(path, **relaxing(time, static_friction=friction)))
    assert found.static_stiffness == pytest.approx(elastic.static_stiffness, rel=0.05)
    assert found.one_tick_stiffness > 2.0 * found.static_stiffness
    assert found.doubt < 0.5


@nightly
@pytest.mark.parametrize("time", ["0.1 s", "30 ms"])
def test_a_body_with_modes_relaxation_and_friction_has_its_long_term_static_stiffness_or_none(
    time: str, tmp_path: Path
) -> None:
    """A drift of the contact's iterations is no response: the sum over its ticks was a thirtieth of the stiffness."""
    options = {"kind": "modal", "contact": "signed_distance", "static_friction": 5.0, "rayleigh_beta": "2 ms"}
    elastic = contact_stability(held_on_a_block(tmp_path / "block.h5", 60, **options))
    relaxes = {"instantaneous_ratio": 3.0, "retardation_time": time}
    trace = held_on_a_block(tmp_path / "block.h5", 60, **options, **relaxes)
    refused, found = "", elastic
    try:
        found = contact_stability(trace)
    except StabilityError as trouble:
        refused = str(trouble)
    assert not refused or "its stiffness differs by" in refused
    assert found.static_stiffness == pytest.approx(elastic.static_stiffness, rel=0.1)


@nightly
def test_a_body_that_relaxes_slowly_oscillates_like_one_of_its_instantaneous_stiffness(tmp_path: Path) -> None:
    """By signed distance, whose iterations leave a constant in the slow response: certified in spite of it."""
    path = tmp_path / "block.h5"
    volume = fem.block((0.04, 0.04, 0.02), 0.004)
    fem.build(volume, young=10e3, fixed="z < 0.1 mm", touch="z > 19.9 mm", output=path)
    scenario: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "run": {"duration": "2 s"},
    }
    body = {"file": str(path), "origin": ["20 mm", "20 mm", "20 mm"], "radius": "15 mm"}
    slow = {"contact": "signed_distance", "instantaneous_ratio": 2.0, "retardation_time": "0.3 s"}
    margins = []
    for options in ({"kind": "signed_distance", "stiffness_scale": 2.0}, {"kind": "viscoelastic", **slow}):
        touched = {"kind": "body", "position": ["0 mm", "0 mm", "-15 mm"], "body": {**body, **options}}
        found = certify({**scenario, "object": touched})
        assert found.verdict.state is State.STABLE
        margins.append(found.margin["gain_margin"])
    assert margins[1] == pytest.approx(margins[0], rel=0.1)
