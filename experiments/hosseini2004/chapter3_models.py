"""Chapter 3, the linear models: 3.9, discretizations, experimental model 3.25 to 3.31, cases C and D 3.37 to 3.42."""

from __future__ import annotations

import control
import numpy as np
from palpate.arrays import Array
from palpate.devices import Device
from palpate.linear import discretize, linearize
from palpate.linear.linearization import static_tip_force
from palpate.report import Page
from scipy.linalg import expm

from experiments.hosseini2004 import figures
from experiments.hosseini2004.checks import Check, Status, at_most, compare, matrix_pair, statement, within
from experiments.hosseini2004.experimental import PERIOD, experimental_model
from experiments.hosseini2004.printed_numbers import printed, with_zero

__all__ = ["case_c", "case_d", "discretisation", "experimental", "linear_model"]

EQUILIBRIUM = np.array([0.0, 2.2305, 3.2776])  # rad, as printed in (2.84)
TORQUE = np.array([0.0, 0.01, 0.01])  # N m, at which (3.37) and (3.41) are taken
STIFFEST = 3500.0  # N/m
DENOMINATORS = ("eq3.26-denominator", "eq3.27-denominator", "eq3.29-denominator")
NUMERATORS = ("eq3.27-numerator", "eq3.28-numerator", "eq3.29-numerator", "eq3.30-numerator")


def linear_model(page: Page, device: Device) -> list[Check]:
    """Check A_c of (3.9): entries without damping, and the factors of k1, k2, k3."""
    free = linearize(device.frictionless(), EQUILIBRIUM).A
    # One friction factor at a time, each 1 N m s/rad: the columns of -M^-1.
    factor = [linearize(device.with_viscous(unit), EQUILIBRIUM).A[3:, 3:] for unit in np.eye(3)]
    checks = [
        *compare("eq3.9-yaw-damping", factor[0][0, 0]),
        *compare("eq3.9-position", free[4:, 1:3]),
        *compare("eq3.9-k2", factor[1][1:, 1]),
        *compare("eq3.9-k3", factor[2][1:, 2]),
    ]
    page.subsection("Linear model in torque (3.9)")
    page.paragraph(
        "A_c about θ = (0, 2.2305, 3.2776) rad, exact derivatives of the nonlinear arm. Below: its entries that the "
        "thesis prints, damping apart, then the factors of k2 and k3."
    )
    matrix_pair(page, "eq3.9-position", free[4:, 1:3])
    matrix_pair(page, "eq3.9-k2", factor[1][1:, 1])
    matrix_pair(page, "eq3.9-k3", factor[2][1:, 2])
    page.paragraph(f"A_c(4,4): printed −444.4 k1, computed {factor[0][0, 0]:.1f} k1.".replace("-", "−"))
    return checks


def discretisation(page: Page, device: Device) -> list[Check]:
    """Compare the nested series (3.12), the exact hold and Tustin's rule at T = 0.5 ms."""
    model = linearize(device, EQUILIBRIUM)
    exact = expm(model.A * PERIOD)
    rows = []
    error = {}
    for method, text in (("series", "nested series (3.12), N = 4"), ("zoh", "exact hold"), ("tustin", "Tustin (3.42)")):
        sampled = discretize(model, PERIOD, method=method)  # type: ignore[arg-type]
        error[method] = float(np.abs(sampled.A - exact).max())
        poles = np.linalg.eigvals(sampled.A)
        speeds = np.log(poles[np.abs(poles - 1) > 1e-9]) / PERIOD
        fastest = speeds[np.argmax(np.abs(speeds))]
        reference = np.linalg.eigvals(model.A)
        wanted = reference[np.argmax(np.abs(reference))]
        relative = abs(fastest - wanted) / abs(wanted)
        rows.append((text, f"{error[method]:.1e}", f"{relative:.1e}", "yes" if np.any(sampled.D) else "no"))
    page.subsection("Discretisation (3.12) to (3.14)")
    page.paragraph(
        "The arm's fastest pole is 22 1/s and T = 0.5 ms, so four terms of the series are exact to "
        f"{error['series']:.0e}: the truncation is far below anything that can be measured. Tustin's rule, which "
        "(3.42) uses, answers within the sample (D ≠ 0), which no sampled loop with a hold does."
    )
    page.table(
        ["method", "largest error of A_d", "relative error of the fastest pole", "answers within the sample"],
        rows,
        "Discretisations of (3.9) at T = 0.5 ms against the matrix exponential.",
    )
    return [
        within("eq3.12-series", "largest error of A_d by the series with N = 4", 0.0, error["series"], "", 1e-9,
               kind="own", where="(3.12), (3.13)",
               note="against the matrix exponential; the thesis prints no matrices here"),
    ]  # fmt: skip


