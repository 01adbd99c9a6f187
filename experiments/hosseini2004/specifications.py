"""Table 2.1, the manufacturer's figures, against the model of the same device: every row."""

from __future__ import annotations

from typing import Final

import numpy as np
from palpate import devices
from palpate.arrays import Array
from palpate.control import Controller, critical_gain, loop_gain
from palpate.devices import Device
from palpate.linear import rendering_plant
from palpate.report import Page

from experiments.hosseini2004.checks import Check, at_most, compare, not_computed
from experiments.hosseini2004.printed_numbers import printed

__all__ = ["specifications"]

GHOST_PERIOD: Final = 1e-3  # s, the manufacturer's servo loop
STIFF: Final = 1e5  # N/m, well above the limit that is looked for


def specifications(page: Page, device: Device, pose: Array) -> list[Check]:
    """Compare every number of table 2.1 with the model; `pose` (3,), rad, is (2.84)."""
    count = float(np.linalg.norm(device.jacobian(pose) * device.encoder_step, axis=0).max())
    rotors = devices.load("phantom-premium-1.5a-rotors")
    mass, heavy = (_apparent_mass(arm) for arm in (device, rotors))
    friction = np.linalg.norm(np.linalg.solve(device.jacobian(np.zeros(3)).T, np.diag(rotors.coulomb)), axis=0)
    limit = _stiffest(device, pose)
    reach = np.ptp(device.forward(_poses()), axis=0)
    checks = [
        *compare("tab2.1-resolution", count, scale=1e3),
        *compare("tab2.1-workspace", reach, scale=1e2),
        *compare("tab2.1-friction", friction.min()),
        *compare("tab2.1-peak-force", device.peak_force, kind="carried"),
        *compare("tab2.1-continuous-force", device.continuous_force, kind="carried"),
        *compare("tab2.1-stiffness", limit, scale=1e-3),
        _mass_check(mass),
        *not_computed("tab2.1-footprint"),
    ]
    status = {
        check.id.partition("[")[0]: "carried over"
        if (check.kind, check.status) == ("carried", "match")
        else check.status
        for check in checks
    }
    three = [", ".join(f"{1e3 * part:.0f}" for part in each) for each in (mass, heavy)]
    rows = [
        ("position resolution [mm]", "0.03", f"{count * 1e3:.3f}", "one count of the coarsest joint, at (2.84)",
         status["tab2.1-resolution"]),
        ("workspace [cm]", "19.5, 27, 37.5", ", ".join(f"{1e2 * part:.0f}" for part in reach),
         "reach of the links; no joint limits are printed", status["tab2.1-workspace"]),
        ("back-drive friction [N]", "0.04", f"{friction.min():.2f} to {friction.max():.2f}",
         "0.01 N·m of each joint at θ = 0, from another source", status["tab2.1-friction"]),
        ("maximum force [N]", "8.5", device.peak_force, "from the print", status["tab2.1-peak-force"]),
        ("continuous force [N]", "1.4", device.continuous_force, "from the print", status["tab2.1-continuous-force"]),
        ("stiffness [N/mm]", "3.5", f"{1e-3 * limit:.2f}",
         "stiffest stable spring at 1 kHz, free arm, friction (3.36)", status["tab2.1-stiffness"]),
        ("apparent mass [g]", "< 75", three[0], f"along x, y, z at θ = 0 (with rotors {three[1]})",
         status["tab2.1-apparent-mass"]),
        ("footprint [cm]", "25, 33", None, "the model has no housing", status["tab2.1-footprint"]),
    ]  # fmt: skip
    page.table(
        ["specification", "printed", "palpate", "how", "status"],
        rows,
        "Table 2.1, the manufacturer's figures, beside the model. Rows of system requirements are left out.",
    )
    return checks


def _apparent_mass(device: Device) -> Array:
    """Return the apparent mass (3,), kg, of the tip along x, y, z at θ = 0."""
    jacobian = device.jacobian(np.zeros(3))
    return np.asarray(1.0 / np.diag(jacobian @ np.linalg.inv(device.mass_matrix(np.zeros(3))) @ jacobian.T))


def _mass_check(mass: Array) -> Check:
    """Return the check of the apparent mass: the print is an upper bound."""
    p = printed("tab2.1-apparent-mass")
    limit = float(p.rows[0][0])
    return at_most(p.id, p.what, limit, 1e3 * float(mass.max()), p.unit, kind="recomputed", where=p.where,
                   reason=p.difference(0, 0))  # fmt: skip


def _stiffest(device: Device, pose: Array) -> float:
    """Return the stiffness, N/m, up to which the free arm displays a spring at 1 kHz without a controller."""
    plant = rendering_plant(device, pose, stiffness=STIFF, period=GHOST_PERIOD)
    return STIFF * critical_gain(loop_gain(Controller.gain(1.0, GHOST_PERIOD), plant))


def _poses() -> Array:
    """Return poses (n, 3), rad, that contain the farthest points of the links: arm and forearm in line."""
    turn = np.linspace(-np.pi, np.pi, 73)
    yaw, arm = (grid.ravel() for grid in np.meshgrid(turn, turn, indexing="ij"))
    return np.stack([yaw, arm, arm + np.pi / 2], axis=1)  # the forearm continues the upper arm at θ3 = θ2 + π/2
