"""Impedance display: the operator applies the force, and the device renders the object."""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from palpate import simulate
from palpate.control import Controller
from palpate.report import Page

from experiments.hosseini2004.cases import design
from experiments.hosseini2004.loops import FORCES, STIFFNESSES, Loop, loop_of, scenario

__all__ = ["display", "other_topology"]

DAMPING: Final = 20.0  # N*s/m of the displayed object; without any the sampled display of 3.5 N/mm diverges
DURATION: Final = 0.8  # s


def display(
    force: float,
    stiffness: float,
    *,
    controller: Controller | None = None,
    damping: float = DAMPING,
    model: Literal["nonlinear", "linear"] = "nonlinear",
    duration: float = DURATION,
) -> Loop:
    """Push the tip with a step of force while the device displays a cube; N, N/mm, N*s/m, s.

    Without a controller the device answers with the cube's force as it is: torque -J^T F_object.
    """
    tables: dict[str, Any] = scenario(force, stiffness, model, "nonlinear", duration)
    tables["servo"]["topology"] = "impedance_display"
    tables["operator"] = {"kind": "force", **tables.pop("reference")}
    tables["object"]["damping"] = f"{damping} N*s/m"
    return loop_of(simulate(tables, controller), force, stiffness)


def other_topology(page: Page) -> None:
    """Write the subsection on the impedance display."""
    page.subsection("The other topology: an impedance display")
    page.paragraph(
        "In the thesis's loop the operator's force enters as a reference, and a controller makes the arm press so. "
        "In a real display the operator pushes the tip, and the device answers with −Jᵀ C(z) F_object. The object's "
        f"force as it is, C = 1, needs a damper to survive sampling at 0.5 ms: {DAMPING:g} N·s/m here. The error that "
        "remains is the stiffness of gravity, which a constant hold balances only where the arm started."
    )
    rows = []
    for force in FORCES:
        for stiffness in STIFFNESSES:
            loop, linear = display(force, stiffness), display(force, stiffness, model="linear")
            rows.append((f"{force:g}", f"{stiffness:g}", f"{loop.ideal:.4f}", *(f"{d:.4f}" for d in loop.steady),
                         _worst(loop), f"{loop.overshoot:.1f}", _ms(loop), _worst(linear), _ms(linear)))  # fmt: skip
    page.table(
        ["force", "stiffness", "F/K", "x", "y", "z", "error", "overshoot", "settling", "linear: error", "settling"],
        rows,
        "The object's force as it is, on the nonlinear and on the linearized arm: the worst of the three axes.",
        units=["N", "N/mm", "mm", "mm", "mm", "mm", "%", "%", "ms", "%", "ms"],
    )
    bare = display(8.5, 3.5, damping=0.0)
    end = "diverges" if bare.diverged is None else f"diverges, gone at {bare.diverged:.2f} s"
    rows = []
    for name, kind in (("lead–lag", "lead_lag"), ("LQG with integrators", "lqg")):
        loop = display(8.5, 3.5, controller=design("D", kind), damping=0.0, duration=2.0)  # type: ignore[arg-type]
        deflections = [f"{8.5 / d:.2f}" if abs(d) > 1e-6 else "rigid" for d in loop.steady]
        rows.append((name, *deflections, "stable" if loop.diverged is None else "unstable"))
    page.table(
        ["controller", "x", "y", "z", "loop"],
        rows,
        "What 3.5 N/mm feels like, 8.5 N over the deflection, when a controller made for tracking stands in a display. "
        f"Without controller and damper the loop {end}. A tracking controller multiplies what it is given, an "
        "integrator without bound: it belongs into the thesis's topology, not into a display.",
        units=["", "N/mm", "N/mm", "N/mm", ""],
    )


def _worst(loop: Loop) -> str:
    return f"{np.abs(loop.error).max() / loop.ideal * 100:.2f}"


def _ms(loop: Loop) -> str:
    return "–" if loop.settling is None else f"{loop.settling * 1e3:.0f}"
