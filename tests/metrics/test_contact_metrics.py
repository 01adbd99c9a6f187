"""Metrics of a contact from channels of any shape, against plain sums over the samples."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.metrics import body_contact, mesh_contact
from palpate.metrics.body_contact import PalpationMetrics, palpation_metrics, stiffness_along_path, work_so_far
from palpate.metrics.mesh_contact import SlidingMetrics, _ripple_power, sliding_metrics
from palpate.simulation.trace import Trace
from scipy.spatial.transform import Rotation

N, T = 300, 1e-3
HOLDING = ("modal", "viscoelastic", "mass_spring")


def times() -> np.ndarray:
    """Return samples of which one is exactly 0.1 s before the last."""
    time = T * np.arange(N)
    time[N - 101] = time[-1] - 0.1
    return time


def random_trace(touching: np.ndarray, scenario: dict[str, Any], scale: float = 1e-4, **more: Any) -> Trace:
    rng = np.random.default_rng(4)
    way = np.cumsum(scale * rng.normal(size=(N, 3)), axis=0)
    force = rng.normal(size=(N, 3)) + np.array([0.0, 0.5, -3.0])
    channels = {
        "touching": touching,
        "tip": way,
        "proxy": way + 1e-3 * rng.normal(size=(N, 3)),
        "object_force": np.where(touching[:, None] > 0, force, 0.0),
        "deflection": 1e-3 * rng.normal(size=(N, 3)),
        "contact_nodes": rng.integers(1, 60, size=N),
        "solved": rng.random(N) > 0.2,
        "contact_lost": rng.random(N) > 0.9,
        "stored_energy": rng.random(N),
        "tank_energy": rng.random(N),
        "normal": np.where(touching[:, None] > 0, [0.0, 0.6, 0.8], 0.0),
        "depth": 1e-3 * rng.random(N) * touching,
        "surface_stiffness": 500.0 * (1.0 + rng.random(N)) * touching,
        "triangle": np.where(touching > 0, rng.integers(0, 3, size=N), -1),
        "reference_force": rng.normal(size=(N, 3)) + np.array([0.0, 0.0, -2.0]),
    }
    channels.update(more)
    kept = {name: values for name, values in channels.items() if values is not None}
    return Trace.of(times(), kept, metadata={"scenario": scenario})


def contact(*gaps: tuple[int, int]) -> np.ndarray:
    touching = np.ones(N)
    for begin, end in gaps:
        touching[begin:end] = 0.0
    return touching


MOVING = {
    "frame_position": np.cumsum(1e-4 * np.random.default_rng(8).normal(size=(N, 3)), axis=0),
    "frame_rotation": np.cumsum(1e-2 * np.random.default_rng(9).normal(size=(N, 3)), axis=0),
}


def seen(trace: Trace) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the touching point and the force of every sample in the frame of the object."""
    points, forces = [], []
    for k in range(len(trace)):
        point, force = trace["tool" if "tool" in trace else "tip"][k], trace["object_force"][k]
        if "frame_position" in trace:
            turn = Rotation.from_rotvec(trace["frame_rotation"][k]).as_matrix()
            point, force = turn.T @ (point - trace["frame_position"][k]), turn.T @ force
        points.append(point)
        forces.append(force)
    return points, forces


def plain_path(trace: Trace) -> tuple[list[float], list[float]]:
    """Return the path across the mean force and the stiffness, sample by sample."""
    points, forces = seen(trace)
    size = [float(np.linalg.norm(force)) for force in forces]
    touched = [size[k] for k in range(N) if trace["touching"][k, 0] > 0.0]
    if not touched:
        return [], []
    pressed = [trace["touching"][k, 0] > 0.0 and size[k] > 0.5 * float(np.median(touched)) for k in range(N)]
    if not any(pressed):
        return [], []
    mean = sum(force for force, one in zip(forces, pressed, strict=True) if one)
    down = mean / np.linalg.norm(mean)
    across, steps, path, stiffness = 0.0, set(), [], []
    for k in range(N):
        move = points[k] - points[max(k - 1, 0)]
        across += float(np.linalg.norm(move - (move @ down) * down)) if pressed[k] else 0.0
        step = math.floor(across / 1e-4)
        if step not in steps and pressed[k]:
            path.append(across)
            stiffness.append(size[k] / float(np.linalg.norm(trace["deflection"][k])))
        steps.add(step)
    return path, stiffness


