"""Summaries of channels that are given: every entry, and the sentences of each kind of contact."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from palpate.fem.indentation import OVERLAPS_UNTOUCHED
from palpate.metrics import summarize, summary
from palpate.metrics.body_contact import PalpationMetrics
from palpate.metrics.mesh_contact import SlidingMetrics
from palpate.metrics.summary import _drive
from palpate.scenario import Scenario
from palpate.simulation.energy_balance import EnergyBalance
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State, Verdict

N, T = 2000, 1e-3
TIME = T * np.arange(N)
ARM: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a", "saturation": True},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "1 ms"},
    "object": {"kind": "spring", "stiffness": "100 N/m"},
}
HAND = {"kind": "arm", "mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "50 N/m"}
DISPLAY: dict[str, Any] = {**ARM, "servo": {"period": "1 ms", "topology": "impedance_display"}, "operator": HAND}
REFERENCE = {"shape": "step", "force": ["1 N", "0 N", "0 N"]}
RAMP = {"shape": "ramp", "rise": "0.1 s", "start": "0.05 s", "force": ["1 N", "0 N", "0 N"]}


def rise(steady: float, tau: float, start: float = 0.0) -> np.ndarray:
    """Return a deflection that approaches its steady value from `start`; 5 % are left after three time constants."""
    return np.asarray(steady * (1.0 - np.exp(-np.maximum(TIME - start, 0.0) / tau)))


def made(
    tables: dict[str, Any] | None,
    deflection: Any = 0.0,
    state: State = State.SETTLED,
    unstable_from: float | None = None,
    metadata: dict[str, Any] | None = None,
    **channels: Any,
) -> Trace:
    rng = np.random.default_rng(3)
    forces = {name: rng.normal(size=(N, 3)) for name in ("command_force", "motor_force", "object_force")}
    reference = np.zeros((N, 3))
    if tables is not None and (signal := Scenario.from_dict(tables).reference) is not None:
        reference = signal.values(TIME)
    pose = np.tile([0.0, 2.2305, 3.2776], (N, 1))
    shown = np.broadcast_to(np.asarray(deflection).T, (3, N)).T if np.ndim(deflection) < 2 else np.asarray(deflection)
    values = {
        **forces, "reference_force": reference, "deflection": shown, "angle": pose, "touching": np.ones(N),
        "torque": rng.normal(size=(N, 3)), "saturated": np.zeros(N), **channels,
    }  # fmt: skip
    values = {name: value for name, value in values.items() if value is not None}
    return Trace.of(
        TIME, values, unstable_from=unstable_from,
        metadata={"scenario": tables, "verdict": Verdict(state, "it is so").to_dict(), **(metadata or {})},
    )  # fmt: skip


@pytest.fixture(autouse=True)
def no_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out energies and the drive's remarks, which have tests of their own."""
    monkeypatch.setattr(summary, "energy_balance", lambda *_: None)
    monkeypatch.setattr(summary, "_drive", lambda *_: [])


