"""Linear loop about the contact with a mesh or a deformable body where a run rests."""

from __future__ import annotations

from dataclasses import replace
from threading import Lock
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.body_response import HeldTip, body_response
from palpate.simulation.contact_law import ContactLaw, closed_matrix
from palpate.simulation.controllers import build_controller
from palpate.simulation.decision import FLOOR, SWING
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.meshes import mesh_origin, touched_mesh
from palpate.simulation.proxy_law import ProxyProbe
from palpate.simulation.recorded import Recorded, without_trend

__all__ = ["UNHELD", "contact_radius", "swings_in_place"]

UNHELD = "nothing holds the tip along the surface"

NORMALIZES = (
    "it divides by the stiffness, and the law from a body's motion to the scaled forces is not linear; judge and "
    "measure it on a spring, and run it on the body with palpate.simulate"
)
SLOW = 4.0 * np.pi  # rad/s: slower motions of modulus 1 or more are drifts along the surface
MARGINAL = 1e-9  # distance of a modulus from 1 that is rounding
ASYMMETRY = 0.01  # of a body's responses to opposite displacements, above which its linear loop is not known
DOUBT = 1e-3  # relative error of a body's response that must not change the verdict, besides its asymmetry
IN_PLACE = 0.2  # way of the mean over the range of an oscillation, up to which it stays in one place
HELD = Lock()  # cells of a sweep share the core of a body


def contact_radius(trace: Recorded, scenario: Scenario) -> tuple[float | None, str]:
    """Return the spectral radius of the loop in the contact mode in which a run rests, or None and the reason.

    A tip that still swings passes other contact modes. The loop is then that in the middle and at the ends of its
    swing: the largest radius counts, and none if they lie on both sides of 1.

    Args:
        trace: of a run that rests in contact.
        scenario: its object is a mesh or a body.
    """
    rows = _places(trace)
    if not trace["touching"][-1, 0]:
        return None, "the tip is off the object"
    if not trace["touching"][rows, 0].all():
        return None, "the tip still swings, and leaves the object"
    radii = []
    try:
        for row in rows:
            if scenario.object.kind == "mesh":
                radius, reason = _mesh_radius(trace, scenario, row)
            else:
                with HELD:
                    radius, reason = _body_radius(trace, scenario, row)
            if radius is None:
                return None, reason
            radii.append(radius)
    except PalpateError as problem:
        return None, str(problem)
    if min(radii) < 1.0 <= max(radii):
        return None, (
            "the tip still swings, and the loop is stable in a part of its swing and unstable in another (spectral "
            f"radius {min(radii):.6g} and {max(radii):.6g})"
        )
    return max(radii), ""


def swings_in_place(trace: Recorded) -> bool:
    """Return whether the tip oscillates about one place in the last fifth of a run."""
    swing, trend = _late_motion(trace)
    return float(np.ptp(trend, axis=0).max()) <= IN_PLACE * float(np.ptp(swing, axis=0).max())


def _places(trace: Recorded) -> list[int]:
    """Return the last sample, or the middle and the ends of the oscillation in the last fifth of a run if it counts."""
    last, (swing, _) = len(trace.time) - 1, _late_motion(trace)
    along = swing @ np.linalg.svd(swing, full_matrices=False)[2][0]
    deflection = trace["deflection"][-1] if "deflection" in trace else trace["tip"][-1] - trace["tip"][0]
    if np.ptp(along) <= 2.0 * max(SWING * float(np.linalg.norm(deflection)), FLOOR):
        return [last]
    begin = last + 1 - len(swing)
    return [begin + int(found) for found in (np.argmin(np.abs(along)), np.argmin(along), np.argmax(along))]


