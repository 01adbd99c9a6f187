"""Closed-loop contact with blocks of 2 to 100 kPa: press, release in part, press again and slide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Final

from palpate.errors import ScenarioError
from palpate.metrics.body_contact import PalpationMetrics, palpation_metrics
from palpate.scenario import Scenario
from palpate.scenario.operators import OPERATOR_STIFFNESS, default_operator
from palpate.simulation.bodies import scenario_body
from palpate.simulation.simulator import simulate
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.stability import ContactStability, contact_stability
from palpate.units import to_si

__all__ = ["LAWS", "POSE", "YOUNG", "PressResult", "controller_of", "press_all", "press_scenario"]

YOUNG: Final = (2e3, 5e3, 10e3, 20e3, 50e3, 100e3)  # Pa
POSE: Final = ("0 rad", "2.2305 rad", "3.2776 rad")
PERIOD: Final = "1 ms"
DEPTH: Final = 1e-3  # intended depth, m
MAX_FORCE: Final = 1.2  # N; the continuous force of the drive is 1.4 N
SLIDE: Final = 10e-3  # m
# [controller] of each law; None is an impedance display without a controller.
LAWS: Final[dict[str, dict[str, Any] | None]] = {
    "impedance display": None,
    "lead–lag": {"kind": "lead_lag", "stiffness": "0.2 N/mm"},
    "LQG": {"kind": "lqg", "stiffness": "1 N/mm", "windup_time": "0.2 s"},
}
BLOCK: Final[dict[str, Any]] = {
    "shape": "block",
    "size": ["48 mm", "48 mm", "24 mm"],
    "young": "10 kPa",
    "spacing": "4 mm",
    "radius": "8 mm",
    "tip": "flat",
}
_BLOCK_YOUNG: Final = 10e3  # Pa


@dataclass(frozen=True)
class PressResult:
    """Run with one body and one law.

    Attributes:
        young: Young's modulus, Pa.
        law: key of `LAWS`.
        trace: the run.
        found: metrics of the run.
        contact: stability of the loop linearized at the equilibrium; None if the tip does not settle.
    """

    young: float
    law: str
    trace: Trace
    found: PalpationMetrics
    contact: ContactStability | None

    @property
    def stable(self) -> bool:
        """Whether the run is bounded, ends in contact with a steady force, and the linearized loop there is stable."""
        bounded = self.trace.verdict.state in (State.SETTLED, State.UNDECIDED)
        return bounded and self.found.settled and self.contact is not None and self.contact.stable

    @property
    def rests(self) -> bool:
        """Whether the tip comes to rest; under some controllers it slides on across the smooth top."""
        return self.trace.stable

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        contact = self.contact
        return {
            "law": self.law,
            "young_Pa": self.young,
            "stable": self.stable,
            "rests": self.rests,
            "contact_stiffness_N_per_m": None if contact is None else contact.static_stiffness,
            "critical_stiffness_N_per_m": None if contact is None else plain(contact.critical_stiffness),
            "spectral_radius": None if contact is None else contact.radius,
            **self.found.to_dict(),
        }


def plain(value: float) -> float | None:
    """Return a number for JSON: None if it is not finite."""
    return value if isfinite(value) else None


def controller_of(law: str) -> dict[str, Any]:
    """Return [controller] of a law. Raise ScenarioError if `LAWS` does not have it."""
    if law not in LAWS:
        raise ScenarioError(f'law: "{law}" is not one of {", ".join(LAWS)}')
    return dict(LAWS[law] or {"kind": "none"})


def press_scenario(
    young: float | str, law: str, stiffness: float | str, body: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the scenario of one run.

    Args:
        young: Young's modulus, Pa or text.
        law: key of `LAWS`.
        stiffness: expected contact stiffness, N/m or text, from which the force is computed.
        body: [object.body] of 10 kPa; None for the block.

    Raises:
        ScenarioError: the law is unknown, or a number is not positive or cannot be read.
    """
    controller, shown = controller_of(law), LAWS[law] is None
    modulus, expected = _positive(young, "Pa", "young"), _positive(stiffness, "N/m", "stiffness")
    press = min(expected * DEPTH, MAX_FORCE)
    if shown:  # the operator's spring is loaded as well
        press *= 1.0 + OPERATOR_STIFFNESS / expected
    lead = OPERATOR_STIFFNESS * SLIDE
    # time, fraction of the force, fraction of the slide
    course = (
        (0.0, 0, 0),
        (0.3, 1, 0),
        (0.7, 1, 0),
        (0.9, 0.3, 0),
        (1.1, 0.3, 0),
        (1.3, 1, 0),
        (1.5, 1, 0),
        (1.9, 1, 1),
    )
    pressed = [[f"{t:g} s", *_force(0.0, part * press)] for t, part, _ in course]
    led = [[f"{t:g} s", *_force(slide * lead, part * press if shown else 0.0)] for t, part, slide in course]
    return {
        "title": f"Body of {modulus / 1e3:g} kPa, {law}",
        "device": {"name": "phantom-premium-1.5a", "saturation": True},
        "start": {"pose": list(POSE)},
        "servo": {"period": PERIOD, "topology": "impedance_display" if shown else "force_tracking"},
        **({} if shown else {"reference": {"shape": "table", "table": pressed}}),
        "operator": default_operator(led),
        "object": {
            "kind": "body",
            "position": [f"{SLIDE / 2:g} m", "0 m", "-0.2 mm"],
            "body": {**(BLOCK if body is None else body), "stiffness_scale": modulus / _BLOCK_YOUNG},
        },
        "controller": controller,
        "run": {"duration": "4 s"},
    }


def _positive(value: float | str, unit: str, field: str) -> float:
    found = to_si(value, unit, field)
    if not 0.0 < found < inf:
        raise ScenarioError(f"{field}: {found:g} {unit} must be positive and finite")
    return found


def _force(x: float, z: float) -> list[str]:
    return [f"{x:.6g} N", "0 N", f"{-z:.6g} N"]


def press_all(
    young: Sequence[float | str] = YOUNG,
    laws: Sequence[str] = tuple(LAWS),
    *,
    body: dict[str, Any] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> list[PressResult]:
    """Run every law on a body of every Young's modulus.

    Args:
        young: Young's moduli, Pa or text.
        laws: keys of `LAWS`.
        body: [object.body] of 10 kPa; None for the block.
        progress: called with a description and the fraction done.

    Raises:
        ScenarioError: a law is unknown, or a modulus is not positive or cannot be read.
    """
    moduli = [_positive(modulus, "Pa", "young") for modulus in young]
    report = progress if progress is not None else (lambda _text, _fraction: None)
    report("building the block", 0.0)
    scenario = Scenario.from_dict(press_scenario(_BLOCK_YOUNG, "impedance display", 1.0, body))
    reference = scenario_body(scenario, report)
    low, high = reference.nodes.min(axis=0), reference.nodes.max(axis=0)
    radius = 8e-3
    stiffness = float(reference.indent((low + high) / 2.0, radius, DEPTH, tip="flat").force[2]) / DEPTH
    runs = []
    for index, (law, modulus) in enumerate((law, modulus) for law in laws for modulus in moduli):
        report(f"{modulus / 1e3:g} kPa, {law}", index / (len(moduli) * len(laws)))
        trace = simulate(press_scenario(modulus, law, stiffness * modulus / _BLOCK_YOUNG, body))
        found = palpation_metrics(trace)
        if found is None:
            raise RuntimeError(f"the tip has no contact with the body of {modulus:g} Pa")
        runs.append(PressResult(modulus, law, trace, found, contact_stability(trace) if found.settled else None))
    return runs
