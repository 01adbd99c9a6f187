"""Chapter 4: lead-lag and LQG on cases A to D, linear and nonlinear, and the instability of case B with LQG."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

import numpy as np
from palpate.arrays import Array
from palpate.control import Controller, loop_gain, margins, spectral_radius
from palpate.report import Page

from experiments.hosseini2004 import figures
from experiments.hosseini2004.as_printed import lead_lag_of_table_51
from experiments.hosseini2004.cases import CASES, case_b, case_plant, design, tracking_controllers
from experiments.hosseini2004.chapter4_as_printed import chapter4_as_printed
from experiments.hosseini2004.checks import Check, at_most, compare, statement, within
from experiments.hosseini2004.loops import FORCES, STIFFNESSES, Loop, respond, respond_case
from experiments.hosseini2004.topologies import other_topology

__all__ = ["chapter4", "grid"]

Name = Literal["A", "B", "C", "D"]
Kind = Literal["lead_lag", "lqg"]
KINDS: Final[dict[Kind, str]] = {"lead_lag": "lead–lag", "lqg": "LQG"}
DURATION: Final[dict[Name, float]] = {"A": 6.0, "B": 0.4, "C": 6.0, "D": 0.4}  # s
SHOWN: Final[dict[tuple[Name, Kind], float]] = {  # s
    ("A", "lead_lag"): 2.0,
    ("A", "lqg"): 2.0,
    ("B", "lead_lag"): 0.2,
    ("B", "lqg"): 0.4,
    ("C", "lead_lag"): 2.0,
    ("C", "lqg"): 1.0,
    ("D", "lead_lag"): 0.2,
    ("D", "lqg"): 0.2,
}
LEAD_LAG_ERROR: Final = 0.005  # of F/K: what palpate asks of its own lead-lag
RUNAWAY: Final = 60.0  # mm: the figure of an unstable loop is cut here
FIGURES: Final = {"A": "4.4 to 4.7", "B": "4.8 to 4.11", "C": "4.12 to 4.15", "D": "4.16 to 4.19"}
MODELS: Final = {
    "A": "identified model, nonlinear kinematics; LQG designed without the Jacobians",
    "B": "linearized arm, nonlinear kinematics; LQG designed without the Jacobians",
    "C": "identified model, linearized kinematics; LQG without integrators",
    "D": "linearized arm and kinematics; LQG with integrators",
}


def chapter4(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Compute chapter 4, write it on the page and return its checks; `tick(text, fraction)` reports progress."""
    page.section("Chapter 4: the controllers in the loop", "chapter-4")
    checks = chapter4_as_printed(page)
    controllers = {(case, kind): design(case, kind) for case in CASES for kind in KINDS}  # type: ignore[arg-type]
    tick("margins", 0.05)
    _designs(page, controllers[("D", "lead_lag")], controllers[("D", "lqg")])
    runs: dict[tuple[Name, Kind], list[Loop]] = {}
    for index, case in enumerate(MODELS):
        tick(f"case {case}", 0.15 + 0.1 * index)
        for kind in KINDS:
            runs[case, kind] = [  # type: ignore[index]
                respond_case(case, controllers[case, kind], force=f, stiffness=3.5, duration=DURATION[case])  # type: ignore[arg-type, index]
                for f in FORCES
            ]
    checks += _cases(page, runs, controllers)
    tick("case B", 0.6)
    checks += _case_b(page)
    tick("every force and stiffness", 0.7)
    tables = {kind: grid(controllers["D", kind]) for kind in KINDS}
    checks += _nonlinear(page, tables)
    checks += _table41(page, tables["lqg"])
    tick("soft object", 0.9)
    _soft(page)
    tick("the other topology", 0.95)
    other_topology(page)
    return checks


def grid(controller: Controller) -> list[Loop]:
    """Run one controller on the nonlinear device for every force and stiffness of the thesis."""
    return [respond(controller, force=f, stiffness=k, duration=0.8) for f in FORCES for k in STIFFNESSES]


