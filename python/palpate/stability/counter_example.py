"""Scenarios that show an instability when they are run: an unstable loop pushed, or the hand that it cannot bear."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.simulator import simulate

__all__ = ["CounterExample", "destabilizing_operator", "divergence_example", "growth", "to_toml"]


@dataclass(frozen=True)
class CounterExample:
    """A scenario that was run and seen to grow.

    Attributes:
        scenario: its tables, as ``Scenario.to_dict`` gives them.
        growth: how many times larger the swing is in the last fifth of the run than in the second; inf if it diverged.
        sentence: what it shows.
    """

    scenario: Mapping[str, Any]
    growth: float
    sentence: str

    def toml(self) -> str:
        """Return the scenario as the text of a file for `palpate run`."""
        return to_toml(self.scenario)


def divergence_example(scenario: Scenario, radius: float) -> CounterExample | None:
    """Return the unstable ``scenario``, run for long enough to see it grow; None if the run does not show it.

    Args:
        scenario: its loop has the spectral radius ``radius`` > 1.
    """
    tables = scenario.to_dict()
    ticks = min(max(math.log(1e3) / math.log(radius), 400.0), 400_000.0)
    tables["run"] = {**tables.get("run", {}), "duration": f"{ticks * scenario.period:.6g} s", "record_every": 1}
    if scenario.servo.topology == "impedance_display":
        tables["operator"] = _pushed(scenario, tables.get("operator", {}), scenario.operator.kind)
        _press_in(scenario, tables)
    return _run(tables, "the swing")


def destabilizing_operator(scenario: Scenario, masses: int = 9, stiffnesses: int = 17) -> CounterExample | None:
    """Return the mass and spring, as a rigid hand without damping, with which the loop is most unstable.

    A hand of mass and spring is passive. The search goes over both on a logarithmic grid, then finer about the worst.
    None if the loop is stable in all of them, or the device's model takes no hand.
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
    tables["operator"] = _pushed(
        scenario, {"mass": f"{mass!r} kg", "damping": "0 N*s/m", "stiffness": f"{stiffness!r} N/m"}, "arm"
    )
    tables["title"] = f"{scenario.title}, in the worst passive hand"
    _press_in(scenario, tables)
    ticks = min(max(math.log(1e3) / math.log(worst), 400.0), 400_000.0)
    tables["run"] = {
        **tables.get("run", {}),
        "duration": f"{ticks * scenario.period:.6g} s",
        "record_every": 1,
        "substeps": max(scenario.run.substeps, 20),
    }
    return _run(tables, f"in a hand of {mass:g} kg and {stiffness:g} N/m without damping, the swing")


def _pushed(scenario: Scenario, operator: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Return the operator's table with a small steady push into the object on it."""
    keep = {
        k: operator[k] for k in ("mass", "damping", "stiffness", "tissue_stiffness", "tissue_damping") if k in operator
    }
    inward = -np.array(scenario.object.normal) if scenario.object.normal is not None else np.array([1.0, 1.0, 1.0])
    if scenario.load_device().dof == 1:
        inward = inward * [1.0, 0.0, 0.0]
    force = [f"{0.1 * part:.6g} N" for part in inward]
    if kind == "arm":
        return {"kind": "arm", **keep, "shape": "step", "force": force}
    return {"kind": "force", "shape": "step", "force": force}


def _press_in(scenario: Scenario, tables: dict[str, Any]) -> None:
    """Hold the object from both sides where the tip starts: the contact that the linear verdict is about."""
    if scenario.object.kind != "wall":
        return
    touched = {k: v for k, v in tables["object"].items() if k != "normal"}
    touched["kind"] = "spring"
    touched.pop("position", None)
    normal = np.abs(np.array(scenario.object.normal))
    axis = int(np.argmax(normal))
    if normal[axis] < 1 - 1e-9:
        return  # an oblique surface has no spring of its own: the wall stays one-sided
    for key in ("stiffness", "damping"):
        value = touched.get(key)
        if value is not None:
            one = value[axis] if isinstance(value, list) else value
            unit = one.split(" ", 1)[1]
            touched[key] = [one if i == axis else f"0 {unit}" for i in range(3)]
    tables["object"] = touched


def _run(tables: dict[str, Any], what: str) -> CounterExample | None:
    """Run with ever harder pushes (dry friction may hold a soft one) until the swing grows; None if it never does."""
    base = tables.get("operator", {}).get("force")
    for push in (1, 10, 50) if base else (1,):
        if base:
            force = [f"{float(one.split()[0]) * push:.6g} N" for one in base]
            tables = {**tables, "operator": {**tables["operator"], "force": force}}
        trace = simulate(Scenario.from_dict(tables))
        pushed = f"pushed with {0.1 * push:g} N, {what}" if base else what
        if trace.unstable_from is not None:
            return CounterExample(tables, float("inf"), f"{pushed} diverges after {trace.unstable_from:.3g} s.")
        times = growth(trace["tip"])
        if times >= 1.5:
            said = f"{pushed} grows {times:.3g}-fold from the run's second fifth to its last."
            return CounterExample(tables, times, said)
    return None


def growth(tip: Any, differences: int = 1) -> float:
    """Return how many times larger the tip's swing (sample to sample) is in the last fifth than in the second.

    Each further difference hides slow motions more: of two swings, the faster one is judged.
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
