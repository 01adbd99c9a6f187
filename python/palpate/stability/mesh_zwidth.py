"""Z-width of a scenario whose object is a mesh: the stiffest surface for which every contact mode is stable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.zwidth_map import ZWidth
from palpate.stability.mesh_contact import MeshContact, mesh_contact
from palpate.stability.mesh_modes import face_modes
from palpate.stability.mesh_sites import Site
from palpate.stability.mode_stability import ModeStability, gain_margin, mode_stability

__all__ = ["mesh_zwidth"]

RATIOS = (0.0, 0.01, 0.03, 0.06, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.7, 2.5, 4.0, 8.0, 20.0, 100.0)
MORE = 16  # rays at most beside these
GAP = 0.06  # of the size of the curve, between neighbors above which there is a ray between them
SITES = 3
SMALLEST = 1e-4  # factor on the surface's forces at which the search for a stable one ends


def mesh_zwidth(s: Scenario, _simulated: bool, report: Callable[[str, float], None]) -> ZWidth:
    """Return the Z-width of a mesh: the stiffness of its stiffest face, over damping, that every mode admits.

    The forces of the surface, tangential spring and viscous friction included, are scaled together. The modes are those
    of the faces near the run's path, sticking and sliding, as the scenario has them; curvature is neglected.

    Raises:
        StabilityError: a mode is unstable with every stiffness, or the tip never touches the mesh.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    report("running the scenario", 0.05)
    contact = mesh_contact(s, SITES - 1)
    stiffest = max(point.stiffness for site in contact.sites for point in site.points)
    kinds = sorted({one.mode.kind for one in contact.found if one.mode.kind != "edge"})
    curves = {"every contact mode": _boundary(contact, stiffest, None, report)}
    if len(kinds) > 1:
        curves |= {
            kind: _boundary(contact, stiffest, kind, report) for kind in kinds if kind in ("sticking", "sliding")
        }
    damping = max(point.damping for site in contact.sites for point in site.points)
    return ZWidth(
        s.title,
        curves,
        None,
        "the passive stiffness of a mesh depends on its edges and its friction, and no condition for it is known",
        None,
        (damping, stiffest),
        all(one.stable for one in contact.found),
        not_simulated="a run shows the modes that it meets, and the map is of every mode near its path; palpate "
        "certify compares the loop with the run of the scenario",
    )


def _boundary(
    contact: MeshContact, stiffest: float, kind: str | None, report: Callable[[str, float], None]
) -> Boundary:
    """Return the boundary of the modes of a kind (None: all), along rays of constant damping over stiffness."""
    period, rays = contact.scenario.period, dict[float, tuple[float, float, float]]()

    def follow(ratio: float) -> None:
        report(kind or "every contact mode", 0.1 + 0.8 * len(rays) / (len(RATIOS) + MORE))
        damping = ratio * period * stiffest
        found = [one for site in contact.sites for one in _modes(site, damping, kind)]
        scale, worst = _largest_scale(found)
        rays[ratio] = scale * damping, scale * stiffest, worst.angle

    for ratio in RATIOS:
        follow(ratio)
    for _ in range(MORE):  # where neighbors are farthest apart
        ratios = sorted(rays)
        points = np.array([rays[ratio][:2] for ratio in ratios])
        gaps = np.linalg.norm(np.diff(points, axis=0) / np.maximum(points.max(axis=0), 1e-300), axis=1)
        at = int(np.argmax(gaps))
        if gaps[at] < GAP:
            break
        follow(0.5 * (ratios[at] + ratios[at + 1]))
    kept = [rays[ratio] for ratio in sorted(rays) if rays[ratio][1] > 0.0]
    if not kept:
        raise StabilityError("object.surface: no stiffness of the surface makes every contact mode stable in this loop")
    b, k, angle = (np.array(column) for column in zip(*kept, strict=True))
    return Boundary(b, k, angle, (0.5 * float(b[0]), 0.5 * float(k[0])), np.inf)


def _modes(site: Site, damping: float, kind: str | None) -> list[ModeStability]:
    points = [replace(point, damping=damping) for point in site.points]
    modes = [mode for point in points for mode in face_modes(point) if kind in (None, mode.kind)]
    return mode_stability(site, modes)


def _largest_scale(found: list[ModeStability]) -> tuple[float, ModeStability]:
    """Return the largest stable factor on the forces, connected with the smallest stable one; 0 if there is none."""
    scale, at = 1.0, found
    while not all(one.stable for one in at):
        scale /= 1.5
        if scale < SMALLEST:
            return 0.0, max(found, key=lambda one: one.radius)
        sites = {id(one.site): one.site for one in found}
        at = [
            one
            for key, site in sites.items()
            for one in mode_stability(site, [f.mode for f in found if id(f.site) == key], scale)
        ]
    factor, worst = gain_margin(found, start=scale)
    return (factor, worst) if np.isfinite(factor) else (0.0, worst)