def _designs(page: Page, lead_lag: Controller, lqg: Controller) -> None:
    page.subsection("Palpate's own controllers")
    page.paragraph(
        "From here on the controllers are palpate's own, designed from stated margins: one of each kind for the arm, "
        "designed once for a cube of 1 N/mm, and one of each for the identified model. The thesis prints no gain of "
        "its lead–lag. Checks of these controllers compare palpate with F/K or with the thesis's sentences, never with "
        "a printed number."
    )
    rows = []
    for controller in (lead_lag, lqg):
        for k in (1.0, 3.5):
            m = margins(controller, case_plant("D", k * 1e3))
            low = f"{m.gain_down:.3f}" if m.gain_down > 0 else "0"
            rows.append((KINDS["lead_lag" if controller is lead_lag else "lqg"], k, f"{low} to {m.gain_up:.1f}",
                         f"{m.phase:.0f}", f"{m.delay * 1e3:.2f}", f"{m.crossover:.0f}", f"{m.disk:.2f}"))  # fmt: skip
    page.table(
        ["controller", "stiffness", "gain interval", "phase margin", "delay margin", "crossover", "disk margin"],
        rows,
        "Exact margins of the sampled loops of case D (T = 0.5 ms), all axes changed alike; the disk margin lets each "
        "axis change by itself.",
        units=["", "N/mm", "", "deg", "ms", "rad/s", ""],
    )


def _cases(
    page: Page, runs: dict[tuple[Name, Kind], list[Loop]], controllers: dict[tuple[str, Kind], Controller]
) -> list[Check]:
    rows = []
    checks = []
    for case in MODELS:
        page.subsection(f"Case {case} (figures {FIGURES[case]})")
        page.paragraph(f"Models: {MODELS[case]}. Steps of 1, 4 and 8.5 N on 3.5 N/mm.")
        for kind, text in KINDS.items():
            loops = runs[case, kind]  # type: ignore[index]
            until = SHOWN[case, kind]  # type: ignore[index]
            lowest, highest = _limits(loops, until)
            series = {f"{loop.force:g} N": (loop.time, loop.deflection) for loop in loops}
            panels = {"linear": series} if case == "D" else {"": series}
            if case == "D":
                panels["nonlinear"] = {
                    f"{f:g} N": (run.time, run.deflection)
                    for f in FORCES
                    for run in [respond(controllers["D", kind], force=f, duration=0.4)]
                }
            page.figure(
                figures.steps(
                    panels, targets=[loop.ideal for loop in loops], until=until, lowest=lowest, highest=highest
                ),
                f"Case {case}, {text}, palpate's own design. Dashed: force / stiffness.",
            )
            loop = loops[-1]
            radius = spectral_radius(loop_gain(controllers[case, kind], case_plant(case, 3500.0)))  # type: ignore[arg-type]
            stable = radius < 1.0
            rows.append((
                case, text, f"{radius:.5f}", "stable" if stable else "unstable",
                f"{float(np.abs(loop.error).max()):.3f}" if stable else None,
                f"{loop.overshoot:.1f}" if stable else None,
                "–" if not stable or loop.settling is None else f"{loop.settling:.3g}",
            ))  # fmt: skip
    page.subsection("The cases side by side")
    page.table(
        ["case", "controller", "spectral radius", "loop", "largest steady error", "overshoot", "5 % settling"],
        rows,
        "8.5 N on 3.5 N/mm, the worst of the three axes. Case A and C answer slowly because the identified model does: "
        "axis 3 has a pole at 0.990 per sample beside a zero at 1.",
        units=["", "", "per sample", "", "mm", "%", "s"],
    )
    for row in rows:
        name, controller, found = row[0], row[1], row[3]
        said = "unstable" if (name, controller) == ("B", "LQG") else "stable"
        checks.append(
            statement(
                f"case{name}-{'lqg' if controller == 'LQG' else 'lead-lag'}-own",
                f"case {name} with palpate's own {controller} at 3.5 N/mm",
                f"{said} (thesis's own gains)",
                found,
                holds=found == said,
                kind="own",
                where=f"figures {FIGURES[name]}",
            )
        )
    return checks


def _limits(loops: list[Loop], until: float) -> tuple[float, float]:
    """Limits of the deflection axis, mm, that show the loops until `until` seconds."""
    shown = np.concatenate([loop.deflection[loop.time <= until].ravel() for loop in loops])
    low, high = max(float(shown.min()), -RUNAWAY), min(float(shown.max()), RUNAWAY)
    margin = 0.08 * (high - low)
    return low - margin, high + margin


