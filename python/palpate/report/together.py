"""Pages of a run of several devices on one deformable body: one of all devices, and one of each."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np

from palpate.metrics import summarize
from palpate.plotting.body_contact import deformed_surface, forces_and_deflections
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.report.run import run_page
from palpate.simulation.bodies import depths_at_rest
from palpate.simulation.joint_run import JointRun
from palpate.simulation.shared_body import SharedBody
from palpate.simulation.verdict import State
from palpate.stability.joint import JointStability

__all__ = ["device_page", "together_page"]


def together_page(
    run: JointRun,
    shared: SharedBody,
    names: Sequence[str],
    verdict: tuple[State, str],
    found: JointStability | None,
    links: Sequence[str] = (),
) -> Page:
    """Return the page of all devices: the joint verdict, their loops, and the body under all tips.

    Args:
        run: of the devices.
        shared: their body; its state changes.
        names: of the devices, such as the titles of their scenarios.
        verdict: joint state, and the joint verdict as a sentence.
        found: stability of the loops; None if it is not known.
        links: names of the files with the pages of the devices, in the same folder.
    """
    page = Page(" and ".join(names), f"{len(names)} devices on one deformable body.")
    page.section("Verdict")
    page.verdict(_sentence(verdict[1]), verdict[0].tone)
    rows = [
        (number, name, trace.verdict.state.label, trace.verdict.reason)
        for number, (name, trace) in enumerate(zip(names, run.traces, strict=True), 1)
    ]
    page.table(["device", "scenario", "in the run", "reason"], rows, "Verdict of each device in the run.")
    if found is not None:
        loops = [("all together", found.together), *((f"{k}, others held", one) for k, one in enumerate(found.each, 1))]
        page.table(
            ["device", "small motions", "spectral radius", "stiffness margin"],
            [(name, one.state.label, f"{one.radius:.6g}", _factor(one.stiffness_margin)) for name, one in loops],
            "Loops at the end of the run. The margin is the factor on the body's stiffness at which they oscillate.",
        )
    if links:
        entries = [
            f'<li><a href="{html.escape(link, quote=True)}">Device {number}: {html.escape(name)}</a></li>'
            for number, (name, link) in enumerate(zip(names, links, strict=True), 1)
        ]
        page.raw(f"<p>Reports of the devices:</p><ul>{''.join(entries)}</ul>")
    _body_section(page, run, shared)
    return page


def device_page(run: JointRun, index: int, names: Sequence[str], verdict: tuple[State, str], link: str = "") -> Page:
    """Return the page of one device, with the joint verdict before its own.

    Args:
        run: of all devices.
        index: of the device, from 0.
        names: of the devices.
        verdict: joint state, and the joint verdict as a sentence.
        link: name of the file with the page of all devices, in the same folder.
    """
    trace = run.traces[index]
    others = ", ".join(name for number, name in enumerate(names) if number != index)
    page = Page(
        f"Device {index + 1}: {names[index]}", f"One of {len(names)} devices on one deformable body, beside {others}."
    )
    page.section("All devices together")
    page.verdict(_sentence(verdict[1]), verdict[0].tone)
    if link:
        page.raw(f'<p><a href="{html.escape(link, quote=True)}">Report of all devices and their body</a></p>')
    return page.extend(run_page(trace, summarize(trace)))


def _body_section(page: Page, run: JointRun, shared: SharedBody) -> None:
    """Add the body at the sample with the largest deflection, and the contact of each tip."""
    depths = np.array([np.linalg.norm(contact.deflection, axis=1) for contact in run.contacts])
    known = np.where(run.solved, depths.max(axis=0), -1.0)
    page.section("Shared body")
    at = int(np.argmax(known))
    time = at * shared.scenarios[0].period
    if known[at] <= 0.0:
        page.paragraph("No tip presses the body in.")
    else:
        picture = deformed_surface(shared.body, *shared.pressed(run.tips[: at + 1]))
        page.figure(
            picture,
            f"Surface of the body at t = {time:.3g} s, at the largest deflection, in the body frame: displacement, and "
            "pressure of the tips." + stretched(picture),
        )
    page.figure(
        forces_and_deflections(run.traces), "Force of each tip on the body, and deflection of its contact patch."
    )
    forces = [np.linalg.norm(contact.force, axis=1) for contact in run.contacts]
    centers = shared.in_body(run.tips)
    below = [depths_at_rest(shared.body, centers[:, tip], radius) for tip, radius in enumerate(shared.radii)]
    page.table(
        ["device", "deepest deflection", "depth of the tip there", "force there", "nodes there", "force at the end"],
        [
            (
                number,
                f"{1e3 * deep[deepest]:.4g}",
                f"{1e3 * tip[deepest]:.4g}",
                f"{force[deepest]:.4g}",
                int(contact.nodes[deepest]),
                f"{force[-1]:.4g}",
            )
            for number, (deep, tip, force, contact) in enumerate(
                zip(depths, below, forces, run.contacts, strict=True), 1
            )
            for deepest in [int(np.argmax(np.where(run.solved, deep, -1.0)))]
        ],
        "Contact of each tip with the body: deflection of the contact patch, and depth of the tip below the surface at "
        "rest.",
        units=["", "mm", "mm", "N", "", "N"],
    )


def _sentence(text: str) -> str:
    return f"{text.partition(chr(10))[0].rstrip('.')}."


def _factor(margin: float) -> str:
    if math.isnan(margin):
        return "–"
    return "any" if math.isinf(margin) else f"{margin:.4g}"
