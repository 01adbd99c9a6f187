"""Scenarios that demonstrate an instability: an unstable loop with a push, or a destabilizing operator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.recorded import held_tip
from palpate.simulation.simulator import simulate

__all__ = ["CounterExample", "destabilizing_operator", "divergence_example", "growth", "to_toml"]


@dataclass(frozen=True)
class CounterExample:
    """A scenario whose simulation diverges or oscillates with growing amplitude.

    Attributes:
        scenario: its tables, as from ``Scenario.to_dict``.
        growth: ratio of the oscillation in the last fifth of the run to that in the second; inf if it diverged.
        sentence: the observed instability.
    """

    scenario: Mapping[str, Any]
    growth: float
    sentence: str

    def toml(self) -> str:
        """Return the scenario as TOML text for `palpate run`."""
        return to_toml(self.scenario)


def divergence_example(scenario: Scenario, radius: float) -> CounterExample | None:
    """Return the unstable ``scenario`` with a duration that shows the growth; None if the run does not show it.

    Args:
        scenario: scenario of an unstable loop.
        radius: spectral radius of the loop, above 1.
    """
    tables = scenario.to_dict()
    ticks = min(max(math.log(1e3) / math.log(radius), 400.0), 400_000.0)
    tables["run"] = {**tables.get("run", {}), "duration": f"{ticks * scenario.period:.6g} s", "record_every": 1}
    if scenario.servo.topology == "impedance_display":
        tables["operator"] = _with_push(scenario, tables.get("operator", {}), scenario.operator.kind)
        _make_bilateral(scenario, tables)
    return _run(tables, "the oscillation")


def destabilizing_operator(scenario: Scenario, masses: int = 9, stiffnesses: int = 17) -> CounterExample | None:
    """Return the scenario with the passive mass and spring, gripped rigidly, that destabilizes the loop most.

    The search uses a logarithmic grid over mass and stiffness, refined about the worst operator.

    Args:
        scenario: scenario of a stable loop.
        masses: grid points from 1 g to 10 kg.
        stiffnesses: grid points from 0.1 N/m to 10 MN/m.

    Returns:
        The counter-example; None if the loop is stable with every operator tested, or the device model has none.
    """
    if scenario.device.model != "nonlinear":
        return None

    def radius(log_mass: float, log_stiffness: float) -> float:
        arm = HumanArm(10.0**log_mass, 0.0, 10.0**log_stiffness)
        return scenario_loop(scenario, arm=arm, operator_force=(0.0, 0.0, 0.0)).spectral_radius()

    m, k = np.linspace(-3, 1, masses), np.linspace(-1, 7, stiffnesses)
    best = max((radius(a, b), a, b) for a in m for b in k)
    for step in (0.5, 0.25, 0.1):
        around = [(best[1] + i * step / 2, best[2] + j * step / 2) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        best = max([best, *((radius(a, b), a, b) for a, b in around)])
    worst, log_mass, log_stiffness = best
    if worst <= 1 + 1e-9:
        return None
    tables = scenario.to_dict()
    mass, stiffness = float(f"{10**log_mass:.4g}"), float(f"{10**log_stiffness:.4g}")
    tables["operator"] = _with_push(
        scenario, {"mass": f"{mass!r} kg", "damping": "0 N*s/m", "stiffness": f"{stiffness!r} N/m"}, "arm"
    )
    tables["title"] = f"{scenario.title}, with the worst passive operator"
    _make_bilateral(scenario, tables)
    ticks = min(max(math.log(1e3) / math.log(worst), 400.0), 400_000.0)
    tables["run"] = {
        **tables.get("run", {}),
        "duration": f"{ticks * scenario.period:.6g} s",
        "record_every": 1,
        "substeps": max(scenario.run.substeps, 20),
    }
    return _run(tables, f"in a hand of {mass:g} kg and {stiffness:g} N/m without damping, the oscillation")


def _with_push(scenario: Scenario, operator: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Return the operator's table with a small constant push into the object."""
    arm = {
        k: operator[k] for k in ("mass", "damping", "stiffness", "tissue_stiffness", "tissue_damping") if k in operator
    }
    inward = -np.array(scenario.object.normal) if scenario.object.normal is not None else np.array([1.0, 1.0, 1.0])
    if scenario.load_device().dof == 1:
        inward = inward * [1.0, 0.0, 0.0]
    force = [f"{0.1 * part:.6g} N" for part in inward]
    if kind == "arm":
        return {"kind": "arm", **arm, "shape": "step", "force": force}
    return {"kind": "force", "shape": "step", "force": force}


def _make_bilateral(scenario: Scenario, tables: dict[str, Any]) -> None:
    """Replace a wall by a bilateral spring at the start tip, the contact of the linear verdict."""
    if scenario.object.kind != "wall":
        return
    spring = {k: v for k, v in tables["object"].items() if k != "normal"}
    spring["kind"] = "spring"
    spring.pop("position", None)
    normal = np.abs(np.array(scenario.object.normal))
    axis = int(np.argmax(normal))
    if normal[axis] < 1 - 1e-9:
        return  # springs act along the axes only: an oblique wall stays unilateral
    for key in ("stiffness", "damping"):
        value = spring.get(key)
        if value is not None:
            text = value[axis] if isinstance(value, list) else value
            unit = text.split(" ", 1)[1]
            spring[key] = [text if i == axis else f"0 {unit}" for i in range(3)]
    tables["object"] = spring


def _run(tables: dict[str, Any], subject: str) -> CounterExample | None:
    """Run with increasing pushes, against dry friction, until the oscillation grows; None if it never does."""
    base = tables.get("operator", {}).get("force")
    for push in (1, 10, 50) if base else (1,):
        if base:
            force = [f"{float(part.split()[0]) * push:.6g} N" for part in base]
            tables = {**tables, "operator": {**tables["operator"], "force": force}}
        trace = simulate(Scenario.from_dict(tables))
        pushed = f"pushed with {0.1 * push:g} N, {subject}" if base else subject
        if trace.unstable_from is not None:
            return CounterExample(tables, float("inf"), f"{pushed} diverges after {trace.unstable_from:.3g} s.")
        ratio = growth(held_tip(trace))
        if ratio >= 1.5:
            sentence = f"{pushed} grows {ratio:.3g}-fold from the run's second fifth to its last."
            return CounterExample(tables, ratio, sentence)
    return None


def growth(tip: Any, differences: int = 1) -> float:
    """Return the ratio of the tip's oscillation (sample to sample) in the last fifth to that in the second.

    Args:
        tip: positions (n, 3), m.
        differences: order of the difference; a higher order emphasizes faster oscillations.
    """
    moved = np.linalg.norm(np.diff(np.asarray(tip, dtype=float), n=differences, axis=0), axis=1)
    fifth = max(len(moved) // 5, 1)
    early, late = moved[fifth : 2 * fifth].max(initial=0.0), moved[-fifth:].max(initial=0.0)
    return float(late / early) if early > 0 else float("nan")


def to_toml(tables: Mapping[str, Any]) -> str:
    """Return scenario tables as TOML text."""
    top = [f"{key} = {_value(value)}" for key, value in tables.items() if not isinstance(value, Mapping)]
    parts = ["\n".join(top)] if top else []
    for name, table in tables.items():
        if isinstance(table, Mapping):
            parts.append("\n".join([f"[{name}]", *(f"{key} = {_value(value)}" for key, value in table.items())]))
    return "\n\n".join(parts) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, float) and not math.isfinite(value):
        return "inf" if value > 0 else "-inf" if value < 0 else "nan"
    return repr(value)
