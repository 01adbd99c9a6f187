"""Chapter 5, palpate's own slides: friction, less tangential stiffness, a continuous field, a curved object."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from palpate.control import Controller
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.plotting.figures import forces
from palpate.plotting.mesh_contact import stiffness_and_depth, trajectory
from palpate.report import Page
from palpate.simulation.simulator import simulate
from palpate.simulation.trace import Trace

from experiments.hosseini2004.checks import Check, at_most, statement
from experiments.hosseini2004.sliding import FIELDS, GROUNDS, Field, Kind, Pair, pairs, slide_controller, slide_scenario
from experiments.hosseini2004.workspace_slides import workspace_slides

__all__ = ["sliding"]

CONTROLLERS: Final[dict[str, Kind]] = {"lead–lag": "lead_lag", "LQG": "lqg", "LQG normalized": "lqg_normalized"}
TANGENTIAL: Final = (1.0, 0.3, 0.1, 0.0)  # N/mm
WHERE: Final = "section 5.6"
_SHOWN: Final = "cube, large steps"

Run = tuple[str, str, float, Field]  # ground, controller, tangential stiffness, field


def sliding(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Slide over cubes and organs, write what is found on the page and return its checks."""
    page.subsection("Palpate's own slides")
    page.paragraph(
        "These slides depart from the thesis: a proxy with friction in place of the tangential spring, a hand that "
        "leads the tip, a limited drive, and 60 mm of way. They answer the thesis's future work: less tangential "
        "stiffness and a continuous force field. The arm presses a point into the top of the object with 1 N (large "
        "steps of stiffness) or 2 N (small steps). A hand (0.15 kg, 4.5 N s/m, 200 N/m) leads the stylus along x and y "
        "at 60 mm/s. The reference contains the friction of the surface, 0.2 of the press. Without tangential "
        "stiffness there is no friction, and only the hand holds the tip along the surface."
    )
    laws = {name: slide_controller(kind) for name, kind in CONTROLLERS.items()}
    tick("a slide", 0.0)
    traces = {name: simulate(slide_scenario(GROUNDS[_SHOWN]), law) for name, law in laws.items()}
    _pictures(page, traces["lead–lag"], traces["LQG"])
    tick("slides", 0.05)
    found = {
        (ground, name, tangential, field): _slide(
            simulate(slide_scenario(GROUNDS[ground], tangential=tangential, field=field), law)
        )
        for ground in GROUNDS
        for name, law in laws.items()
        for tangential in TANGENTIAL
        for field in FIELDS
    }
    checks = [*_comparison(page, found), workspace_slides(page)]
    checks.append(_by_forces(page, laws))
    tick("pairs of stiffnesses", 0.3)
    checks += _pairs(page, laws, tick)
    tick("a slope without friction", 0.95)
    return [*checks, _slope(page)]


def _slide(trace: Trace) -> tuple[SlidingMetrics, bool]:
    """Return what a trace shows, and whether its loop stayed bounded and in contact at the end."""
    found = sliding_metrics(trace)
    if found is None:
        raise RuntimeError("the tip never touched the object")
    return found, trace.completed and found.touching_at_end


def _pictures(page: Page, lead_lag: Trace, lqg: Trace) -> None:
    page.figure(
        trajectory(lead_lag),
        "Lead–lag, discrete field, tangential stiffness 1 N/mm: the way over a cube with stripes of 0.2, 3.5, 0.5 and "
        "2 N/mm (the darker, the stiffer), its deflection stretched.",
    )
    page.figure(
        stiffness_and_depth(lead_lag),
        "Lead–lag: stiffness under the tip and deflection. Dashed: force / stiffness.",
    )
    page.figure(stiffness_and_depth(lqg), "LQG: the same slide.")
    page.figure(forces(lead_lag), "Lead–lag: the forces. The drive gives 8.5 N at most.")


