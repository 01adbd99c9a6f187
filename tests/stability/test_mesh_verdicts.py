"""The verdict on a mesh by what its run, its modes and a push show: every case, and the sentence that says so."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State, Verdict
from palpate.stability import mesh_certificate as certificate
from palpate.stability.certificate import Certificate
from palpate.stability.contact_run import Observed, PushedRun
from palpate.stability.mesh_contact import MeshContact
from palpate.stability.mesh_sites import NEAR
from palpate.stability.mode_stability import Switching

T = 1e-3
SCENARIO = Scenario.from_dict(
    {
        "title": "Press",
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0 N", "-1 N"]},
        "object": {"kind": "mesh", "mesh": {"shape": "box", "edge": "80 mm", "divisions": 1},
                   "surface": {"stiffness": "300 N/m"}},
        "run": {"duration": "0.1 s"},
    }
)  # fmt: skip
EARLY, LAST = (SimpleNamespace(time=at, points=(1, 2), resolution=0.01) for at in (0.02, 0.1))
SETTLED = Verdict(State.SETTLED, "the tip rests")
TRACE = Trace.of(T * np.arange(101), {"touching": np.ones(101), "object_force": np.tile([0.0, 0.0, 2.0], (101, 1))})
OFF = Trace.of(T * np.arange(101), {"touching": np.r_[np.ones(100), 0.0], "object_force": np.zeros((101, 3))})


def mode(radius: float, site: Any = LAST, name: str = "on its face", **values: Any) -> Any:
    given = {"angle": 0.2, "drift": 0.0, "slides_away": False, "radius": radius, "stable": radius < 1.0, "site": site}
    return SimpleNamespace(mode=SimpleNamespace(name=name, kind="slide"), **{**given, **values})


def contact(*found: Any, run: Verdict = SETTLED, constant: bool = True, trace: Trace = TRACE) -> MeshContact:
    """A contact that rests in the first of some modes."""
    return MeshContact(SCENARIO, Observed(trace, 100, constant, run), (EARLY, LAST), found, found[0])  # type: ignore[arg-type]


def certify(
    monkeypatch: pytest.MonkeyPatch,
    given: MeshContact,
    pushed: Verdict = SETTLED,
    kept: float = 0.1,
    slide: float = 0.0,
    agree: bool = True,
    keeps: float = 0.0,
    decided: bool = True,
) -> Certificate:
    """The certificate of a contact, with the outcome of a push and the disturbance that keeps its mode, N."""
    push = PushedRun(0.02, 0.5, kept, slide, pushed, TRACE)
    monkeypatch.setattr(certificate, "run_pushed", lambda *_: push)
    monkeypatch.setattr(certificate, "_criteria", lambda *_: ({"eigenvalues": given.worst.stable}, agree))
    monkeypatch.setattr(certificate, "largest_disturbance", lambda *_: keeps)
    monkeypatch.setattr(certificate, "_switching", lambda *_: ("an order", decided))
    monkeypatch.setattr(certificate, "gain_margin", lambda modes: (1.5 + len(modes), modes[0]))
    found: Certificate = certificate._certify(given)
    assert found.title == "Press"
    assert found.scenario == SCENARIO.to_dict()
    assert found.margin.get("spectral_radius") == (given.resting.radius if agree else None)
    return found


def test_a_mesh_is_stable_with_the_margin_of_its_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    found = certify(monkeypatch, contact(mode(0.9), mode(0.95, EARLY)))
    assert found.verdict.state is State.STABLE
    assert found.claim == (
        "Stable: each of 2 contact modes (slide) along the run is stable, with forces of the surface up to 3.5 times "
        "as large at the same depths (then unstable on its face); an order."
    )
    assert found.margin["gain_margin"] == 3.5
    assert found.margin["gain_margin_at_rest"] == 2.5
    assert found.margin["spectral_radius_worst_mode"] == 0.95
    assert "drift_doubling_time_s" not in found.margin
    assert certify(monkeypatch, contact(mode(0.9)), decided=False).verdict.state is State.UNDECIDED
    some = certify(monkeypatch, contact(mode(0.9), mode(1.1), mode(1.2, EARLY, "off")), keeps=1.0)
    assert some.verdict.state is State.STABLE
    assert "1 of 2 contact modes (slide) where the run rests are stable" in some.claim
    assert some.claim.endswith(
        "Before it rests, small motions grow off, at the pose at t = 0.02 s (spectral radius 1.2)."
    )
    drifting = certify(monkeypatch, contact(mode(0.9), mode(0.8, drift=1.002)))
    assert 1.002 ** (drifting.margin["drift_doubling_time_s"] / T) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("given", "options", "state", "says"),
    [
        (contact(mode(0.9), mode(1.1, EARLY, "off")), {"agree": False}, State.UNDECIDED,
         "a mode is so near its limit (off) that the criteria disagree."),
        (contact(mode(0.9, drift=1.0)), {}, State.UNDECIDED,
         "every contact mode is stable, but on its face nothing holds the tip along the surface"),
        (contact(mode(0.9), trace=OFF), {}, State.UNDECIDED,
         "every contact mode is stable, but at its end the tip is off the mesh"),
        (contact(mode(0.9)), {"pushed": Verdict(State.UNSTABLE, "it grows")}, State.UNDECIDED,
         "but after a push of 0.02 N the verdict of the run is unstable: it grows."),
        (contact(mode(0.9)), {"slide": 0.9e-4}, State.STABLE, "an order"),
        (contact(mode(0.9)), {"slide": 2e-4}, State.UNDECIDED,
         "but after a push of 0.02 N the run slides on at 0.2 mm/s under constant forces."),
        (contact(mode(0.9), run=Verdict(State.DRIVE_LIMIT, "it is warm")), {}, State.UNDECIDED,
         "every contact mode is stable, but the verdict of the run is drive limit exceeded: it is warm."),
        (contact(mode(0.9), run=Verdict(State.DRIVE_LIMIT, "it is warm"), constant=False), {}, State.STABLE, "order"),
        (contact(mode(0.9), mode(1.1, EARLY, "off"), run=Verdict(State.CONTACT_LOST, "it left"), trace=OFF), {},
         State.UNSTABLE, "small motions grow off, at the pose at t = 0.02 s (spectral radius 1.1), and the verdict of "
         "the run is contact lost: it left."),
        (contact(mode(0.9), mode(0.95, EARLY), run=Verdict(State.CONTACT_LOST, "it left"), trace=OFF), {},
         State.UNDECIDED, "at its end the tip is off the mesh"),
        (contact(mode(0.9), mode(1.1, name="off")), {"keeps": 0.099}, State.UNDECIDED,
         "stable where the run rests, but unstable off, at the pose at t = 0.1 s (spectral radius 1.1); it is not "
         "proven that the contact keeps its mode under disturbances of 5% of its force."),
        (contact(mode(0.9), mode(1.1, name="off")), {"keeps": 0.101}, State.STABLE, "1 of 2"),
        (contact(mode(0.9), mode(1.1, EARLY)), {}, State.STABLE, "each of 1 contact modes (slide) where the run rests"),
        (contact(mode(1.1)), {}, State.UNDECIDED,
         "but the run does not show it; its verdict after a push is settled: the tip rests."),
        (contact(mode(1.1)), {"kept": 3.0}, State.UNSTABLE,
         "the response of the run to a push grows by a factor of 3."),
        (contact(mode(1.1), run=Verdict(State.CONTACT_LOST, "it left")), {"kept": 3.0}, State.UNSTABLE,
         "the verdict of the run is contact lost: it left."),
        (contact(mode(1.1)), {"pushed": Verdict(State.UNSTABLE, "it grows")}, State.UNSTABLE,
         "the verdict of the run is unstable: it grows."),
    ],
)  # fmt: skip
def test_a_mesh_is_judged_by_its_run_its_modes_and_a_push(
    given: MeshContact, options: dict[str, Any], state: State, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = certify(monkeypatch, given, **options)
    assert found.verdict.state is state
    assert says in found.claim
    lost = given.observed.verdict.state is State.CONTACT_LOST and state is State.UNSTABLE
    assert (found.counter_example is not None) is (lost and given.resting.stable)
    if given.resting.radius > 1.0:
        assert 1.1 ** (found.margin["doubling_time_s"] / T) == pytest.approx(2.0)
        assert found.margin["frequency_Hz"] == pytest.approx(0.2 / (2.0 * np.pi * T))
        oscillation = f"on its face, an oscillation at {found.margin['frequency_Hz']:.4g} Hz doubles every "
        assert f"{oscillation}{found.margin['doubling_time_s']:.3g} s" in found.claim


@pytest.mark.parametrize(
    ("found", "why"),
    [
        ((0.9, 0.95), "although every contact mode by itself is stable."),
        ((0.9, 1.1), "and the loop is unstable off."),
        ((1.2, 1.1), "and 2 of 3 contact modes are unstable."),
    ],
)
def test_a_run_that_fails_is_its_own_counter_example_and_counts_the_unstable_modes(
    found: tuple[float, float], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = Verdict(State.BOUNDED_OSCILLATION, "it oscillates")
    given = contact(mode(found[0]), mode(found[1], EARLY, "off"), mode(0.1), run=failed)
    got = certify(monkeypatch, given)
    assert got.verdict.state is State.UNSTABLE
    assert got.claim == f"Unstable: the verdict of the run is bounded oscillation: it oscillates, {why}"
    assert got.counter_example is not None
    assert got.counter_example.sentence == "the scenario itself, bounded oscillation: it oscillates."
    assert got.counter_example.growth == math.inf


@pytest.mark.parametrize(("radius", "near"), [(0.9994, False), (0.9996, True)])
def test_a_run_that_may_yet_decay_is_undecided(radius: float, near: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Above a spectral radius of 0.9995, if the run with that linear loop would not oscillate."""
    failed = Verdict(State.BOUNDED_OSCILLATION, "it oscillates")
    monkeypatch.setattr(certificate, "judge", lambda trace, r: SETTLED if r == radius and trace is TRACE else failed)
    unstable = certify(monkeypatch, contact(mode(radius), mode(1.1, EARLY), run=failed))
    assert unstable.verdict.state is (State.UNDECIDED if near else State.UNSTABLE)
    assert ("stable where it rests, but so near its limit" in unstable.claim) is near
    slow = certify(monkeypatch, contact(mode(radius), run=failed))
    assert slow.verdict.state is (State.UNDECIDED if near else State.UNSTABLE)  # the run is in FAILED
    monkeypatch.setattr(certificate, "judge", lambda *_: failed)
    assert certify(monkeypatch, contact(mode(radius), run=failed)).verdict.state is State.UNSTABLE


