"""Phases of a run between the changes of its bodies' supports."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.fem.support_changes import SupportChange, SupportPlan
from palpate.scenario import Scenario

__all__ = ["last_change", "support_phase"]


def support_phase(scenario: Scenario, time: ArrayLike) -> NDArray[np.int64]:
    """Return the number of changes of supports, of all objects, that are made at ticks at times (n,), s: (n,)."""
    tick = np.floor(np.asarray(time) / scenario.period + 1e-6)  # a late tick is late by less than a period
    count = np.zeros(len(tick), dtype=np.int64)
    for one in scenario.each_object.values():
        changes = () if one.object.body is None else one.object.body.supports or ()
        for step in SupportPlan(tuple(SupportChange(change.at) for change in changes), scenario.period).steps[1:]:
            count += tick >= step
    return count


def last_change(scenario: Scenario) -> float | None:
    """Return the time of the last change of supports, s; None if there is none."""
    bodies = [one.object.body for one in scenario.each_object.values() if one.object.body is not None]
    return max((change.at for body in bodies for change in body.supports or ()), default=None)
