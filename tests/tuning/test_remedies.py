"""Remedies for a specification that cannot be met: each is the least change that was tried and does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.tuning import remedies
from palpate.tuning.axis import ENCODER, OPERATOR
from palpate.tuning.presses import Settled
from palpate.tuning.remedies import Trial, friction_remedies, most_reachable, sampling_remedies


def asked(**changes: Any) -> Any:
    values = {"stiffness": (100.0, 1000.0), "force": 2.0, "settle": 0.04, "period": 1e-3, "delay": 1, "name": "own",
              "device": SimpleNamespace(name="own")}  # fmt: skip
    return SimpleNamespace(**{**values, **changes})


@pytest.mark.parametrize(
    ("settle", "bound", "hold", "duration"),
    [
        (0.04, 0.01, np.inf, 0.16),  # four settling times
        (0.02, 0.01, np.inf, 0.1),  # a tenth of a second at least
        (0.04, 0.05, np.inf, 0.2),  # four times the bound
        (0.04, np.inf, np.inf, 0.16),
        (0.4, 0.01, np.inf, 1.0),  # a second at most
        (0.04, 0.01, 0.1, 0.09),  # what the motors hold
        (0.04, 0.01, 0.0556, 0.05004),
        (0.04, 0.01, 0.0555, None),  # less than 1.25 settling times
    ],
)
def test_a_trial_lasts_as_long_as_it_needs_and_the_motors_hold_the_force(
    settle: float, bound: float, hold: float, duration: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(remedies, "hold_time", lambda _device, pose, _along, _force, _stiffness: hold + pose)
    monkeypatch.setattr(remedies, "run_presses", lambda *given: seen.append(given) or "settled")
    presses: Any = [SimpleNamespace(pose=pose, direction=None) for pose in (0.5, 0.0, 1.0)]
    for name in (None, "other"):
        trial = Trial(asked(settle=settle), "the controller", np.zeros((1, 1)), presses, bound, name)  # type: ignore[arg-type]
        assert trial.hold(2.0, 100.0) == hold
        found = trial.run(2.0, 500.0)
        if duration is None:
            assert seen == []
            assert found.times.tolist() == [np.inf] * 3
            assert found.overshoot.tolist() == [0.0] * 3
        else:
            assert seen[-1] == ("the controller", name or "own", presses, 2.0, 500.0, pytest.approx(duration), 1)


@pytest.mark.parametrize(
    ("share", "bounds", "slowest", "settles"),
    [
        (0.1, (0.04, 0.03), 0.04, True), (0.099, (0.04,), 0.04, False), (0.5, (0.0401, 0.03), 0.01, False),
        (0.5, (0.03, 0.04), 0.0401, False), (0.5, (), 0.01, False), (0.5, (np.nan,), 0.01, False),
    ],
)  # fmt: skip
def test_a_design_settles_if_enough_presses_are_within_reach_and_the_slowest_is_in_time(
    share: float, bounds: tuple[float, ...], slowest: float, settles: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    presses = [SimpleNamespace(bound=bound) for bound in bounds]
    monkeypatch.setattr(remedies, "draw_presses", lambda *_: presses)
    monkeypatch.setattr(remedies, "share_within_reach", lambda *_: share)
    monkeypatch.setattr(remedies, "choose", lambda found: found[:1])
    ran: list[Any] = []

    def run(self: Trial, force: float, stiffness: float) -> Settled:
        ran.append((list(self.presses), self.bound, force, stiffness))
        return Settled(np.array([0.01, slowest]), np.zeros(2))

    monkeypatch.setattr(Trial, "run", run)
    trial = Trial(asked(), None, np.zeros((1, 1)), [], 7.0)  # type: ignore[arg-type]
    assert trial.settles(3.0, 400.0) is settles
    assert ran in ([], [(presses[:1], max(bounds, default=0.0), 3.0, 400.0)])


def test_a_softer_range_or_a_later_settling_is_the_remedy_for_friction() -> None:
    def tried(limit: float) -> Any:
        return SimpleNamespace(specification=asked(), settles=lambda force, k: force == 2.0 and k <= limit)

    late = {100.0: 0.03, 1000.0: 0.04123}
    assert friction_remedies(tried(456.0), late) == ('--settle "41.3 ms"', '--stiffness "100 N/m..450 N/m"')
    assert friction_remedies(tried(456.0), {100.0: 0.03, 1000.0: np.inf}) == ('--stiffness "100 N/m..450 N/m"',)
    assert friction_remedies(tried(50.0), late) == ('--settle "41.3 ms"',)


@pytest.mark.parametrize(
    ("limit", "meets", "expected"),
    [
        (OPERATOR, lambda _period, data: data.operators == (), "no operator at the tip"),
        (OPERATOR, lambda period, _data: period < 1e-3, None),
        (ENCODER, lambda _period, data: data.count <= 0.25, "an encoder with 4 times the counts"),
        (ENCODER, lambda period, data: data.count <= 0.5 and period <= 0.5e-3,
         'an encoder with 2 times the counts and --period "0.5 ms"'),
        ("another", lambda period, _data: period <= 0.25e-3, '--period "0.25 ms"'),
        ("another", lambda period, data: data.count <= 0.125 and period <= 0.125e-3,
         'an encoder with 8 times the counts and --period "0.125 ms"'),
        ("another", lambda _period, data: data.count <= 0.25,
         'an encoder with 4 times the counts and --period "0.25 ms"'),
        ("another", lambda period, _data: period <= 0.0625e-3, None),
    ],
)  # fmt: skip
def test_the_remedy_of_a_slow_axis_is_the_first_halving_that_does(
    limit: str, meets: Any, expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Settling at the wanted time itself is in time."""
    monkeypatch.setattr(remedies, "replace", lambda data, **new: SimpleNamespace(**{**vars(data), **new}))

    def tune(period: float, delay: int, data: Any) -> Any:
        assert delay == 1
        return SimpleNamespace(settling=0.04) if meets(period, data) else SimpleNamespace(settling=0.0401)

    monkeypatch.setattr(remedies, "tune_axis", tune)
    data: Any = SimpleNamespace(count=1.0, operators=("a hand",))
    found = sampling_remedies(asked(), data, SimpleNamespace(limit=limit), 0.04123)  # type: ignore[arg-type]
    rest = () if expected is None else (expected,)
    assert found == ('--settle "41.3 ms"', *rest)
    assert sampling_remedies(asked(), data, SimpleNamespace(limit=limit), np.inf) == rest  # type: ignore[arg-type]
    monkeypatch.setattr(remedies, "tune_axis", lambda *_: None)
    assert sampling_remedies(asked(), data, SimpleNamespace(limit=limit), np.inf) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("reach", "expected"),
    [
        (456.0, ('--stiffness "460 N/m..1000 N/m"', '--force "0.43 N"')),
        (1000.0, ('--stiffness "1000 N/m..1000 N/m"', '--force "0.2 N"')),
        (5000.0, ('--force "0.04 N"',)),
        (2e5, ()),
    ],
)
def test_a_range_within_reach_is_the_remedy_for_ways_that_leave_it(
    reach: float, expected: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remedies, "draw_presses", lambda _device, _poses, force, k: (force, k))
    monkeypatch.setattr(
        remedies, "share_within_reach", lambda found, _: 0.1 if found[1] >= reach * found[0] / 2 else 0.09
    )
    reason, found = most_reachable(asked(), np.zeros((40, 3)))
    assert reason.startswith("2 N on 100 N/m deflect it by 20 mm, and of the ways of this length from 40 poses hardly")
    assert found == expected