def plain_palpation(trace: Trace) -> dict[str, Any]:
    run = trace.scenario.get("run", {})
    choice = trace.scenario.get("object", {}).get("body") or {}
    every = run.get("record_every", 1)
    touching = [bool(one > 0.0) for one in trace["touching"][:, 0]]
    first = max(touching.index(True) - 1, 0)
    points, forces = seen(trace)
    depth = [float(np.linalg.norm(one)) for one in trace["deflection"]]
    size = [float(np.linalg.norm(one)) for one in trace["object_force"]]
    later = 0.5 + 0.5 / every if choice.get("kind") in HOLDING else 0.5
    work, held, path, touches = 0.0, 0.0, 0.0, int(touching[first])
    for k in range(1, N):
        move = points[k] - points[k - 1]
        work += float((later * forces[k] + (1.0 - later) * forces[k - 1]) @ move)
        if k > first:
            held += float(forces[k - 1] @ move)
            path += float(np.linalg.norm(move)) if touching[k] and touching[k - 1] else 0.0
            touches += touching[k] and not touching[k - 1]
    rows = range(first, N)
    known = [k for k in rows if touching[k] and trace["solved"][k, 0] > 0.0]
    at = max(known or rows, key=lambda k: depth[k])
    last = [k for k in rows if trace.time[k] >= trace.time[-1] - 0.1]
    ways, stiffness = plain_path(trace)
    swept = bool(ways) and ways[-1] > 10e-3
    stored, saved = trace["stored_energy"][:, 0], trace["tank_energy"][:, 0]
    swing = [max(trace["object_force"][k][axis] for k in last) - min(trace["object_force"][k][axis] for k in last)
             for axis in range(3)]  # fmt: skip
    return {
        "touches": touches,
        "deepest": depth[at],
        "deepest_force": size[at],
        "stiffness": size[at] / depth[at],
        "nodes": int(trace["contact_nodes"][at, 0]),
        "path": path,
        "path_stiffness_median": float(np.median(stiffness)) if swept else None,
        "path_stiffness_max": max(stiffness) if swept else None,
        "work": work,
        "stored": stored[-1],
        "saved": saved[-1],
        "at_start": stored[first] + saved[first],
        "lost": work + stored[first] + saved[first] - stored[-1] - saved[-1],
        "held": work - held if every == 1 else None,
        "final_deflection": sum(depth[k] for k in last) / len(last),
        "final_force": sum(size[k] for k in last) / len(last),
        "final_swing": max(swing),
        "touching_at_end": all(touching[k] for k in last),
        "unsolved": sum(trace["solved"][k, 0] == 0.0 for k in rows),
        "contact_lost": sum(trace["contact_lost"][k, 0] > 0.0 for k in rows) if "contact_lost" in trace else 0,
    }


BODY = {"object": {"body": {"kind": "compliance"}}}


