"""Chapter 2: the arm's parameters, kinematics, dynamics, equilibrium and open-loop motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from palpate import devices
from palpate.arrays import Array
from palpate.devices import Device
from palpate.linear import equilibria, linearize
from palpate.report import Page

from experiments.hosseini2004 import figures
from experiments.hosseini2004.checks import Check, compare, statement, within
from experiments.hosseini2004.motion import Motion, constant, move, pulse
from experiments.hosseini2004.printed_equations import PrintedArm, body_jacobian, rotation
from experiments.hosseini2004.printed_numbers import printed
from experiments.hosseini2004.specifications import specifications

__all__ = ["DEVICE", "EQUILIBRIUM", "chapter2"]

DEVICE = "phantom-premium-1.5a"
EQUILIBRIUM = np.array([0.0, 2.2305, 3.2776])  # rad, as printed in (2.84) and used for every linear model
SPEED = np.array([0.0, 0.1, 0.1])  # rad/s, (2.86), (2.88)
PULSE = 1.0  # s: the thesis calls tau1 a pulse without giving its width


def chapter2(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Compute chapter 2, write it on the page and return its checks; `tick(text, fraction)` reports progress."""
    device = devices.load(DEVICE)
    page.section("Chapter 2: the arm", "chapter-2")
    checks = _parameters(page, device)
    tick("kinematics and dynamics", 0.1)
    checks += _kinematics(page, device)
    checks += _dynamics(page, device)
    tick("equilibrium", 0.3)
    checks += _equilibrium(page, device)
    tick("open-loop motion", 0.4)
    checks += _open_loop(page, device)
    return checks


def _parameters(page: Page, device: Device) -> list[Check]:
    p = device.parameters
    values: dict[str, tuple[Array | float, float]] = {  # SI, factor to the printed unit
        "eq2.19-l1": (p.one("geometry.l1"), 1.0),
        "eq2.20-l2": (p.one("geometry.l2"), 1.0),
        "eq2.21-l3": (p.one("geometry.l3"), 1.0),
        "eq2.27-ma": (p.one("mass.a"), 1.0),
        "eq2.29-Ia": (p.many("inertia.a", 3), 1e4),
        "eq2.36-mc": (p.one("mass.c"), 1.0),
        "eq2.38-Ic": (p.many("inertia.c", 3), 1e4),
        "eq2.44-mbe": (p.one("mass.be"), 1.0),
        "eq2.46-Ibe": (p.many("inertia.be", 3), 1e4),
        "eq2.47-l5": (p.one("geometry.l5"), 1e3),
        "eq2.53-mdf": (p.one("mass.df"), 1.0),
        "eq2.55-Idf": (p.many("inertia.df", 3), 1e4),
        "eq2.56-l6": (p.one("geometry.l6"), 1e3),
        "eq2.58-Ibase": (p.one("inertia.base"), 1e4),
    }
    checks: list[Check] = []
    rows = []
    for key, (value, scale) in values.items():
        mine = compare(key, value, kind="carried", scale=scale)
        entry = printed(key)
        ours = ", ".join(_alike(text, check) for text, check in zip(entry.rows[0], mine, strict=True))
        rows.append((entry.where, entry.what, ", ".join(entry.rows[0]), ours, entry.unit, _carried(mine)))
        checks += mine
    page.paragraph(
        "The published segments of the PHANToM Premium 1.5A, as `palpate.devices` carries them: input of everything "
        "below, not a result. The inertias of BE and DF are about the joint axis already."
    )
    page.table(
        ["equation", "parameter", "printed", "palpate", "unit", "status"],
        rows,
        "Parameters (2.19) to (2.58), carried over.",
    )
    return checks + specifications(page, device, EQUILIBRIUM)


def _kinematics(page: Page, device: Device) -> list[Check]:
    p = device.parameters
    rng = np.random.default_rng(2004)
    poses = rng.uniform(-np.pi, np.pi, (200, 3))
    l1, l2 = p.one("geometry.l1"), p.one("geometry.l2")
    gap = max(float(np.abs(device.jacobian(q) - rotation(q) @ body_jacobian(q, l1, l2)).max()) for q in poses)
    points = device.forward(poses)
    back = max(float(np.abs(device.forward(device.inverse(point)) - point).max()) for point in points)
    page.subsection("Kinematics (2.10) to (2.14)")
    page.paragraph(
        f"At 200 random poses the tip's Jacobian equals the printed body Jacobian (2.14) turned by R(θ) of (2.10) to "
        f"{gap:.0e} m/rad, and the inverse kinematics (2.11) to (2.13) lead back to the same tip to {back:.0e} m."
    )
    return [
        within("eq2.14-jacobian", "largest |R(θ) J_body(θ) − ∂p/∂θ| at 200 random poses", 0.0, gap, "m/rad", 1e-14,
               kind="sentence", where="(2.10), (2.14)", note="rounding only"),
        within("eq2.13-inverse", "largest |p(θ(p)) − p| at 200 random poses", 0.0, back, "m", 1e-12,
               kind="sentence", where="(2.10) to (2.13)", note="rounding only"),
    ]  # fmt: skip