def experimental(page: Page) -> list[Check]:
    """Hold the printed A_e, B_e against the printed transfer functions, and look at the poles."""
    a, b = printed("eq3.31-A_e"), printed("eq3.31-B_e")
    checks = _polynomials(a.values, b.values)
    model = experimental_model(integrating=False)
    whole = experimental_model()
    poles = np.linalg.eigvals(model.A)
    outermost = sorted((abs(np.linalg.eigvals(model.A[i : i + 6, i : i + 6])).max() for i in (0, 6, 12)), reverse=True)
    misprint = np.roots(printed("eq3.29-denominator").values[0])
    worst = float(np.abs(misprint).max())
    page.subsection("Experimental model (3.25) to (3.31)")
    page.paragraph(
        "The recordings behind this model are not public, so A_e and B_e are carried over. The transfer functions "
        "h_ij(z) are recomputed from them and agree within the rounding of both, except one coefficient: −1.1428 in "
        f"(3.29) and (3.30) must be −0.1428. As printed the model has a pole at {worst:.3f}."
    )
    for kind, rows in (("denominators", DENOMINATORS), ("numerators", NUMERATORS)):
        found = {c.id: c for c in checks}
        texts, ours, marks = [], [], []
        for key in rows:
            entry = printed(key)
            mine = [found.get(f"{key}[{j + 1}]") for j in range(len(entry.rows[0]))]
            texts.append([with_zero(text) for text in entry.rows[0]])
            ours.append(
                [float(t) if c is None else float(c.computed) for t, c in zip(entry.rows[0], mine, strict=True)]
            )
            marks.append([c is not None and c.status != "match" for c in mine])
        names = ", ".join(dict.fromkeys(printed(key).what.split(",")[0] for key in rows))
        page.matrices(f"(3.26) to (3.30): {kind} of {names}, highest power first", texts, ours, differs=marks,
                      labels=("printed transfer functions", "from the printed A_e, B_e"))  # fmt: skip
    page.paragraph(
        f"With that corrected, the largest pole of each axis is {outermost[0]:.4f}, {outermost[1]:.4f} and "
        f"{outermost[2]:.4f}: 1 within the rounding of the printed digits, and palpate sets these poles to 1. "
        "Mechanics supports this for the yaw only. On axes 2 and 3 gravity acts as a spring: (3.9) has −5.7 and −84.2 "
        "1/s² there, and no pole at 1. The next section compares the two models."
    )
    page.figure(
        figures.poles_in_the_disk({"as printed, corrected": poles, "misprint −1.1428": misprint}),
        "Poles of the experimental model and of the misprinted denominator of (3.29), (3.30).",
    )
    return [
        *checks,
        *_carried_matrices(model),
        statement("eq3.29-pole", "largest pole of h32, h33 as printed", "a model of a stable experiment",
                  f"{worst:.3f}: it would double every {np.log(2) / np.log(worst) * PERIOD * 1e3:.1f} ms",
                  holds=worst > 1.5, cause="digit-of-3.29", where="(3.29), (3.30)"),
        statement("eq3.25-integrates", "poles nearest to 1 of the three axes", "palpate: 1 within rounding",
                  ", ".join(f"{value:.4f}" for value in outermost),
                  holds=bool(np.all(np.abs(np.array(outermost) - 1) < 5e-3)
                             and np.abs(np.abs(np.linalg.eigvals(whole.A)).max() - 1) < 1e-9),
                  kind="own", where="(3.26) to (3.30)"),
    ]  # fmt: skip


