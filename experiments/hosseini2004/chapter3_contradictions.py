"""Chapter 3, the printed identified model beside the arm: signs, rates, and the friction factors that it requires."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import control
import numpy as np
from palpate.arrays import Array
from palpate.devices import Device
from palpate.linear.linearization import static_tip_force
from palpate.report import Page

from experiments.hosseini2004 import figures
from experiments.hosseini2004.cases import POSE, STIFFEST
from experiments.hosseini2004.checks import Check, compare, statement
from experiments.hosseini2004.experimental import PERIOD, experimental_model
from experiments.hosseini2004.motion import constant, move
from experiments.hosseini2004.printed_numbers import printed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["contradictions", "end_rates"]

PULSE: Final = 0.05  # s
TORQUE: Final = 1.0  # N m


def contradictions(page: Page, device: Device) -> list[Check]:
    """Compare the printed identified model with the arm, and its friction with (3.36)."""
    model = experimental_model()
    identified = [_response(model, joint) for joint in range(3)]
    arm = [_arm_response(device, joint) for joint in range(3)]
    rates = end_rates(model)
    friction = 1.0 / np.diag(rates)
    page.subsection("The identified model against the arm, and the friction factors (3.36)")
    page.paragraph(
        "The thesis finds k1, k2 and k3 by matching the arm to the identified model under one lead–lag. The models do "
        "not match. Under 1 N·m about the gravity torque, axis 1 of the identified model turns the other way, and so "
        "do θ2 under τ3 and θ3 under τ2. A controller without unstable poles stabilizes the identified model only with "
        "a negative static gain along x; the arm needs a positive one, or none. Palpate therefore cannot repeat the "
        "matching. It compares friction instead: a joint that only friction slows down ends at the rate τ/k."
    )
    page.figure(_figure(identified, arm), "Angles under 1 N·m on one joint at a time, first 50 ms.")
    page.table(
        ["angle", "under torque", "identified", "arm", "same sign"],
        [
            (f"θ{i + 1}", f"τ{j + 1}", f"{identified[j][-1, i]:.2f}", f"{arm[j][-1, i]:.2f}",
             "yes" if identified[j][-1, i] * arm[j][-1, i] > 0 else "no")
            for i, j in ((0, 0), (1, 1), (1, 2), (2, 1), (2, 2))
        ],
        "Angles after 1 N·m for 50 ms.",
        units=["", "", "rad", "rad", ""],
    )  # fmt: skip
    checks = compare("eq3.36-k", np.abs(friction))
    page.table(
        ["", "printed", "by the end rate of (3.25)", "end rate", "status"],
        [
            (f"k{j + 1}", printed("eq3.36-k").rows[0][j], f"{friction[j]:.4f}", f"{rates[j, j]:.1f}", checks[j].status)
            for j in range(3)
        ],
        "Friction factors. k1 is negative because axis 1 turns against its torque.",
        units=["", "N·m·s/rad", "N·m·s/rad", "rad/s per N·m", ""],
    )
    return [*checks, *_signs(identified, arm), _inverted(device)]


def end_rates(model: control.StateSpace) -> Array:
    """Return the angular rates (3, 3), rad/s per N m, at which an integrating model ends: angle row, torque column."""
    size = model.nstates
    # x[n] ~ n v + w with (A - I) v = 0 and (A - I) w = v - B u: least squares over v and w.
    left = model.A - np.eye(size)
    whole = np.block([[left, np.zeros((size, size))], [-np.eye(size), left]])
    right = np.vstack([np.zeros_like(model.B), -model.B])
    drift = np.linalg.lstsq(whole, right, rcond=None)[0][:size]
    return np.asarray(model.C @ drift / PERIOD, dtype=float)


def _response(model: control.StateSpace, joint: int) -> Array:
    """Return the angles (n, 3), rad, of the identified model under a constant torque on one joint."""
    torque = TORQUE * np.eye(3)[joint]
    state, angles = np.zeros(model.nstates), [np.zeros(3)]
    for _ in range(round(PULSE / PERIOD)):
        state = model.A @ state + model.B @ torque
        angles.append(model.C @ state)
    return np.array(angles)


def _arm_response(device: Device, joint: int) -> Array:
    """Return the same of the nonlinear arm about its pose, gravity held."""
    pose = np.array(POSE)
    torque = device.gravity(pose) + TORQUE * np.eye(3)[joint]
    motion = move(device, pose, np.zeros(3), constant(torque), PULSE, samples=round(PULSE / PERIOD) + 1)
    return np.asarray(motion.q - pose, dtype=float)


def _figure(identified: list[Array], arm: list[Array]) -> Figure:
    time = 1e3 * PERIOD * np.arange(len(arm[0]))
    pairs = ((0, 0), (1, 2), (2, 1))
    series = {
        name: (time, np.stack([runs[joint][:, angle] for angle, joint in pairs], axis=1))
        for name, runs in (("identified model (3.25)", identified), ("arm", arm))
    }
    return figures.lines(series, titles=["θ1 under τ1", "θ2 under τ3", "θ3 under τ2"], ylabel="angle [rad]",
                         xlabel="time [ms]")  # fmt: skip


def _signs(identified: list[Array], arm: list[Array]) -> list[Check]:
    checks = []
    for id, angle, torque, cause in (
        ("eq3.25-axis1-sign", 0, 0, "sign-of-axis-1"),
        ("eq3.25-theta2-tau3-sign", 1, 2, "sign-of-cross-terms"),
        ("eq3.25-theta3-tau2-sign", 2, 1, "sign-of-cross-terms"),
    ):
        theirs, ours = float(identified[torque][-1, angle]), float(arm[torque][-1, angle])
        checks.append(
            statement(id, f"θ{angle + 1} after 1 N·m on joint {torque + 1} for 50 ms", f"{theirs:+.2f} rad (3.25)",
                      f"{ours:+.2f} rad by (3.1)", holds=theirs * ours < 0, cause=cause, where="(3.25), (3.1)",
                      note="the identified model and the arm turn in opposite directions")
        )  # fmt: skip
    return checks


def _inverted(device: Device) -> Check:
    """Axis 1 of the identified model needs a negative static gain along x, the arm one that is not."""
    pose = np.array(POSE)
    lead = float(device.jacobian(pose)[0, 0])
    hold = static_tip_force(device.jacobian(pose), device.gravity(pose))
    held = -float(np.einsum("k,kij->ij", hold, device.tip_hessian(pose))[0, 0])  # N m/rad, the held force pulls back
    least = -held / (STIFFEST * lead**2)
    rate = float(end_rates(experimental_model())[0, 0])
    return statement(
        "sec3.7-one-controller",
        "one lead–lag for the identified and for the nonlinear model",
        "both respond alike under the same controller",
        f"along x the arm needs a static gain above {least:.4f}, the identified model one below 0".replace("-", "−"),
        holds=rate < 0.0 < held,
        refuted=True,
        where="sections 3.7, 3.9",
        note="controllers without unstable poles; the thesis may count the first torque the other way round and does "
        "not say so",
    )