def _comparison(page: Page, found: dict[Run, tuple[SlidingMetrics, bool]]) -> list[Check]:
    forces_, energies = [], []
    for ground, name, tangential, field in found:
        if field != "discrete":
            continue
        (d, d_stays), (c, c_stays) = (found[ground, name, tangential, f] for f in FIELDS)
        which: list[Any] = [ground, name, f"{tangential:g}" if tangential else "none"]
        forces_.append([*which, _n(d.step_at_crossing), _n(c.step_at_crossing),
                        f"{(d.lost_ticks or 0) + (c.lost_ticks or 0)}", _n(d.deflection_error_percent),
                        _n(c.deflection_error_percent), "yes" if d_stays and c_stays else "no"])  # fmt: skip
        energies.append([*which, _n(1e3 * d.energy_generated), _n(1e3 * c.energy_generated), _n(d.ripple_power),
                         _n(c.ripple_power)])  # fmt: skip
    page.table(
        ["object", "controller", "tangential", "step, discrete", "continuous", "apart", "error, discrete",
         "continuous", "stays"],
        forces_,
        "Palpate's slides: largest force step at a crossing; ticks apart (both fields); deflection at the end against "
        "F/K; whether both runs stayed bounded and in contact at the end.",
        units=["", "", "N/mm", "N", "N", "ticks", "%", "%", ""],
    )  # fmt: skip
    page.table(
        ["object", "controller", "tangential", "energy, discrete", "continuous", "ripple, discrete", "continuous"],
        energies,
        "The same slides: energy that the field generated; power of the force between 20 and 500 Hz.",
        units=["", "", "N/mm", "mJ", "mJ", "N²", "N²"],
    )
    page.paragraph(
        "On the discrete field each step from soft to stiff puts (k₂ − k₁) d²/2 into the loop, felt as a "
        "click; the continuous field generates nothing on the cube where there is no friction. With friction the tip "
        "lags behind its proxy, whose stiffness counts: the field then gives or takes a little, and friction takes far "
        "more. On the organ the continuous field is shaded as well, or the normal would turn by the angle between two "
        "facets, whatever the stiffness does. The lead–lag's error is the hand's: its spring bears a part of the "
        "press, and without an integrator it takes seconds to make up for that. Large errors of the LQG are on 0.2 "
        "N/mm, where it still sinks in when the run ends. The normalized LQG divides both forces by the stiffness of "
        "the tick and settles alike on each. The workspace controller has a table of its own: by default it tracks the "
        "force along the surface too, and so fights the hand on a slope; along the normal alone it does not."
    )
    return _field_checks(found)


def _field_checks(found: dict[Run, tuple[SlidingMetrics, bool]]) -> list[Check]:
    """Return the checks of the slides over the cube: contact, and energy of the continuous field."""
    cubes = [stays for (ground, *_), (_, stays) in found.items() if ground.startswith("cube")]
    smooth = [
        (abs(s.energy_generated), found[g, n, t, "discrete"][0].energy_generated)
        for (g, n, t, f), (s, _) in found.items()
        if f == "continuous" and t == 0.0 and g.startswith("cube")
    ]
    return [
        statement(
            "sec5.6-sliding",
            "palpate's own slides, led by a hand, over small and large steps of stiffness",
            "bounded, and in contact at the end",
            f"{sum(cubes)} of {len(cubes)} slides over the cube",
            holds=all(cubes),
            kind="own",
            where=WHERE,
        ),
        at_most(
            "sec5.6-continuous-energy",
            "energy from the continuous field over that from the discrete one, no friction, largest of the cubes",
            0.01,
            max(abs(mine) / theirs for mine, theirs in smooth),
            "",
            kind="own",
            where=WHERE,
        ),
    ]


def _by_forces(page: Page, laws: dict[str, Controller]) -> Check:
    """Slide without a hand, moved by the reference force alone over a surface with friction and drag."""
    rows, stays, apart = [], [], []
    for ground in ("cube, small steps", "cube, large steps"):
        for name, law in laws.items():
            for tangential in TANGENTIAL[:-1]:
                trace = simulate(slide_scenario(GROUNDS[ground], tangential=tangential, led_by="forces"), law)
                found, here = _slide(trace)
                stays.append(here)
                apart.append(found.lost_ticks or 0)
                reached = 1e3 * float(trace["tip"][-1, 0] - trace["tip"][0, 0])
                rows.append(
                    (ground, name, f"{tangential:g}", f"{reached:.1f}", _n(found.step_at_crossing),
                     f"{found.lost_ticks}", _n(found.deflection_error_percent), "yes" if here else "no")
                )  # fmt: skip
    page.table(
        ["object", "controller", "tangential", "way along x", "step", "apart", "error", "stays"],
        rows,
        "Moved by forces along x, y and z alone, no hand, discrete field, on a surface with a drag of 20 N s/m besides "
        "its friction, which the thesis does not have; 60 mm along x are asked for.",
        units=["", "", "N/mm", "mm", "N", "ticks", "%", ""],
    )
    return statement(
        "sec5.6-forces-alone",
        "palpate's own slides by forces along x, y and z, with 20 N s/m of drag",
        "bounded, and in contact at the end",
        f"{sum(stays)} of {len(stays)}; {sum(n > 0 for n in apart)} lose contact on the way, by {max(apart)} ticks",
        holds=all(stays),
        kind="own",
        where=WHERE,
    )