def _dynamics(page: Page, device: Device) -> list[Check]:
    """Show what the printed signs of M23 (2.64, 2.65) and C32 (2.73) do."""
    ideal = device.frictionless()
    arms: dict[str, Device | PrintedArm] = {
        "signs of palpate": ideal,
        "M23, M32 as printed": PrintedArm(ideal, coriolis=False),
        "C32 as printed": PrintedArm(ideal, inertia=False),
        "all as printed": PrintedArm(ideal),
    }
    start, speed = np.array([1.0, 1.0, 1.0]), np.array([3.0, -2.0, 4.0])
    free = constant([0.0, 0.0, 0.0])
    drift = {}
    for label, arm in arms.items():
        motion = move(arm, start, speed, free, 1.0)
        energy = np.array([arm.energy(q, qd) for q, qd in zip(motion.q, motion.qd, strict=True)])
        drift[label] = (motion.time, 100 * (energy / energy[0] - 1))
    largest = {label: float(curve[np.argmax(np.abs(curve))]) for label, (_, curve) in drift.items()}
    page.subsection("Dynamics (2.61) to (2.81)")
    page.paragraph(
        "The energy of an arm without drive and damping is constant. With the printed sign of M23 = M32 (2.64, 2.65), "
        "or of C32 (2.73), it is not. The thesis's own linear model (3.41) follows from M23 with a minus. "
        "dM/dt − 2C is skew-symmetric only with C32 = −½ h cos(θ2 − θ3) θ2'. The leading minus of (2.79), (2.81), "
        "(3.5) and (3.7) is wrong as well: a positive torque accelerates its joint forward."
    )
    page.figure(
        figures.lines(
            {label: (time, values[:, None]) for label, (time, values) in drift.items()},
            titles=["free motion from (1, 1, 1) rad at (3, −2, 4) rad/s"],
            ylabel="energy change [%]",
        ),
        "Energy of the undamped arm in free motion, each printed sign alone and all together.",
    )
    conserved = abs(largest["signs of palpate"])
    pushed = float(ideal.acceleration(EQUILIBRIUM, np.zeros(3), np.add(ideal.gravity(EQUILIBRIUM), [0, 1e-3, 0]))[1])
    m23, c32 = largest["M23, M32 as printed"], largest["C32 as printed"]
    return [
        within("eq2.62-energy", "largest change of energy in 1 s of free motion", 0.0, float(conserved), "%", 1e-4,
               kind="own", where="(2.61) to (2.75)",
               note="corrected signs, against conservation of energy; the tolerance is the integrator's"),
        statement("eq2.64-M23", "sign of M23 = M32", "+½ h sin(θ2 − θ3)", "−½ h sin(θ2 − θ3)",
                  holds=bool(abs(m23) > 1.0 and conserved < 1e-4), cause="sign-of-M23", where="(2.64), (2.65)",
                  note=f"energy changes by up to {abs(m23):.0f} % in 1 s with this sign alone as printed"),
        statement("eq2.73-C32", "sign of C32", "+½ h cos(θ2 − θ3) θ2'", "−½ h cos(θ2 − θ3) θ2'",
                  holds=bool(abs(c32) > 0.5 and conserved < 1e-4), cause="sign-of-C32", where="(2.73)",
                  note=f"energy changes by up to {abs(c32):.0f} % in 1 s with this sign alone as printed"),
        statement("eq2.79-minus", "sign in front of M⁻¹ in the state equations", "−1/(M22 M33 − M23²)",
                  "+1/(M22 M33 − M23²)", holds=pushed > 0, cause="leading-minus",
                  where="(2.79), (2.81), (3.5), (3.7)",
                  note=f"a torque of +0.001 N·m on joint 2 accelerates it by {pushed:+.2f} rad/s²"),
    ]  # fmt: skip


def _equilibrium(page: Page, device: Device) -> list[Check]:
    found = equilibria(device, torque=[0.0, 0.01, 0.01])
    stable = next(pose for pose in found if pose.stable)
    checks = [*compare("eq2.84-theta2", stable.q[1]), *compare("eq2.84-theta3", stable.q[2])]
    poles = np.linalg.eigvals(linearize(device.frictionless(), stable.q).A)
    damped = np.linalg.eigvals(linearize(device, stable.q).A)
    page.subsection("Equilibrium (2.82) to (2.84) and eigenvalues (figure 2.13)")
    page.table(
        ["angle", "printed", "palpate", "tolerance", "status"],
        [(c.what, f"{c.printed:.4f}", f"{c.computed:.4f}", f"±{c.tolerance:.2g}", c.status) for c in checks],
        "Equilibrium under τ = (0, 0.01, 0.01) N·m. The difference in θ2 is the rounding of l5 to 0.1 mm.",
    )
    shown = sorted({round(abs(pole.imag), 2) for pole in poles})
    worst = float(poles.real.max())
    page.paragraph(
        f"The equation has {len(found)} solutions in one turn of each joint; one is stable. Without damping the "
        f"eigenvalues there are 0, 0, ±{shown[1]}j and ±{shown[2]}j 1/s: all on the imaginary axis, none to its right. "
        "θ2 and θ3 swing like pendulums; the yaw, a double pole at 0, drifts. Damping moves all poles but one of the "
        "yaw to the left."
    )
    page.figure(
        figures.eigenvalues({"undamped": poles, "with k of (3.36)": damped}),
        "Eigenvalues of the linearized arm at its equilibrium (the thesis's figure 2.13), without and with damping.",
    )
    checks.append(
        statement(
            "fig2.13-eigenvalues",
            "eigenvalues of the open-loop system",
            "some in the right half-plane or on the imaginary axis",
            f"0, 0, ±{shown[1]}j, ±{shown[2]}j: on the axis, none to its right",
            holds=abs(worst) < 1e-6 and float(np.abs(poles.real).max()) < 1e-6,
            where="figure 2.13, section 2.7",
        )
    )
    return checks


