"""The data that a body's model is built from in the core, for programs that build it without Python."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from palpate.fem.body import Body
from palpate.fem.errors import BodyError

Arrays = dict[str, NDArray[Any]]


class ModelData(NamedTuple):
    """Arguments of a linear body model of the core.

    Attributes:
        model: "compliance", "modal", "standard_linear_solid", "mass_spring" or "free_form".
        parameters: numbers of the model in SI, static and dynamic friction included.
        arrays: by name; float64, float32, int32 or uint8.
    """

    model: str
    parameters: dict[str, float]
    arrays: Arrays


def model_data(body: Body) -> ModelData:
    """Return the data of a linear body's model.

    Raises:
        BodyError: the body is hyperelastic.
    """
    points, normals, areas, compliance = body._arrays()
    options = {key: float(value) for key, value in body.kind.options.items() if not isinstance(value, str)}
    static, dynamic = (float(coefficient) for coefficient in body.kind.friction)
    parameters = {"static_friction": static, "dynamic_friction": dynamic}
    arrays: Arrays = {"points": points, "normals": normals, "areas": areas}
    name = body.kind.name
    if name == "free_form":
        law = body.free_form_law
        parameters |= {
            "spacing": law.spacing,
            "control_compliance": law.control_compliance,
            "surface_layer": law.layer_compliance,
            "tangential_control_compliance": law.tangential_control_compliance,
            "tangential_surface_layer": law.tangential_layer_compliance,
        }
        return ModelData("free_form", parameters, arrays)
    if name == "mass_spring":
        network = body._network_arrays()
        network["fixed"] = network["fixed"].astype(np.uint8)
        return ModelData("mass_spring", parameters | options, arrays | network)
    arrays["compliance"] = compliance
    if name == "compliance":
        return ModelData("compliance", parameters, arrays)
    if name == "viscoelastic":
        return ModelData("standard_linear_solid", parameters | options, arrays)
    if name == "modal":
        arrays |= {"frequencies": body.contents.frequencies, "shapes": body.contents.shapes}
        return ModelData("modal", parameters | options, arrays)
    raise BodyError(f"a body of the kind {name} has no linear model")