@pytest.mark.parametrize("constant", [True, False])
@pytest.mark.parametrize("reason", ["", "it slides for ever."])
def test_an_undecided_run_goes_on_once_and_is_unstable_if_it_cannot_rest(
    constant: bool, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[float | None] = []
    given = contact(mode(0.9), constant=constant)
    undecided = certify(monkeypatch, given, agree=False)

    def mesh_contact(s: Scenario, hold: float | None = None) -> MeshContact:
        assert s is SCENARIO
        ran.append(hold)
        return given

    monkeypatch.setattr(certificate, "mesh_contact", mesh_contact)
    monkeypatch.setattr(certificate, "_certify", lambda of: undecided if of is given else None)
    monkeypatch.setattr(certificate, "no_rest", lambda of: reason if of is given else "?")
    found = certificate.certify_mesh(SCENARIO)
    assert ran == ([None, certificate._hold(given)] if constant else [None])
    assert found.verdict.state is (State.UNSTABLE if constant and reason else State.UNDECIDED)
    if constant and reason:
        assert found.verdict.reason == reason


def test_the_method_says_what_was_tested_and_how_the_run_answered() -> None:
    given = contact(mode(0.9), mode(0.8, EARLY), mode(0.7))
    said = " ".join(certificate._method(given))
    assert "at 2 poses of the run (t = 0.02, 0.1 s), and sampled exactly for forces held over 1 ms." in said
    assert f"3 in all, on 4 pairs of a normal (within {math.degrees(0.01):.2g} degrees) and a stiffness." in said
    assert "The scenario was run for 0.1 s; its verdict is settled: the tip rests." in said
    push = PushedRun(0.02, 0.5, 0.034, 0.0, SETTLED, TRACE)
    assert certificate._push_sentence(push).endswith("is settled: the tip rests. It kept 3.4 % of its response.")
    ended = PushedRun(0.02, 0.5, math.inf, 0.0, SETTLED, TRACE)
    assert certificate._push_sentence(ended).endswith("is settled: the tip rests.")
    common = [SimpleNamespace(proof="common", decrease=one, site=LAST) for one in (0.03, 0.02)]
    assert "decreases by at least 0.02 of its value" in certificate._switching_method(common)  # type: ignore[arg-type]
    apart: Any = [common[0], SimpleNamespace(proof="dwell", decrease=0.0, site=EARLY)]
    assert "At t = 0.1, 0.02 s no common Lyapunov matrix" in certificate._switching_method(apart)


def test_the_assumptions_name_what_the_surface_has() -> None:
    def said(surface: dict[str, Any], radius: str = "0 mm", *found: Any) -> str:
        tables = SCENARIO.to_dict()
        tables["object"] = {
            "kind": "mesh", "mesh": {"shape": "box", "edge": "80 mm", "divisions": 1, "radius": radius},
            "surface": {"stiffness": "300 N/m", **surface},
        }  # fmt: skip
        given = MeshContact(Scenario.from_dict(tables), None, (EARLY, LAST), found, None)  # type: ignore[arg-type]
        return " ".join(certificate._assumptions(given))

    plain = said({})
    assert f"within {1e3 * NEAR:g} mm of the path of this run" in plain
    assert "place where this run rests" in said({}, "0 mm", mode(1.1, EARLY))
    for surface, radius, word in (
        ({"static_friction": 0.5, "dynamic_friction": 0.3}, "0 mm", "stick and slip"),
        ({"shading": "20 deg"}, "0 mm", "neglects shading"),
        ({}, "2 mm", "A sphere is tested on the faces"),
    ):
        assert word not in plain
        assert word in said(surface, radius)
    assert "stick and slip" not in said({"static_friction": 0.5, "dynamic_friction": 0.5})


@pytest.mark.parametrize("away", [True, False])
def test_what_is_proven_of_switching_is_part_of_the_claim(away: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    states = SimpleNamespace(nstates=14)
    point = SimpleNamespace(rubs=True, friction=0.5)
    first, middle, last = (SimpleNamespace(time=0.1 * k, path=states, points=(point,), point=point) for k in range(3))
    force, push = TRACE["object_force"], PushedRun(0.02, 0.5, 0.1, 0.0, SETTLED, TRACE)
    assert np.linalg.norm(force[100]) == 2.0
    disturbance, asked, proof = 0.5, [], "common"

    def site_switching(site: Any) -> Switching:
        asked.append(site)
        return SimpleNamespace(proof=proof, separates=True, site=site, decrease=0.1, dwell=40, pair=("a", "b"))  # type: ignore[return-value]

    monkeypatch.setattr(certificate, "site_switching", site_switching)
    monkeypatch.setattr(certificate, "largest_disturbance", lambda site, _: disturbance if site is last else None)

    def switching(*found: Any) -> tuple[str, bool, dict[str, float]]:
        given = MeshContact(SCENARIO, Observed(TRACE, 100, True, SETTLED), (first, middle, last), found, found[0])  # type: ignore[arg-type]
        margin: dict[str, float] = {}
        asked.clear()
        return (*certificate._switching(given, push, away, margin, []), margin)

    keeps = "disturbances of the contact's force up to 0.5 N (25 %) leave the proxy sticking, so no mode changes"
    assert switching(mode(0.9, last)) == (
        "motions stay bounded in any order of the modes, and if contact is lost", True, {},
    )  # fmt: skip
    assert asked == ([last] if away else [first, middle, last])
    states.nstates = 15
    switching(mode(0.9, last))
    assert asked == [last]
    proof = "dwell"
    said, decided, margin = switching(mode(0.9, last))
    assert (decided, margin) == (True, {"dwell_time_s": pytest.approx(0.04)})
    assert said == "motions stay bounded if a mode lasts 0.04 s on average (worst between a and b)"
    proof = "undecided"
    said, decided, margin = switching(mode(0.9, last))
    assert said == f"{keeps}; beyond it their switching is undecided, because friction on a has no Lyapunov function"
    assert (decided, margin) == (True, {"disturbance_that_keeps_mode_N": 0.5})
    beside, slides = mode(1.1, last, "off"), mode(1.2, last, "away", slides_away=True)
    said, decided, margin = switching(mode(0.9, last), beside, slides)
    assert said == f"{keeps}; beyond it motions may grow away, and double in {math.log(2) / math.log(1.2) * T:.3g} s"
    assert (decided, margin) == (True, {"disturbance_that_keeps_mode_N": 0.5})
    assert "beyond it the tip may slide away, its speed doubles in 0.0038 s" in switching(mode(0.9, last), slides)[0]
    point.friction = 0.0
    assert "leave the proxy on its face, so" in switching(mode(0.9, last), slides)[0]
    disturbance = 0.9e-3 * 2.0
    assert switching(mode(0.9, last))[1] is False
    disturbance = 1.1e-3 * 2.0
    assert switching(mode(0.9, last))[1] is True
