"""A run that goes on under its last forces, where its tip may move on: by a guard, counts, or on a smooth surface."""

from __future__ import annotations

from typing import Final

import numpy as np

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.scenario.body import LARGE
from palpate.simulation.decision import band_of
from palpate.simulation.energy_balance import own_motions
from palpate.simulation.evidence import evidence
from palpate.simulation.friction_hold import friction_of
from palpate.simulation.recorded import Recorded, external_forces, held_tip, recorded_scenario
from palpate.simulation.support_phase import last_change
from palpate.simulation.windows import Window, windows

LATER: Final = 12  # durations of the run for which it goes on
LATER_SLOW: Final = 4  # the same of a hyperelastic body, whose updates take long
FAR: Final = 1.0  # m
SHIFTS: Final = 0.1  # of the band of rest: way on that is stated
SLIDES: Final = 1.0 / (5 * LATER)  # of the band, in a fifth: a steady shift that leaves it within `LATER` durations

__all__ = ["LATER", "durations_on", "moves_on", "resting_window", "way_on"]


def durations_on(scenario: Scenario) -> int:
    """Return for how many durations of its run a scenario goes on."""
    bodies = [one.object.body for one in scenario.each_object.values() if one.object.body is not None]
    return LATER_SLOW if any(body.kind in LARGE for body in bodies) else LATER


def moves_on(trace: Recorded) -> str | None:
    """Return by how much a tip moves on after its run; None if by little, or if the run did not go on."""
    continued = trace.metadata.get("continued")
    if continued is None or continued["moved_m"] <= SHIFTS * continued.get("band_m", np.inf):
        return None
    far = "without limit" if continued["moved_m"] > FAR else f"by {1e3 * continued['moved_m']:.2g} mm"
    return f"the tip moves on {far} in {continued['durations']} more durations of the run"


def resting_window(trace: Recorded) -> tuple[Window, float] | None:
    """Return the window in which a tip rests that may move on, and its band, m.

    It may behind a guard, on a mesh or body with dry friction under encoder counts, and on one without friction if its
    mean position still shifts. The tip rests if its motion is within the band. None if it does not, if objects, tools
    or supports of the scenario change by themselves, or if the drive comes to its limits.
    """
    scenario = recorded_scenario(trace)
    if scenario is None or scenario.operator.kind == "fixed":
        return None
    rough = friction_of(scenario) > 0.0
    smooth = not rough and any(one.object.kind in ("mesh", "body") for one in scenario.each_object.values())
    if not smooth and not (rough and scenario.device.encoder) and scenario.guard.kind == "none":
        return None
    if trace.unstable_from is not None or len(trace.time) < 2:
        return None
    window = windows(external_forces(trace, scenario))[-1]
    changes = bool(own_motions(trace, scenario)) or last_change(scenario) is not None
    if not window.constant or changes or trace["saturated"].any():
        return None
    found = evidence(trace, scenario, window, None)
    band = float(band_of(found)[0])
    if not found.touching[0] > 0.0 or not found.ripple[0] <= band:
        return None
    if smooth and scenario.guard.kind == "none" and not _shift(trace, window) > SLIDES * band:
        return None
    return window, band


def _shift(trace: Recorded, window: Window) -> float:
    """Return by how much the mean position of a tip in the last fifth of a window differs from that before, m."""
    tip, ending = held_tip(trace), window.ending
    before = tip[max(2 * ending.start - ending.stop, 0) : ending.start]
    return float(np.linalg.norm(tip[ending].mean(axis=0) - before.mean(axis=0))) if len(before) else 0.0


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
