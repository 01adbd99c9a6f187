"""The page of the palpation experiment: soft to stiff bodies in closed loop, and the nodule that a hand looks for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from palpate.plotting.body_contact import deformed
from palpate.plotting.figures import forces, thin
from palpate.plotting.style import COLORS, FAINT, INK, TITLE, new_figure
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.simulation.bodies import pressed_at

from experiments.palpation_phantom.stiffnesses import LAWS, PressResult
from experiments.palpation_phantom.sweep import AWAY, JND, PalpationSweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["course_figure", "felt_figure", "margin_figure", "palpation_page"]

_DASHED: Final = (0, (4, 3))


def palpation_page(held: Sequence[PressResult], sweep: PalpationSweep) -> Page:
    """Return the page of runs on bodies of several stiffnesses, and of the sweeps over the phantom."""
    good = sum(one.stable for one in held)
    soft, stiff = (pick(one.young for one in held) / 1e3 for pick in (min, max))
    page = Page(
        "Palpation in closed loop",
        "The PHANToM Premium 1.5A at 1 kHz, its drive limited, in a hand of 0.15 kg, 4.5 N s/m and 200 N/m, on bodies "
        "that yield.",
    )
    page.section("Bodies from soft to stiff")
    page.verdict(
        f"{good} of {len(held)} loops, on bodies of {soft:g} to {stiff:g} kPa, stay bounded and come to rest in "
        "contact, where the linear loop is stable by four criteria.",
        "good" if good == len(held) else "bad",
    )
    page.paragraph(
        "A flat end of 16 mm presses a block of 48 x 48 x 24 mm, bonded below, by about 1 mm (with at most 1.2 N, as "
        "much as the drive can hold), holds, lets go to 0.3 of that, presses again, and slides 10 mm over it. Either "
        "the display shows the body's force as it is and the hand presses, or a controller, one design for all bodies, "
        "brings the force to its reference. Critical: how stiff the contact could be until the loop, linearised where "
        "it rests, oscillates."
    )
    page.figure(
        course_figure(held), "How far the pressed patch has moved, and the force on it, as a part of its largest."
    )
    page.figure(
        margin_figure(held), "Stiffness of the contacts, and dashed in the same colour the critical one of each loop."
    )
    page.table(
        ["law", "Young", "contact", "critical", "deflection", "force", "swing", "work", "lost", "stable"],
        [
            (
                _unbroken(one.law), one.young / 1e3,
                None if one.contact is None else one.contact.stiffness,
                None if one.contact is None else one.contact.critical_stiffness,
                1e3 * one.found.final_deflection, one.found.final_force,
                _percent(one.found.final_swing, one.found.final_force),
                1e3 * one.found.work, _percent(one.found.lost, one.found.work), "yes" if one.stable else "no",
            )
            for one in held
        ],
        "Deflection and force over the last 0.1 s, and the force's swing as a part of it. Work of the tip on the body; "
        "lost: less what the body stores at the end, as a part of it, zero but for adding up.",
        units=["", "kPa", "N/m", "N/m", "mm", "N", "%", "mJ", "%", ""],
    )  # fmt: skip
    _phantom(page, sweep)
    return page


def _percent(part: float, whole: float) -> str | None:
    """Return a share in percent, all with as many decimals; None where there is nothing to have a share of."""
    return None if whole == 0.0 else f"{round(100.0 * part / whole, 4) + 0.0:.4f}"


def _unbroken(text: str) -> str:
    """Return a text that stays on one line: spaces that do not break, and joiners around its dashes."""
    return text.replace(" ", "\u00a0").replace("–", "\u2060–\u2060")


def _phantom(page: Page, sweep: PalpationSweep) -> None:
    page.section("The palpation phantom")
    told = "a hand can tell" if sweep.detectable else "too little for a hand to tell"
    page.verdict(
        f"The nodule raises the stiffness felt by {100 * sweep.contrast:.3g} %: {told} "
        f"(the just-noticeable difference is about {100 * JND:g} %).",
        "good" if sweep.detectable else "note",
    )
    page.paragraph(
        f"{sweep.title}: 100 x 100 x 50 mm, skin of 2 mm, a nodule of 15 mm. The LQG holds the press while the hand "
        "leads a flat end of 16 mm over the middle at 20 mm/s. The block's edges count, too: along the sweep the "
        f"middle feels {100 * sweep.with_nodule.contrast:.3g} % stiffer than {1e3 * AWAY[0]:g} to {1e3 * AWAY[1]:g} mm "
        f"beside it, without the nodule {100 * sweep.without_nodule.contrast:.3g} %."
    )
    page.facts(
        [
            ("over the nodule", f"{sweep.with_nodule.over:.4g} N/m"),
            ("beside it", f"{sweep.with_nodule.beside:.4g} N/m"),
            ("there without it", f"{sweep.without_nodule.over:.4g} N/m"),
            ("nodule's contrast", f"{100 * sweep.contrast:.3g} %"),
        ]
    )
    page.figure(
        felt_figure(sweep), "Stiffness felt along the sweep. Band: what a hand cannot tell from the phantom without."
    )
    trace = sweep.trace
    middle = int(np.argmin(np.abs(trace["tip"][:, 0] - trace["tip"][0, 0]) + 1e3 * (trace.time < 1.2)))
    at = pressed_at(trace, middle)
    picture = deformed(at.body, at.displacement, at.pressure)
    page.figure(
        picture, "The phantom's top with the tip over the nodule: displacement and pressure." + stretched(picture)
    )
    page.figure(forces(trace), "The forces of the sweep.")


def course_figure(held: Sequence[PressResult]) -> Figure:
    """Return deflection, mm, and force as a part of its largest, against time: a column for each law."""
    laws = list(dict.fromkeys(one.law for one in held))
    figure, rows = new_figure(2, len(laws), height=2.3, sharey=False)
    for column, law in enumerate(laws):
        mine = [one for one in held if one.law == law]
        for one, colour in zip(mine, _shades(len(mine)), strict=True):
            deep = 1e3 * np.linalg.norm(one.trace["deflection"], axis=1)
            size = np.linalg.norm(one.trace["object_force"], axis=1)
            rows[0][column].plot(*thin(one.trace.time, deep), color=colour, label=f"{one.young / 1e3:g} kPa")
            rows[1][column].plot(*thin(one.trace.time, size / size.max()), color=colour)
        rows[0][column].set_title(law, **TITLE)
        rows[0][column].set_ylim(0.0, 1.2)
        rows[1][column].set_xlabel("time [s]")
    rows[0][0].set_ylabel("deflection [mm]")
    rows[1][0].set_ylabel("force / largest [1]")
    handles, labels = rows[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def margin_figure(held: Sequence[PressResult]) -> Figure:
    """Return the stiffness of each contact and the critical one against Young's modulus."""
    figure, rows = new_figure(1, 1, height=3.0)
    panel = rows[0][0]
    for law, colour in zip(LAWS, COLORS, strict=False):
        mine = [(one.young / 1e3, one.contact) for one in held if one.law == law and one.contact is not None]
        if not mine:
            continue
        young = [e for e, _ in mine]
        panel.plot(young, [c.critical_stiffness for _, c in mine], color=colour, linestyle=_DASHED, marker=".")
        panel.plot([], [], color=colour, label=law)
        panel.plot(young, [c.stiffness for _, c in mine], color=INK, marker="o", markersize=4, linewidth=1.0)
    panel.plot([], [], color=INK, marker="o", markersize=4, linewidth=1.0, label="the contact")
    panel.set(xscale="log", yscale="log", xlabel="Young's modulus [kPa]", ylabel="stiffness [N/m]")
    moduli = sorted({one.young / 1e3 for one in held})
    panel.set_xticks(moduli, [f"{e:g}" for e in moduli])
    panel.set_xticks([], minor=True)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def felt_figure(sweep: PalpationSweep) -> Figure:
    """Return the stiffness felt along the sweep, with and without the nodule."""
    figure, rows = new_figure(1, 1, height=3.2)
    panel = rows[0][0]
    lump, plain = sweep.with_nodule, sweep.without_nodule
    panel.fill_between(
        1e3 * plain.place, plain.stiffness, (1.0 + JND) * plain.stiffness, color=FAINT, alpha=0.22, linewidth=0
    )
    panel.plot(*thin(1e3 * plain.place, plain.stiffness), color=COLORS[1], label="without the nodule")
    panel.plot(*thin(1e3 * lump.place, lump.stiffness), color=COLORS[0], label="with the nodule")
    for side in (-7.5, 7.5):
        panel.axvline(side, color=INK, linestyle=_DASHED, linewidth=0.9)
    panel.annotate("nodule", (0.0, 0.05), xycoords=("data", "axes fraction"), ha="center", fontsize=9, color=INK)
    top = 1.08 * max(float(lump.stiffness.max()), (1.0 + JND) * float(plain.stiffness.max()))
    panel.set(xlabel="place of the tip along the sweep [mm]", ylabel="force / deflection [N/m]", ylim=(0.0, top))
    panel.legend(loc="lower right")
    return figure


def _shades(count: int) -> list[str]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["cividis"](x)) for x in np.linspace(0.0, 0.9, count)]
