"""The axis of the forces: a short spike at the start does not flatten the rest, and its peak is written."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.plotting.figures import force_limits, forces
from palpate.simulation import Trace

TIME = np.linspace(0.0, 4.0, 4001)


def run(along: np.ndarray) -> Trace:
    """A run whose operator has the force `along` x, N, beside a constant one on the object along z."""
    operator, pressed = np.zeros((len(TIME), 3)), np.zeros((len(TIME), 3))
    operator[:, 0], pressed[:, 2] = along, -0.5
    return Trace.of(TIME, {"operator_force": operator, "object_force": pressed})


def spike(peak: float, begin: float = 0.0, width: float = 0.02) -> np.ndarray:
    inside = (begin <= TIME) & (begin + width >= TIME)
    return np.where(inside, peak, 0.0) + 0.25 * TIME


def test_a_spike_at_the_start_is_cut_off_and_its_peak_is_written() -> None:
    """The later forces are from -0.5 to 1 N: a tenth of their range is left above and below."""
    trace = run(spike(-6.4))
    assert force_limits(trace) == pytest.approx((-0.65, 1.15))
    first, last = forces(trace).axes
    assert first.get_ylim() == last.get_ylim() == pytest.approx((-0.65, 1.15))
    assert [note.get_text() for note in first.texts] == ["↓ −6.4 N"]
    assert not last.texts
    both = np.where(TIME < 0.01, 9.0, spike(-6.4))
    assert [note.get_text() for note in forces(run(both)).axes[0].texts] == ["↓ −6.4 N", "↑ 9 N"]


@pytest.mark.parametrize(
    "along",
    [
        spike(-1.5),  # the rest is more than a third of the whole
        spike(-6.4, begin=2.0),  # an impact on the way
        spike(-6.4, width=0.3),  # it lasts
        spike(-200.0),  # little follows
        0.25 * TIME,
        np.exp(TIME) - 1.0,  # it grows
        np.ones(len(TIME)),
    ],
    ids=["small", "later", "long", "alone", "none", "growing", "constant"],
)
def test_other_forces_are_drawn_in_full(along: np.ndarray) -> None:
    trace = run(along)
    assert force_limits(trace) is None
    low, high = forces(trace).axes[0].get_ylim()
    assert low <= along.min()
    assert high >= along.max()


def test_a_peak_near_the_later_forces_stays_on_the_axis() -> None:
    """The swing back after a cut spike: 1.6 N beside forces up to 1 N."""
    swing = np.where((TIME > 0.03) & (TIME < 0.06), 1.6, spike(-6.4))
    assert force_limits(run(swing)) == pytest.approx((-0.65, 1.75))
