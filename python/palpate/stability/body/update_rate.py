"""Slowest rate at which a hyperelastic body may be updated in a stable loop."""

from __future__ import annotations

from collections.abc import Callable

from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace

__all__ = ["slowest_update"]

_LONGEST = 0.2  # s


def slowest_update(
    scenario: Scenario, trace: Trace, row: int, ticks: int, stable: Callable[[Scenario, Trace, int], bool | None]
) -> tuple[float | None, str]:
    """Return the longest interval of updates, s, found stable about a contact, and a sentence; None: undecided.

    The interval is doubled up to 0.2 s while the loop is stable, then bisected to whole ticks. The body's response is
    measured anew for each interval.

    Args:
        scenario: its object is a hyperelastic body.
        trace: a run of it.
        row: index of the sample in contact.
        ticks: interval of the scenario, for which the loop is stable.
        stable: whether the loop of a scenario is stable about a sample of a trace; None: undecided.
    """

    def test(interval: int) -> bool | None:
        body = {**scenario.to_dict()["object"]["body"]}
        body["options"] = {**body.get("options", {}), "update_interval": f"{interval * scenario.period!r} s"}
        tables = {**scenario.to_dict(), "object": {**scenario.to_dict()["object"], "body": body}}
        try:
            return stable(Scenario.from_dict(tables), trace, row)
        except PalpateError:
            return None

    most = max(round(_LONGEST / scenario.period), ticks)
    good = ticks
    while good < most:
        interval = min(2 * good, most)
        found = test(interval)
        if found is None:
            text = (
                f"the slowest stable rate is unknown: at {interval * scenario.period:.4g} s the criteria do not decide"
            )
            return None, f"Updates every {good * scenario.period:.4g} s are stable; {text}."
        if not found:
            return _bisect(good, interval, test, scenario.period)
        good = interval
    return good * scenario.period, (
        f"Updates of the body's model as rare as every {good * scenario.period:.4g} s, the longest tested, leave small "
        "motions stable."
    )


def _bisect(good: int, bad: int, test: Callable[[int], bool | None], period: float) -> tuple[float | None, str]:
    while bad - good > max(1, good // 50):
        middle = (good + bad) // 2
        found = test(middle)
        if found is None:
            return None, (
                f"Updates every {good * period:.4g} s are stable, every {bad * period:.4g} s unstable; between them "
                "the criteria do not decide."
            )
        good, bad = (middle, bad) if found else (good, middle)
    return good * period, f"The slowest stable updates of the body's model are {good * period:.4g} s apart."