def test_every_entry_of_a_summary_is_that_of_its_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    balance = EnergyBalance(*(float(k) for k in range(1, 1 + len(fields(EnergyBalance)))))
    monkeypatch.setattr(summary, "energy_balance", lambda *_: balance)
    x = rise(0.0098, 0.1)
    trace = made({**ARM, "title": "it", "reference": REFERENCE}, np.stack([x, 0 * x, 0 * x], axis=1))
    found = summarize(trace)
    settled = float(TIME[np.flatnonzero(np.abs(x - x[-100:].mean()) > 0.05 * x[-100:].mean())[-1] + 1])
    peaks = {name: float(np.max(np.linalg.norm(trace[name], axis=1))) for name in trace.channels if "force" in name}
    assert found == {
        "title": "it",
        "stable": True,
        "state": "settled",
        "verdict": f"settled to 5 % in {1e3 * settled:.3g} ms, steady error 2 %",
        "judgment": Verdict(State.SETTLED, "it is so").to_dict(),
        "unstable_from_s": None,
        "duration_s": TIME[-1],
        "samples": N,
        "peak_reference_force_N": 1.0,
        "peak_command_force_N": peaks["command_force"],
        "peak_motor_force_N": peaks["motor_force"],
        "peak_object_force_N": peaks["object_force"],
        "peak_deflection_m": x.max(),
        "peak_torque": np.abs(trace["torque"]).max(axis=0).tolist(),
        "torque_unit": "N*m",
        "saturated_fraction": 0.0,
        "energy": {
            "supplied_J": balance.supplied,
            "generated_in_last_fifth_J": balance.generated,
            "generated_in_fourth_fifth_J": balance.generated_before,
        },
        "axes": {
            "x": {
                "steady_deflection_m": pytest.approx(x[-100:].mean()),
                "expected_deflection_m": pytest.approx(0.01),
                "error_percent": pytest.approx(-2.0, abs=1e-4),
                "overshoot_percent": pytest.approx(0.0, abs=1e-3),
                "settling_5_percent_s": pytest.approx(settled),
                "peak_deflection_m": pytest.approx(x.max()),
                "ripple_m": pytest.approx(np.ptp(x[-100:]) / 2.0),
                "swing_growth": None,
            }
        },
        "warnings": [],
    }
    bare = made({**ARM, "reference": REFERENCE}, torque=None, saturated=None, motor_force=None, angle=None)
    for key in ("peak_torque", "torque_unit", "saturated_fraction", "peak_motor_force_N"):
        assert summarize(bare)[key] is None
    half = summarize(made({**ARM, "reference": REFERENCE}, saturated=np.arange(N) % 2))
    assert half["saturated_fraction"] == 0.5
    assert made(None, state=State.UNDECIDED)["reference_force"].any() is np.False_
    nothing = summarize(made(None, state=State.UNDECIDED))
    assert (nothing["title"], nothing["peak_reference_force_N"], nothing["energy"]) == ("", None, None)


def test_the_energies_are_those_of_the_window_in_which_the_force_is_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(summary, "energy_balance", lambda _trace, _scenario, window: asked.append(window))
    tables = {**ARM, "reference": RAMP}
    assert summarize(made(tables, rise(0.01, 0.05)))["energy"] is None
    force = made(tables)["reference_force"][:, 0]
    begin = int(np.flatnonzero(force != force[-1])[-1]) + 1
    assert begin >= 150
    assert (asked[0].begin, asked[0].end, asked[0].constant) == (begin, N - 1, True)
    assert summarize(made(tables, unstable_from=1.0, state=State.UNSTABLE))["energy"] is None
    assert len(asked) == 1


@pytest.mark.parametrize(
    ("changes", "deflection", "says"),
    [
        ({"reference": REFERENCE}, (0.01, 0.05), "settled to 5 % in 150 ms, steady error 1e-06 %"),
        ({"reference": REFERENCE}, (0.0102, 0.05), "settled to 5 % in 150 ms, steady error 2 %"),
        (
            {"reference": REFERENCE, "run": {"record_every": 2}},
            (0.01, 0.05),
            "settled to 5 % in 150 ms (recorded every 2 ms), steady error ",
        ),
        ({"reference": REFERENCE}, (0.01, 0.38), "settled to 5 % in 1.1 s, steady error "),
        ({"reference": RAMP}, (0.01, 0.05, 0.05), "settled to 5 % in 50 ms after the end of the ramp, steady error "),
        ({"reference": RAMP}, (0.01, 0.02, 0.05), "settled to 5 % by the end of the ramp, steady error "),
        ({"reference": {**RAMP, "stop": "1.9 s"}}, (0.01, 0.05), "settled: it is so"),
        ({"reference": {**REFERENCE, "stop": "1.9 s"}}, (0.01, 0.05), "settled: it is so"),
        ({"reference": {"shape": "sine", "frequency": "1 Hz", "force": "1 N"}}, (0.01, 0.05), "settled: it is so"),
        (
            {"reference": REFERENCE, "run": {"record_every": 7}},
            (0.01, 0.05),
            "settled to 5 % in 150 ms (recorded every 7 ms), steady error ",
        ),
        (
            {"reference": RAMP, "operator": {**HAND, "shape": "step", "start": "0.02 s", "force": "1 N"}},
            (0.01, 0.1, 0.05),
            "settled to 5 % in 200 ms after the end of the ramp, steady error ",
        ),
    ],
)
def test_the_verdict_of_a_settled_run_tells_when(
    changes: dict[str, Any], deflection: tuple[float, ...], says: str
) -> None:
    """Counted from the end of the last ramp, in s from one on; other signals have no settling time."""
    x = rise(*deflection)
    trace = made({**ARM, **changes}, np.stack([x, 0 * x, 0 * x], axis=1))
    found = summarize(trace)["verdict"]
    assert found.startswith(says) if says.endswith("error ") else found == says.replace("1e-06", found.split()[-2])


