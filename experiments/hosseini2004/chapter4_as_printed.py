"""Chapter 4 as printed: LQG with Q = I and R = 10 I, driven by the error, and palpate's weights beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from palpate.arrays import Array
from palpate.control import Controller, closed_loop, gain_interval, loop_gain, lqg, spectral_radius
from palpate.devices import load
from palpate.linear import rendering_plant
from palpate.report import Page

from experiments.hosseini2004 import figures
from experiments.hosseini2004.as_printed import Z_GAIN, driven_by_error, printed_weights, rest
from experiments.hosseini2004.cases import POSE, STIFFEST, case_plant, design
from experiments.hosseini2004.checks import Check, statement
from experiments.hosseini2004.loops import FORCES, Loop, respond, respond_case

__all__ = ["chapter4_as_printed"]

Name = Literal["A", "B", "C", "D"]
CASE_NAMES: Final[tuple[Name, ...]] = ("A", "B", "C", "D")
DURATION: Final[dict[Name, float]] = {"A": 6.0, "B": 6.0, "C": 20.0, "D": 6.0}  # s: the printed weights creep
SAID: Final = {"A": "stable", "B": "unstable", "C": "stable", "D": "stable"}
WHERE: Final = {"A": "section 4.4.1", "B": "section 4.4.2", "C": "section 4.4.3", "D": "section 4.4.4"}
SMALL_CHANGE: Final = 2.0  # factor of the settling time that a "small change in the transient" may be
POOR: Final = 25.0  # %; an overshoot above this is called poor


@dataclass(frozen=True)
class _Lqg:
    """An LQG of a case at 3.5 N/mm, the same force on every axis.

    Attributes:
        radius: spectral radius, per sample.
        error: of the linear loop at rest (3,), % of F/K; nan if it is unstable.
        run: with 8.5 N; None if it is unstable.
    """

    radius: float
    error: Array
    run: Loop | None

    @property
    def verdict(self) -> str:
        return "stable" if self.radius < 1.0 else "unstable"


def chapter4_as_printed(page: Page) -> list[Check]:
    """Run the printed LQG in every case, write the findings on the page and return their checks."""
    theirs = {case: _lqg(case, printed_weights(case)) for case in CASE_NAMES}
    ours = {case: _lqg(case, design(case, "lqg")) for case in CASE_NAMES}
    page.subsection("The LQG as printed: Q = I, R = 10 I, driven by the error")
    page.paragraph(
        "The thesis prints one example of its weights, Q = I and R = 10 I (section 4.3.3), and an LQG that sees only "
        "F_ref − F_object (figure 4.1). This table runs that controller; palpate's own weights and feedforward come "
        "beside it and below. The covariances of the Kalman filter are taken alike."
    )
    page.table(
        ["case", "thesis", "printed weights", "radius", "steady error", "overshoot", "settling", "own weights",
         "radius"],
        [_row(case, theirs[case], ours[case]) for case in theirs],
        "LQG on 3.5 N/mm, 8.5 N, in the linear model of each case: worst axis, settling to 5 %. Own weights of case A: "
        "R = 10⁶ I; of C and D: see the margins below.",
        units=["", "", "", "per sample", "% of F/K", "%", "s", "", "per sample"],
    )  # fmt: skip
    checks = [_stability(case, theirs[case]) for case in theirs]
    checks += _case_c(page, theirs["C"])
    checks += _case_d(page)
    return [*checks, _weights(theirs, ours), _two_rates()]


def _lqg(case: Name, controller: Controller) -> _Lqg:
    radius = spectral_radius(loop_gain(controller, case_plant(case, STIFFEST)))
    stable = radius < 1.0
    run = respond_case(case, controller, force=8.5, stiffness=3.5, duration=DURATION[case]) if stable else None
    error = static_gain(controller, case, STIFFEST).sum(axis=1) - 1.0 if stable else np.full(3, np.nan)
    return _Lqg(radius, 100 * error, run)


def _row(case: str, theirs: _Lqg, ours: _Lqg) -> tuple[Any, ...]:
    run = theirs.run
    cells: tuple[Any, ...] = (None, None, None)
    if run is not None:
        settling = "not reached" if run.settling is None else f"{run.settling:.3g}"
        cells = (f"{float(np.abs(theirs.error).max()):.1f}", f"{run.overshoot:.0f}", settling)
    return (case, SAID[case], theirs.verdict, f"{theirs.radius:.5f}", *cells, ours.verdict, f"{ours.radius:.5f}")


def _percent(run: Loop) -> float:
    """Largest steady error of the axes, % of F/K."""
    return float(np.abs(run.error).max() / run.ideal * 100)


def _stability(case: str, found: _Lqg) -> Check:
    refuted = found.verdict != SAID[case]
    return statement(
        f"case{case}-lqg-stability",
        f"case {case} with LQG, Q = I and R = 10 I, at 3.5 N/mm",
        SAID[case],
        f"{found.verdict} (spectral radius {found.radius:.4g})",
        holds=not refuted or case == "A",
        refuted=refuted,
        where=WHERE[case],
        note="the weights of case A are not printed; palpate's R = 10⁶ I is stable" if refuted else "",
    )


def static_gain(controller: Controller, case: Name, stiffness: float) -> Array:
    """Return the gain (3, 3) from F_ref to F_object at rest in the linear loop of a case, on `stiffness` N/m."""
    whole = closed_loop(controller, case_plant(case, stiffness))
    left = np.eye(whole.nstates) - whole.A
    return np.asarray((whole.C @ np.linalg.lstsq(left, whole.B, rcond=None)[0] + whole.D)[:3], dtype=float)


def _case_c(page: Page, found: _Lqg) -> list[Check]:
    """Case C has no integrators: the loop of figure 4.1 leaves an error at 3.5 N/mm, palpate's feedforward does not."""
    own = design("C", "lqg")
    by_error = np.abs(1.0 - np.diag(static_gain(driven_by_error(own), "C", STIFFEST))) * 100
    forward = {k: np.abs(1.0 - static_gain(own, "C", k * 1e3).sum(axis=1)).max() * 100 for k in (3.5, 1.0)}
    error = np.abs(found.error)
    page.paragraph(
        f"Case C has no integrators. With the printed weights the loop of figure 4.1 rests {error[1]:.1f} % off along "
        f"y and {error[2]:.1f} % along z at 3.5 N/mm, as the thesis finds. Palpate's own gains, driven by the error, "
        f"leave {by_error[1]:.1f} % along y. With palpate's feedforward (N_x, N_u), which figure 4.1 does not have, "
        f"the error is {forward[3.5]:.3f} % at 3.5 N/mm and {forward[1.0]:.1f} % on 1 N/mm."
    )
    controller = printed_weights("C")
    loops = [respond_case("C", controller, force=f, stiffness=3.5, duration=DURATION["C"]) for f in FORCES]
    page.figure(
        figures.steps({"": {f"{run.force:g} N": (run.time, run.deflection) for run in loops}},
                      targets=[run.ideal for run in loops]),
        "Case C, LQG with the printed weights, no integrators (the thesis's figures 4.13 and 4.15). Dashed: force / "
        "stiffness.",
    )  # fmt: skip
    return [
        statement("caseC-lqg-steady-error", "LQG without integrators, printed weights, loop of figure 4.1, 3.5 N/mm",
                  "leaves a steady error", f"{error[1]:.1f} % along y, {error[2]:.1f} % along z",
                  holds=bool(error.max() > 1.0), where=WHERE["C"]),
        statement("caseC-lqg-own-gains-by-error", "palpate's LQG gains of case C in the loop of figure 4.1, 3.5 N/mm",
                  "leaves a steady error", f"{by_error[1]:.1f} % along y", holds=bool(by_error[1] > 1.0), kind="own",
                  where=WHERE["C"]),
        statement("caseC-lqg-feedforward", "palpate's LQG of case C with its feedforward, 3.5 N/mm",
                  "no steady error at the stiffness designed for", f"{forward[3.5]:.3f} %",
                  holds=bool(forward[3.5] < 1e-3 and forward[1.0] > 1.0), kind="own", where=WHERE["C"],
                  note=f"on 1 N/mm, not designed for, {forward[1.0]:.1f} %"),
    ]  # fmt: skip


