"""What an observed run is said to do after its push, and how much of its response it keeps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.simulation.observed_run import _kept, _sentence
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State, Verdict

T = 1e-3


def run(n: int, diverges: bool = False) -> Trace:
    return replace(Trace.of(T * np.arange(n), {"tip": np.zeros((n, 3))}), unstable_from=n * T if diverges else None)


SCENARIO: Any = SimpleNamespace(run=SimpleNamespace(duration=0.25), period=T)


@pytest.mark.parametrize(
    ("n", "diverges", "verdict", "said"),
    [
        (120, True, Verdict(State.UNSTABLE, "diverges at t = 0.12 s"), "; it diverges at t = 0.12 s."),
        (501, False, Verdict(State.SETTLED, "the tip rests"), "; its verdict is settled: the tip rests."),
        (801, False, Verdict(State.SETTLED, "the tip rests"),
         ", pushed by 5 % of its force for 5 ticks, and observed for 0.301 s; its verdict is settled: the tip rests."),
        (801, False, Verdict(State.UNSTABLE, "it grows"),
         ", pushed by 5 % of its force for 5 ticks, and observed for 0.301 s; its verdict is unstable: it grows."),
    ],
)  # fmt: skip
def test_the_sentence_says_how_far_the_run_came(n: int, diverges: bool, verdict: Verdict, said: str) -> None:
    found = _sentence(SCENARIO, run(n, diverges), 0.25, 500, verdict)
    assert found == f"The scenario was run for 0.25 s and held for 0.25 s{said}"


@pytest.mark.parametrize("factor", [0.1, 1.0, 2.0])
def test_the_response_kept_is_the_motion_of_the_last_fifth_over_that_of_the_first(factor: float) -> None:
    """Steps of 3 and 4 um in turn in the first fifth; below 1e-6 of the deflection, or two counts, the tip is still."""
    steps = np.tile([3e-6, -4e-6], 250)
    steps[400:] *= factor
    tip = np.concatenate([np.full(101, 5e-3), 5e-3 + np.cumsum(steps)])[:, None] * np.array([0.6, 0.8, 0.0])
    scenario: Any = SimpleNamespace(device=SimpleNamespace(encoder=False))

    def kept(deflection: float) -> float:
        bent = np.tile([0.0, deflection, 0.0], (len(tip), 1))
        return _kept(scenario, Trace.of(T * np.arange(len(tip)), {"tip": tip, "deflection": bent}), 100)

    assert kept(1e-3) == pytest.approx(factor, rel=1e-9)
    last = 4e-6 * factor
    assert kept(0.99e6 * last) == pytest.approx(factor, rel=1e-9)
    assert kept(1.01e6 * last) == 0.0
    jacobian = np.array([[1.0, 0.0], [0.0, -2.0], [0.0, 0.0]])
    for count, expected in ((0.99, factor), (1.01, 0.0)):
        device = SimpleNamespace(jacobian=lambda q: jacobian, encoder_step=np.array([0.1, 0.5 * count]) * last)
        scenario = SimpleNamespace(device=SimpleNamespace(encoder=True), load_device=lambda device=device: device)
        trace = Trace.of(
            T * np.arange(len(tip)), {"tip": tip, "deflection": np.zeros_like(tip), "angle": np.zeros((len(tip), 2))}
        )
        assert _kept(scenario, trace, 100) == pytest.approx(expected, rel=1e-9)
    still = Trace.of(T * np.arange(50), {"tip": np.zeros((50, 3)), "deflection": np.zeros((50, 3))})
    assert _kept(SimpleNamespace(device=SimpleNamespace(encoder=False)), still, 10) == 0.0  # type: ignore[arg-type]
