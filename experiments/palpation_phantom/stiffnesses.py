"""Press, hold, release in part, press again and slide on a block of 2 to 100 kPa, to see every loop come to rest."""

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
from palpate.stability import ContactStability, contact_stability
from palpate.units import to_si

__all__ = ["LAWS", "POSE", "YOUNG", "PressResult", "controller_of", "press_all", "press_scenario"]

YOUNG: Final = (2e3, 5e3, 10e3, 20e3, 50e3, 100e3)  # Pa
POSE: Final = ("0 rad", "2.2305 rad", "3.2776 rad")
PERIOD: Final = "1 ms"
DEPTH: Final = 1e-3  # m that the press is for
MOST: Final = 1.2  # N: the drive holds 1.4 N for long
SLIDE: Final = 10e-3  # m
# What the loop does with the body's force: [controller]; None: an impedance display that shows it as it is.
LAWS: Final[dict[str, dict[str, Any] | None]] = {
    "shown as it is": None,
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
    """One body under one law.

    Attributes:
        young: Pa.
        law: of `LAWS`.
        trace, found: the run, and what it shows.
        contact: the loop about where the tip rests; None if it does not rest there.
    """

    young: float
    law: str
    trace: Trace
    found: PalpationMetrics
    contact: ContactStability | None

    @property
    def stable(self) -> bool:
        """Whether the run stayed bounded and came to rest in contact, and its linear loop there is stable."""
        return self.trace.stable and self.found.settled and self.contact is not None and self.contact.stable

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        contact = self.contact
        return {
            "law": self.law,
            "young_Pa": self.young,
            "stable": self.stable,
            "contact_stiffness_N_per_m": None if contact is None else contact.stiffness,
            "critical_stiffness_N_per_m": None if contact is None else plain(contact.critical_stiffness),
            "spectral_radius": None if contact is None else contact.radius,
            **self.found.to_dict(),
        }


def plain(value: float) -> float | None:
    """Return a number as JSON holds it: None for what is not finite."""
    return value if isfinite(value) else None


def controller_of(law: str) -> dict[str, Any]:
    """Return [controller] of one of `LAWS`, or raise ScenarioError."""
    if law not in LAWS:
        raise ScenarioError(f'law: "{law}" is not one of {", ".join(LAWS)}')
    return dict(LAWS[law] or {"kind": "none"})


def press_scenario(
    young: float | str, law: str, stiffness: float | str, body: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return one run as its file would have it.

    Args:
        young: Young's modulus, Pa or text.
        law: of `LAWS`.
        stiffness: of the contact as the press expects it, N/m or text.
        body: [object.body] of 10 kPa; the block if not given.

    Raises:
        ScenarioError: the law is unknown, or a number is not positive or cannot be read.
    """
    controller, shown = controller_of(law), LAWS[law] is None
    modulus, expected = _positive(young, "Pa", "young"), _positive(stiffness, "N/m", "stiffness")
    press = min(expected * DEPTH, MOST)
    if shown:  # the hand's own spring is pressed, too
        press *= 1.0 + OPERATOR_STIFFNESS / expected
    lead = OPERATOR_STIFFNESS * SLIDE
    # time, part of the press, part of the slide
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
    led = [[f"{t:g} s", *_force(way * lead, part * press if shown else 0.0)] for t, part, way in course]
    return {
        "title": f"A body of {modulus / 1e3:g} kPa, {law}",
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
    """Run every law on a body of every Young's modulus, Pa or text; `progress` is told what, and the share done."""
    moduli = [_positive(modulus, "Pa", "young") for modulus in young]
    tell = progress if progress is not None else (lambda _text, _share: None)
    tell("making the block", 0.0)
    ten = scenario_body(Scenario.from_dict(press_scenario(_BLOCK_YOUNG, "shown as it is", 1.0, body)), tell)
    low, high = ten.nodes.min(axis=0), ten.nodes.max(axis=0)
    radius = 8e-3
    stiffness = float(ten.indent((low + high) / 2.0, radius, DEPTH, tip="flat").force[2]) / DEPTH
    runs = []
    for number, (law, modulus) in enumerate((law, modulus) for law in laws for modulus in moduli):
        tell(f"{modulus / 1e3:g} kPa, {law}", number / (len(moduli) * len(laws)))
        trace = simulate(press_scenario(modulus, law, stiffness * modulus / _BLOCK_YOUNG, body))
        found = palpation_metrics(trace)
        if found is None:
            raise RuntimeError(f"the tip never touched the body of {modulus:g} Pa")
        runs.append(PressResult(modulus, law, trace, found, contact_stability(trace) if found.settled else None))
    return runs
