"""A run that goes on under its last forces, where encoder counts may move the tip on along a surface with friction."""

from __future__ import annotations

from typing import Final

import numpy as np

from palpate.arrays import Array
from palpate.simulation.energy_balance import own_motions
from palpate.simulation.evidence import evidence
from palpate.simulation.recorded import Recorded, external_forces, recorded_scenario
from palpate.simulation.support_phase import last_change
from palpate.simulation.verdict import band_of
from palpate.simulation.windows import Window, windows

LATER: Final = 4  # durations of the run for which it goes on

__all__ = ["LATER", "resting_window", "way_on"]


def resting_window(trace: Recorded) -> Window | None:
    """Return the window in which a tip rests on a body with dry friction under encoder counts; None if it does not.

    It is None too if objects, tools or supports of the scenario change by themselves, or the drive comes to its limits.
    """
    scenario = recorded_scenario(trace)
    if scenario is None or not scenario.device.encoder or scenario.operator.kind == "fixed":
        return None
    if trace.unstable_from is not None or len(trace.time) < 2:
        return None
    window = windows(external_forces(trace, scenario))[-1]
    changes = bool(own_motions(trace, scenario)) or last_change(scenario) is not None
    if not window.constant or changes or trace["saturated"].any():
        return None
    found = evidence(trace, scenario, window, None)
    rubs = not np.isnan(found.fluctuation[0]) and found.resolution[0] > 0.0
    return window if rubs and found.ripple[0] <= band_of(found)[0] else None


def way_on(tip: Array, window: Window) -> float:
    """Return how far a tip moves on after a window, m.

    It is the largest distance of its mean in a stretch as long as the last fifth of the window from the mean in that
    fifth. The mean hides the oscillation within the counts.

    Args:
        tip: positions (n, 3) of the continued run from its start, m.
        window: of the run.
    """
    ending = window.ending
    size = ending.stop - ending.start
    count = (len(tip) - ending.stop) // size
    means = tip[ending.stop : ending.stop + count * size].reshape(count, size, 3).mean(axis=1)
    return float(np.linalg.norm(means - tip[ending].mean(axis=0), axis=1).max(initial=0.0))