def _case_b(page: Page) -> list[Check]:
    found = {True: case_b(integrators=True), False: case_b(integrators=False)}
    b = found[True]
    low, middle, high = b.mismatch
    page.subsection("Why case B with LQG is unstable, and whether it must be")
    page.paragraph(
        "The thesis finds case B unstable with LQG and blames the kinematics that its design leaves out. The "
        "eigenvalues of the sampled loop say the same, with numbers. That LQG takes angles (rad) for object forces (N) "
        "and torques (N·m) for tip forces (N). What it does not see is the gain between them, K J Jᵀ: at 3.5 N/mm its "
        f"eigenvalues are {low:.0f}, {middle:.0f} and {high:.0f}. The loop it was designed for has spectral radius "
        f"{b.own_radius:.5f}; the loop it runs in, {b.radius:.4f}."
    )
    page.facts(
        [
            ("gain it does not see", f"{low:.0f} to {high:.0f}"),
            ("would be stable up to", f"{b.critical_stiffness:.1f} N/m"),
            ("that is, of 3.5 N/mm", f"{b.critical_factor * 100:.2f} %"),
            ("Jacobians in the design: up to", f"{b.aware_interval[1] / 1e3:.1f} N/mm"),
        ]
    )
    page.verdict(
        "Case B need not be unstable: the LQG must know the Jacobians. One that does is stable from "
        f"{b.aware_interval[0]:.0f} N/m to {b.aware_interval[1] / 1e3:.1f} N/mm.",
        "good",
    )
    page.paragraph(
        f"Without them no weight that still renders helps: the command must cost R = {_power_of_ten(b.dear_enough)} Q "
        f"before the loop is stable, and then its slowest mode decays in {b.dear_decay:.1f} s. Integrators are "
        f"not the cause: without them the critical stiffness is {found[False].critical_stiffness:.1f} N/m."
    )
    _radius_figure(page)
    return [
        statement(
            "caseB-lqg-cause", "cause of the instability of case B with LQG",
            "the controller did not take the kinematics and force transformation into account",
            f"it misses a gain of {low:.0f} to {high:.0f}: critical at {b.critical_factor * 100:.2f} % of 3.5 N/mm; "
            f"with the Jacobians stable to {b.aware_interval[1] / 1e3:.1f} N/mm",
            holds=b.radius > 1 > b.aware_radius and found[False].radius > 1, where="section 4.4.2"),
    ]  # fmt: skip


def _power_of_ten(value: float) -> str:
    exponent = int(np.floor(np.log10(value)))
    return f"{value / 10**exponent:.0f}·10{''.join('⁰¹²³⁴⁵⁶⁷⁸⁹'[int(d)] for d in str(exponent))}"


def _radius_figure(page: Page) -> None:
    stiffness = np.geomspace(1.0, 1e4, 121)
    series = {}
    for label, aware in (("designed without the Jacobians", False), ("designed with them", True)):
        controller = design("B", "lqg", integrators=True, jacobians=aware)
        loop = loop_gain(controller, case_plant("B", 1000.0))
        radius = [spectral_radius(loop, k / 1000.0) for k in stiffness]
        series[label] = (stiffness / 1e3, np.array(radius)[:, None])
    figure = figures.lines(series, titles=["case B, LQG with integrators"], ylabel="spectral radius",
                           xlabel="stiffness of the object [N/mm]", height=3.0)  # fmt: skip
    panel = figure.axes[0]
    panel.set_xscale("log")
    panel.set_ylim(0.993, 1.021)
    panel.axhline(1.0, color="#1d2126", linestyle=(0, (4, 3)), linewidth=1.0)
    panel.axvline(3.5, color="#8a9099", linewidth=1.0)
    panel.annotate("3.5 N/mm", (3.5, 1.0), xytext=(4, 12), textcoords="offset points", fontsize=9)
    page.figure(figure, "Above the dashed line the loop is unstable. The grey line is the thesis's object.")


def _nonlinear(page: Page, tables: dict[Kind, list[Loop]]) -> list[Check]:
    page.subsection("Every force and stiffness on the nonlinear device")
    checks = []
    for kind, loops in tables.items():
        rows = []
        for loop in loops:
            x, y, z = loop.steady
            settling = "–" if loop.settling is None else f"{loop.settling * 1e3:.0f}"
            worst = float(np.abs(loop.error).max() / loop.ideal * 100)
            rows.append((f"{loop.force:g}", f"{loop.stiffness:g}", f"{loop.ideal:.4f}", f"{x:.4f}", f"{y:.4f}",
                         f"{z:.4f}", f"{worst:.4f}", f"{loop.overshoot:.1f}", settling))  # fmt: skip
            checks += _row_checks(kind, loop)
        page.table(
            ["force", "stiffness", "F/K", "x", "y", "z", "largest error", "overshoot", "5 % settling"],
            rows,
            f"{KINDS[kind][0].upper() + KINDS[kind][1:]}, one fixed design, nonlinear device and kinematics: steady "
            "deflection; error, overshoot and settling are the worst of the three axes.",
            units=["N", "N/mm", "mm", "mm", "mm", "mm", "%", "%", "ms"],
        )
    return checks


