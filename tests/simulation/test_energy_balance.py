"""Energy that the motors of an impedance display generate, and the loops that it keeps from being settled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate.scenario import Scenario
from palpate.simulation.decision import GENERATED, SWING, Evidence, decide
from palpate.simulation.energy_balance import EnergyBalance, energy_balance
from palpate.simulation.evidence import evidence
from palpate.simulation.recorded import external_forces
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window, windows

SCENARIOS = Path(__file__).parents[2] / "scenarios"
MASS, DAMPING = 0.05, 9.0  # kg, N*s/m of the operator's arm
SLIDER_FRICTION = 0.05  # N*s/m


def leaning(**changes: Any) -> dict[str, Any]:
    """Return the tables of an arm that leans with 3 N on a spring of 500 N/m, through a slider of 60 g."""
    arm = {"kind": "arm", "mass": f"{MASS} kg", "damping": f"{DAMPING} N*s/m", "stiffness": "200 N/m"}
    return {
        "device": {"name": "slider"},
        "start": {"pose": ["0 mm"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**arm, "shape": "step", "force": ["-3 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "500 N/m"},
        "run": {"duration": "20 s"},
        **changes,
    }


def assisting(tick: Any) -> np.ndarray:
    """Return the force of the object and 20 mN along the motion, which friction cannot bring to rest."""
    return np.asarray(-tick.object_force + 0.02 * np.tanh(tick.velocity / 1e-3))


def judged(trace: Trace) -> tuple[Scenario, Window, EnergyBalance | None]:
    scenario = Scenario.from_dict(trace.scenario)
    window = windows(external_forces(trace, scenario))[-1]
    return scenario, window, energy_balance(trace, scenario, window)


@pytest.fixture(scope="module")
def sustained() -> Trace:
    return palpate.simulate(leaning(), controller=assisting)


def state(found: Evidence) -> State:
    return State(int(decide(found)[0]))


def test_a_display_that_keeps_generating_energy_is_not_settled(sustained: Trace) -> None:
    """The oscillation is below the threshold of rest, but it lasts: without the energy the run would be settled."""
    scenario, window, _ = judged(sustained)
    found = evidence(sustained, scenario, window, None)
    assert 0.5 * SWING < found.swing[0] / found.deflection[0] < SWING
    assert state(replace(found, generated=np.full(1, np.nan))) is State.SETTLED
    assert found.generated[0] > GENERATED
    assert state(found) is sustained.verdict.state is State.UNDECIDED
    assert "its motors keep generating energy" in sustained.verdict.reason


def test_the_energy_generated_in_a_sustained_oscillation_is_that_dissipated(sustained: Trace) -> None:
    _, window, balance = judged(sustained)
    assert balance is not None
    velocity = sustained["velocity"][window.end - window.fifth : window.end, 0]
    dissipated = (DAMPING + SLIDER_FRICTION) * float(np.sum(velocity**2)) * 1e-3
    assert balance.generated == pytest.approx(dissipated, rel=5e-3)
    assert balance.generated_before == pytest.approx(balance.generated, rel=1e-3)


def test_the_energy_supplied_is_stored_in_the_springs_or_dissipated() -> None:
    """Until the tip first rests, a slow push supplies the energy of the object's spring."""
    tables = leaning(run={"duration": "4 s"})
    tables["operator"] |= {"shape": "ramp", "rise": "2 s"}
    trace = palpate.simulate(tables)
    _, _, balance = judged(trace)
    assert balance is not None
    assert balance.supplied == pytest.approx(0.5 * 500.0 * trace["deflection"][-1, 0] ** 2, rel=0.03)
    assert abs(balance.generated) < 1e-6 * balance.supplied
    assert trace.verdict.state is State.SETTLED


def test_the_energy_supplied_to_a_free_device_is_stored_in_it_or_dissipated_by_it() -> None:
    """The kinetic energy of the arm, five times as heavy as the device, is no part of it."""
    arm = {
        "kind": "arm",
        "mass": "0.3 kg",
        "damping": "6 N*s/m",
        "stiffness": "200 N/m",
        "force": ["-3 N", "0 N", "0 N"],
    }
    trace = palpate.simulate(leaning(operator=arm, object={"kind": "none"}, run={"duration": "0.5 s"}))
    _, _, balance = judged(trace)
    assert balance is not None
    lost = np.concatenate([[0.0], np.cumsum(SLIDER_FRICTION * trace["velocity"][1:, 0] ** 2) * 1e-3])
    assert balance.supplied == pytest.approx(float((trace["energy"][:, 0] + lost).max()), rel=1e-2)


@pytest.mark.parametrize("name", ["press-stiff-cube-lqg", "moving-surface"])
def test_no_energy_is_stated_where_motors_or_objects_supply_it_by_design(name: str) -> None:
    trace = palpate.simulate(SCENARIOS / f"{name}.toml")
    assert judged(trace)[2] is None
    assert palpate.summarize(trace)["energy"] is None
    assert trace.verdict.state is State.SETTLED


def test_the_energies_do_not_judge_a_loop_that_is_stable_or_within_two_encoder_counts() -> None:
    """Encoder counts sustain small motions in stable loops, which generate energy."""
    values: dict[str, Any] = dict.fromkeys(("early", "prior", "late"), 1e-5)
    values |= {"unstable_from": np.nan, "ripple": 5e-5, "deflection": 1e-2, "generated": 0.1, "generated_before": 0.1}
    assert state(Evidence.of(1, **values)) is State.UNDECIDED
    assert state(Evidence.of(1, **values, linear=1)) is State.SETTLED
    assert state(Evidence.of(1, **values, resolution=1e-4)) is State.SETTLED
    assert state(Evidence.of(1, **{**values, "generated_before": 0.2})) is State.SETTLED
    unstable = {**values, "late": 5e-6, "linear": -1, "lossy": True}
    assert state(Evidence.of(1, **unstable)) is State.UNSTABLE
    assert state(Evidence.of(1, **{**unstable, "generated": 0.0})) is State.UNDECIDED
