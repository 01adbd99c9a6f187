"""Result of a design: the controller with its proofs, or the constraint that forbids it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from palpate.arrays import Array
from palpate.control import WorkspaceController
from palpate.errors import OutputError
from palpate.files import check_suffix, write_json, write_text
from palpate.scenario import Scenario
from palpate.simulation.decision import BAND
from palpate.stability.workspace_certificate import WorkspaceCertificate
from palpate.tuning.axis import AxisDesign
from palpate.tuning.specification import Specification

__all__ = ["ControllerDesign"]


@dataclass(frozen=True, eq=False)
class ControllerDesign:
    """Workspace controller for a device, a range of stiffness and a force, or the reason why there is none.

    Attributes:
        specification: in SI.
        controller: the workspace controller; None: no bandwidth meets the constraints.
        axis: its margins, what limits its bandwidth, and its share of the optimal robustness.
        bound: least settling time that the drive allows at the worst pose, force and softest object, s; inf: the
            motors cannot brake; nan: unknown.
        bound_pose: that pose (3,), rad; bound_direction: of the force there (3,).
        hold: time for which cold motors hold the force at every press, s; nan: unknown.
        within_reach: share of the presses at the softest object whose way stays well conditioned.
        settling: longest simulated settling time by stiffness, s; inf: not settled.
        overshoot: largest simulated overshoot, relative, also on the devices of `against`.
        count: largest displacement of the tip by one encoder count at the poses, m. Presses are simulated without
            counts.
        certificate: one Lyapunov matrix for all poses; None: see `certificate_remark`.
        certificate_remark: what the certificate covers, or why there is none.
        constraint: "" if the specification is met; otherwise "drive limit", "sampling", "encoder", "operator",
            "dry friction", "overshoot" or "stiffness range".
        reason: the constraint in words, with its number.
        remedies: changes of the specification that meet it, each tried.
        scenario: ready to run, in the middle of the range; None if the specification is not met.
    """

    specification: Specification
    controller: WorkspaceController | None
    axis: AxisDesign | None
    bound: float
    bound_pose: Array | None
    bound_direction: Array | None
    hold: float
    within_reach: float
    settling: dict[float, float]
    overshoot: float
    count: float
    certificate: WorkspaceCertificate | None
    certificate_remark: str
    constraint: str
    reason: str
    remedies: tuple[str, ...]
    scenario: Scenario | None

    @property
    def feasible(self) -> bool:
        """Whether the controller meets the specification in simulation."""
        return not self.constraint

    @property
    def claim(self) -> str:
        """Result in a sentence."""
        s = self.specification
        asked = f"{s.force:g} N on {s.objects} within {1e3 * s.settle:g} ms on {s.name}"
        if self.feasible:
            heat = "" if math.isinf(self.hold) else f" Cold motors hold the force for {self.hold:.3g} s."
            slowest = f"{1e3 * max(self.settling.values()):.3g} ms in the slowest simulated press"
            return f"{asked}: met, {slowest}{' without encoder counts' if self.count else ''}.{self._counts}{heat}"
        return f"{asked}: not met. Binding constraint: {self.constraint}. {self.reason}"

    @property
    def _counts(self) -> str:
        """Objects on which one encoder count exceeds the band of rest, in a sentence; "" if there are none."""
        if self.count_share <= BAND:
            return ""
        s = self.specification
        return (
            f" Above {BAND * s.force / self.count:.3g} N/m one encoder count is more than {100 * BAND:g} % of the "
            "deflection: there the force rests within the counts only."
        )

    @property
    def count_share(self) -> float:
        """One encoder count over the deflection of the stiffest object under the force."""
        return self.count * self.specification.stiffness[1] / self.specification.force

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON; values that are not finite become null."""
        s, a, c = self.specification, self.axis, self.controller
        return {
            "feasible": self.feasible,
            "claim": self.claim,
            "constraint": self.constraint or None,
            "reason": self.reason or None,
            "remedies": list(self.remedies),
            "device": s.name,
            "stiffness_N_per_m": list(s.stiffness),
            "force_N": s.force,
            "settle_s": s.settle,
            "period_s": s.period,
            "delay_samples": s.delay,
            "controller": None if c is None else c.notes,
            "margins": None if a is None else {k: _plain(v) for k, v in a.margins.to_dict().items()},
            "bandwidth_limit": None if a is None else a.reason,
            "force_per_encoder_count_N": None if a is None else a.count_force,
            "robustness_share": None if a is None else a.robustness.share,
            "drive_bound_s": _plain(self.bound),
            "drive_bound_pose": None if self.bound_pose is None else self.bound_pose.tolist(),
            "drive_bound_direction": None if self.bound_direction is None else self.bound_direction.tolist(),
            "hold_time_s": _plain(self.hold),
            "presses_within_reach": self.within_reach,
            "settling": [{"stiffness_N_per_m": k, "worst_s": _plain(t)} for k, t in self.settling.items()],
            "overshoot": _plain(self.overshoot),
            "tip_displacement_per_encoder_count_m": self.count,
            "certificate": self.certificate_remark,
            "lyapunov_matrix": None if self.certificate is None else self.certificate.matrix.tolist(),
        }

    def save(self, path: str | Path) -> Path:
        """Write the result atomically as `.json` and return the path.

        Raises:
            OutputError: the suffix is not `.json`, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "design"), self.to_dict())

    def save_scenario(self, path: str | Path) -> Path:
        """Write the scenario atomically as `.toml` and return the path.

        Raises:
            OutputError: the specification is not met, the suffix is not `.toml`, or the file cannot be written.
        """
        target = check_suffix(path, (".toml",), "design: scenario")
        if self.scenario is None:
            raise OutputError(f"{path}: there is no scenario, because the specification is not met; {self.reason}")
        tables = self.scenario.to_dict()
        table = tables["controller"]
        tables["controller"] = {key: entry for key, entry in table.items() if key != "options"} | table["options"]
        return write_text(target, f"# {self.claim}\n" + toml_text(tables))


def toml_text(tables: dict[str, Any]) -> str:
    """Return tables of one level with texts, numbers, flags and lists of them as TOML."""

    def value(entry: Any) -> str:
        if isinstance(entry, bool):
            return "true" if entry else "false"
        if isinstance(entry, (list, tuple)):
            return f"[{', '.join(value(one) for one in entry)}]"
        if isinstance(entry, str):
            return '"' + entry.replace("\\", "\\\\").replace('"', '\\"') + '"'
        return repr(entry)

    plain = {key: entry for key, entry in tables.items() if not isinstance(entry, dict)}
    lines = [f"{key} = {value(entry)}" for key, entry in plain.items()]
    for name, table in tables.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{key} = {value(entry)}" for key, entry in table.items())]
    return "\n".join(lines) + "\n"


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