def _carried_matrices(model: control.StateSpace) -> list[Check]:
    """Return checks that the model in use has the printed A_e and B_e, within the rounding of both printed forms."""
    # Axis 1 is built from (3.26), whose digits are scaled by the chain 2, 1, 1, 0.5, 0.25 of A_e.
    slack = np.zeros((18, 18))
    entry, chain = printed("eq3.26-denominator"), np.cumprod([1.0, 2.0, 1.0, 1.0, 0.5, 0.25])
    slack[0, :6] = [entry.resolution(text) / scale for text, scale in zip(entry.rows[0][1:], chain, strict=True)]
    checks = []
    for key, ours, more in (("eq3.31-A_e", model.A, slack), ("eq3.31-B_e", model.B, np.zeros((18, 3)))):
        p = printed(key)
        allowed = np.array([[p.resolution(text) for text in row] for row in p.rows]) + more
        excess = float((np.abs(ours - p.values) / allowed).max())
        checks.append(
            at_most(key, f"{p.what} in use: largest difference over the rounding of the printed forms", 1.0, excess, "",
                    kind="carried", tolerance=1e-6, where=p.where)
        )  # fmt: skip
    return checks


def _polynomials(a: Array, b: Array) -> list[Check]:
    """Return checks of each printed coefficient; its tolerance adds what the rounding of A_e and B_e can do."""

    def coefficients(a: Array, b: Array) -> dict[str, Array]:
        out = {}
        for axis, key in enumerate(DENOMINATORS):
            block = slice(6 * axis, 6 * axis + 6)
            out[key] = np.asarray(np.poly(a[block, block]), dtype=np.float64)
        for key, (axis, column) in zip(NUMERATORS, ((1, 1), (1, 2), (2, 1), (2, 2)), strict=True):
            block = slice(6 * axis, 6 * axis + 6)
            c = np.zeros((1, 6))
            c[0, -1] = 0.5  # C_e of the axis's last state, by (3.37): C_dl(2,12) = -230.6 = 0.5 * -461.19
            # num = det(zI - A + b c) - det(zI - A)
            closed = np.poly(a[block, block] - b[block, [column]] @ c)
            out[key] = np.asarray((closed - np.poly(a[block, block]))[2:], dtype=np.float64)
        return out

    base = coefficients(a, b)
    slack = {key: np.zeros_like(value) for key, value in base.items()}
    for key, matrix in (("eq3.31-A_e", a), ("eq3.31-B_e", b)):
        entry = printed(key)
        for i, row in enumerate(entry.rows):
            for j, text in enumerate(row):
                if "." not in text or text in ("0.5", "0.25"):  # structure, not data
                    continue
                moved = matrix.copy()
                moved[i, j] += entry.resolution(text)
                shifted = coefficients(moved, b) if matrix is a else coefficients(a, moved)
                for name in slack:
                    slack[name] += np.abs(shifted[name] - base[name])
    checks = []
    for key, values in base.items():
        entry = printed(key)
        powers = len(entry.rows[0]) - 1
        for j, text in enumerate(entry.rows[0]):
            if float(text) == 0.0 or (j == 0 and "denominator" in key):
                continue
            tolerance = entry.resolution(text) + float(slack[key][j])
            part = "denominator" if key in DENOMINATORS else "numerator"
            what = f"{entry.what.split(',')[0]}, {part}, z{_power(powers - j)}"
            name, value, where = f"{key}[{j + 1}]", float(values[j]), entry.where
            wrong = entry.erratum(0, j)
            if wrong is None:
                note = "tolerance: rounding of the transfer function and of the matrices"
                checks.append(
                    within(name, what, float(text), value, "", tolerance, kind="recomputed", where=where, note=note)
                )
                continue
            right, why = float(wrong[0]), wrong[1].why
            good = abs(value - right) <= tolerance < abs(value - float(text))
            status: Status = "erratum" if good else "differs"
            checks.append(
                Check(name, what, float(text), value, "", tolerance, status, "recomputed", why, where=where,
                      right=right, cause=wrong[1].cause)
            )  # fmt: skip
    return checks


def _power(n: int) -> str:
    return "⁰¹²³⁴⁵⁶"[n] if n != 1 else ""


