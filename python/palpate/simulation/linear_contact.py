"""Linear loop about the contact with a mesh or a deformable body where a run rests."""

from __future__ import annotations

from dataclasses import replace
from threading import Lock
from typing import Any

import numpy as np

from palpate.control.controller import Controller
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.body_response import HeldTip, body_response
from palpate.simulation.contact_law import ContactLaw, closed_matrix
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.meshes import mesh_origin, touched_mesh
from palpate.simulation.proxy_law import ProxyProbe
from palpate.simulation.recorded import Recorded

__all__ = ["contact_radius"]

NORMALIZES = (
    "it divides by the stiffness, and the law from a body's motion to the scaled forces is not linear; judge and "
    "measure it on a spring, and run it on the body with palpate.simulate"
)
SLOW = 4.0 * np.pi  # rad/s: slower motions of modulus 1 or more are drifts along the surface
MARGINAL = 1e-9  # distance of a modulus from 1 that is rounding
ASYMMETRY = 0.01  # of a body's responses to opposite displacements, above which its linear loop is not known
DOUBT = 1e-3  # relative error of a body's response that must not change the verdict, besides its asymmetry
HELD = Lock()  # cells of a sweep share the core of a body


def contact_radius(trace: Recorded, scenario: Scenario) -> tuple[float | None, str]:
    """Return the spectral radius of the loop in the contact mode in which a run rests, or None and the reason.

    Args:
        trace: of a run that rests in contact.
        scenario: its object is a mesh or a body.
    """
    if not trace["touching"][-1, 0]:
        return None, "the tip is off the object"
    try:
        if scenario.object.kind == "mesh":
            return _mesh_radius(trace, scenario)
        with HELD:
            return _body_radius(trace, scenario)
    except PalpateError as problem:
        return None, str(problem)


def _mesh_radius(trace: Recorded, scenario: Scenario) -> tuple[float | None, str]:
    mesh, surface = touched_mesh(scenario, mesh_origin(scenario))
    assert scenario.object.mesh is not None
    place, normal, depth = trace["proxy"][-1], trace["normal"][-1], float(trace["depth"][-1, 0])
    probe = ProxyProbe(mesh, replace(surface, damping=0.0).core_for(mesh), scenario.object.mesh.radius)
    law = probe.law(int(trace["triangle"][-1, 0]), normal, place, place - depth * normal)
    if law is None:
        return None, "the contact with the mesh is not smooth where the tip rests"
    law = law.damped(float(np.max(np.asarray(surface.damping))), normal, scenario.period)
    controller = _controller(trace, scenario)
    if controller.design_stiffness is not None:  # along the normal the controller sees its design stiffness
        ratio = float(normal**2 @ np.asarray(controller.design_stiffness)) / float(trace["surface_stiffness"][-1, 0])
        rubs = surface.tangential != 0.0 and (float(surface.static_friction) > 0.0 or float(surface.viscous) > 0.0)
        law = law.scaled(ratio, normal if rubs else None)
    loop = _loop(trace, scenario, {"kind": "spring", "stiffness": "1 N/m"})
    radius, drifts = _radius(loop, law)
    if drifts and radius < 1.0:
        return None, "nothing holds the tip along the surface of the mesh"
    return radius, ""


def _body_radius(trace: Recorded, scenario: Scenario) -> tuple[float | None, str]:
    if scenario.controller.normalizes:
        return None, "the controller divides by the stiffness of the body, which is not linear in its motion"
    if scenario.object.body is not None and scenario.object.body.supports and scenario.run.record_every > 1:
        return None, "the supports of the body change, and not every tick is recorded"
    if scenario.object.body is not None and scenario.object.body.tool is not None and scenario.run.record_every > 1:
        return None, "the tool moves, and not every tick is recorded"
    held = HeldTip(scenario, trace["tip"] - trace["tip"][0])
    if held.multirate:
        return None, "the model of the body is updated outside the tick; use palpate certify"
    response = body_response(held)
    if response.asymmetry > ASYMMETRY:
        reason = "the response of the body to opposite displacements is not the same where the tip rests"
        return None, f"{reason}; use palpate certify"
    s, frame = response.system, held.frame
    law = ContactLaw(s.A, s.B @ frame.T, frame @ s.C, frame @ s.D @ frame.T)
    spring: dict[str, Any] = {"kind": "spring", "stiffness": "1 N/m"}
    if not held.holds_across and scenario.operator.kind != "arm":
        spring = {"kind": "wall", "stiffness": "1 N/m", "normal": frame[:, 0].tolist()}
    loop, doubt = _loop(trace, scenario, spring), response.asymmetry + DOUBT
    (low, _), (radius, drifts), (high, _) = (_radius(loop, law, scale) for scale in (1.0 - doubt, 1.0, 1.0 + doubt))
    if (low < 1.0) != (high < 1.0):
        return None, f"the loop is too near its limit for the error of the body's response (radius {radius:.6g})"
    if drifts and radius < 1.0:
        return None, "nothing holds the tip along the surface of the body"
    return radius, ""


def _radius(loop: ScenarioLoop, law: ContactLaw, scale: float = 1.0) -> tuple[float, bool]:
    """Return the spectral radius of a loop without slow drifts along the surface, and whether there are any."""
    values = np.linalg.eigvals(closed_matrix(loop.path, law, loop.directions, scale))
    rates = np.abs(np.log(np.maximum(np.abs(values), 1e-300)) + 1j * np.angle(values)) / float(loop.path.dt)
    drifts = (np.abs(values) >= 1.0 - MARGINAL) & (rates < SLOW)
    return float(np.abs(values[~drifts]).max(initial=0.0)), bool(drifts.any())


def _loop(trace: Recorded, scenario: Scenario, placeholder: dict[str, Any]) -> ScenarioLoop:
    """Return the loop around a unit spring or wall where the run rests, with the scenario's own controller."""
    return scenario_loop(
        Scenario.from_dict({**scenario.to_dict(), "object": placeholder}),
        pose=trace["angle"][-1],
        tip_force=trace["command_force"][-1],
        operator_force=trace["operator_force"][-1],
        controller=None if scenario.controller.kind == "workspace" else _controller(trace, scenario),
    )


def _controller(trace: Recorded, scenario: Scenario) -> Controller:
    """Return the linear controller of a run; a workspace controller is linearized where it rests."""
    device = scenario.load_device()
    if scenario.controller.kind == "workspace":
        return build_controller(scenario, device, trace["angle"][-1])
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    return build_controller(scenario, device, start)
