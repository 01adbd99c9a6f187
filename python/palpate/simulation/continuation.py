"""A run that goes on under its last forces, where its tip may move on: by a guard, counts, or on a smooth surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from palpate.scenario import Scenario
from palpate.scenario.body import LARGE
from palpate.simulation.decision import MOST_CONTACTS, band_of
from palpate.simulation.energy_balance import own_motions
from palpate.simulation.evidence import evidence
from palpate.simulation.friction_hold import friction_of
from palpate.simulation.linear_contact import UNHELD
from palpate.simulation.linear_evidence import linear_radii_of
from palpate.simulation.recorded import Recorded, external_forces, held_tip, recorded_scenario
from palpate.simulation.support_phase import last_change
from palpate.simulation.windows import Window, windows

LATER: Final = 12  # durations of the run for which it goes on
LATER_SLOW: Final = 4  # the same of a hyperelastic body, whose updates take long
FAR: Final = 1.0  # m
SHIFTS: Final = 0.1  # of the band of rest: way on that is stated
SLIDES: Final = 1.0 / (5 * LATER)  # of the band, in a fifth: a steady shift that leaves it within `LATER` durations

__all__ = ["LATER", "durations_on", "later_motion", "may_slide", "moves_on", "resting_window"]


def durations_on(scenario: Scenario) -> int:
    """Return for how many durations of its run a scenario goes on."""
    bodies = [one.object.body for one in scenario.each_object.values() if one.object.body is not None]
    return LATER_SLOW if any(body.kind in LARGE for body in bodies) else LATER


def moves_on(trace: Recorded) -> str | None:
    """Return by how much a tip moves on after its run; None if by little, or if the run did not go on."""
    continued = trace.metadata.get("continued")
    if continued is None:
        return None
    more = f"in {continued['durations']} more durations of the run"
    if _bounces(continued):
        return f"the tip bounces {more}"
    if _swings(continued):
        return f"the tip oscillates by {1e3 * continued['swing_m']:.2g} mm {more}"
    if continued["moved_m"] <= SHIFTS * continued.get("band_m", np.inf):
        return None
    far = "without limit" if continued["moved_m"] > FAR else f"by {1e3 * continued['moved_m']:.2g} mm"
    return f"the tip moves on {far} {more}"


def _swings(continued: Mapping[str, Any]) -> bool:
    return bool(continued.get("swing_m", 0.0) > continued.get("band_m", np.inf))


def _bounces(continued: Mapping[str, Any]) -> bool:
    return bool(continued.get("contacts", 0) > MOST_CONTACTS)


def resting_window(trace: Recorded, unheld: bool | None = None) -> tuple[Window, float] | None:
    """Return the window in which a tip rests that may move on, and its band, m.

    It may behind a guard, and on a mesh or body with dry friction. Without friction it may if its mean position still
    shifts, or if nothing holds it along the surface, where its equilibrium may be unstable. The tip rests if its motion
    is within the band; with dry friction without encoder counts, also if it decays. None if it does not, if objects,
    tools or supports of the scenario change by themselves, or if the drive comes to its limits.

    Args:
        trace: of the run.
        unheld: whether nothing holds the tip along the surface; None: the linear loop is evaluated.
    """
    scenario = recorded_scenario(trace)
    if scenario is None or scenario.operator.kind == "fixed":
        return None
    rough, smooth = friction_of(scenario) > 0.0, _is_smooth(scenario)
    if not (smooth or rough or scenario.guard.kind != "none"):
        return None
    if trace.unstable_from is not None or len(trace.time) < 2:
        return None
    window = windows(external_forces(trace, scenario))[-1]
    changes = bool(own_motions(trace, scenario)) or last_change(scenario) is not None
    if not window.constant or changes or trace["saturated"].any():
        return None
    found = evidence(trace, scenario, window, None)
    band = float(band_of(found)[0])
    decays = rough and not scenario.device.encoder and bool(found.late[0] < found.prior[0])
    if not found.touching[0] > 0.0 or not (found.ripple[0] <= band or decays):
        return None
    if smooth and not (_shift(trace, window) > SLIDES * band or (_unheld(trace) if unheld is None else unheld)):
        return None
    return window, band


def may_slide(trace: Recorded, unheld: bool) -> bool:
    """Return whether a tip that rests on a mesh or body without friction may slide on, and the run did not go on.

    False of devices that share a body, whose loops are judged together.

    Args:
        trace: of the run.
        unheld: as in `resting_window`.
    """
    scenario = recorded_scenario(trace)
    if scenario is None or not {"continued", "object"}.isdisjoint(trace.metadata):
        return False
    return _is_smooth(scenario) and resting_window(trace, unheld) is not None


def _is_smooth(scenario: Scenario) -> bool:
    """Return whether a mesh or body is touched without dry friction and guard."""
    touched = any(one.object.kind in ("mesh", "body") for one in scenario.each_object.values())
    return touched and scenario.guard.kind == "none" and not friction_of(scenario) > 0.0


def _unheld(trace: Recorded) -> bool:
    """Return whether the linear loop at the rest of a run has slow motions along the surface that do not decay."""
    return linear_radii_of(trace, recorded_scenario(trace))[1].startswith(UNHELD)


def _shift(trace: Recorded, window: Window) -> float:
    """Return by how much the mean position of a tip in the last fifth of a window differs from that before, m."""
    tip, ending = held_tip(trace), window.ending
    before = tip[max(2 * ending.start - ending.stop, 0) : ending.start]
    return float(np.linalg.norm(tip[ending].mean(axis=0) - before.mean(axis=0))) if len(before) else 0.0


def later_motion(trace: Recorded, window: Window, band: float) -> dict[str, Any]:
    """Return how a tip moves after a window, in stretches as long as the last fifth of the window.

    `moved_m` is the largest distance of its mean in a stretch from the mean in that fifth: the mean hides the
    oscillation within the counts. In the second half of the stretches, `swing_m` is the largest half range along an
    axis, and `contacts` is the number of contacts that begin. `onward_m` is how far the tip leaves its rest: by its
    mean, by an oscillation beyond the band, or, where it bounces, at least by the band.

    Args:
        trace: the continued run from its start.
        window: of the run.
        band: within which the tip rests, m.
    """
    tip, ending = held_tip(trace), window.ending
    size = ending.stop - ending.start
    count = (len(tip) - ending.stop) // size
    stretches = tip[ending.stop : ending.stop + count * size].reshape(count, size, 3)
    moved = np.linalg.norm(stretches.mean(axis=1) - tip[ending].mean(axis=0), axis=1).max(initial=0.0)
    touching = np.asarray(trace["touching"][ending.stop : ending.stop + count * size, 0] > 0.0).reshape(count, size)
    begun = (touching[:, 1:] & ~touching[:, :-1]).sum(axis=1)
    swing = 0.5 * np.ptp(stretches, axis=1).max(axis=1, initial=0.0)
    later = slice(count // 2, None)
    found = {
        "moved_m": float(moved),
        "band_m": band,
        "swing_m": float(swing[later].max(initial=0.0)),
        "contacts": int(begun[later].sum()),
    }
    ways = (found["moved_m"], found["swing_m"] * _swings(found), band * _bounces(found))
    return {**found, "onward_m": max(ways)}
