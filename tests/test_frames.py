"""Frames of a body's surface: they show what the loop presses, and the loop does not know of them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from palpate import bodies
from palpate.bodies import BodyError
from palpate.loop.body import pressed_at
from palpate.loop.frames import SurfaceFrames
from palpate.loop.simulate import prepare
from palpate.palpation import press_scenario


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = bodies.block((0.045, 0.03, 0.02), (0.005, 0.005, 0.01))
    bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, output=path)
    body = {"file": str(path), "origin": ["22.5 mm", "15 mm", "20 mm"], "radius": "8 mm", "tip": "flat"}
    return press_scenario(10e3, "LQG", 400.0, body)


def test_the_loop_is_the_same_bit_for_bit_while_its_body_is_drawn(tables: dict[str, Any]) -> None:
    """A thread that fetches as often as it can, and a reader beside it, change nothing."""
    alone = prepare(tables).run()[0]
    watched = prepare(tables)
    frames = SurfaceFrames(watched, rate=20_000.0)
    for _ in range(5):
        rows, _ = watched.run()
        assert np.array_equal(rows, alone)
        frames.latest()


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_last_frame_shows_the_last_tick(tables: dict[str, Any], friction: float) -> None:
    """Against the run played to the body again: compliance times the forces of the end of the run, friction's too."""
    body = {**tables["object"]["body"], "static_friction": friction}
    experiment = prepare({**tables, "object": {**tables["object"], "body": body}})
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

    experiment = prepare({**tables, "run": {"duration": "0.3 s"}})
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


def test_what_cannot_be_drawn_is_refused(tables: dict[str, Any]) -> None:
    with pytest.raises(BodyError, match="no body to draw"):
        SurfaceFrames(prepare({**tables, "object": {"kind": "spring", "stiffness": "1 N/mm"}}))
    with pytest.raises(BodyError, match="positive rate"):
        SurfaceFrames(prepare(tables), rate=0.0)