def _open_loop(page: Page, device: Device) -> list[Check]:
    ideal = device.frictionless()
    torque = pulse([0.01, 0.01, 0.01], 0, PULSE)
    as_printed = PrintedArm(ideal)
    far = {
        "palpate": move(ideal, [1.0, 1.0, 1.0], SPEED, torque, 6.0, tolerance=1e-7),
        "signs as printed": move(as_printed, [1.0, 1.0, 1.0], SPEED, torque, 3.0, tolerance=1e-6),
    }
    near = {
        "palpate": move(ideal, [1.0, 3.0, 4.0], SPEED, torque, 15.0, tolerance=1e-7),
        "signs as printed": move(as_printed, [1.0, 3.0, 4.0], SPEED, torque, 5.0, tolerance=1e-6),
    }
    no_pulse = move(ideal, [1.0, 3.0, 4.0], SPEED, constant([0.0, 0.01, 0.01]), 15.0, tolerance=1e-7)
    swing, calm = near["palpate"].q[:, 1], no_pulse.q[:, 1]
    page.subsection("Open-loop motion (figures 2.11 and 2.12)")
    page.paragraph(
        "Torques τ = (0.01 for 1 s, 0.01, 0.01) N·m, no damping. The thesis calls τ1 a pulse and does not give its "
        "width; 1 s is ours. The width sets the speed of the yaw, and this speed moves the swing of θ2: without the "
        f"pulse θ2 runs from {calm.min():.2f} to {calm.max():.2f} rad."
    )
    page.figure(figures.angles(far), "From (1, 1, 1) rad (the thesis's figure 2.11): upper arm and forearm tumble.")
    page.figure(
        figures.angles(near, targets=(None, EQUILIBRIUM[1], EQUILIBRIUM[2]), limits=[(0, 45), (-1, 9), (-1, 9)]),
        f"From (1, 3, 4) rad (figure 2.12); the equilibrium is dashed. With the correct signs θ2 swings between "
        f"{swing.min():.2f} and {swing.max():.2f} rad about a mean of {swing.mean():.2f} and never reaches "
        f"{EQUILIBRIUM[1]:.3f} rad; the yaw turns on. With the printed signs θ2 and θ3 grow.",
    )
    run_away = _travel(far["palpate"])
    bounded = _travel(near["palpate"])
    misses = bool(swing.min() > EQUILIBRIUM[1] and np.ptp(swing[len(swing) // 2 :]) > 0.5)
    return [
        statement("fig2.11-unbounded", "motion from (1, 1, 1) under small torques", "angles approach infinity",
                  f"θ2 and θ3 travel {run_away[1]:.0f} and {run_away[2]:.0f} rad in 6 s",
                  holds=bool(run_away[1:].min() > 4 * np.pi), where="figure 2.11"),
        statement("fig2.12-no-rest", "motion from (1, 3, 4) under small torques", "does not tend to the equilibrium",
                  f"θ2 swings from {swing.min():.2f} to {swing.max():.2f} rad (mean {swing.mean():.2f}) and never "
                  f"reaches {EQUILIBRIUM[1]:.3f} rad", holds=misses, where="figure 2.12"),
        statement("sec2.8-unbounded-near", "motion from (1, 3, 4): unbounded", "the responses are unbounded",
                  f"θ2 and θ3 stay within {bounded[1:].max():.1f} rad of their start for 15 s; only the yaw turns on",
                  holds=bool(bounded[1:].max() < np.pi < bounded[0]), refuted=True, where="section 2.8",
                  note="with the correct signs of M23 and C32"),
    ]  # fmt: skip


def _travel(motion: Motion) -> Array:
    """Largest distance of each angle from its start, rad."""
    return np.asarray(np.abs(motion.q - motion.q[0]).max(axis=0), dtype=float)


def _alike(text: str, check: Check) -> str:
    """Write a computed number with as many decimals as the printed one."""
    return f"{check.computed:.{len(text.partition('.')[2])}f}"


def _carried(checks: list[Check]) -> str:
    """Return "carried over", or the status of a parameter that is not the printed one."""
    return next((check.status for check in checks if check.status != "match"), "carried over")
