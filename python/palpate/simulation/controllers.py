"""Conversion between a scenario's [controller] table and a controller, and its design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.controller_forms import as_linear_controller
from palpate.control.lead_lag_design import lead_lag
from palpate.control.lqg_design import lqg
from palpate.control.workspace_controller import WorkspaceController, workspace
from palpate.devices import Device
from palpate.errors import DesignError, ScenarioError
from palpate.linear.discretization import rendering_plant
from palpate.scenario import ControllerChoice, Scenario

DESIGN_STIFFNESS: Final = 1000.0  # N/m, without an object


def design_for(
    kind: str,
    options: Mapping[str, Any],
    device: Device,
    start: Array,
    stiffness: ArrayLike | None,
    period: float,
    normalize: bool = False,
) -> Controller:
    """Return the "lead_lag" or "lqg" controller for ``device`` at rest in ``start``.

    Args:
        kind: "lead_lag" or "lqg".
        options: keyword arguments of ``lead_lag`` or ``lqg`` in SI, angles in rad; and "stiffness", N/m, one value or
            three, of the object for which the controller is designed.
        start: pose (dof,), rad.
        stiffness: of the object in the loop, N/m, the default of "stiffness"; None for 1 N/mm.
        period: servo period, s.
        normalize: scale the forces of each tick to the design stiffness, see ``Controller``. Its default is then
            1 N/mm, whatever the object.

    Raises:
        DesignError: unknown kind or option, or no controller meets it.
        PoseError: the tip force cannot reach every joint at ``start``.
    """
    keywords = dict(options)
    default = DESIGN_STIFFNESS if stiffness is None or normalize else stiffness
    designed_for = keywords.pop("stiffness", default)
    plant = rendering_plant(device, start, stiffness=designed_for, period=period)
    if kind == "lead_lag":
        if "phase_margin" in keywords:
            keywords["phase_margin"] = np.degrees(keywords["phase_margin"])
        design: Any = lead_lag
    elif kind == "lqg":
        design = lqg
    else:
        raise DesignError(f'a design is "lead_lag" or "lqg", not {kind!r}')
    try:
        controller: Controller = design(plant, **keywords)
    except TypeError as error:
        raise DesignError(f"{kind}: an option is not known: {error}") from error
    notes = {"design_stiffness": np.asarray(designed_for, dtype=float).tolist(), **controller.notes}
    controller = replace(controller, notes=notes)
    return controller.normalized(designed_for) if normalize else controller


def build_law(scenario: Scenario, device: Device, start: Array) -> Controller | WorkspaceController:
    """Return the scenario's controller as it runs; arguments and errors as `build_controller`."""
    if scenario.controller.kind == "workspace":
        return _workspace(scenario, device)
    return build_controller(scenario, device, start)


def build_controller(scenario: Scenario, device: Device, start: Array) -> Controller:
    """Return the scenario's controller, designed for the device linearized at `start` (dof,), rad, if necessary.

    A workspace controller is linearized about rest there.

    Raises:
        DesignError: no controller meets the options.
        PoseError: the tip force cannot reach every joint at `start` (a singular pose).
    """
    table = scenario.controller
    period = scenario.period
    if table.kind in ("none", "gain"):
        gain = Controller.gain(np.array(table.gain if table.gain is not None else (1.0, 1.0, 1.0)), period)
        return _normalized(gain, table)
    if table.kind == "state_space":
        n = len(table.A or ())
        a, b = np.array(table.A, float).reshape(n, n), np.array(table.B, float).reshape(n, 6)
        c, d = np.array(table.C, float).reshape(3, n), np.array(table.D, float)
        antiwindup = None if table.antiwindup is None else np.array(table.antiwindup, float)
        return _normalized(Controller(control.StateSpace(a, b, c, d, period), antiwindup, "state_space"), table)
    if scenario.servo.tool is not None:
        raise DesignError(
            "servo.topology: the controller of an admittance_display follows a tool, so it is no linear law from force "
            "to force; judge the loop by its run"
        )
    if table.kind == "workspace":
        adapting = _workspace(scenario, device)
        if adapting.normal_only and scenario.object.kind not in ("spring", "none"):
            raise DesignError(
                "controller.normal_only: along the surface nothing but the operator holds the tip, so the controller "
                "has no linear model there; judge the loop by its run, or leave normal_only out"
            )
        return adapting.linearized(start)
    normalize = table.normalize is True
    law = design_for(table.kind, table.options, device, start, scenario.object.stiffness, period, normalize)
    return law if normalize else _normalized(law, table)


def _workspace(scenario: Scenario, device: Device) -> WorkspaceController:
    """Return the workspace controller of a scenario; raise DesignError with the place of a wrong option."""
    options = scenario.controller.options
    try:
        return workspace(device, scenario.period, **options)
    except DesignError as error:
        sentence = str(error).removeprefix("workspace: ")
        name = sentence.split(" ")[0]
        if name not in options:
            raise
        raise DesignError(str(scenario.mistake(f"controller.{name}", sentence))) from error


def _normalized(law: Controller, table: ControllerChoice) -> Controller:
    """Return the controller, normalized if the table says for which stiffness."""
    return law.normalized(table.normalize) if isinstance(table.normalize, tuple) else law


def read_scenario(scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None) -> Scenario:
    """Return a scenario from any form, with a linear controller if one is given.

    Raises:
        ScenarioError: the scenario has a mistake.
        DesignError: the controller is not linear, or does not fit.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario.from_dict(scenario) if isinstance(scenario, Mapping) else Scenario.from_file(scenario)
    return scenario if controller is None else with_controller(scenario, controller)


def read_scenarios(scenarios: Sequence[Scenario | Mapping[str, Any] | str | Path]) -> list[Scenario]:
    """Return the scenarios of several devices from any form. Raise ScenarioError if one has a mistake."""
    if isinstance(scenarios, (Scenario, Mapping, str, Path)) or not isinstance(scenarios, Sequence):
        raise ScenarioError(f"scenarios: a list with one scenario for each device is needed, not {scenarios!r:.80}")
    return [read_scenario(scenario) for scenario in scenarios]


def written_out(scenario: Scenario) -> Scenario:
    """Return the scenario with a designed controller as a state space: its object may then be replaced.

    Raises:
        DesignError, PoseError: as `build_controller`.
    """
    if scenario.controller.kind not in ("lead_lag", "lqg"):
        return scenario
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    return with_controller(scenario, build_controller(scenario, device, start))


def with_controller(scenario: Scenario, controller: Any) -> Scenario:
    """Return the scenario with a linear controller (see `as_linear_controller`) in its [controller].

    Raises:
        DesignError: the controller is not linear, or does not fit.
    """
    law = as_linear_controller(controller, scenario.period)
    system = law.system
    d = np.asarray(system.D, dtype=float)
    gain = np.diag(d)
    if not system.nstates and np.array_equal(d, np.hstack([np.diag(gain), -np.diag(gain)])) and gain.min() >= 0.0:
        choice = ControllerChoice(kind="gain", gain=tuple(gain.tolist()))
    else:
        matrices = {name: np.asarray(getattr(system, name), dtype=float).tolist() for name in "ABCD"}
        if law.antiwindup is not None and system.nstates:
            matrices["antiwindup"] = np.asarray(law.antiwindup, dtype=float).tolist()
        choice = ControllerChoice(kind="state_space", **matrices)
    if law.design_stiffness is not None:
        choice = choice.model_copy(update={"normalize": law.design_stiffness})
    return scenario.model_copy(update={"controller": choice})