def _late_motion(trace: Recorded) -> tuple[Array, Array]:
    """Return the oscillation and the quadratic trend (n, 3) of the tip in the last fifth of a run, m."""
    late = trace["tip"][-max(len(trace.time) // 5, 4) :]
    swing = without_trend(late)
    return swing, late - swing


def _mesh_radius(trace: Recorded, scenario: Scenario, row: int) -> tuple[float | None, str]:
    mesh, surface = touched_mesh(scenario, mesh_origin(scenario))
    assert scenario.object.mesh is not None
    place, normal, depth = trace["proxy"][row], trace["normal"][row], float(trace["depth"][row, 0])
    probe = ProxyProbe(mesh, replace(surface, damping=0.0).core_for(mesh), scenario.object.mesh.radius)
    law = probe.law(int(trace["triangle"][row, 0]), normal, place, place - depth * normal)
    if law is None:
        return None, "the contact with the mesh is not smooth where the tip rests"
    law = law.damped(float(np.max(np.asarray(surface.damping))), normal, scenario.period)
    controller = _controller(trace, scenario, row)
    if controller.design_stiffness is not None:  # along the normal the controller sees its design stiffness
        ratio = float(normal**2 @ np.asarray(controller.design_stiffness)) / float(trace["surface_stiffness"][row, 0])
        rubs = surface.tangential != 0.0 and (float(surface.static_friction) > 0.0 or float(surface.viscous) > 0.0)
        law = law.scaled(ratio, normal if rubs else None)
    loop = _loop(trace, scenario, row, {"kind": "spring", "stiffness": "1 N/m"})
    radius, drifts = _radius(loop, law)
    if drifts and radius < 1.0:
        return None, f"{UNHELD} of the mesh"
    return radius, ""


def _body_radius(trace: Recorded, scenario: Scenario, row: int) -> tuple[float | None, str]:
    if scenario.controller.normalizes:
        return None, "the controller divides by the stiffness of the body, which is not linear in its motion"
    if scenario.object.body is not None and scenario.object.body.supports and scenario.run.record_every > 1:
        return None, "the supports of the body change, and not every tick is recorded"
    if scenario.object.body is not None and scenario.object.body.tool is not None and scenario.run.record_every > 1:
        return None, "the tool moves, and not every tick is recorded"
    held = HeldTip(scenario, trace["tip"][: row + 1] - trace["tip"][0])
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
    loop, doubt = _loop(trace, scenario, row, spring), response.asymmetry + DOUBT
    (low, _), (radius, drifts), (high, _) = (_radius(loop, law, scale) for scale in (1.0 - doubt, 1.0, 1.0 + doubt))
    if (low < 1.0) != (high < 1.0):
        return None, f"the loop is too near its limit for the error of the body's response (radius {radius:.6g})"
    if drifts and radius < 1.0:
        return None, f"{UNHELD} of the body"
    return radius, ""


def _radius(loop: ScenarioLoop, law: ContactLaw, scale: float = 1.0) -> tuple[float, bool]:
    """Return the spectral radius of a loop without slow drifts along the surface, and whether there are any."""
    values = np.linalg.eigvals(closed_matrix(loop.path, law, loop.directions, scale))
    rates = np.abs(np.log(np.maximum(np.abs(values), 1e-300)) + 1j * np.angle(values)) / float(loop.path.dt)
    drifts = (np.abs(values) >= 1.0 - MARGINAL) & (rates < SLOW)
    return float(np.abs(values[~drifts]).max(initial=0.0)), bool(drifts.any())


def _loop(trace: Recorded, scenario: Scenario, row: int, placeholder: dict[str, Any]) -> ScenarioLoop:
    """Return the loop around a unit spring or wall at one sample of a run, with the scenario's own controller."""
    return scenario_loop(
        Scenario.from_dict({**scenario.to_dict(), "object": placeholder}),
        pose=trace["angle"][row],
        tip_force=trace["command_force"][row],
        operator_force=trace["operator_force"][row],
        controller=None if scenario.controller.kind == "workspace" else _controller(trace, scenario, row),
    )


def _controller(trace: Recorded, scenario: Scenario, row: int) -> Controller:
    """Return the linear controller of a run; a workspace controller is linearized at the sample."""
    device = scenario.load_device()
    if scenario.controller.kind == "workspace":
        return build_controller(scenario, device, trace["angle"][row])
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    return build_controller(scenario, device, start)
