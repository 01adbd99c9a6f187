"""Frames of a body's surface: they show what the loop presses, and the loop does not know of them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import BodyError
from palpate.simulation.bodies import pressed_at
from palpate.simulation.simulator import build_simulation
from palpate.simulation.surface_frames import SurfaceFrames

from experiments.palpation_phantom import press_scenario


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = bodies.block((0.045, 0.03, 0.02), (0.005, 0.005, 0.01))
    bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, output=path)
    body = {"file": str(path), "origin": ["22.5 mm", "15 mm", "20 mm"], "radius": "8 mm", "tip": "flat"}
    return press_scenario(10e3, "LQG", 400.0, body)


def test_the_loop_is_the_same_bit_for_bit_while_its_body_is_drawn(tables: dict[str, Any]) -> None:
    """A thread that fetches as often as it can, and a reader beside it, change nothing."""
    alone = build_simulation(tables).run()[0]
    watched = build_simulation(tables)
    frames = SurfaceFrames(watched, rate=20_000.0)
    for _ in range(5):
        rows, _ = watched.run()
        assert np.array_equal(rows, alone)
        frames.latest()


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_last_frame_shows_the_last_tick(tables: dict[str, Any], friction: float) -> None:
    """Against the run played to the body again: compliance times the forces of the end of the run, friction's too."""
    body = {**tables["object"]["body"], "static_friction": friction}
    experiment = build_simulation({**tables, "object": {**tables["object"], "body": body}})
    frames = SurfaceFrames(experiment, rate=500.0)
    first = frames.latest()
    assert first.tick == -1
    assert not first.displacement.any()
    rows, unstable = experiment.run()
    ticks = len(rows) - 1
    deadline = time.monotonic() + 10.0
    while (shown := frames.latest()).tick != ticks and time.monotonic() < deadline:
        time.sleep(0.002)
    assert shown.tick == ticks
    expected = pressed_at(experiment.trace(rows, unstable), -1).displacement
    assert np.abs(expected).max() > 1e-4
    np.testing.assert_allclose(shown.displacement, expected, atol=1e-6 * np.abs(expected).max())


def test_a_live_loop_is_seen_while_it_runs(tables: dict[str, Any]) -> None:
    """Paced by the clock, a loop of 0.3 s is shown many times on the way, each frame a later tick."""
    import threading

    experiment = build_simulation({**tables, "run": {"duration": "0.3 s"}})
    frames = SurfaceFrames(experiment, rate=200.0)
    loop = threading.Thread(target=experiment.setup.time_ticks, args=(experiment.reference, experiment.operator, True))
    seen: dict[int, int] = {}
    loop.start()
    while loop.is_alive():
        frame = frames.latest()
        seen[frame.number] = frame.tick
        time.sleep(0.001)
    loop.join()
    ticks = [seen[number] for number in sorted(seen)]
    assert len(set(ticks)) > 5
    assert ticks == sorted(ticks)


@pytest.fixture(scope="module")
def soft(tables: dict[str, Any]) -> dict[str, Any]:
    """The same loop, for a second, on the same block under large displacements."""
    body = {**tables["object"]["body"], "kind": "neo-hookean"}
    return {**tables, "object": {**tables["object"], "body": body}, "run": {"duration": "1.01 s"}}


def test_large_displacements_are_drawn_as_the_slow_steps_left_them(soft: dict[str, Any]) -> None:
    """Against the run played to the body again; and the loop is the same, bit for bit, with and without.

    A slow step solves to 10 % and leaves the rest to the next. So the rounding of the repeated path counts while the
    body moves: 1 to 2 % of the displacement.
    """
    alone = build_simulation(soft).run()[0]
    experiment = build_simulation(soft)
    frames = SurfaceFrames(experiment)
    first = frames.latest()
    assert (first.number, first.tick) == (0, -1)
    assert not first.displacement.any()
    rows, unstable = experiment.run()
    assert np.array_equal(rows, alone)
    shown = frames.latest()
    expected = pressed_at(experiment.trace(rows, unstable), -1).displacement
    assert np.abs(expected).max() > 2e-4
    np.testing.assert_allclose(shown.displacement, expected, atol=0.03 * np.abs(expected).max())
    ticks = len(rows) - 1
    assert 0 < ticks - shown.tick < 40  # a slow step of 20 ms: it saw the tip where that began


def test_large_displacements_are_seen_while_a_live_loop_runs(soft: dict[str, Any]) -> None:
    """Paced by the clock, slow steps in their thread: each is a frame, of a later tick than the one before."""
    import threading

    experiment = build_simulation(soft)
    frames = SurfaceFrames(experiment)
    loop = threading.Thread(target=experiment.setup.time_ticks, args=(experiment.reference, experiment.operator, True))
    seen: dict[int, tuple[int, float]] = {}
    loop.start()
    while loop.is_alive():
        frame = frames.latest()
        seen[frame.number] = frame.tick, float(np.abs(frame.displacement).max())
        time.sleep(0.001)
    loop.join()
    ticks = [seen[number][0] for number in sorted(seen)]
    assert len(ticks) > 5
    assert ticks == sorted(ticks)
    assert seen[max(seen)][1] > 2e-4


def test_what_cannot_be_drawn_is_refused(tables: dict[str, Any]) -> None:
    with pytest.raises(BodyError, match="no body to draw"):
        SurfaceFrames(build_simulation({**tables, "object": {"kind": "spring", "stiffness": "1 N/mm"}}))
    with pytest.raises(BodyError, match="positive rate"):
        SurfaceFrames(build_simulation(tables), rate=0.0)
