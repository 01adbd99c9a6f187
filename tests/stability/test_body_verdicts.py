"""A certificate on a body is stable only if every finding is, and each of its sentences appears where it applies."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from palpate.simulation.observed_run import ObservedRun
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import FAILED, OSCILLATES, State, Verdict
from palpate.stability.body.body_loop import BodyLoop
from palpate.stability.body.certificate import _Findings, _margins, _oscillates, _verdict
from palpate.stability.body.multirate_loop import MultirateLoop
from palpate.stability.contact_loop import ContactStability


def loop(*poles: complex) -> BodyLoop:
    """A closed loop with these eigenvalues around a body without stiffness."""
    blocks = [np.array([[p.real, p.imag], [-p.imag, p.real]]) if p.imag else np.array([[p.real]]) for p in poles]
    n = sum(len(one) for one in blocks)
    a, at = np.zeros((n, n)), 0
    for one in blocks:
        a[at : at + len(one), at : at + len(one)] = one
        at += len(one)
    path = control.StateSpace(a, np.ones((n, 1)), np.ones((1, n)), 0, 1e-3)
    body = control.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[0.0]], 1e-3)
    return BodyLoop(path, body, np.zeros((1, 1, 1)), np.eye(1), np.ones(1), np.zeros((1, 1)))


def contact(radius: float, doubt: float = 0.1, depth: float = 2e-3, margin: float = 3.0) -> ContactStability:
    stable = radius < 1.0
    criteria = {"eigenvalues": stable, "Nyquist": stable}
    around = loop(complex(0.0, radius))
    margin = margin if stable else float("nan")
    return ContactStability(np.array([0, 0, 1.0]), depth, 9, 500.0, 700.0, radius, criteria, doubt, margin, around)


def run(state: State = State.SETTLED, lasts: bool = True) -> ObservedRun:
    return ObservedRun(Trace(np.zeros(1), {}), 0, 0, Verdict(state, "seen"), 0.01, lasts, "It was run.")


def findings(
    rest: ContactStability | None, of: ObservedRun, *depths: ContactStability, untested: str = ""
) -> _Findings:
    return _Findings(rest, depths, untested, of)


STABLE, UNSTABLE, DOUBTFUL = contact(0.9), contact(1.1), contact(0.9, doubt=1.2)


def test_a_response_that_is_not_known_states_no_stiffness_and_no_margin() -> None:
    """Only where it leaves the verdict undecided."""
    assert set(_margins(findings(DOUBTFUL, run()))) == {"depth_m", "response_error_over_tolerable"}
    assert "stiffness" not in _verdict(findings(DOUBTFUL, run())).reason
    known = {"spectral_radius", "static_stiffness_N_per_m", "one_tick_stiffness_N_per_m"}
    assert known <= set(_margins(findings(STABLE, run()))) & set(_margins(findings(UNSTABLE, run())))


def test_the_loop_is_stable_if_and_only_if_every_finding_is() -> None:
    """Every state of the run, lasting or not, against each kind of contact at rest and at other depths."""
    for state in State:
        for lasts in (True, False):
            for rest in (STABLE, UNSTABLE, DOUBTFUL, None):
                for beside in ((), (STABLE,), (STABLE, UNSTABLE), (DOUBTFUL,)):
                    for untested in ("", "two of three"):
                        found = findings(rest, run(state, lasts), *beside, untested=untested)
                        verdict = _verdict(found)
                        good = rest is STABLE and state is State.SETTLED and lasts and not untested
                        good = good and all(one is STABLE for one in beside)
                        assert (verdict.state is State.STABLE) == good
                        # Without what shows the instability in the run, it is not told.
                        shown = state in OSCILLATES or (state in FAILED and not lasts)
                        assert (verdict.state is State.UNSTABLE) == (rest is UNSTABLE and shown)
                        assert verdict.reason


def test_the_factor_of_a_body_with_mass_scales_stiffness_and_mass() -> None:
    assert "may be 3 times as stiff and as heavy at every depth" in _verdict(findings(STABLE, run()), True).reason


def test_an_unstable_motion_that_only_slides_is_undecided() -> None:
    sliding = replace(UNSTABLE, loop=loop(1.01 + 0j, 0.3 + 0.4j))
    verdict = _verdict(findings(sliding, run(State.BOUNDED_OSCILLATION)))
    assert verdict.state is State.UNDECIDED
    assert "the tip slides" in verdict.reason
    assert _verdict(findings(sliding, run(State.BOUNDED_OSCILLATION, lasts=False))).state is State.UNSTABLE
    for poles, oscillates in (
        ((1.2 + 0j,), False), ((0.9 + 0.1j,), False), ((1.2 + 0j, 0.99 + 0.2j), True), ((-1.01 + 0j,), True),
    ):  # fmt: skip
        assert _oscillates(loop(*poles)) is oscillates


@pytest.mark.parametrize(
    ("found", "says"),
    [
        (findings(STABLE, run()), "may be 3 times as stiff at every depth"),
        (findings(replace(STABLE, stiffness_margin=np.inf), run()), "may be of any stiffness at every depth"),
        (findings(STABLE, run(), contact(0.5, margin=2.0)), "may be 2 times as stiff"),
        (findings(contact(0.9, margin=2.0), run(), contact(0.5, margin=2.5)), "may be 2 times as stiff"),
        (findings(STABLE, run()), "Small motions decay at 2 mm, where the body's stiffness is 0.5 N/mm"),
        (findings(UNSTABLE, run(State.UNSTABLE)), "small motions grow at 2 mm, where the body's stiffness is 0.5 N/mm"),
        (findings(STABLE, run(), untested="one failed"), "But one failed."),
        (
            findings(STABLE, run(), replace(UNSTABLE, depth=1e-3)),
            "But not at other depths of the run: 1 mm (unstable, spectral radius 1.1)",
        ),
        (
            findings(STABLE, run(), replace(UNSTABLE, depth=1e-3, stiffness_margin=2.0)),
            "may be 2 times as stiff at every depth tested before the loop oscillates. Small motions decay at 2 mm, "
            "where the body's stiffness is 0.5 N/mm (spectral radius 0.9). Held at 1 mm, the tip would slide across",
        ),
        (findings(DOUBTFUL, run()), "error of the body's response is 1.2 times what the loop tolerates"),
        (findings(replace(STABLE, criteria={"eigenvalues": True, "Nyquist": False}), run()), "the criteria disagree"),
        (findings(STABLE, run(lasts=False)), "But the run does not rest. It was run."),
        (findings(UNSTABLE, run(State.SETTLED)), "But the run does not show it. It was run."),
        (findings(None, run(), untested="no contact"), "no contact. It was run."),
    ],
)  # fmt: skip
def test_the_reason_says_what_was_found_and_nothing_else(found: _Findings, says: str) -> None:
    reason = _verdict(found).reason
    assert says in reason
    parts = {
        "of any stiffness": found.rest is not None and np.isinf(found.rest.stiffness_margin),
        "But one failed": bool(found.untested) and found.rest is not None,
        "not at other depths": any(not one.stable and np.isnan(one.stiffness_margin) for one in found.depths),
        "would slide": any(not one.stable and one.stiffness_margin > 0.0 for one in found.depths),
        "does not rest": not found.run.rests and found.rest is not None and found.rest.stable,
        "does not show it": found.rest is UNSTABLE and found.run.rests,
        "criteria disagree": found.rest is not None and len(set(found.rest.criteria.values())) > 1,
    }
    for part, applies in parts.items():
        assert (part in reason) == applies


def test_margins_are_those_of_the_contact_and_absent_where_there_are_none() -> None:
    assert _margins(findings(None, run())) == {}
    unstable = _margins(findings(UNSTABLE, run()))
    assert unstable == {
        "spectral_radius": 1.1, "depth_m": 2e-3, "static_stiffness_N_per_m": 500.0, "one_tick_stiffness_N_per_m": 700.0,
        "response_error_over_tolerable": 0.1,
    }  # fmt: skip
    stable = _margins(findings(STABLE, run()))
    assert stable["gain_margin"] == 3.0
    assert stable.keys() - unstable.keys() == {"gain_margin", "phase_margin_deg", "delay_margin_s", "disk_margin"}
    name = "least_gain_margin_of_depths"
    assert _margins(findings(STABLE, run(), contact(0.8, margin=5.0), contact(0.8, margin=4.0)))[name] == 4.0
    assert name not in _margins(findings(STABLE, run(), STABLE, UNSTABLE))
    assert _margins(findings(STABLE, run(), STABLE, replace(UNSTABLE, stiffness_margin=2.0)))[name] == 2.0
    one = STABLE.loop
    slow = MultirateLoop(one.path, np.zeros((1, 1)), np.zeros((2, 1, 1)), 2, np.eye(1), np.ones(1), np.zeros((1, 1)))
    assert _margins(findings(replace(STABLE, loop=slow), run())).keys() == unstable.keys() | {"gain_margin"}


def test_a_contact_is_undecided_if_criteria_disagree_or_the_error_may_matter() -> None:
    assert (STABLE.state, UNSTABLE.state) == (State.STABLE, State.UNSTABLE)
    assert STABLE.stable
    assert not UNSTABLE.stable
    assert STABLE.critical_stiffness == 1500.0
    for doubt, state in ((0.999, State.STABLE), (1.0, State.UNDECIDED), (np.nan, State.UNDECIDED)):
        assert replace(STABLE, doubt=doubt).state is state
    for radius, state in ((1.0 - 1e-8, State.STABLE), (1.0 - 1e-10, State.UNDECIDED), (1.0 + 1e-8, State.UNSTABLE)):
        assert contact(radius).state is state
