"""Maps of the stable objects: critical stiffness, boundary in stiffness and damping, Z-width, workspace."""

from palpate.stability.maps.boundary_curve import Boundary, stability_boundary
from palpate.stability.maps.wall_interval import (
    StabilityInterval,
    critical_stiffness,
    stability_interval,
    wall_spectral_radius,
)
from palpate.stability.maps.workspace_map import Workspace, workspace
from palpate.stability.maps.zwidth_map import ZWidth

__all__ = [
    "Boundary",
    "StabilityInterval",
    "Workspace",
    "ZWidth",
    "critical_stiffness",
    "stability_boundary",
    "stability_interval",
    "wall_spectral_radius",
    "workspace",
]
