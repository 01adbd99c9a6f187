"""The slide of chapter 5 as described there: stiffness by the polygon at the tip, and a tangential spring.

Section 5.3.1 gives each polygon of a cube's side a normal stiffness. It sets a tangential stiffness of 1 N/mm "in any
direction on the surface". Section 5.2 starts the tip on the surface and moves it by the applied forces alone. There is
no friction and no drag. The scan lacks figures 5.5 and 5.8 with the stiffnesses and the forces: these are palpate's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from palpate import Trace, simulate
from palpate.arrays import Array
from palpate.devices import load
from palpate.simulation import ContactResult

from experiments.hosseini2004.cases import POSE, Tracking
from experiments.hosseini2004.experimental import PERIOD

__all__ = ["STEPS", "TANGENTIAL", "LiteralCube", "LiteralSlide", "slide"]

DEVICE: Final = "phantom-premium-1.5a"
TANGENTIAL: Final = 1000.0  # N/m, section 5.3.1
STEPS: Final = {"small": (1.0, 1.2, 1.4), "large": (0.2, 3.5, 0.5, 2.0)}  # N/mm, as in palpate's other slides
WIDTH: Final = 1.5e-3  # m, of a polygon along x: five crossings in 8.5 mm
ALONG: Final = (8.5, 4.0)  # N along x and y at the end: 8.5 N is the device's maximum, and moves the tip 8.5 mm
PRESSED, LED_FROM, LED_TO, END = 0.1, 0.4, 2.4, 3.2  # s


class LiteralCube:
    """Side z = 0 of a cube, in the frame of the start tip: stripes of stiffness, and a spring along the surface.

    The tip touches while its z is positive. The normal force is the stiffness of the polygon at the tip times z. The
    tangential force is 1 N/mm times the distance along the surface from the first contact point.

    Attributes:
        stiffness: of the stripes along x in turn, N/m.
        width: of a stripe, m.
        origin: start tip (3,), m, in the device's frame.
    """

    def __init__(self, stiffness: ArrayLike, width: float, origin: ArrayLike) -> None:
        self.stiffness = np.asarray(stiffness, dtype=float)
        self.width = width
        self.origin = np.asarray(origin, dtype=float)
        self.reset()

    def reset(self) -> None:
        """Forget the first contact point."""
        self._first: Array | None = None

    def normal_stiffness(self, x: float) -> float:
        """Return the stiffness, N/m, of the polygon at x, m, from the start."""
        return float(self.stiffness[int(np.floor(x / self.width)) % len(self.stiffness)])

    def step(self, tip: Any) -> ContactResult:
        """Return the contact at one sample."""
        place = np.asarray(tip.position, dtype=float) - self.origin
        depth = float(place[2])
        if depth <= 0.0:
            self._first = None
            return ContactResult(np.zeros(3), touching=False)
        if self._first is None:
            self._first = place[:2].copy()
        along = place[:2] - self._first
        k = self.normal_stiffness(float(place[0]))
        force = np.array([TANGENTIAL * along[0], TANGENTIAL * along[1], k * depth])
        return ContactResult(force, np.array([along[0], along[1], depth]), (0.0, 0.0, -1.0), depth, k, True)


@dataclass(frozen=True)
class LiteralSlide:
    """A run, from the first contact on.

    Attributes:
        press: reference force along z, N.
        trace: of the run.
        place: tip (n, 3), mm, from the start.
        stiffness: under the tip (n,), N/mm; nan where the tip is apart.
        apart: ticks apart after the first contact.
        step: largest change of the object force between two samples, N.
        error: of the deflection along z at the end against F/K, %.
    """

    press: float
    trace: Trace
    place: Array
    stiffness: Array
    apart: int
    step: float
    error: float

    @property
    def stays(self) -> bool:
        """Whether the loop stayed bounded and the tip in contact at every sample."""
        return bool(self.trace.completed and self.apart == 0)

    @property
    def way(self) -> Array:
        """Way (2,) along x and y at the end, mm."""
        return np.asarray(self.place[-1, :2], dtype=float)


def slide(controller: Tracking, steps: str, press: float) -> LiteralSlide:
    """Run the slide with "small" or "large" steps of stiffness, pressed by `press`, N."""
    origin = load(DEVICE).forward(np.array(POSE))
    cube = LiteralCube(1e3 * np.array(STEPS[steps]), WIDTH, origin)
    trace = simulate(_scenario(press), controller, cube)
    place = trace["tip"] - cube.origin
    touching = trace["touching"][:, 0] > 0.0
    first = int(np.argmax(touching))
    stiffness = np.where(touching, [1e-3 * cube.normal_stiffness(x) for x in place[:, 0]], np.nan)
    force = trace["object_force"]
    end = float(stiffness[-1]) if touching[-1] else float("nan")
    error = 100 * (1e3 * float(place[-1, 2]) * end / press - 1)
    steps_of_force = np.abs(np.diff(force[first:], axis=0))
    return LiteralSlide(press, trace, 1e3 * place, stiffness, int((~touching[first:]).sum()),
                        float(steps_of_force.max()), error)  # fmt: skip


def _scenario(press: float) -> dict[str, Any]:
    x, y = ALONG
    rows = [(0.0, 0.0, 0.0, 0.0), (PRESSED, 0.0, 0.0, press), (LED_FROM, 0.0, 0.0, press), (LED_TO, x, y, press),
            (END, x, y, press)]  # fmt: skip
    return {
        "title": "The slide of chapter 5 as described",
        "device": {"name": DEVICE},
        "start": {"pose": [f"{angle} rad" for angle in POSE]},
        "servo": {"period": f"{PERIOD * 1e3:g} ms", "topology": "force_tracking"},
        "reference": {"shape": "table", "table": [[f"{t:g} s", *(f"{f:g} N" for f in forces)] for t, *forces in rows]},
        "object": {"kind": "none"},
        "run": {"duration": f"{END} s"},
    }
