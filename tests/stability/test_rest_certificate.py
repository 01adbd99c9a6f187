"""Certificates where a run rests: the law of a virtual mass, and each verdict on given roots."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.verdict import State, Verdict
from palpate.stability import rest_certificate
from palpate.stability.rest_certificate import mass_law

T = 1e-3


@pytest.mark.parametrize(("stiffness", "damping"), [(800.0, 3.0), (500.0, 0.0), (0.0, 2.0)])
def test_a_virtual_mass_moves_as_the_force_of_its_spring_and_damper_says(stiffness: float, damping: float) -> None:
    """Semi-implicit Euler: v += T f / m, then p += T v; the speed of the tip is a backward difference."""
    mass, rng = 0.15, np.random.default_rng(0)
    law = mass_law({"mass": mass, "stiffness": stiffness, "damping": damping}, T)
    state, before, place, velocity = np.zeros(9), np.zeros(3), np.zeros(3), np.zeros(3)
    for x in rng.normal(size=(30, 3)):
        force = stiffness * (x - place) + damping * ((x - before) / T - velocity)
        np.testing.assert_allclose(law.C @ state + law.D @ x, force, rtol=1e-9, atol=1e-9)
        state = law.A @ state + law.B @ x
        velocity = velocity + T * force / mass
        place, before = place + T * velocity, x
        np.testing.assert_allclose(state, np.concatenate([before, place, velocity]), rtol=1e-9, atol=1e-12)


TABLES: dict[str, Any] = {
    "title": "a title", "device": {"name": "slider"}, "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]}, "object": {"kind": "spring", "stiffness": "9 N/m"},
}  # fmt: skip
RESTS = Verdict(State.SETTLED, "it rests")
DIVERGES = Verdict(State.UNSTABLE, "diverges at t = 0.5 s", 0.5)
SWINGS = Verdict(State.BOUNDED_OSCILLATION, "it swings", None)


@pytest.mark.parametrize(
    ("roots", "run", "state", "says", "radius"),
    [
        ([0.9, -0.95, 0.3j], RESTS, State.STABLE, "every small motion decays (spectral radius 0.95)", 0.95),
        ([0.9, 1.0 - 1.1e-6], RESTS, State.STABLE, "every small motion decays (spectral radius 0.999999)", 1 - 1.1e-6),
        ([0.9, 1.0 - 0.9e-6], RESTS, State.UNDECIDED,
         "nothing holds the tip or the mass in some direction; other motions decay (radius 0.9)", 0.9),
        ([0.9, np.exp(0.0125j), np.exp(-0.0125j)], RESTS, State.UNDECIDED, "nothing holds the tip", 0.9),
        ([0.9, 1.0000001 * np.exp(0.0126j)], RESTS, State.UNDECIDED, "a small motion grows", 1.0),
        ([0.9, np.exp(0.0125)], RESTS, State.UNDECIDED, "nothing holds the tip", 0.9),
        ([0.9, np.exp(0.0126)], RESTS, State.UNDECIDED,
         f"a small motion grows (spectral radius {np.exp(0.0126):.6g}), and the run is {RESTS}", np.exp(0.0126)),
        ([-1.2], DIVERGES, State.UNSTABLE,
         f"a small motion grows (spectral radius 1.2), and the run is {DIVERGES}", 1.2),
        ([-1.2], SWINGS, State.UNDECIDED, f"a small motion grows (spectral radius 1.2), and the run is {SWINGS}", 1.2),
        ([0.9], SWINGS, State.UNDECIDED, f"small motions decay, but the verdict of the run is {SWINGS}", 0.9),
        ([1.0], RESTS, State.UNDECIDED, "other motions decay (radius 0)", 0.0),
    ],
)  # fmt: skip
def test_a_certificate_follows_from_the_roots_that_do_not_drift_and_the_run(
    roots: list[complex], run: Verdict, state: State, says: str, radius: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Motions of a modulus of 1 or more below 2 Hz are drifts."""
    seen: dict[str, Any] = {}
    monkeypatch.setattr(rest_certificate, "scenario_loop", lambda s, **at: seen.update(at, object=s.object) or
                        SimpleNamespace(path="a path", directions="all"))  # fmt: skip
    monkeypatch.setattr(
        rest_certificate, "closed_matrix", lambda *given: seen.update(given=given) or np.diag(np.array(roots, complex))
    )
    names = ("angle", "command_force", "operator_force")
    columns = {name: np.arange(6.0).reshape(2, 3) + k for k, name in enumerate(names)}

    class Run(dict):  # type: ignore[type-arg]
        verdict = run

    scenario = Scenario.from_dict(TABLES)
    found = rest_certificate._certificate(scenario, Run(columns), "a law", "a detail")  # type: ignore[arg-type]
    assert (found.title, found.verdict.state) == ("a title", state)
    assert says in found.verdict.reason
    assert found.margin == {"spectral_radius_at_rest": pytest.approx(radius)}
    assert seen["given"] == ("a path", "a law", "all")
    assert (seen["object"].kind, seen["object"].stiffness) == ("spring", (1.0, 1.0, 1.0))
    for name, key in (("angle", "pose"), ("command_force", "tip_force"), ("operator_force", "operator_force")):
        np.testing.assert_array_equal(seen[key], columns[name][-1])
    assert found.assumptions[-1] == "Small motions about the place at which the run ends, with a detail."
    assert found.method[-1] == f"The scenario was simulated with the object itself: {run}."
    if state is State.UNSTABLE:
        assert found.counter_example is not None
        assert found.counter_example.scenario == scenario.to_dict()
        assert found.counter_example.sentence == "the scenario itself diverges at t = 0.5 s."
        assert found.counter_example.growth == np.inf
    else:
        assert found.counter_example is None


def test_a_controller_that_divides_by_the_stiffness_has_no_such_certificate() -> None:
    controller = {"kind": "lqg", "stiffness": "1 N/mm", "normalize": True}
    tables = {
        **TABLES,
        "servo": {"topology": "force_tracking"},
        "reference": {"force": "1 N"},
        "controller": controller,
    }
    del tables["operator"]
    with pytest.raises(StabilityError, match=r"controller\.normalize: it divides by the object's stiffness"):
        rest_certificate._certificate(Scenario.from_dict(tables), None, None, "")  # type: ignore[arg-type]
