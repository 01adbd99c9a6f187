"""Certificate and Z-width of a scenario, by the kind of its object."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario
from palpate.simulation.linear_loop import require_linear_parts
from palpate.stability.body.certificate import certify_body
from palpate.stability.body.zwidth import body_zwidth
from palpate.stability.certificate import Certificate
from palpate.stability.certification import certify_spring
from palpate.stability.display_certificate import certify_display
from palpate.stability.force_object_certificate import certify_field, certify_law
from palpate.stability.maps.zwidth_map import ZWidth, spring_zwidth
from palpate.stability.mesh_certificate import certify_mesh
from palpate.stability.mesh_zwidth import mesh_zwidth
from palpate.stability.rest_certificate import certify_texture

__all__ = ["certify", "zwidth"]

Progress = Callable[[str, float], None]
CERTIFICATES: Mapping[str, Callable[[Scenario], Certificate]] = {
    "mesh": certify_mesh,
    "body": certify_body,
    "force_law": certify_law,
    "field": certify_field,
    "textured_wall": certify_texture,
}  # other kinds: a spring's
ZWIDTHS: Mapping[str, Callable[[Scenario, bool, Progress], ZWidth]] = {"mesh": mesh_zwidth, "body": body_zwidth}


def certify(scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None) -> Certificate:
    """Return the certificate of a scenario's servo loop.

    With a spring or a wall, the loop is linearized at the start and where the run comes to rest, sampled exactly, and
    tested by four independent criteria. If the criteria disagree, nothing is claimed. An unstable loop comes with a
    scenario that diverges. A stable loop that is not passive comes with the passive operator, found by search, that
    destabilizes it. Every counter-example has been simulated.

    With a mesh, every contact mode of the proxy along the run is tested: faces, valley edges and vertices, sticking and
    sliding. A common Lyapunov function or a dwell time covers the switching between them. The scenario is simulated,
    and again with a small push.

    With a deformable body, the loop is tested where the run comes to rest and at other depths of the run, with the
    body's own states (`ContactStability`). It is called stable or unstable only if the run, pushed slightly, agrees.

    With a force law, every slope of its table is covered by a multiplier (`certify_force_law`). A viscous field and
    the linear part of a gravity well are springs. A textured wall and a virtual mass are judged for small motions
    about the place where the run rests, and by the run.

    An admittance display is judged on a spring or a wall, by the same criteria and the run.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: in place of the scenario's: a Controller or a python-control system, as for `palpate.simulate`. It
            is written into the scenario of the certificate. A Python function has no linear model and is refused.

    Raises:
        ScenarioError, DesignError, PoseError: the scenario has a mistake, or the controller is not linear.
        StabilityError: the scenario has no loop (no contact, or a fixed tip), several objects or a moving one.
    """
    s = read_scenario(scenario, controller)
    with s.naming_place():
        if s.servo.tool is not None:
            return certify_display(s)
        require_linear_parts(s)
        return CERTIFICATES.get(s.object.kind, certify_spring)(s)


def zwidth(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    controller: Any = None,
    simulated: bool = True,
    progress: Progress | None = None,
) -> ZWidth:
    """Return the Z-width of a scenario's loop: exact boundary, passive walls, and boundary by simulation.

    The object of the scenario is replaced by springs and dampers of every size, equal in all directions of the object
    and damped by backward difference. The map of an impedance display includes other operators. With a mesh, its
    surface is scaled, and every contact mode along the run must be stable; nothing is simulated. With a deformable
    body, its response at the rest of the run is scaled, beside a damper along the normal; the stiffness of the map is
    its static stiffness there, and nothing is simulated.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: in place of the scenario's: a Controller or a python-control system, as for `palpate.simulate`. A
            Python function has no linear model and is refused.
        simulated: also find the boundary of a spring or wall by simulation.
        progress: called with a text and the fraction done.

    Raises:
        StabilityError: no object of any stiffness is stable, the scenario has no loop, several objects or a moving one,
            or its controller divides by the stiffness.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    s = read_scenario(scenario, controller)
    report = progress or (lambda _text, _fraction: None)
    with s.naming_place():
        require_linear_parts(s)
        if s.controller.normalizes:
            raise StabilityError(
                "controller.normalize: it divides by the object's stiffness, so the loop is the same for every "
                "stiffness and has no Z-width; palpate.stability.certify judges it"
            )
        return ZWIDTHS.get(s.object.kind, spring_zwidth)(s, simulated, report)
