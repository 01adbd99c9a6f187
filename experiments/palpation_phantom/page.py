"""Page of the palpation experiment: bodies of several stiffnesses in closed loop, and detection of the nodule."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from palpate.plotting.body_contact import deformed_surface
from palpate.plotting.figures import forces, thin
from palpate.plotting.style import COLORS, FAINT, INK, TITLE, new_figure
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.simulation.bodies import pressed_at

from experiments.palpation_phantom.stiffnesses import LAWS, PressResult
from experiments.palpation_phantom.sweep import AWAY, JND, PalpationSweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["margin_figure", "palpation_page", "profile_figure", "time_figure"]

_DASHED: Final = (0, (4, 3))


def palpation_page(results: Sequence[PressResult], sweep: PalpationSweep) -> Page:
    """Return the page of the runs on several bodies and of the sweeps over the phantom."""
    good = sum(result.stable for result in results)
    soft, stiff = (pick(result.young for result in results) / 1e3 for pick in (min, max))
    page = Page(
        "Palpation in closed loop",
        "The PHANToM Premium 1.5A at 1 kHz with drive limits, operated by a hand of 0.15 kg, 4.5 N s/m and 200 N/m, in "
        "contact with deformable bodies.",
    )
    page.section("Bodies from soft to stiff")
    resting = sum(result.rests for result in results)
    others = "" if resting == len(results) else "; in the others it slides on slowly across the smooth top"
    page.verdict(
        f"{good} of {len(results)} loops, on bodies of {soft:g} to {stiff:g} kPa, are bounded, in contact with a "
        f"steady force, and stable in the linearized loop by four criteria. In {resting} runs the tip rests{others}.",
        "good" if good == len(results) else "bad",
    )
    page.paragraph(
        "A flat end of 16 mm indents a block of 48 x 48 x 24 mm, fixed at its bottom, by about 1 mm. The force is at "
        "most 1.2 N, within the continuous force of the drive. It is then reduced to 0.3 of that and restored, and the "
        "tip slides by 10 mm. Either an impedance display renders the body and the operator applies the force, or a "
        "controller of one design for all bodies tracks a reference force. The critical stiffness is the contact "
        "stiffness at the stability limit of the loop, linearized at its equilibrium."
    )
    page.figure(time_figure(results), "Deflection of the contact patch, and force over its maximum.")
    page.figure(margin_figure(results), "Contact stiffness, and critical stiffness of each loop (dashed).")
    page.table(
        ["law", "Young", "contact", "critical", "deflection", "force", "oscillation", "work", "residual", "stable"],
        [
            (
                _unbroken(result.law), result.young / 1e3,
                None if result.contact is None else result.contact.static_stiffness,
                None if result.contact is None else result.contact.critical_stiffness,
                1e3 * result.found.final_deflection, result.found.final_force,
                _percent(result.found.final_swing, result.found.final_force),
                1e3 * result.found.work, _percent(result.found.lost, result.found.work),
                "yes" if result.stable else "no",
            )
            for result in results
        ],
        "Deflection and force over the last 0.1 s, and the oscillation of the force relative to it. Work of the tip on "
        "the body. Residual: work minus energy stored at the end, relative to the work; zero up to rounding.",
        units=["", "kPa", "N/m", "N/m", "mm", "N", "%", "mJ", "%", ""],
    )  # fmt: skip
    _phantom(page, sweep)
    return page


def _percent(part: float, whole: float) -> str | None:
    """Return a part of `whole` in percent, with four decimals; None if `whole` is zero."""
    return None if whole == 0.0 else f"{round(100.0 * part / whole, 4) + 0.0:.4f}"


def _unbroken(text: str) -> str:
    """Return a text without line breaks: nonbreaking spaces, and word joiners around dashes."""
    return text.replace(" ", "\u00a0").replace("–", "\u2060–\u2060")


def _phantom(page: Page, sweep: PalpationSweep) -> None:
    page.section("The palpation phantom")
    verdict = "detectable" if sweep.detectable else "not detectable"
    page.verdict(
        f"The nodule raises the contact stiffness by {100 * sweep.contrast:.3g} %, which is {verdict} "
        f"(the just-noticeable difference is about {100 * JND:g} %).",
        "good" if sweep.detectable else "note",
    )
    page.paragraph(
        f"{sweep.title}; 100 x 100 x 50 mm, surface layer of 2 mm, nodule of 15 mm. The LQG controls the force while "
        "the operator moves a flat end of 16 mm over the center at 20 mm/s. The edges of the block also have an "
        f"effect: the stiffness at the center exceeds that at {1e3 * AWAY[0]:g} to {1e3 * AWAY[1]:g} mm by "
        f"{100 * sweep.with_nodule.contrast:.3g} % with the nodule and by "
        f"{100 * sweep.without_nodule.contrast:.3g} % without it."
    )
    page.facts(
        [
            ("over the nodule", f"{sweep.with_nodule.over:.4g} N/m"),
            ("beside it", f"{sweep.with_nodule.beside:.4g} N/m"),
            ("without the nodule", f"{sweep.without_nodule.over:.4g} N/m"),
            ("contrast", f"{100 * sweep.contrast:.3g} %"),
        ]
    )
    page.figure(
        profile_figure(sweep), "Stiffness along the sweep. Band: just-noticeable difference above the phantom without."
    )
    trace = sweep.trace
    middle = int(np.argmin(np.abs(trace["tip"][:, 0] - trace["tip"][0, 0]) + 1e3 * (trace.time < 1.2)))
    at = pressed_at(trace, middle)
    picture = deformed_surface(at.body, at.displacement, at.pressure)
    page.figure(
        picture, "Top of the phantom with the tip over the nodule: displacement and pressure." + stretched(picture)
    )
    page.figure(forces(trace), "Forces of the sweep.")


def time_figure(results: Sequence[PressResult]) -> Figure:
    """Return deflection, mm, and force over its maximum against time, with one column per law."""
    laws = list(dict.fromkeys(result.law for result in results))
    figure, rows = new_figure(2, len(laws), height=2.3, sharey=False)
    for column, law in enumerate(laws):
        selected = [result for result in results if result.law == law]
        for result, color in zip(selected, _shades(len(selected)), strict=True):
            deep = 1e3 * np.linalg.norm(result.trace["deflection"], axis=1)
            size = np.linalg.norm(result.trace["object_force"], axis=1)
            rows[0][column].plot(*thin(result.trace.time, deep), color=color, label=f"{result.young / 1e3:g} kPa")
            rows[1][column].plot(*thin(result.trace.time, size / size.max()), color=color)
        rows[0][column].set_title(law, **TITLE)
        rows[0][column].set_ylim(0.0, 1.2)
        rows[1][column].set_xlabel("time [s]")
    rows[0][0].set_ylabel("deflection [mm]")
    rows[1][0].set_ylabel("force / maximum [1]")
    handles, labels = rows[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def margin_figure(results: Sequence[PressResult]) -> Figure:
    """Return the stiffness of each contact and the critical stiffness against Young's modulus."""
    figure, rows = new_figure(1, 1, height=3.0)
    panel = rows[0][0]
    for law, color in zip(LAWS, COLORS, strict=False):
        selected = [
            (result.young / 1e3, result.contact)
            for result in results
            if result.law == law and result.contact is not None
        ]
        if not selected:
            continue
        young = [e for e, _ in selected]
        panel.plot(young, [c.critical_stiffness for _, c in selected], color=color, linestyle=_DASHED, marker=".")
        panel.plot([], [], color=color, label=law)
        panel.plot(young, [c.static_stiffness for _, c in selected], color=INK, marker="o", markersize=4, linewidth=1.0)
    panel.plot([], [], color=INK, marker="o", markersize=4, linewidth=1.0, label="contact")
    panel.set(xscale="log", yscale="log", xlabel="Young's modulus [kPa]", ylabel="stiffness [N/m]")
    moduli = sorted({result.young / 1e3 for result in results})
    panel.set_xticks(moduli, [f"{e:g}" for e in moduli])
    panel.set_xticks([], minor=True)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def profile_figure(sweep: PalpationSweep) -> Figure:
    """Return the stiffness along the sweep, with the nodule and without."""
    figure, rows = new_figure(1, 1, height=3.2)
    panel = rows[0][0]
    nodule, without = sweep.with_nodule, sweep.without_nodule
    panel.fill_between(
        1e3 * without.position, without.stiffness, (1.0 + JND) * without.stiffness, color=FAINT, alpha=0.22, linewidth=0
    )
    panel.plot(*thin(1e3 * without.position, without.stiffness), color=COLORS[1], label="without the nodule")
    panel.plot(*thin(1e3 * nodule.position, nodule.stiffness), color=COLORS[0], label="with the nodule")
    for side in (-7.5, 7.5):
        panel.axvline(side, color=INK, linestyle=_DASHED, linewidth=0.9)
    panel.annotate("nodule", (0.0, 0.05), xycoords=("data", "axes fraction"), ha="center", fontsize=9, color=INK)
    top = 1.08 * max(float(nodule.stiffness.max()), (1.0 + JND) * float(without.stiffness.max()))
    panel.set(xlabel="position along the sweep [mm]", ylabel="force / deflection [N/m]", ylim=(0.0, top))
    panel.legend(loc="lower right")
    return figure


def _shades(count: int) -> list[str]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["cividis"](x)) for x in np.linspace(0.0, 0.9, count)]
