"""Palpate's own slides, with the extensions that chapter 5 of the thesis proposes; `literal_slide` has the thesis's.

The extensions are lower tangential stiffness, a continuous force field, and a curved object. The reference force is
normal along Z. Along X and Y it equals the friction and drag of the surface at the desired speed, which moves the tip
without a hand ("forces"); the thesis has no drag. Without tangential stiffness there is no friction or drag, and no
force depends on the position or speed of the tip. A hand then moves the tip ("hand"): a spring whose rest position
moves along the path (the operator's force in X and Y over the hand's stiffness).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from palpate.control import Controller
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.scenario.operators import OPERATOR_STIFFNESS, default_operator
from palpate.simulation.simulator import build_simulation

from experiments.hosseini2004.cases import DESIGN_STIFFNESS, POSE, design
from experiments.hosseini2004.experimental import PERIOD

__all__ = [
    "FIELDS",
    "GROUNDS",
    "Field",
    "Ground",
    "Kind",
    "Pair",
    "pair",
    "pairs",
    "slide_controller",
    "slide_scenario",
]

Kind = Literal["lead_lag", "lqg", "lqg_normalized"]
Field = Literal["discrete", "continuous"]

FIELDS: Final[tuple[Field, Field]] = ("discrete", "continuous")
PAIR_STIFFNESSES: Final = (0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)  # N/mm
# The step that a crossing asks for lasts one tick. An integrator that follows the saturated drive within 10 ms would
# take it for a load, and then needs 0.4 s to forget it.
WINDUP_TIME: Final = 0.2  # s
DRAG: Final = 20.0  # N s/m, where forces alone move the tip
FRICTION: Final = 0.2  # static and dynamic, where there is a tangential stiffness to carry it
SPEED: Final = 60.0  # mm/s
PRESSED: Final = 0.1  # s until the press is reached
LED_FROM: Final = 0.4  # s
REST: Final = 1.2  # after the motion, s


@dataclass(frozen=True)
class Ground:
    """What the tip slides over, and how.

    Attributes:
        mesh: [object.mesh].
        position: of the mesh's origin from the start tip, mm: the way begins just above the surface.
        stiffness: of the stripes in turn, N/mm.
        width: of a stripe, mm.
        way: of the hand, x and y, mm.
        press: along -z, N.
    """

    mesh: dict[str, Any]
    position: tuple[float, float, float]
    stiffness: tuple[float, ...]
    width: float
    way: tuple[float, float]
    press: float


_CUBE: Final = {"shape": "box", "edge": "80 mm", "divisions": 16}
_ORGAN: Final = {"shape": "bumpy_ellipsoid", "size": ["90 mm", "70 mm", "50 mm"], "bump": 0.06, "divisions": 4}
GROUNDS: Final = {
    "cube, small steps": Ground(_CUBE, (30.0, 6.0, 0.0), (1.0, 1.2, 1.4), 10.0, (60.0, 12.0), 2.0),
    "cube, large steps": Ground(_CUBE, (30.0, 6.0, 0.0), (0.2, 3.5, 0.5, 2.0), 20.0, (60.0, 12.0), 1.0),
    "organ, small steps": Ground(_ORGAN, (15.0, 5.0, 2.9), (1.0, 1.2, 1.4), 10.0, (30.0, 10.0), 2.0),
    "organ, large steps": Ground(_ORGAN, (15.0, 5.0, 2.9), (0.2, 3.5, 0.5, 2.0), 15.0, (30.0, 10.0), 1.0),
}


def slide_scenario(
    ground: Ground,
    *,
    controller: Kind = "lead_lag",
    tangential: float = 1.0,
    field: Field = "discrete",
    led_by: Literal["hand", "forces"] = "hand",
    **options: Any,
) -> dict[str, Any]:
    """Return a slide as its file would have it.

    Args:
        ground: what is slid over.
        controller: designed for 1 N/mm, as for table 5.1: one design for every stiffness.
        tangential: stiffness between tip and proxy along the surface, N/mm; 0: none, and no friction.
        field: of the surface; on the organ the continuous one is shaded, so that the normal is continuous too.
        led_by: what moves the tip along the surface; forces alone need a tangential stiffness.
        options: of the controller.
    """
    drag = DRAG if led_by == "forces" else 0.0
    friction = FRICTION if tangential > 0.0 else 0.0
    length = float(np.hypot(*ground.way))
    end = LED_FROM + length / SPEED
    answer = friction * ground.press + drag * SPEED * 1e-3
    along_x, along_y = (answer * part / length for part in ground.way)
    still, led = _force(0.0, 0.0, -ground.press), _force(along_x, along_y, -ground.press)
    lead_x, lead_y = (OPERATOR_STIFFNESS * 1e-3 * part for part in ground.way)
    hand = default_operator(
        [
            [_time(0.0), *_force(0.0, 0.0, 0.0)],
            [_time(LED_FROM), *_force(0.0, 0.0, 0.0)],
            [_time(end), *_force(lead_x, lead_y, 0.0)],
        ]
    )
    return {
        "title": "A slide",
        "device": {"name": "phantom-premium-1.5a", "saturation": True},
        "start": {"pose": [f"{angle} rad" for angle in POSE]},
        "servo": {"period": f"{PERIOD * 1e3:g} ms", "topology": "force_tracking"},
        "reference": {
            "shape": "table",
            "table": [
                [_time(0.0), *_force(0.0, 0.0, 0.0)],
                [_time(PRESSED), *still],
                [_time(LED_FROM), *still],
                [_time(LED_FROM + 0.05), *led],
                [_time(end), *led],
                [_time(end + 0.05), *still],
            ],
        },
        **({"operator": hand} if led_by == "hand" else {}),
        "object": {
            "kind": "mesh",
            "position": [f"{part:g} mm" for part in ground.position],
            "mesh": dict(ground.mesh),
            "surface": {
                "stiffness": [f"{k:g} N/mm" for k in ground.stiffness],
                "pattern": "stripes",
                "width": f"{ground.width:g} mm",
                "tangential": f"{tangential:g} N/mm",
                "static_friction": friction,
                **({"viscous": f"{drag:g} N*s/m"} if drag else {}),
                "field": field,
                **(
                    {"shading": "30 deg"} if field == "continuous" and ground.mesh["shape"] == "bumpy_ellipsoid" else {}
                ),
            },
        },
        "controller": {
            "kind": "lead_lag" if controller == "lead_lag" else "lqg",
            "stiffness": "1 N/mm",
            **({"windup_time": f"{WINDUP_TIME:g} s"} if controller != "lead_lag" else {}),
            **({"normalize": True} if controller == "lqg_normalized" else {}),
            **options,
        },
        "run": {"duration": _time(end + REST)},
    }


def slide_controller(kind: Kind) -> Controller:
    """Return the controller that `slide_scenario` describes: one design serves every slide."""
    if kind == "lead_lag":
        return design("D", "lead_lag")
    lqg = design("D", "lqg", windup_time=WINDUP_TIME)
    return lqg.normalized(DESIGN_STIFFNESS["linear"]) if kind == "lqg_normalized" else lqg


def _time(seconds: float) -> str:
    return f"{seconds:.4g} s"


def _force(x: float, y: float, z: float) -> list[str]:
    return [f"{part:.4g} N" for part in (x, y, z)]


@dataclass(frozen=True)
class Pair:
    """A slide from a polygon of one stiffness to its neighbour of another, N/mm.

    Attributes:
        rests: the loop stayed bounded and came to rest in contact, its force steady to 1 %.
        arrived: it ended on the second stiffness.
    """

    first: float
    second: float
    rests: bool
    arrived: bool
    found: SlidingMetrics

    @property
    def stable(self) -> bool:
        """Whether the loop came to rest on the second stiffness."""
        return self.rests and self.arrived


def pair(first: float, second: float, controller: Controller, *, tangential: float, field: Field) -> Pair:
    """Slide 30 mm with 1 N from a stiffness to another one, N/mm."""
    ground = Ground(_CUBE, (15.0, 0.0, 0.0), (first, second), 40.0, (30.0, 0.0), 1.0)
    simulation = build_simulation(slide_scenario(ground, tangential=tangential, field=field), controller)
    trace = simulation.trace(*simulation.run())  # without the verdict, which needs a second run
    found = sliding_metrics(trace)
    if found is None:
        raise RuntimeError(f"the slide from {first:g} to {second:g} N/mm never touched")
    arrived = abs(trace["surface_stiffness"][-1, 0] - 1e3 * second) < 1e-6 * second
    return Pair(first, second, bool(trace.completed and found.settled), bool(arrived), found)


def pairs(
    controller: Controller,
    *,
    tangential: float,
    field: Field,
    stiffnesses: Sequence[float] = PAIR_STIFFNESSES,
) -> list[Pair]:
    """Slide over every ordered pair of different stiffnesses."""
    return [
        pair(a, b, controller, tangential=tangential, field=field) for a in stiffnesses for b in stiffnesses if a != b
    ]
