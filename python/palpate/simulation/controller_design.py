"""Design of a scenario's controller: options in SI, plant from device and object."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.control import Controller
from palpate.control.lead_lag_design import lead_lag
from palpate.control.lqg_design import lqg
from palpate.devices import Device
from palpate.errors import DesignError
from palpate.linear.discretization import rendering_plant

DESIGN_STIFFNESS: Final = 1000.0  # N/m, where there is no object to design for


def design_for(
    kind: str,
    options: Mapping[str, Any],
    device: Device,
    start: NDArray[np.float64],
    stiffness: ArrayLike | None,
    period: float,
) -> Controller:
    """Return the "lead_lag" or "lqg" controller for ``device`` at rest in ``start``.

    Args:
        kind: "lead_lag" or "lqg".
        options: keyword arguments of ``lead_lag`` or ``lqg`` in SI, but angles in rad; and "stiffness", N/m, one
            value or three: design for this object.
        start: pose (dof,), rad.
        stiffness: of the object in the loop, N/m, the design's unless options say otherwise; None: 1 N/mm.
        period: servo period, s.

    Raises:
        DesignError: unknown kind or option, or no controller meets it.
        PoseError: the tip force cannot reach every joint at ``start``.
    """
    keywords = dict(options)
    designed_for = keywords.pop("stiffness", DESIGN_STIFFNESS if stiffness is None else stiffness)
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
    return Controller(controller.system, controller.antiwindup, controller.kind, notes)
