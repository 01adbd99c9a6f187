"""Stability certificates of the loops of the thesis: cases A to D, and the rows of tables 3.1 and 5.1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal

from palpate.control import Controller, gain_interval, loop_gain
from palpate.report import Page
from palpate.stability import Certificate, certify

from experiments.hosseini2004.cases import CASES, STIFFEST, case_b, case_plant, design
from experiments.hosseini2004.checks import Check, statement, within
from experiments.hosseini2004.loops import Model, scenario

__all__ = ["certificate", "certificates", "rows"]

Name = Literal["A", "B", "C", "D"]
KINDS: Final = {"lead_lag": "lead–lag", "lqg": "LQG"}
SECONDS: Final[dict[str, float]] = {"experimental": 6.0, "linear": 0.4, "nonlinear": 0.8}


@dataclass(frozen=True)
class Row:
    """A loop of the thesis.

    Attributes:
        id: as its check is called.
        where: the thesis's place.
        case: whose controller it has; kind: of the controller.
        model, kinematics: of the device, in a scenario's words.
        stiffness: of the object, N/mm.
        stable: what the thesis shows.
    """

    id: str
    where: str
    case: Name
    kind: Literal["lead_lag", "lqg"]
    model: Model
    kinematics: Literal["nonlinear", "linear"]
    stiffness: float
    stable: bool = True


def rows() -> list[Row]:
    """Return the loops, 8.5 N on each axis; table 3.1's identified model is case A, its nonlinear one table 5.1's."""
    found = []
    for case, chosen in CASES.items():
        for kind in ("lead_lag", "lqg"):
            where = f"case {case}" + (", table 3.1" if (case, kind) == ("A", "lead_lag") else "")
            stable = (case, kind) != ("B", "lqg")
            name = f"case{case}-{kind.replace('_', '-')}-certificate"
            found.append(Row(name, where, case, kind, chosen.model, chosen.kinematics, 3.5, stable))  # type: ignore[arg-type]
    for stiffness in (3.5, 1.0, 2.0, 2.5, 3.0):
        for kind in ("lead_lag", "lqg"):
            where = "table 5.1" + (", table 3.1" if (stiffness, kind) == (3.5, "lead_lag") else "")
            name = f"tab5.1-{stiffness:g}-{kind.replace('_', '-')}-certificate"
            found.append(Row(name, where, "D", kind, "nonlinear", "nonlinear", stiffness))  # type: ignore[arg-type]
    return found


def certificate(row: Row, controller: Controller) -> Certificate:
    """Return the certificate of a loop: a scenario with the controller's matrices in it, so that it runs anywhere."""
    s = controller.system
    table: dict[str, Any] = {"kind": "state_space", "A": s.A.tolist(), "B": s.B.tolist(), "C": s.C.tolist()}
    table["D"] = s.D.tolist()
    if controller.antiwindup is not None:
        table["antiwindup"] = controller.antiwindup.tolist()
    tables = scenario(8.5, row.stiffness, row.model, row.kinematics, SECONDS[row.model])
    return certify({**tables, "controller": table})


def certificates(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Certify every loop, write the verdicts on the page and return their checks."""
    page.section("Certificates", "certificates")
    page.paragraph(
        "Every loop of palpate's own controllers, judged as `palpate certify` judges a scenario: the sampled loop as "
        "one matrix, exact for forces held over 0.5 ms; four methods that share no step (eigenvalues, Jury's table, "
        "Routh's array, a Lyapunov matrix), and no claim unless all four agree; then 8.5 N on every axis, run in full, "
        "and the loop judged again where that run comes to rest. Each verdict holds for small motions about these "
        "poses, ticks on time, no encoder counts, no dry friction, no limit of the drive, and a reference force that "
        "does not depend on the motion."
    )
    found: list[tuple[Row, Certificate]] = []
    listed = rows()
    for number, row in enumerate(listed):
        tick(f"certificate of {row.where}", number / len(listed))
        found.append((row, certificate(row, design(row.case, row.kind))))
    page.table(
        ["loop", "controller", "stiffness", "verdict", "stable up to", "phase", "delay", "disk", "radius"],
        [_cells(row, c) for row, c in found],
        "Certificates. Stable up to: stiffness at which the loop at the start loses stability, all axes alike; phase "
        "and further delay that every axis bears; disk: alpha that each axis bears by itself.",
        units=["", "", "N/mm", "", "N/mm", "deg", "ms", "", "per sample"],
    )
    unstable = next(c for row, c in found if not row.stable)
    if unstable.counter_example is not None:
        page.paragraph(f"Counter-example of case B with LQG, run: {unstable.counter_example.sentence}")
    checks = [_verdict(row, c) for row, c in found]
    return [*checks, *_agreements({row.id: c for row, c in found})]


def _cells(row: Row, c: Certificate) -> tuple[Any, ...]:
    m = c.margin
    up = m.get("gain_margin", m.get("critical_gain"))
    return (
        row.where, KINDS[row.kind], f"{row.stiffness:g}", c.verdict.state.label,
        None if up is None else f"{row.stiffness * up:.4g}",
        None if "phase_margin_deg" not in m else f"{m['phase_margin_deg']:.0f}",
        None if "delay_margin_s" not in m else f"{1e3 * m['delay_margin_s']:.2f}",
        None if "disk_margin" not in m else f"{m['disk_margin']:.2f}",
        f"{m['spectral_radius']:.5f}",
    )  # fmt: skip


def _verdict(row: Row, c: Certificate) -> Check:
    said, label = "stable" if row.stable else "unstable", c.verdict.state.label
    holds = label == said and len(set(c.criteria.values())) == 1
    return statement(
        row.id, f"certificate: {row.where}, palpate's own {KINDS[row.kind]}, {row.stiffness:g} N/mm", said, label,
        holds=holds, kind="own", where=row.where, note=c.claim,
    )  # fmt: skip


def _agreements(found: dict[str, Certificate]) -> list[Check]:
    """Hold the certified limits against those that chapter 4 finds from the case's own plant."""
    b = case_b(integrators=CASES["B"].integrators)
    fraction = found["caseB-lqg-certificate"].margin["critical_gain"]
    aware = loop_gain(design("D", "lqg"), case_plant("D", STIFFEST))
    up = found["caseD-lqg-certificate"].margin["gain_margin"]
    return [
        within(
            "caseB-lqg-certified-limit", "case B with LQG: stiffness up to which it is certified, against chapter 4's",
            b.critical_stiffness, fraction * STIFFEST, "N/m", 1e-6 * b.critical_stiffness, kind="own",
            where="section 4.4.2",
        ),
        within(
            "caseD-lqg-certified-limit", "case D with LQG: stiffness up to which it is certified, against the margins'",
            gain_interval(aware)[1] * STIFFEST, up * STIFFEST, "N/m", 1e-5 * up * STIFFEST, kind="own",
            where="section 4.4.4",
        ),
    ]  # fmt: skip