def _case_d(page: Page) -> list[Check]:
    """Case D with the printed weights on the nonlinear arm: no steady error, and a poor transient."""
    printed, own = printed_weights("D"), design("D", "lqg")
    forces = [respond(printed, force=f, duration=DURATION["D"]) for f in FORCES]
    theirs = [forces[-1], respond(printed, stiffness=1.0, duration=DURATION["D"])]
    ours = [respond(own, stiffness=k, duration=1.5) for k in (3.5, 1.0)]
    page.figure(
        figures.steps(
            {f"{a.stiffness:g} N/mm": {"printed weights": (a.time, a.deflection),
                                       "palpate's own": (b.time, b.deflection)}
             for a, b in zip(theirs, ours, strict=True)},
            targets=[8.5 / 3.5, 8.5], until=1.5, lowest=-0.5, highest=14.0,
        ),
        "Case D, LQG on the nonlinear arm, 8.5 N: printed weights and palpate's own (the thesis's figures 4.17 and "
        "4.21). Dashed: force / stiffness of both cubes.",
    )  # fmt: skip
    page.figure(
        figures.steps({"": {f"{run.force:g} N": (run.time, run.deflection) for run in forces}},
                      targets=[run.ideal for run in forces], until=1.5),
        "Case D, LQG with the printed weights on the nonlinear arm, 3.5 N/mm (figure 4.19).",
    )  # fmt: skip
    errors = max(_percent(run) for run in theirs)
    overshoot, slow = max(run.overshoot for run in theirs), max(run.settling or np.inf for run in theirs)
    best, fast = max(run.overshoot for run in ours), max(run.settling or np.inf for run in ours)
    page.paragraph(
        f"Case D has integrators. With the printed weights the nonlinear arm comes to F/K within {errors:.1f} % in "
        f"6 s, but overshoots by {overshoot:.0f} % and settles in {slow:.2g} s: the poor transient that the thesis "
        f"reports. It comes from the weights: palpate's own overshoot by {best:.0f} % and settle in "
        f"{fast * 1e3:.0f} ms."
    )
    return [
        statement("caseD-lqg-steady", "LQG with integrators, printed weights, nonlinear arm, 1 and 3.5 N/mm",
                  "almost zero steady error", f"{errors:.2f} % after 6 s at most", holds=errors < 0.5,
                  where="section 4.5"),
        statement("caseD-lqg-transient", "the same: transient", "poor transient response",
                  f"overshoot {overshoot:.0f} %, 5 % settling {slow:.2g} s", holds=overshoot > POOR,
                  where="section 4.5"),
        statement("caseD-lqg-own-transient", "palpate's own LQG of case D: transient",
                  "overshoot below 10 %, settling below 0.1 s", f"{best:.0f} %, {fast * 1e3:.0f} ms",
                  holds=best < 10.0 and fast < 0.1, kind="own", where="section 4.5"),
        _forces(forces),
        _robust(printed, theirs),
    ]  # fmt: skip


