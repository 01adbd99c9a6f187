"""A body under the tips of several devices, held where a run was, and its forces as they are moved from there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.simulation.body_response.held_tip import BLOCK, NODES, HeldTip, check_solved, contact_frame, relaxation_of
from palpate.simulation.shared_body import SharedBody

__all__ = ["HeldTips"]


class HeldTips(HeldTip):
    """The core's own body with the tips of k devices held at the end of their paths.

    As `HeldTip`, with r = 3k coordinates in place of 3: those of each tip in its device's frame, one after the other.

    Attributes:
        each: number of nodes in contact of each tip (k,).
    """

    def __init__(self, shared: SharedBody, paths: Array) -> None:
        """Move the tips along their paths and hold them at the end until the forces change no less from then on.

        Args:
            shared: the body, at rest.
            paths: of the tips (m, k, 3), m, each in its device's frame.

        Raises:
            StabilityError: a tip does not touch the body at the end.
        """
        self._shared = shared
        self.core = shared.core
        self.size = 3 * len(shared.radii)
        self.radius, self.period, self.every = float(shared.radii.min()), shared.scenarios[0].period, 1
        self.friction, self.holds_across, self.ticks = shared.friction, True, 0
        choice = shared.scenarios[0].object.body
        assert choice is not None
        self.relaxation = relaxation_of(choice, self.period)
        self.core.reset()
        self._step(paths)
        self._ends = paths[-1]
        self._settle(BLOCK)
        for tip, touched in enumerate(self.each):
            if touched == 0:
                raise StabilityError(f"the tip of device {tip + 1} does not touch the body where the run has left it")
        self.frame = block_diag(*(contact_frame(-force) for force in self.force.reshape(-1, 3)))

    def move(self, displacements: Array) -> tuple[Array, NDArray[np.int64]]:
        """Return the forces on the body (m, r), N, and the number of nodes, as the tips move about where they are held.

        Args:
            displacements: of the tips, one period each (m, r), m.
        """
        rows = self._step(self._ends + displacements.reshape(len(displacements), -1, 3))
        nodes = rows[:, :, NODES].astype(np.int64)
        self.each = nodes[-1]
        return self._shared.forces(rows).reshape(len(rows), -1), nodes.sum(axis=1)

    def _step(self, positions: Array) -> Array:
        rows = self._shared.step(positions)
        check_solved(rows, "the tips; use smaller tips or depths")
        self.ticks += len(positions)
        return rows