def _pairs(page: Page, laws: dict[str, Controller], tick: Callable[[str, float], None]) -> list[Check]:
    checks, rows = [], []
    step = 0.65 / (2 * len(laws))
    for number, (name, tangential) in enumerate((name, t) for name in laws for t in (1.0, 0.0)):
        tick("pairs of stiffnesses", 0.3 + number * step)
        runs = {field: pairs(laws[name], tangential=tangential, field=field) for field in FIELDS}
        discrete, continuous = (runs[field] for field in FIELDS)
        ratios = [_step(c) / _step(d) for d, c in zip(discrete, continuous, strict=True)]
        unstable = sum(not p.stable for p in discrete + continuous)
        short = sum(p.rests and not p.arrived for p in discrete + continuous)
        shown = f"{tangential:g}" if tangential else "none"
        worst = max(range(len(ratios)), key=ratios.__getitem__)
        rows.append(
            (name, shown, f"{len(discrete)}", f"{sum(p.stable for p in discrete)}",
             f"{sum(p.stable for p in continuous)}", _n(max(map(_step, discrete))), _n(max(map(_step, continuous))),
             _n(ratios[worst]), f"{discrete[worst].first:g} to {discrete[worst].second:g}",
             f"{max(p.found.lost_ticks or 0 for p in discrete + continuous)}")
        )  # fmt: skip
        key = f"sec5.6-pairs-{CONTROLLERS[name].replace('_', '-')}-{shown}"
        what = f"{name}, tangential stiffness {shown}{' N/mm' if tangential else ''}"
        checks += [
            at_most(f"{key}-unstable", f"{what}: slides that do not come to rest on the second stiffness",
                    0.0, unstable, "", kind="own", where=WHERE,
                    reason=f"{short} rest in contact before it: the integrators hold the force along the surface"
                    if short == unstable else ""),
            at_most(f"{key}-steps", f"{what}: largest force step, continuous over discrete field, worst pair",
                    0.1, max(ratios), "", kind="own", where=WHERE),
        ]  # fmt: skip
    page.table(
        ["controller", "tangential", "pairs", "stable, discr.", "contin.", "step, discr.", "contin.",
         "ratio", "at", "apart"],
        rows,
        "Every ordered pair of 0.2, 0.5, 1, 1.5, 2, 2.5, 3 and 3.5 N/mm, pressed with 1 N; discrete and continuous "
        "field. Stable: bounded, at rest in contact on the second stiffness, force steady to 1 %. Largest step, and "
        "largest ratio of the continuous to the discrete field, with its pair. Apart: ticks, the worst pair.",
        units=["", "N/mm", "", "", "", "N", "N", "", "N/mm", "ticks"],
    )  # fmt: skip
    return checks


def _slope(page: Page) -> Check:
    """Show what integrators do on a slope without friction: eight seconds over the organ, the drive without limits."""
    ground = GROUNDS["organ, small steps"]
    away, stays = {}, {}
    for integrators in (True, False):
        tables = slide_scenario(ground, controller="lqg", tangential=0.0, integrators=integrators)
        tables["device"]["saturation"], tables["run"]["duration"] = False, "8 s"
        trace = simulate(tables)
        from_hand = 1e3 * (trace["tip"] - trace["tip"][0])[:, :2] - ground.way
        away[integrators] = float(np.max(np.hypot(*from_hand[trace.time > 2.0].T)))
        stays[integrators] = bool(trace["touching"][-1, 0])
    page.paragraph(
        "What cannot be had: force tracking with integrators along a slope without friction. The surface's force along "
        "X and Y is fixed by the slope; integrators that are told to make it zero move the tip until the surface is "
        "level or ends, whatever the hand wants. In eight seconds over the organ, the drive unlimited, the LQG with "
        f"integrators carries the tip {away[True]:.0f} mm from where the hand wants it"
        f"{'' if stays[True] else ', off the organ'}; without integrators it stays within {away[False]:.1f} mm, at the "
        "price of the steady error that the hand's spring makes. On the cube the reference along X and Y, zero, is "
        "what the surface gives, and nothing drifts."
    )
    return statement(
        "sec5.7-less-friction",
        "sliding with less friction, which the thesis leaves to later work",
        "integrators carry the tip away on a slope without friction",
        f"{away[True]:.0f} mm from the hand with integrators, {away[False]:.1f} mm without",
        holds=away[True] > 10.0 * away[False] and stays[False],
        kind="own",
        where="section 5.7",
    )


def _step(p: Pair) -> float:
    return p.found.step_at_crossing or 0.0


def _n(value: float | None) -> str | None:
    return None if value is None else f"{value:.3g}"
