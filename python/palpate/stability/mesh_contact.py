"""Contact of a scenario's run with its mesh: poses of the run, and the stability of every contact mode there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.stability.contact_run import Observed, run_on
from palpate.stability.mesh_sites import Site, TouchedSurface, contact_rows, faces_near
from palpate.stability.mode_stability import ModeStability, mode_stability

__all__ = ["SITES", "MeshContact", "mesh_contact"]

SITES = 4  # poses along the path of the proxy, besides the last


@dataclass(frozen=True, eq=False)
class MeshContact:
    """Contact of a scenario's run with its mesh: the run, its sites, and the stability of every mode at each.

    Attributes:
        scenario: the scenario.
        observed: the run.
        sites: poses of the run in contact; the last is where the contact ends or rests.
        found: the stability of every contact mode at every site.
        resting: the stability of the mode at the last site in which the tip rests.
    """

    scenario: Scenario
    observed: Observed
    sites: tuple[Site, ...]
    found: tuple[ModeStability, ...]
    resting: ModeStability

    @property
    def touching(self) -> bool:
        """Whether the tip touches the mesh at the end of the run."""
        return bool(self.observed.trace["touching"][self.observed.rest, 0] > 0.0)

    @property
    def here(self) -> tuple[ModeStability, ...]:
        """Return the modes at the last site."""
        return tuple(one for one in self.found if one.site is self.sites[-1])

    @property
    def away(self) -> tuple[ModeStability, ...]:
        """Return the unstable modes at the other sites."""
        return tuple(one for one in self.found if not one.stable and one.site is not self.sites[-1])

    @property
    def worst(self) -> ModeStability:
        """Return the mode with the largest spectral radius."""
        return max(self.found, key=lambda one: one.radius)


def mesh_contact(s: Scenario, sites: int = SITES, hold: float = 0.0) -> MeshContact:
    """Return the contact of a scenario's run with its mesh.

    Args:
        s: the scenario.
        sites: poses along the path, besides the last.
        hold: s for which the last forces of the scenario last at least.

    Raises:
        StabilityError: the tip never touches the mesh, or nothing lets it move.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    if s.operator.kind == "fixed":
        raise StabilityError(
            'operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another operator'
        )
    surface = TouchedSurface(s)
    observed = run_on(s, hold)
    trace = observed.trace
    rows = contact_rows(trace, sites, observed.rest)
    triangle = trace["triangle"][:, 0].astype(np.int64)
    ends = [rows[0], *((a + b) // 2 for a, b in pairwise(rows)), rows[-1]]
    found = []
    for row, first, last in zip(rows, ends[:-1], ends[1:], strict=True):
        visited = np.unique(triangle[first : last + 1])
        path = trace["proxy"][first : last + 1][triangle[first : last + 1] >= 0]
        faces = faces_near(surface.mesh, visited[visited >= 0], path - surface.radius * trace["normal"][row])
        found.append(surface.site(trace, row, faces))
    modes = [one for site in found for one in mode_stability(site, site.modes)]
    resting = mode_stability(found[-1], [found[-1].resting])[0]
    return MeshContact(s, observed, tuple(found), tuple(modes), resting)