@pytest.mark.parametrize(
    ("touching", "scenario", "more"),
    [
        (contact((0, 17), (60, 75)), BODY, {}),
        (contact(), {"object": {"body": {"kind": "modal"}}, "run": {"record_every": 1}}, {}),
        (
            contact((0, 9)),
            {"object": {"body": {"kind": "viscoelastic", "contact": "signed_distance"}}, "run": {"record_every": 1}},
            {},
        ),
        (contact((0, 1), (290, 300)), {"object": {"body": {"kind": "mass_spring"}}, "run": {"record_every": 3}}, {}),
        (contact((0, 5), (N - 102, N - 101)), {"object": {"body": {}}, "run": {"record_every": 2}}, {}),
        (contact((0, 9), (100, 102)), {"object": {"body": {"kind": "viscoelastic"}}}, {"contact_lost": None, **MOVING}),
        (contact((0, 30), (N - 101, N - 100)), {}, {"tool": np.cumsum(np.full((N, 3), 3e-5), axis=0)}),
        (contact((0, 30)), {}, {"tool": np.cumsum(np.full((N, 3), 1.9e-5), axis=0), "scale": 1e-6}),
    ],
    ids=range(8),
)
def test_a_palpation_is_summed_sample_by_sample(
    touching: np.ndarray, scenario: dict[str, Any], more: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The overlap is looked for at 200 samples in contact at most, the first, the last and the deepest among them."""
    asked: list[Any] = []
    monkeypatch.setattr(body_contact, "overlaps_untouched", lambda _trace, rows: asked.append(rows) or True)
    monkeypatch.setattr(body_contact, "mesh_error", lambda _trace, *at: asked.append(at) or 0.07)
    trace = random_trace(touching, scenario, **more)
    found = palpation_metrics(trace)
    assert found is not None
    expected = plain_palpation(trace)
    for key, value in expected.items():
        assert getattr(found, key) == (value if value is None else pytest.approx(value, rel=1e-9, abs=1e-15)), key
    assert set(asdict(found)) == {
        *expected, "mesh_error", "over_untouched", "final_tip_forces", "tip_depth", "final_tip_depth", "softening",
    }  # fmt: skip
    assert found.over_untouched is True
    first = max(int(np.flatnonzero(touching)[0]) - 1, 0)
    deepest = first + int(np.argmax(np.linalg.norm(trace["deflection"][first:], axis=1)))
    assert found.mesh_error == 0.07
    rows = asked.pop()
    assert asked == [(deepest, found.nodes)]
    count = min(len(touching) - first, 200)
    span = len(touching) - 1 - first
    assert rows.tolist() == [*(first + k * span // (count - 1) for k in range(count)), deepest]


def test_a_body_is_palpated_in_two_samples_at_least(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body_contact, "overlaps_untouched", lambda _trace, _rows: False)
    touching = np.zeros(N)
    touching[40] = 1.0
    assert palpation_metrics(random_trace(touching, {})) is None
    touching[80] = 1.0
    flat = random_trace(touching, {}, deflection=np.zeros((N, 3)))
    with np.errstate(divide="ignore"):
        found = palpation_metrics(flat)
    assert found is not None
    assert (found.touches, found.stiffness, found.over_untouched) == (2, 0.0, False)
    assert palpation_metrics(random_trace(touching, {}, contact_nodes=None)) is None


@pytest.mark.parametrize(
    ("choice", "known"),
    [
        ({"kind": "signed_distance"}, True),
        ({"kind": "modal", "contact": "signed_distance"}, True),
        ({"kind": "signed_distance", "tip": "flat"}, True),
        ({"kind": "modal"}, False),
        ({}, False),
    ],
)
def test_a_tip_by_signed_distance_is_too_soft_when_deep(choice: dict[str, Any], known: bool) -> None:
    trace: Any = SimpleNamespace(scenario={"object": {"body": {"radius": "10 mm", **choice}}})
    assert body_contact._softening(trace, 7e-3) == (
        pytest.approx(0.39 if choice.get("tip") == "flat" else 0.365) if known else None
    )
    assert body_contact._softening(trace, 2e-3) is None


def test_the_work_and_the_path_of_a_contact_are_summed_sample_by_sample() -> None:
    for touching in (contact((0, 17), (60, 75)), contact(), contact((0, 40), (60, 250))):
        trace = random_trace(touching, BODY, 3e-5, **MOVING)
        path, stiffness = plain_path(trace)
        found = stiffness_along_path(trace)
        np.testing.assert_allclose(found[0], path, rtol=1e-9)
        np.testing.assert_allclose(found[1], stiffness, rtol=1e-9)
        assert len(path) > 5
        work = work_so_far(trace)
        assert (len(work), work[0]) == (N, 0.0)
        points, forces = seen(trace)
        each = [0.5 * (forces[k] + forces[k - 1]) @ (points[k] - points[k - 1]) for k in range(1, N)]
        np.testing.assert_allclose(np.diff(work), each, rtol=1e-9, atol=1e-15)


def test_half_of_the_median_force_does_not_press() -> None:
    """Nor does a contact without force; a tip that arrives in one step has a path of one sample."""
    force = np.tile([0.0, 0.0, -2.0], (N, 1))
    force[10] = [0.0, 0.0, -1.0]
    tip = np.zeros((N, 3))
    tip[:, 0] = 1e-3 * np.arange(N)
    trace = random_trace(contact(), {}, object_force=force, tip=tip, deflection=np.full((N, 3), 1e-3))
    path, stiffness = stiffness_along_path(trace)
    np.testing.assert_allclose(path, 1e-3 * np.array([k if k < 10 else k - 1 for k in range(N) if k != 10]), atol=1e-12)
    np.testing.assert_allclose(stiffness, 2.0 / math.sqrt(3e-6))
    for one in (contact((0, N)), contact()):
        empty = stiffness_along_path(random_trace(one, {}, object_force=np.zeros((N, 3))))
        assert [part.shape for part in empty] == [(0,), (0,)]
    tip = np.zeros((N, 3))
    tip[5:, 1] = 20.05e-3
    jump = random_trace(contact((0, 5)), {}, object_force=np.where(np.arange(N)[:, None] < 5, 0.0, force), tip=tip)
    assert stiffness_along_path(jump)[0] == pytest.approx([20.05e-3])


def test_names_of_a_palpation_end_with_their_unit() -> None:
    values: Any = {one.name: float(number) for number, one in enumerate(fields(PalpationMetrics))}
    found = PalpationMetrics(**values).to_dict()
    assert list(found) == [
        "touches", "deepest_m", "deepest_force_N", "stiffness_N_per_m", "nodes", "mesh_error", "path_m",
        "path_stiffness_median_N_per_m", "path_stiffness_max_N_per_m", "work_J", "stored_J", "saved_J", "at_start_J",
        "lost_J", "held_J", "final_deflection_m", "final_force_N", "final_swing_N", "touching_at_end", "unsolved",
        "contact_lost", "over_untouched", "final_tip_forces_N", "tip_depth_m", "final_tip_depth_m", "softening",
        "settled",
    ]  # fmt: skip
    assert list(found.values())[:-1] == list(values.values())


def plain_sliding(trace: Trace, spring: float | None) -> dict[str, Any]:
    touching = [bool(one > 0.0) for one in trace["touching"][:, 0]]
    first = touching.index(True)
    points, own = seen(trace)
    forces, stiff, depth = trace["object_force"], trace["surface_stiffness"][:, 0], trace["depth"][:, 0]
    proxies, normals = trace["proxy"], trace["normal"]
    if "frame_position" in trace:
        turns = Rotation.from_rotvec(trace["frame_rotation"]).inv()
        proxies, normals = turns.apply(proxies - trace["frame_position"]), turns.apply(normals)
    every_tick = trace.scenario.get("run", {}).get("record_every", 1) == 1
    rows = range(first, N)
    path, crossing, elsewhere = 0.0, 0.0, 0.0
    for k in range(first + 1, N):
        step, both = float(np.linalg.norm(forces[k] - forces[k - 1])), touching[k] and touching[k - 1]
        path += float(np.linalg.norm(proxies[k] - proxies[k - 1])) if both else 0.0
        if both and trace["triangle"][k, 0] != trace["triangle"][k - 1, 0]:
            crossing = max(crossing, step)
        else:
            elsewhere = max(elsewhere, step)
    offset = {k: proxies[k] - points[k] - depth[k] * normals[k] for k in rows}
    along = {k: stiff[k] if spring is None else spring * touching[k] for k in rows}
    field = friction = 0.0
    for k in range(first + 1, N):
        move = points[k] - points[k - 1]
        sideways = [along[j] * offset[j] for j in (k, k - 1)]
        friction -= float(0.5 * (sideways[0] + sideways[1]) @ move)
        field += float(0.5 * (-own[k] - own[k - 1] - sideways[0] - sideways[1]) @ move)
    ends = (first, N - 1)
    potential = [0.5 * stiff[k] * depth[k] ** 2 for k in ends]
    strain = [0.5 * along[k] * float(offset[k] @ offset[k]) for k in ends]
    last = [k for k in rows if trace.time[k] >= trace.time[-1] - 0.1]
    resting = [k for k in last if touching[k]]
    size = [float(np.linalg.norm(force)) for force in forces]
    deflection = sum(depth[k] for k in resting) / len(resting) if resting else 0.0
    wanted = rms = error = None
    if np.any(trace["reference_force"][first:]):
        each = {k: max(0.0, -float(trace["reference_force"][k] @ trace["normal"][k])) / stiff[k]
                for k in rows if touching[k] and stiff[k] > 0.0}  # fmt: skip
        held = [k for k in rows if touching[k]]
        rms = math.sqrt(sum((depth[k] - each.get(k, 0.0)) ** 2 for k in held) / len(held))
        if resting:
            wanted = sum(each.get(k, 0.0) for k in resting) / len(resting)
            error = 100.0 * (deflection / wanted - 1.0) if wanted > 0.0 else None
    swing = [max(forces[k][axis] for k in last) - min(forces[k][axis] for k in last) for axis in range(3)]
    return {
        "path": path,
        "lost_ticks": sum(not touching[k] for k in rows) if every_tick else None,
        "step_at_crossing": crossing if every_tick else None,
        "step_elsewhere": elsewhere if every_tick else None,
        "deflection": deflection,
        "expected_deflection": wanted,
        "deflection_error_percent": error,
        "deflection_rms_error": rms,
        "energy_generated": field + potential[1] - potential[0],
        "energy_dissipated": friction - strain[1] + strain[0],
        "ripple_power": _ripple_power(forces[first:], float(trace.time[first + 1] - trace.time[first])),
        "final_force": sum(size[k] for k in last) / len(last),
        "final_swing": max(swing),
        "touching_at_end": all(touching[k] for k in last),
    }


SURFACE = {"object": {"surface": {"tangential": "250 N/m"}}}


@pytest.mark.parametrize(
    ("touching", "scenario", "more", "tangential"),
    [
        (contact((0, 17), (60, 75)), {}, {}, None),
        (contact((0, 17), (60, 75)), SURFACE, MOVING, None),
        (contact((60, 75)), SURFACE, {}, 90.0),
        (contact((0, 3), (N - 102, N - 101)), {"run": {"record_every": 2}}, {}, None),
        (contact((0, 3), (N - 101, N - 100)), {}, {"reference_force": np.zeros((N, 3))}, None),
        (contact((0, 40), (N - 101, N)), {}, {}, 80.0),
        (contact((0, 40)), {}, {"reference_force": np.full((N, 3), 1.0)}, None),
        (contact((0, 40)), {}, {"surface_stiffness": np.where(np.arange(N) % 7 == 0, 0.0, 300.0)}, None),
    ],
    ids=range(8),
)
def test_a_slide_is_summed_sample_by_sample(
    touching: np.ndarray, scenario: dict[str, Any], more: dict[str, Any], tangential: float | None
) -> None:
    trace = random_trace(touching, scenario, **more)
    found = sliding_metrics(trace, tangential=tangential)
    assert found is not None
    spring = tangential if tangential is not None else 250.0 if scenario is SURFACE else None
    expected = plain_sliding(trace, spring)
    for key, value in expected.items():
        assert getattr(found, key) == (value if value is None else pytest.approx(value, rel=1e-9, abs=1e-15)), key
    assert set(asdict(found)) == set(expected)


def test_a_slide_has_two_samples_in_contact_at_least_and_its_names_end_with_their_unit() -> None:
    touching = np.zeros(N)
    touching[N - 3] = 1.0
    assert sliding_metrics(random_trace(touching, {})) is None
    touching[N - 2] = 1.0
    assert sliding_metrics(random_trace(touching, {}, proxy=None)) is None
    found = sliding_metrics(random_trace(touching, {}))
    assert found is not None
    assert list(found.to_dict()) == [
        "path_m", "lost_ticks", "step_at_crossing_N", "step_elsewhere_N", "deflection_m", "expected_deflection_m",
        "deflection_error_percent", "deflection_rms_error_m", "energy_generated_J", "energy_dissipated_J",
        "ripple_power_N2", "final_force_N", "final_swing_N", "touching_at_end", "settled",
    ]  # fmt: skip
    assert list(found.to_dict().values()) == [*asdict(found).values(), found.settled]
    none = dict.fromkeys((one.name for one in fields(SlidingMetrics)), 0.0)
    for force, most in ((0.02, 1e-3), (0.5, 5e-3), (3.0, 0.03)):
        for swing, settled in ((0.99 * most, True), (1.01 * most, False)):
            values: Any = {**none, "final_force": force, "final_swing": swing, "touching_at_end": True}
            assert SlidingMetrics(**values).settled is settled
            assert not SlidingMetrics(**{**values, "touching_at_end": False}).settled
    values = {**none, "final_swing": 1e-3, "touching_at_end": True}
    assert SlidingMetrics(**values).settled


def plain_ripple_power(force: np.ndarray, period: float) -> float:
    """Return the mean periodogram of half-overlapping Hann windows, a sum written out."""
    samples = min(len(force), round(0.25 / period))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(samples) / samples)
    power, begins = 0.0, range(0, len(force) - samples + 1, samples - samples // 2)
    for begin in begins:
        part = force[begin : begin + samples]
        lines = np.fft.rfft((part - part.mean(axis=0)) * window[:, None], axis=0)
        for number, line in enumerate(lines):
            twice = 1.0 if number == 0 or 2 * number == samples else 2.0
            if 20.0 <= number / (samples * period) <= 500.0:
                power += twice * float(np.sum(np.abs(line) ** 2)) / samples / float(np.sum(window**2))
    return power / len(begins)


@pytest.mark.parametrize(
    ("length", "period"),
    [(1000, 1e-3), (777, 0.5e-3), (300, 2e-3), (40, 1e-3), (90, 0.025), (7, 1e-3), (3, 1e-3), (2, 1e-3), (30, 5e-4)],
)
def test_the_power_of_a_ripple_is_that_of_its_lines_between_20_and_500_hz(length: int, period: float) -> None:
    """The borders belong to it: samples 25 ms apart show 20 Hz and no more."""
    force = np.random.default_rng(length).normal(size=(length, 3)) + np.array([3.0, -2.0, 0.5])
    assert _ripple_power(force, period) == pytest.approx(plain_ripple_power(force, period), rel=1e-9)
    assert mesh_contact.RIPPLE_BAND == (20.0, 500.0)