def _row_checks(kind: Kind, loop: Loop) -> list[Check]:
    """Return the check of a run of palpate's own controller against F/K."""
    name = f"ch4.{kind.replace('_', '-')}-{loop.force:g}N-{loop.stiffness:g}"
    worst = int(np.argmax(np.abs(loop.error))) if loop.axes else 0
    what = f"palpate's own {KINDS[kind]}, nonlinear, {loop.force:g} N on {loop.stiffness:g} N/mm"
    note = f"overshoot {loop.overshoot:.1f} %, 5 % settling {_ms(loop)}"
    if kind == "lqg":
        return [
            within(name, f"{what}: deflection of the worst axis ({'xyz'[worst]}) against F/K (3.35)", loop.ideal,
                   float(loop.steady[worst]), "mm", 1e-3 * loop.ideal, kind="own", where="(3.35), chapter 4",
                   note=f"within 0.1 %; {note}"),
        ]  # fmt: skip
    return [
        at_most(name, f"{what}: steady error of the worst axis ({'xyz'[worst]})", LEAD_LAG_ERROR * loop.ideal,
                float(np.abs(loop.error).max()), "mm", kind="own", where="(3.35), chapter 4",
                note=f"at most 0.5 % of F/K; {note}"),
    ]  # fmt: skip


def _ms(loop: Loop) -> str:
    return "not reached" if loop.settling is None else f"{loop.settling * 1e3:.0f} ms"


def _table41(page: Page, loops: list[Loop]) -> list[Check]:
    found = {(loop.force, loop.stiffness): loop for loop in loops}
    keys = {
        "tab4.1-8.5N-3.5": (8.5, 3.5),
        "tab4.1-4N-3.5": (4.0, 3.5),
        "tab4.1-1N-3.5": (1.0, 3.5),
        "tab4.1-8.5N-1.05": (8.5, 1.05),
    }
    checks: list[Check] = []
    rows = []
    for key, at in keys.items():
        loop = found[at]
        check = compare(key, loop.ideal)[0]
        rows.append((f"{at[0]:g}", f"{at[1]:g}", f"{check.printed:g}", f"{loop.ideal:.4f}", f"{loop.steady[2]:.4f}",
                     check.status, check.note))  # fmt: skip
        checks.append(check)
    page.subsection("Table 4.1: desired displacement")
    page.table(["force", "stiffness", "printed", "F/K", "own LQG, z", "status", "why"], rows,
               "The thesis's targets, F/K by (3.35), and what the nonlinear device reaches under palpate's own LQG.",
               units=["N", "N/mm", "mm", "mm", "mm", "", ""])  # fmt: skip
    return checks


def _soft(page: Page) -> None:
    controllers = {
        "lead–lag of table 5.1": lead_lag_of_table_51(),
        **{f"own {name}": law for name, law in tracking_controllers().items()},
    }
    panels: dict[str, dict[str, tuple[Array, Array]]] = {}
    settled: dict[str, str] = {}
    for model in ("nonlinear", "linear"):
        kinematics: Literal["nonlinear", "linear"] = "linear" if model == "linear" else "nonlinear"
        loops = {
            name: respond(c, stiffness=1.05, model=model, kinematics=kinematics, duration=1.0)
            for name, c in controllers.items()
        }
        panels[model] = {name: (loop.time, loop.deflection) for name, loop in loops.items()}
        settled[model] = ", ".join(_ms(loops[f"own {name}"]) for name in tracking_controllers())
    page.subsection("A soft object (figures 4.20 and 4.21)")
    page.figure(
        figures.steps(panels, targets=[8.5 / 1.05], until=1.0, lowest=-0.5, highest=17.0),
        "8.5 N on 1.05 N/mm, nonlinear and linear arm. The gains that explain table 5.1 rest too deep along z; "
        f"palpate's own controllers reach F/K = 8.095 mm. They settle within 5 %, in the order of the legend, after "
        f"{settled['nonlinear']} on the nonlinear arm and {settled['linear']} on the linear one.",
    )