def _forces(lqg_runs: list[Loop]) -> Check:
    """LQG and lead-lag of the thesis under 1, 4 and 8.5 N on 3.5 N/mm: steady error along z."""
    arm = load("phantom-premium-1.5a")
    lqg_error = max(float(np.abs(run.error[2]) / run.ideal) for run in lqg_runs) * 100
    rests = [1e3 * rest(arm, [1.0, 1.0, Z_GAIN], STIFFEST, run.force)[2] / run.ideal for run in lqg_runs]
    lead_lag = [100 * abs(r - 1) for r in rests]
    return statement(
        "sec4.5-forces", "steady error along z under 1, 4 and 8.5 N on 3.5 N/mm, nonlinear arm",
        "the LQG performs better than the lead–lag",
        f"LQG at most {lqg_error:.3f} %, lead–lag (gains of table 5.1) {min(lead_lag):.0f} to {max(lead_lag):.0f} %",
        holds=lqg_error < 0.1 * min(lead_lag), where="section 4.5",
    )  # fmt: skip


def _robust(controller: Controller, runs: list[Loop]) -> Check:
    """Stiffnesses for which case D with the printed weights is stable."""
    low, high = gain_interval(loop_gain(controller, case_plant("D", STIFFEST)))
    return statement(
        "sec4.6-robust", "case D with LQG, printed weights: objects of other stiffness", "very robust",
        f"stable up to {high * STIFFEST * 1e-3:.0f} N/mm; 1 and 3.5 N/mm run on the nonlinear arm",
        holds=low * STIFFEST < 1000.0 and high > 2.0 and all(run.diverged is None for run in runs),
        where="section 4.6", note="the servo period is 0.5 ms, without delay, encoder or limits of the drive",
    )  # fmt: skip


def _weights(theirs: dict[Name, _Lqg], ours: dict[Name, _Lqg]) -> Check:
    """Whether other weights change the transient only a little."""
    slow, fast = (found["D"].run for found in (theirs, ours))
    if slow is None or fast is None or not slow.settling or not fast.settling:
        raise RuntimeError("case D with LQG does not settle")
    ratio = slow.settling / fast.settling
    return statement(
        "sec4.3.3-weights",
        "effect of other weights of the LQG",
        "only a small change in the transient",
        f"case D at 3.5 N/mm settles {ratio:.0f} times faster with palpate's weights; case A is stable with them only",
        holds=ratio > SMALL_CHANGE and theirs["A"].verdict != ours["A"].verdict,
        refuted=True,
        where="section 4.3.3",
    )


def _two_rates() -> Check:
    """The controllers are sampled every 0.5 ms, the virtual couple at 1000 Hz: the limit at the second rate."""
    arm = load("phantom-premium-1.5a")
    limits = {}
    for period in (5e-4, 1e-3):
        plant = rendering_plant(arm, POSE, stiffness=1000.0, period=period)
        limits[period] = gain_interval(loop_gain(lqg(plant), plant))[1]
    return statement(
        "eq3.34-two-rates",
        "servo period",
        "T = 0.5 ms (3.12)",
        "F_vc = 1000 Hz (3.34)",
        holds=limits[5e-4] > 1.2 * limits[1e-3],
        cause="two-rates",
        where="(3.12), (3.34)",
        note=f"not the same loop: palpate's LQG of case D is stable up to {limits[5e-4]:.1f} N/mm at 0.5 ms and up to "
        f"{limits[1e-3]:.1f} N/mm, designed anew, at 1 ms",
    )
