"""Palpate's own slides with the workspace controller: along the normal alone, beside the other controllers."""

from __future__ import annotations

from typing import Final

import numpy as np
from palpate.control import WorkspaceController, workspace
from palpate.devices import load
from palpate.metrics.mesh_contact import sliding_metrics
from palpate.report import Page
from palpate.simulation.simulator import simulate

from experiments.hosseini2004.checks import Check, statement
from experiments.hosseini2004.experimental import PERIOD
from experiments.hosseini2004.sliding import GROUNDS, slide_controller, slide_scenario

__all__ = ["workspace_slides"]

HAND: Final = 0.15  # kg, of the hand that leads the slides
DEEPEST: Final = 1.05  # largest deflection over F/K_min
ALONG: Final = "workspace, normal, mass known"  # along the normal alone, with the mass of the hand


def workspace_slides(page: Page) -> Check:
    """Slide by hand with five controllers, write the table of the page, and return the check of the last one."""
    arm = load("phantom-premium-1.5a")
    modes: dict[str, WorkspaceController] = {
        "workspace": workspace(arm, PERIOD),
        "workspace, normal, mass unknown": workspace(arm, PERIOD, normal_only=True),
        ALONG: workspace(arm, PERIOD, normal_only=True, operator_mass=HAND),
    }
    laws = {"lead–lag": slide_controller("lead_lag"), "LQG": slide_controller("lqg"), **modes}
    rows, apart, deepest = [], [], []
    for name, ground in GROUNDS.items():
        for controller, law in laws.items():
            trace = simulate(slide_scenario(ground), law)
            found = sliding_metrics(trace)
            if found is None or found.lost_ticks is None:
                raise RuntimeError(f"the slide over the {name} with {controller} never touched")
            stiffness = trace["surface_stiffness"][trace["touching"][:, 0] > 0.0, 0]
            deep = float(trace["depth"].max() * stiffness.min() / ground.press)
            stays = trace.completed and found.touching_at_end
            error = "–" if found.deflection_error_percent is None else f"{found.deflection_error_percent:.2g}"
            rows.append((name, controller, str(found.lost_ticks), f"{deep:.2f}", error, "yes" if stays else "no"))
            if controller == ALONG:
                apart.append(found.lost_ticks if stays else len(trace))
                deepest.append(deep)
    page.table(
        ["object", "controller", "apart", "deepest", "error", "stays"],
        rows,
        "The same slides, led by the hand: tangential stiffness 1 N/mm, discrete field. Deepest: largest deflection "
        "over the press divided by the least stiffness. The workspace controller tracks the force in all directions, "
        f"or along the normal alone; the last row of each object also knows the {HAND:g} kg of the hand.",
        units=["", "", "ticks", "", "%", ""],
    )
    return statement(
        "sec5.7-workspace-slides",
        "workspace controller along the normal, hand's mass known: slides over cubes and organs",
        f"always in contact, at most {DEEPEST:g} F/K deep on the softest polygon",
        f"{max(apart)} ticks apart, {max(deepest):.2f} F/K in {len(deepest)} slides",
        holds=bool(np.max(apart) == 0 and np.max(deepest) <= DEEPEST),
        kind="own",
        where="section 5.7",
    )
