"""The data that a body's model is built from in the core, for programs that build it without Python."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.fem.body import Body

Arrays = dict[str, NDArray[Any]]


class ModelData(NamedTuple):
    """Arguments of a body model of the core.

    Attributes:
        model: "compliance", "modal", "standard_linear_solid", "mass_spring", "hyperelastic" or
            "signed_distance".
        parameters: numbers of the model in SI, static and dynamic friction included; and the law of a hyperelastic one.
        arrays: by name; float64, float32, int32 or uint8.
    """

    model: str
    parameters: dict[str, float | str]
    arrays: Arrays


def model_data(body: Body) -> ModelData:
    """Return the data of a body's model."""
    if body.kind.name == "hyperelastic":
        return _hyperelastic_data(body)
    if isinstance(body.core, _core.SignedDistanceBody):
        return _signed_distance_data(body)
    points, normals, areas, compliance = body._arrays()
    if body.kind.supports is not None and body.kind.by_distance:
        bare = _signed_distance_data(body)
        return bare._replace(arrays=bare.arrays | _support_arrays(body))
    options: dict[str, float | str] = {key: float(x) for key, x in body.kind.options.items() if not isinstance(x, str)}
    static, dynamic = (float(coefficient) for coefficient in body.kind.friction)
    parameters: dict[str, float | str] = {"static_friction": static, "dynamic_friction": dynamic}
    arrays: Arrays = {"points": points, "normals": normals, "areas": areas}
    if body.update_ticks:
        parameters["update_interval"] = options["update_interval"] = body.update_ticks[0]
    name = body.kind.name
    if name == "mass_spring":
        network = body._network_arrays()
        network["fixed"] = network["fixed"].astype(np.uint8)
        network["patch_compliance"] = network["patch_compliance"].reshape(-1, 3)
        if body.update_ticks and static > 0.0:
            arrays["compliance"] = body._network_compliance()
        return ModelData("mass_spring", parameters | options, arrays | network)
    arrays["compliance"] = compliance
    if name == "compliance":
        return ModelData("compliance", parameters, arrays | _support_arrays(body))
    if name == "viscoelastic":
        return ModelData("standard_linear_solid", parameters | options, arrays)
    arrays |= {"frequencies": body.contents.frequencies, "shapes": body.contents.shapes}
    return ModelData("modal", parameters | options, arrays)


def _support_arrays(body: Body) -> Arrays:
    """Return the first tick of each phase of the supports and the roles of the nodes in it; nothing without phases."""
    plan = body.kind.supports
    if plan is None:
        return {}
    return {"support_steps": np.array(plan.steps, dtype=np.int32), "support_roles": plan.roles(body.nodes)}


def _signed_distance_data(body: Body) -> ModelData:
    static, dynamic = (float(coefficient) for coefficient in body.kind.friction)
    data = body._signed_distance_arguments()
    data["sideways_fraction"], data["vertex_nodes"] = data.pop("sideways"), data.pop("node")
    if len(data["frequencies"]) == 0:
        del data["frequencies"], data["shapes"]
    arrays: Arrays = dict(zip(("points", "normals", "areas", "compliance"), body._arrays(), strict=True))
    arrays |= {name: value for name, value in data.items() if isinstance(value, np.ndarray)}
    parameters: dict[str, float | str] = {"static_friction": static, "dynamic_friction": dynamic}
    parameters |= {name: float(value) for name, value in data.items() if not isinstance(value, np.ndarray)}
    return ModelData("signed_distance", parameters, arrays)


def _hyperelastic_data(body: Body) -> ModelData:
    options = body.kind.options
    volume, surface = body._hyperelastic_arrays()
    arrays: Arrays = volume | surface
    arrays |= {"tetrahedra": volume["tetrahedra"].astype(np.int32), "fixed": volume["fixed"].astype(np.uint8)}
    parameters: dict[str, float | str] = {
        "law": str(options["law"]),
        "nodes_per_tip": int(options["nodes_per_tip"]),
        "update_interval": body.update_ticks[0],
        "static_friction": float(body.kind.friction[0]),
        "dynamic_friction": float(body.kind.friction[1]),
    }
    if body.kind.friction[0] > 0.0:
        arrays["compliance"] = body._arrays()[3]
        parameters["poisson"] = body._recorded("poisson")
    motion = ("density", "rayleigh_alpha", "rayleigh_beta", "instantaneous_ratio", "retardation_time")
    moving = {key: float(options[key]) for key in motion if key in options}
    if moving:
        parameters |= moving | {"period": float(options["period"])}
    return ModelData("hyperelastic", parameters, arrays)