def case_c(page: Page, device: Device) -> list[Check]:
    """Check A_dl and C_dl of (3.37)."""
    model = experimental_model(integrating=False)
    jacobian = device.jacobian(EQUILIBRIUM)
    turning = np.einsum("k,kij->ij", static_tip_force(jacobian, TORQUE), device.tip_hessian(EQUILIBRIUM))
    a = model.A + model.B @ turning @ model.C
    c = STIFFEST * jacobian @ model.C
    values = {
        "eq3.37-A_dl": a[7:, 11],
        "eq3.37-C_dl-x": c[0, :6],
        "eq3.37-C_dl-y": c[1, 11],
        "eq3.37-C_dl-z": c[2, 17],
    }
    page.subsection("Case C: experimental model and linearized kinematics (3.37)")
    page.paragraph(
        "A_dl = A_e + B_e F̄_θ C_e and C_dl = K P̄ C_e for 3.5 N/mm. C_e is not printed; it follows from (3.26), and "
        "C_dl confirms it. Shown are the entries in which A_dl differs from A_e, and C_dl's row of axis x."
    )
    checks = []
    for key, value in values.items():
        checks += compare(key, value)
        if np.ndim(value):
            matrix_pair(page, key, value)
    y, z = checks[-2], checks[-1]
    checks += _numerator_h11(float(jacobian[0, 0]))
    page.paragraph(
        f"C_dl(2,12): printed {y.printed:.1f}, computed {y.computed:.1f}. "
        f"C_dl(3,18): printed {z.printed:.1f}, computed {z.computed:.1f}.".replace("-", "−")
    )
    return checks


def _numerator_h11(reach: float) -> list[Check]:
    """Check (3.26)'s numerator against the printed C_dl: C_e = C_dl / (K reach), times A_e's chain 2, 1, 1, .5, .25."""
    entry, row = printed("eq3.26-numerator"), printed("eq3.37-C_dl-x")
    chain = 0.5 * np.cumprod([2.0, 1.0, 1.0, 0.5, 0.25])
    checks = []
    for j, text in enumerate(entry.rows[0]):
        scale = chain[j] / (STIFFEST * reach)
        tolerance = entry.resolution(text) + abs(scale) * row.resolution(row.rows[0][j + 1])
        checks.append(
            within(f"{entry.id}[{j + 1}]", f"h11(z), numerator, z{_power(4 - j)}", float(text),
                   float(scale * row.values[0, j + 1]), "", tolerance, kind="recomputed",
                   where="(3.26) from C_dl of (3.37)",
                   note="tolerance: rounding of the transfer function and of C_dl")
        )  # fmt: skip
    return checks


def case_d(page: Page, device: Device) -> list[Check]:
    """Check every matrix of (3.41) and (3.42)."""
    force = static_tip_force(device.jacobian(EQUILIBRIUM), TORQUE)
    model = linearize(device, EQUILIBRIUM, inputs="force", outputs="object_force", force=force, stiffness=STIFFEST)
    sampled = discretize(model, PERIOD, method="tustin")
    values = {
        "eq3.41-A_ci": model.A[3:],
        "eq3.41-C_ci": model.C[:, :3],
        "eq3.42-A_di": sampled.A,
        "eq3.42-B_di": sampled.B,
        "eq3.42-C_di": sampled.C,
        "eq3.42-D_di": sampled.D,
    }
    page.subsection("Case D: integrated linear model (3.41), (3.42)")
    page.paragraph(
        "Linear model from tip force to object force, continuous and sampled by Tustin's rule at T = 0.5 ms. On axis 1 "
        "the entries that depend on the force transformation are −0.948 times the correct ones; B_di has lost one more "
        "sign. Everything else agrees to the last printed digit. Marked entries differ."
    )
    checks = []
    for key, value in values.items():
        checks += compare(key, value)
        matrix_pair(page, key, value)
    return [*checks, _sideways(model)]


def _sideways(model: control.StateSpace) -> Check:
    """What the printed sign of A_ci(4,1) would do."""
    printed_entry = printed("eq3.41-A_ci").values[0, 0]
    ours = np.roots([1.0, -model.A[3, 3], -model.A[3, 0]])
    theirs = np.roots([1.0, -model.A[3, 3], -printed_entry])
    return statement(
        "eq3.41-yaw-pole",
        "slow pole of the yaw axis while the arm is held",
        f"{theirs.real.max():+.2f} 1/s with 3.8814",
        f"{ours.real.max():+.2f} 1/s with {model.A[3, 0]:.4f}",
        holds=bool(ours.real.max() < 0 < theirs.real.max()),
        cause="axis-1-factor",
        where="(3.41)",
        note="the held force points away from the yaw axis, so it pulls the arm back",
    )