def test_the_slowest_axis_tells_when_without_a_reference() -> None:
    """Axes that move by less than 5 % of the deflection or 1 µm are coupling or rounding."""
    tables = {**DISPLAY, "operator": {"kind": "force", "shape": "step", "force": ["1 N", "1 N", "1 N"]}}
    moved = np.stack([rise(0.01, 0.02), rise(-0.02, 0.1), rise(0.0009, 0.3)], axis=1)
    found = summarize(made(tables, moved))
    assert list(found["axes"]) == ["x", "y"]
    times = [found["axes"][axis]["settling_5_percent_s"] for axis in "xy"]
    assert times == pytest.approx([0.06, 0.3], abs=1.5e-3)
    assert found["verdict"] == f"settled to 5 % in {1e3 * times[1]:.3g} ms"
    assert "magnitude" not in found
    least = np.zeros((N, 3))
    least[:, 2], least[:, 1] = 1e-6, 0.99e-6
    assert list(summarize(made(tables, least))["axes"]) == ["z"]
    both = summarize(made({**ARM, "reference": REFERENCE}, moved))
    assert list(both["axes"]) == ["x"]  # the others are not driven


def test_the_largest_error_of_the_axes_is_told() -> None:
    """Of a wall across one axis; a vector settles as its distance from where it rests."""
    tables = {**ARM, "reference": {"shape": "step", "force": ["1 N", "2 N", "-0.5 N"]}}
    moved = np.stack([rise(0.0103, 0.02), rise(0.0198, 0.1), rise(-0.005, 0.05)], axis=1)
    found = summarize(made(tables, moved))
    steady = moved[-N // 20 :].mean(axis=0)
    away = np.linalg.norm(moved - steady, axis=1)
    settled = float(TIME[np.flatnonzero(away > 0.05 * (away[0] - away[-100:].mean()) + away[-100:].mean())[-1] + 1])
    wanted = np.array([0.01, 0.02, -0.005])
    error = 100.0 * float(np.linalg.norm(steady - wanted) / np.linalg.norm(wanted))
    assert found["magnitude"]["settling_5_percent_s"] == pytest.approx(settled, abs=1.1e-3)
    assert found["magnitude"]["error_percent"] == pytest.approx(error)
    when = found["magnitude"]["settling_5_percent_s"]
    assert found["verdict"] == f"settled to 5 % in {1e3 * when:.3g} ms, steady error {error:.3g} %"
    late = {**tables, "reference": {**tables["reference"], "shape": "ramp", "rise": "0.1 s"}}
    after = summarize(made(late, moved))["magnitude"]["settling_5_percent_s"]
    assert after == pytest.approx(when - 0.1)
    endless = moved.copy()
    endless[-20:, 1] += 0.01
    unsettled = summarize(made(tables, endless))
    assert unsettled["magnitude"]["settling_5_percent_s"] is None
    assert unsettled["verdict"] == "settled: it is so"
    few = summary._magnitude(made(tables, moved).thinned(401, {}), [0.01, None, None], 0.0)
    assert few[1] == pytest.approx(100.0 * abs(moved[401 * 4, 0] / 0.01 - 1.0), rel=1e-6)


def test_a_run_that_did_not_settle_keeps_its_reason_and_has_its_axes() -> None:
    x = rise(0.01, 0.05)
    moved = np.stack([x, 0 * x, 0 * x], axis=1)
    found = summarize(made({**ARM, "reference": REFERENCE}, moved, State.UNDECIDED))
    assert found["verdict"] == "undecided: it is so"
    assert list(found["axes"]) == ["x"]
    diverged = summarize(made({**ARM, "reference": REFERENCE}, moved, State.UNSTABLE, unstable_from=1.5))
    assert (diverged["verdict"], diverged["axes"], diverged["unstable_from_s"]) == ("unstable: it is so", {}, 1.5)
    fixed = {**ARM, "operator": {"kind": "fixed"}, "servo": {"period": "1 ms", "topology": "impedance_display"}}
    assert summarize(made(fixed, moved))["verdict"] == "settled: it is so"


def test_a_growing_oscillation_is_told_under_a_constant_force_alone() -> None:
    x = 0.01 + 1e-3 * np.exp(TIME) * np.sin(2.0 * np.pi * 40.0 * TIME)
    moved = np.stack([x, 0 * x, 0 * x], axis=1)
    for reference, known in ((REFERENCE, True), ({**REFERENCE, "start": "1.99 s"}, False)):
        row = summarize(made({**ARM, "reference": reference}, moved, State.UNSTABLE))["axes"]["x"]
        assert (row["swing_growth"] is not None) is known
    assert row["settling_5_percent_s"] is None or row["settling_5_percent_s"] >= 0.0


@pytest.mark.parametrize(
    ("guard", "says"),
    [
        ({"kind": "half_sample"}, "; guard: half sample"),
        (
            {"kind": "energy_bound", "damping": [0.001, 0.0025, 0.003], "coulomb": [0.01, 0.02, 0.0333]},
            "; guard: energy bound that relies on the device's friction, 0.001, 0.0025, 0.003 N*m*s/rad and 0.01, "
            "0.02, 0.0333 N*m",
        ),
    ],
)
def test_a_guard_is_named_with_the_friction_that_it_relies_on(guard: dict[str, Any], says: str) -> None:
    found = summarize(made({**ARM, "reference": REFERENCE}, state=State.UNDECIDED, metadata={"guard": guard}))
    assert found["verdict"] == f"undecided: it is so{says}"
    assert found["guard"] == guard
    assert "guard" not in summarize(made({**ARM, "reference": REFERENCE}))
    unknown = summarize(made(None, state=State.UNDECIDED, metadata={"guard": guard}))
    assert unknown["verdict"] == "undecided: it is so"
    slider = {**DISPLAY, "device": {"name": "slider"}, "start": {"pose": ["0 m"]}, "object": {"kind": "none"}}
    bound = {"kind": "energy_bound", "damping": [0.05], "coulomb": [0.0]}
    found = summarize(made(slider, state=State.UNDECIDED, metadata={"guard": bound}, angle=None))
    assert found["verdict"].endswith("friction, 0.05 N*s/m and 0 N")


def palpation(**values: Any) -> PalpationMetrics:
    none: dict[str, Any] = dict.fromkeys((one.name for one in fields(PalpationMetrics)), 0.0)
    none |= {
        "deepest": 2e-3,
        "deepest_force": 0.5,
        "nodes": 9,
        "mesh_error": None,
        "over_untouched": False,
        "tip_depth": None,
        "final_tip_depth": None,
        "softening": None,
    }
    return PalpationMetrics(**{**none, "unsolved": 0, "contact_lost": 0, "touching_at_end": True, **values})


BEGINS = "presses the body in by 2 mm with 0.5 N"
UNKNOWN = "; the error of that force by the mesh is not known"


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, f"{BEGINS} (largest force 0.75 N), rests in contact at the end{UNKNOWN}"),
        ({"deepest_force": 0.7501}, f"presses the body in by 2 mm with 0.75 N, rests in contact at the end{UNKNOWN}"),
        (
            {"tip_depth": 3.14e-3},
            f"{BEGINS} (largest force 0.75 N), its tip 3.14 mm below the surface at rest, rests in contact at "
            f"the end{UNKNOWN}",
        ),
        (
            {"tip_depth": 3e-3, "final_tip_depth": 2.3e-3},
            f"{BEGINS} (largest force 0.75 N), its tip 3 mm below the surface at rest (2.3 mm and 0 N at the end), "
            f"rests in contact at the end{UNKNOWN}",
        ),
        (
            {"tip_depth": 3e-3, "final_tip_depth": 2.95e-3},
            f"{BEGINS} (largest force 0.75 N), its tip 3 mm below the surface at rest, rests in contact at "
            f"the end{UNKNOWN}",
        ),
        ({"final_swing": 0.5}, f"{BEGINS} (largest force 0.75 N), is in contact at the end{UNKNOWN}"),
        ({"touching_at_end": False}, f"{BEGINS} (largest force 0.75 N), is apart at the end{UNKNOWN}"),
        (
            {"mesh_error": 0.123},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end; the mesh adds an error of up to 12 % to "
            "that force (9 nodes)",
        ),
        (
            {"mesh_error": 0.12, "softening": 0.25},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end; the mesh adds an error of up to 12 % to "
            "that force (9 nodes); small strains are assumed: at that depth it may be up to 25 % too small",
        ),
        (
            {"nodes": 3},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end; only 3 nodes carry that force: take a "
            "finer mesh or a larger tip",
        ),
        (
            {"nodes": 1, "over_untouched": True},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end; only 1 node carries that force: take a "
            f"finer mesh or a larger tip; the tip {OVERLAPS_UNTOUCHED}",
        ),
        (
            {"nodes": 4, "unsolved": 5, "contact_lost": 6},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end{UNKNOWN}; the contact force was not "
            "found in 5 "
            "samples: too many nodes lie near the tip, it inverts tetrahedra of the body or moves too far between "
            "the updates of its model, or the contact has not converged: use a smaller force, depth or tip, a coarser "
            "mesh, smaller steps, or a shorter interval between updates; in 6 samples the tip is in the body without "
            "contact",
        ),
        (
            {"contact_lost": 1},
            f"{BEGINS} (largest force 0.75 N), rests in contact at the end{UNKNOWN}; in 1 sample the tip "
            "is in the body without contact",
        ),
    ],
)
def test_a_run_on_a_body_tells_what_it_pressed(
    values: dict[str, Any], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    metrics = palpation(**values)
    monkeypatch.setattr(summary, "palpation_metrics", lambda _: metrics)
    largest = np.tile([0.0, 0.0, 0.75], (N, 1))
    trace = made(None, contact_nodes=np.ones(N), object_force=largest, touching=np.ones(N))
    found = summarize(trace)
    assert found["verdict"] == f"settled: it is so; {says}"
    assert found["palpation"] == metrics.to_dict()
    first = np.zeros((N, 3))
    first[0] = [0.0, 3e-4, -4e-4]
    deep = made(None, first, contact_nodes=np.ones(N), object_force=largest)
    began = "; it began 0.5 mm deep in the body; check object.position and the unit of its file"
    assert summarize(deep)["verdict"].endswith(began)
    monkeypatch.setattr(summary, "tip_depths", lambda _: np.full(N, 2e-3))
    solved = np.ones(N)
    solved[0] = 0.0  # the deflection of this sample is not known
    lost = made(None, first, contact_nodes=np.ones(N), object_force=largest, solved=solved)
    assert summarize(lost)["verdict"].endswith(began.replace("0.5 mm", "2 mm"))
    off = np.ones(N)
    off[0] = 0.0
    apart = made(None, np.full((N, 3), 1e-3), contact_nodes=np.ones(N), object_force=largest, touching=off)
    assert "it began" not in summarize(apart)["verdict"]
    ended = made(None, state=State.UNSTABLE, unstable_from=1.0, contact_nodes=np.ones(N))
    assert summarize(ended)["verdict"] == "unstable: it is so"
    monkeypatch.setattr(summary, "palpation_metrics", lambda _: None)
    never = summarize(trace)
    assert (never["palpation"], never["verdict"]) == (None, "settled: it is so")


def test_a_tool_with_one_tip_pushed_through_is_in_contact_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run has lost the contact of one tip, which the contact of the other at the end does not contradict."""
    metrics = palpation(tip_depth=9e-3, final_tip_forces=(0.0, 0.23), contact_lost=3)
    monkeypatch.setattr(summary, "palpation_metrics", lambda _: metrics)
    channels = {"contact_nodes": np.ones(N), "object_force": np.zeros((N, 3)), "touching": np.ones(N)}
    for lost, says in ((1.0, "is in contact by another tip"), (0.0, "rests in contact")):
        trace = made(None, **channels, contact_lost=np.where(np.arange(N) < N - 3, 0.0, lost))
        told = summarize(trace)["verdict"]
        assert f"its deepest tip 9 mm below the surface at rest, {says} at the end, its tips with 0, 0.23 N" in told


def sliding(**values: Any) -> SlidingMetrics:
    none: dict[str, Any] = dict.fromkeys((one.name for one in fields(SlidingMetrics)), 0.0)
    return SlidingMetrics(**{**none, "path": 12.34e-3, "step_at_crossing": None, "touching_at_end": True, **values})


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, "slides 12.3 mm over the mesh, rests in contact at the end"),
        ({"final_swing": 1.0}, "slides 12.3 mm over the mesh, is in contact at the end"),
        (
            {"touching_at_end": False, "step_at_crossing": 0.25, "lost_ticks": 0},
            "slides 12.3 mm over the mesh, is apart at the end; contact held, largest force step at a crossing 0.25 N",
        ),
        (
            {"step_at_crossing": 0.0, "lost_ticks": 7},
            "slides 12.3 mm over the mesh, rests in contact at the end; contact lost for 7 ticks, largest force step "
            "at a crossing 0 N",
        ),
    ],
)
def test_a_run_on_a_mesh_tells_how_far_it_slid(
    values: dict[str, Any], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    metrics = sliding(**values)
    monkeypatch.setattr(summary, "sliding_metrics", lambda _: metrics)
    for begins, told in (
        (1e-4, ""),
        (1.01e-4, "; it began 0.101 mm deep in the mesh; check object.position and the unit of its file"),
    ):
        depth = np.full(N, 5e-3)
        depth[0] = begins
        trace = made(None, proxy=np.zeros((N, 3)), depth=depth)
        found = summarize(trace)
        assert found["verdict"] == f"settled: it is so; {says}{told}"
        assert found["sliding"] == metrics.to_dict()
    ended = made(None, state=State.UNSTABLE, unstable_from=1.0, proxy=np.zeros((N, 3)), depth=depth)
    assert summarize(ended)["verdict"] == f"unstable: it is so{told}"
    monkeypatch.setattr(summary, "sliding_metrics", lambda _: None)
    never = summarize(trace)
    assert (never["sliding"], never["verdict"]) == (None, f"settled: it is so{told}")


def test_a_free_tip_that_begins_within_a_wall_is_told_with_the_depth_of_its_first_sample() -> None:
    wall = {**DISPLAY, "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "100 N/m"}}
    deep = np.full((N, 3), [0.0, 0.0, -2e-3])
    deep[0] = [0.0, 3e-4, -4e-4]
    told = "it began 0.5 mm deep in the wall; check object.position"
    assert told in summarize(made(wall, deep, State.UNDECIDED))["verdict"]
    touching = np.ones(N)
    touching[0] = 0.0
    assert told not in summarize(made(wall, deep, State.UNDECIDED, touching=touching))["verdict"]
    assert told not in summarize(made({**ARM, "reference": REFERENCE}, deep, State.UNDECIDED))["verdict"]
    at = np.zeros((N, 3))
    at[0, 2] = -1e-4
    assert "it began" not in summarize(made(wall, at, State.UNDECIDED))["verdict"]


def test_poses_near_a_limit_and_a_wall_that_cannot_be_felt_are_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(summary, "near_limits", lambda device, angles: asked.append((device.name, angles)) or ["near"])
    trace = made({**ARM, "reference": REFERENCE})
    assert summarize(trace)["warnings"] == ["near"]
    assert asked[0][0] == "phantom-premium-1.5a"
    np.testing.assert_array_equal(asked[0][1], trace["angle"])
    assert summarize(made({**ARM, "reference": REFERENCE}, state=State.OUT_OF_REACH))["warnings"] == []
    assert summarize(made({**ARM, "reference": REFERENCE}, angle=None))["warnings"] == []
    assert summarize(made(None))["warnings"] == []
    assert not math.isnan(summarize(trace)["duration_s"])


HOT = "the motors hold it, and the hot drive limits them soon"
FREE = "without drive limits: the motors "


@pytest.mark.parametrize(
    ("limited", "state", "early", "last", "says"),
    [
        (True, State.UNDECIDED, 1.0, 1.0, [HOT]),
        (True, State.SETTLED, 9.0, 9.0, [HOT]),
        (True, State.DRIVE_LIMIT, 1.0, 1.41, []),
        (True, State.UNSTABLE, 1.0, 1.41, []),
        (False, State.UNSTABLE, 1.0, 1.41, []),
        (False, State.SETTLED, 1.0, 1.39, []),
        (False, State.SETTLED, 1.0, 1.41, [f"{FREE}hold 1.41 N, of which the drive gives 1.4 N for long"]),
        (False, State.UNDECIDED, 8.5, 1.41, [f"{FREE}hold 1.41 N, of which the drive gives 1.4 N for long"]),
        (False, State.SETTLED, 8.5, 1.0, []),
        (False, State.SETTLED, 8.6, 1.41, [f"{FREE}deliver 8.6 N, of which the drive gives 8.5 N"]),
        (False, State.UNSTABLE, 8.6, 1.0, [f"{FREE}deliver 8.6 N, of which the drive gives 8.5 N"]),
    ],
)
def test_motors_that_deliver_or_hold_more_than_the_drive_gives_are_told(
    limited: bool, state: State, early: float, last: float, says: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With limits how long they can hold it; without, the peak of the run and the mean of its last twentieth."""
    force = np.full(N, 1.0)
    force[10], force[-N // 20 :] = early, last
    force[-N // 20 - 1] = 0.0
    monkeypatch.setattr(summary, "motor_load", lambda _trace, _scenario: force)
    monkeypatch.setattr(summary, "drive_hold", lambda _trace, _scenario: HOT)
    tables = {**ARM, "reference": REFERENCE, "device": {**ARM["device"], "saturation": limited}}
    scenario = Scenario.from_dict(tables)
    assert _drive(made(tables, state=state), scenario) == says
    full = made(tables, state=state, saturated=(np.arange(N) % 8 == 0).astype(float))
    share = "the drive is at its limit 12.5 % of the time"
    assert _drive(full, None) == [share]
    if limited:
        assert _drive(full, scenario) == [share, *says]
    assert _drive(made(tables, state=state, motor_force=None), scenario) == []
    assert _drive(made(tables, state=state, saturated=None), scenario) == says
    alone = made(tables, state=state).thinned(N, {"scenario": tables, "verdict": Verdict(state, "it is so").to_dict()})
    monkeypatch.setattr(summary, "motor_load", lambda _trace, _scenario: np.array([2.0]))
    monkeypatch.setattr(summary, "drive_hold", lambda _trace, _scenario: None)
    held = [f"{FREE}hold 2 N, of which the drive gives 1.4 N for long"]
    assert _drive(alone, scenario) == ([] if limited or state is State.UNSTABLE else held)
