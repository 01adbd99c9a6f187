"""Chapter 5, the slide as described: figures 5.5 to 5.10, tangential spring, stiffness at the tip's position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from palpate.plotting.figures import thin
from palpate.plotting.style import COLORS, TITLE, new_figure
from palpate.report import Page

from experiments.hosseini2004.as_printed import lead_lag_of_table_51, printed_weights
from experiments.hosseini2004.cases import Tracking, tracking_controllers
from experiments.hosseini2004.checks import Check, statement
from experiments.hosseini2004.literal_slide import ALONG, STEPS, TANGENTIAL, LiteralSlide, slide

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["literal_slide"]

PRESSES: Final = (1.0, 4.0)  # N
THESIS: Final = "lead–lag of table 5.1"
NORMALIZED: Final = ("own LQG normalized", "own workspace")
WHERE: Final = "sections 5.3 to 5.6"

Runs = dict[tuple[str, str, float], LiteralSlide]


def literal_slide(page: Page) -> list[Check]:
    """Slide with both step sizes, write the findings on the page and return their checks."""
    laws: dict[str, Tracking] = {
        THESIS: lead_lag_of_table_51(),
        "LQG, Q = I, R = 10 I": printed_weights("D"),
        **{f"own {name}": law for name, law in tracking_controllers().items()},
    }
    runs = {(name, steps, press): slide(law, steps, press)
            for steps in STEPS for name, law in laws.items() for press in PRESSES}  # fmt: skip
    page.subsection("The slide as described (figures 5.5 to 5.10)")
    page.paragraph(
        "The thesis gives each polygon a normal stiffness, taken at the tip's position, and ties the tip to the "
        f"surface by a tangential spring of {TANGENTIAL / 1e3:g} N/mm from its first contact point. Forces along x, y "
        "and z alone move the tip; there is no friction, no drag and no limit of the drive. With 8.5 N at most, the "
        "tip moves 8.5 mm at most. The stiffnesses and forces stand in figures that the scan does not contain. Here "
        f"the polygons are 1.5 mm wide, with steps of {_list(STEPS['small'])} N/mm (small) or {_list(STEPS['large'])} "
        f"N/mm (large), and the forces ramp to {ALONG[0]:g} N along x and {ALONG[1]:g} N along y in 2 s."
    )
    page.figure(
        _figure({steps: runs[THESIS, steps, PRESSES[0]] for steps in STEPS}),
        f"{THESIS[0].upper() + THESIS[1:]}, pressed with {PRESSES[0]:g} N: stiffness under the tip (5.5), deflection "
        "(5.6), way over the surface (5.7) and object force (5.9). Left: small steps; right: large steps.",
    )
    page.table(
        ["controller", "steps", "press", "way x, y", "step", "apart", "error", "stays"],
        [_row(key, run) for key, run in runs.items()],
        "The slide as described: way at the end; largest force step between two samples; ticks apart after the first "
        "contact; deflection at the end against F/K; whether the loop stayed bounded and the tip always in contact.",
        units=["", "", "N", "mm", "N", "ticks", "%", ""],
    )
    page.paragraph(
        "The low gain along z keeps the tip in contact over large steps, and lets the normal force miss its reference. "
        "Lead–lag and LQG, which track the normal force, throw the tip off the surface at a large step. The thesis, "
        "too, leaves sliding with LQG to later work. The normalized LQG and the workspace controller know the "
        "stiffness of the tick: they stay in contact and hold the reference."
    )
    return _checks(runs)


def _list(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _row(key: tuple[str, str, float], run: LiteralSlide) -> tuple[object, ...]:
    name, steps, press = key
    error = f"{round(run.error, 1) + 0.0:.1f}" if run.stays else None
    way = f"{run.way[0]:.1f}, {run.way[1]:.1f}".replace("-", "−")
    return (name, steps, f"{press:g}", way, f"{run.step:.2f}", f"{run.apart}", error, "yes" if run.stays else "no")


def _figure(runs: dict[str, LiteralSlide]) -> Figure:
    figure, rows = new_figure(4, len(runs), height=1.9, sharex=False)
    labels = ("stiffness [N/mm]", "deflection z [mm]", "y [mm]", "object force [N]")
    for column, (steps, run) in enumerate(runs.items()):
        time = run.trace.time
        panels = [row[column] for row in rows]
        panels[0].plot(*thin(time, run.stiffness), color=COLORS[0])
        panels[1].plot(*thin(time, run.place[:, 2]), color=COLORS[0])
        panels[2].plot(run.place[::20, 0], run.place[::20, 1], color=COLORS[0])
        for axis in range(3):
            panels[3].plot(*thin(time, run.trace["object_force"][:, axis]), color=COLORS[axis], label="xyz"[axis])
        panels[0].set_title(f"{steps} steps", **TITLE)
        for panel, label in zip(panels, ("", "", "x [mm]", "time [s]"), strict=True):
            panel.set_xlabel(label)
    for row, label in zip(rows, labels, strict=True):
        row[0].set_ylabel(label)
    handles, names = rows[3][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _checks(runs: Runs) -> list[Check]:
    theirs = {key: run for key, run in runs.items() if key[0] == THESIS}
    small = [run for (_, steps, _), run in runs.items() if steps == "small"]
    known = [run for (name, *_), run in runs.items() if name in NORMALIZED]
    others = [run for (name, steps, _), run in runs.items() if name not in (THESIS, *NORMALIZED) and steps == "large"]
    lqg = [run for (name, steps, _), run in runs.items() if name.startswith("LQG") and steps == "large"]
    worst = max(abs(run.error) for run in theirs.values())
    return [
        statement("sec5.6-literal-slide", "slide as described, lead–lag of table 5.1, small and large steps",
                  "absolutely stable", f"{sum(r.stays for r in theirs.values())} of {len(theirs)} stay in contact",
                  holds=all(run.stays for run in theirs.values()), where=WHERE),
        statement("sec5.6-literal-small", "slide as described, all controllers, small steps", "stable",
                  f"{sum(r.stays for r in small)} of {len(small)} stay in contact", holds=all(r.stays for r in small),
                  kind="own", where=WHERE),
        statement("sec5.7-literal-force", "the same slide: desired forces on the surface",
                  "the method maintains the desired forces",
                  f"the normal force ends up to {worst:.0f} % off its reference", holds=worst > 10.0, refuted=True,
                  where="section 5.7",
                  note="the static gain along z is 0.0031, and the held gravity changes on the way"),
        statement("sec5.6-literal-lqg", "slide as described, LQG with the printed weights, large steps",
                  "the LQG needs a better transient before it can slide",
                  f"{sum(r.stays for r in lqg)} of {len(lqg)} stay in contact",
                  holds=not all(run.stays for run in lqg), where="section 5.6"),
        statement("sec5.7-normalized-slide", "slide as described, normalized LQG and workspace controller, all steps",
                  "a better transient lets the LQG slide (future work)",
                  f"{sum(r.stays for r in known)} of {len(known)} stay in contact, the normal force at most "
                  f"{max(abs(r.error) for r in known):.1g} % off its reference at the end",
                  holds=all(r.stays and abs(r.error) < 0.1 for r in known), kind="own", where="section 5.7"),
        statement("sec5.7-literal-guarantee", "slide as described, controllers without the stiffness, large steps",
                  "the method guarantees a stable contact during sliding",
                  f"{sum(r.stays for r in others)} of {len(others)} stay in contact (printed LQG and palpate's own)",
                  holds=not all(run.stays for run in others), refuted=True, where="section 5.7",
                  note="the result depends on the controller: no property of the object guarantees contact"),
    ]  # fmt: skip
