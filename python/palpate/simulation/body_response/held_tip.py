"""A body under the tip of a run, held where the run was, and its force as the tip is moved from there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate import _core
from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.scenario.body import LARGE, BodyChoice
from palpate.simulation.bodies import origin_of, scenario_body
from palpate.simulation.decision import SHARE
from palpate.simulation.support_phase import support_phase
from palpate.simulation.tool_motion import last_motion, step_body

__all__ = ["HeldTip"]

BLOCK = 200  # ticks between two tests for rest, or two updates of a hyperelastic body
_MAX_SETTLING = 6000  # ticks
_MAX_UPDATES = 200  # of a hyperelastic body's model
_DRIFT = 1e-9  # change of the force in a block, relative to the force, below which the body is at rest
_STEADY = 4  # blocks without less change, after which it is noise or a vibration
_FORCE, NODES, SOLVED, LOST = slice(0, 3), 7, 9, 14  # columns of a row of the core


class HeldTip:
    """The core's own body with the tip held at the end of a path.

    Positions, displacements and forces are in the device's frame.

    Attributes:
        radius: of the tip, m.
        period: T, s.
        every: ticks of an update of a hyperelastic body; 1 for other bodies.
        force: of the tip on the body where the tip is held (3,), N.
        nodes: number of nodes in contact there.
        frame: axes of the contact in columns (3, 3): the normal, out of the body and against the force, and two
            across.
        friction: whether the body has dry friction.
        relaxation: time constant, in ticks, of the force under a tip held still on a body that relaxes without inertia;
            0 for other bodies, and with friction on nodes that do not creep along the surface.
        holds_across: whether the contact may resist motions across its normal: by friction, or by several contact
            points.
        ticks: number of ticks since the body was at rest and free.
    """

    size = 3  # coordinates of the tip
    _by_distance = True  # whether the contact is by signed distance

    def __init__(self, scenario: Scenario, path: Array, *, equilibrium: bool = False) -> None:
        """Move the tip of a run along its path and hold it at the end until the force changes no less from then on.

        Args:
            scenario: its object is a body.
            path: of the tip from its start (m, 3), m: positions of every tick less the first one.
            equilibrium: bring a hyperelastic body to equilibrium there, with an empty energy tank, instead of keeping
                the local model that the tank allows after the path.

        Raises:
            StabilityError: the tip does not touch the body at the end.
        """
        choice = scenario.object.body
        assert choice is not None
        if choice.kind in LARGE and "density" in choice.options:
            raise StabilityError(
                f"a linear analysis does not take {choice.kind} with inertia, whose swing outlasts an update; remove "
                "density from [object.body], or use the kind modal"
            )
        if choice.kind in LARGE and choice.options.get("instantaneous_ratio", 1.0) > 1.0:
            raise StabilityError(
                f"a linear analysis does not take {choice.kind} with relaxation, which outlasts an update; remove "
                "instantaneous_ratio from [object.body], or use the kind viscoelastic"
            )
        if choice.supports and support_phase(scenario, [scenario.period * (len(path) - 1)])[0] < len(choice.supports):
            raise StabilityError(
                "a linear analysis keeps the supports of the body, and they change later, at "
                f"{choice.supports[-1].at:g} s; analyze a sample after the last change"
            )
        if (end := last_motion(choice)) > scenario.period * (len(path) - 0.5):
            raise StabilityError(
                f"a linear analysis holds the tool still, and it moves until {end:g} s; analyze a sample after that"
            )
        body = scenario_body(scenario)
        if isinstance(body.core, _core.MultirateBody):
            raise StabilityError(
                f"a linear analysis does not take {choice.kind} at two rates, whose motion outlasts an update; remove "
                "update_interval from [object.body]"
            )
        self.core = body.core
        self._by_distance = choice.by_distance
        self.radius, self.period = choice.radius, scenario.period
        self.every = round(choice.options.get("update_interval", 20e-3) / scenario.period) if self.multirate else 1
        self._flat = choice.tip == "flat"
        self._rotation = Rotation.from_euler("xyz", choice.rotation).as_matrix()
        positions = (path - np.array(scenario.object.position)) @ self._rotation + origin_of(choice, body)
        self.core.reset()
        self.ticks = 0
        self.friction = body.kind.friction[0] > 0.0
        self.relaxation = relaxation_of(choice, scenario.period)
        self.holds_across = self.friction or len(choice.contact_points) > 1
        every_tick = self.friction or self.multirate or self._by_distance or choice.supports is not None
        kept = positions if every_tick else _thin(positions, choice.radius)
        times = scenario.period * np.arange(len(kept), dtype=float)
        self._check(step_body(self.core, kept, choice, times), SHARE)
        self._position = positions[-1]
        if equilibrium and isinstance(self.core, _core.HyperelasticBody):
            self._equilibrate(self.core)
        self._settle(max(BLOCK, 2 * self.every))
        self.frame = contact_frame(-self.force)

    @property
    def multirate(self) -> bool:
        """Whether the body's model is updated outside the tick."""
        return isinstance(self.core, _core.HyperelasticBody)

    @property
    def rounds(self) -> bool:
        """Whether the model rounds the force: modes in single precision, or contact or friction by iterations."""
        return self.friction or self._by_distance or isinstance(self.core, _core.ModalBody)

    @property
    def memoryless(self) -> bool:
        """Whether the force depends on the position of the tip alone, from where it is held on."""
        if isinstance(self.core, _core.SignedDistanceBody | _core.SupportedBody):
            return not self.core.has_memory
        return isinstance(self.core, _core.ComplianceBody)

    def move(self, displacements: Array) -> tuple[Array, NDArray[np.int64]]:
        """Return the force on the body (m, 3), N, and the number of nodes, as the tip moves about where it is held.

        Args:
            displacements: of the tip, one period each (m, 3), m.
        """
        rows = self._step(self._position + displacements @ self._rotation)
        return -rows[:, _FORCE] @ self._rotation.T, rows[:, NODES].astype(np.int64)

    def _equilibrate(self, core: _core.HyperelasticBody) -> None:
        force = self._step(self._position[None])[0, _FORCE]
        size = float(np.linalg.norm(force))
        outward = np.array([0.0, 0.0, 1.0]) if self._flat or size == 0.0 else force / size
        row = core.settle(self._position[None], outward[None], self.radius, self._flat, _MAX_UPDATES)[0]
        if not row[-1] > 0.0:
            raise StabilityError("the hyperelastic body finds no equilibrium under the tip held still")
        self.ticks = 0

    def _settle(self, block: int) -> None:
        least, since = np.inf, 0
        still = np.zeros((block, self.size))
        for _ in range(max(_MAX_SETTLING // block, _STEADY)):
            forces, nodes = self.move(still)
            self.force, self.nodes = forces[-1], int(nodes[-1])
            if self.nodes == 0:
                raise StabilityError("the tip does not touch the body where the run has left it, so there is no loop")
            change = float(np.ptp(forces, axis=0).max())
            since = 0 if change < 0.9 * least else since + 1
            least = min(least, change)
            if change <= _DRIFT * np.linalg.norm(self.force) or since >= _STEADY:
                return

    def _step(self, positions: Array) -> Array:
        axes = np.tile([0.0, 0.0, 1.0], (len(positions), 1)) if self._flat else np.empty((0, 3))
        path = np.ascontiguousarray(positions)
        return self._check(np.asarray(self.core.simulate_path(path, axes, self.radius, self._flat)))

    def _check(self, rows: Array, share: float = 0.0) -> Array:
        """Return rows of the core, and count their ticks; raise StabilityError if more than a share has no force."""
        check_solved(rows, "the tip; use a smaller tip or depth", share)
        self.ticks += len(rows)
        return rows


def check_solved(rows: Array, under: str, share: float = 0.0) -> None:
    """Raise StabilityError if more than a share of the core's rows (..., columns) has no force.

    Args:
        rows: of one tip or several.
        under: what too many nodes may lie under, and the remedy.
        share: of the rows.
    """
    if np.mean(rows[..., SOLVED] == 0.0) <= share:
        return
    if rows.shape[-1] > LOST and rows[..., LOST].any():
        raise StabilityError("the tip is pushed through the body: use a smaller force or a larger tip")
    raise StabilityError(
        "the contact of the body is not solved in each tick: tetrahedra of a hyperelastic or mass-spring body are "
        f"inverted, or too many nodes lie under {under}, or a coarser mesh"
    )


def relaxation_of(choice: BodyChoice, period: float) -> float:
    """Return `HeldTip.relaxation` of a body that is stepped once per period, s."""
    creeps_aside = choice.by_distance or choice.options.get("static_friction", 0.0) == 0.0
    if choice.kind != "viscoelastic" or not creeps_aside:
        return 0.0
    return float(choice.options["retardation_time"]) / float(choice.options["instantaneous_ratio"]) / period


def contact_frame(normal: Array) -> Array:
    """Return three orthonormal axes in columns (3, 3), the first along a vector (3,)."""
    axes = np.column_stack([normal, np.eye(3)])
    basis = np.linalg.qr(axes)[0]
    return np.asarray(basis * np.array([np.sign(basis[:, 0] @ normal), 1.0, 1.0]))


def _thin(positions: Array, radius: float) -> Array:
    """Return some positions of a path (k, 3), its last one included, no farther apart than half a radius."""
    every = max(len(positions) // 100, 1)
    kept = np.vstack([positions[::every], positions[-1:]])
    far = np.linalg.norm(np.diff(kept, axis=0), axis=1).max(initial=0.0) > 0.5 * radius
    return positions if far else kept
