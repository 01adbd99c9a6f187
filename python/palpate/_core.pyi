"""palpate's core: device dynamics and the servo loop."""

from collections.abc import Mapping, Sequence
import enum
from typing import Annotated, TypeAlias, overload

import numpy
from numpy.typing import NDArray


class DeformableBody:
    """Interface of deformable bodies to a servo loop."""

class SurfaceFrames:
    """
    Thread that computes the displacements of a body's surface during a servo loop.
    """

    def __init__(self, compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], rate: float) -> None:
        """The compliance is not copied."""

    def latest(self) -> tuple:
        """
        Return the last frame: its number, the tick that it shows (-1: none yet), displacements of the nodes (n, 3), m.
        """

class ToolMotion:
    """
    Tips of a tool that turns, opens and closes, relative to the device's tip.
    """

    def __init__(self, open: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], closed: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 5), order='C', device='cpu', writable=False)]) -> None:
        """
        Places of the tips less the device's tip at the openings 1 and 0 (k, 3), m. Rows of increasing time, s; angles about x, then y, then z of the device, rad; opening.
        """

    def places(self, times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the centers of the tips less the device's tip at times (m,), s: (m, k, 3), m.
        """

class PlacedBody:
    """A body, its pose in the device frame, and the tip that touches it."""

    def __init__(self, body: DeformableBody, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rotation: Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order='F')], radius: float, flat: bool) -> None: ...

    def set_tool(self, motion: ToolMotion) -> None:
        """Move the contact points of the body's tool."""

class ComplianceBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the friction forces on the contact nodes of the last step (n, 3), N.
        """

    def reset(self) -> None: ...

    def node_response(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the displacement of a node along its inward normal after each period, m. The forces [N] are constant over each period.
        """

class ModalBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], shapes: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], frequencies: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], period: float, rayleigh_alpha: float, rayleigh_beta: float, instantaneous_ratio: float = 1.0, retardation_time: float = 1.0, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the friction forces on the contact nodes of the last step (n, 3), N.
        """

    def reset(self) -> None: ...

    def node_response(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the displacement of a node along its inward normal after each period, m. The forces [N] are constant over each period.
        """

class StandardLinearSolidBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], instantaneous_ratio: float, retardation_time: float, period: float, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the friction forces on the contact nodes of the last step (n, 3), N.
        """

    def reset(self) -> None: ...

    def node_response(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the displacement of a node along its inward normal after each period, m. The forces [N] are constant over each period.
        """

class SignedDistanceBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], vertices: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], node: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], modulus: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], poisson: float, shapes: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], frequencies: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], period: float = 0.001, rayleigh_alpha: float = 0.0, rayleigh_beta: float = 0.0, instantaneous_ratio: float = 1.0, retardation_time: float = 1.0, sideways: float = 1.0, tips: int = 1, static_friction: float = 0.0, dynamic_friction: float = 0.0, lanes: int = 0, contact_points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)] | None = None) -> None:
        """
        `lanes`: width of the registers as for run_cells, 0: the widest; the forces do not depend on it. `contact_points`: centers of the equal tips of a rigid tool less the center of a path (k, 3), m; none: one tip, or `tips` of `simulate_tips`.
        """

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool, tool: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)] | None = None) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the direction of the normal force, or the normal of the nearest node. `tool`: centers of the tips of a tool less the position of the path (m, tips, 3), m; none: where they are.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the parts of the forces across the normals that load the body, at the contact nodes of the last step (n, 3), N.
        """

    def simulate_tips(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], axes: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lengths: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Step all tips along their paths `centers` (m, tips, 3). A tip is a capsule of a length. Return rows as `simulate_path` for each step and tip (m, tips, 15).
        """

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on the past: inertia or creep."""

    def reset(self) -> None: ...

class MassSpringBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], positions: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], masses: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fixed: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], springs: Annotated[NDArray[numpy.int32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], stiffness: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], rest_lengths: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], damping: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int32], dict(shape=(None, 4), order='C', device='cpu', writable=False)], pressure: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_begin: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_vertices: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_compliance: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], period: float, rayleigh_alpha: float, rayleigh_beta: float, hardening_strain: float = 0.0, exponent: float = 0.0, stiffness_limit: float = 1.0, static_friction: float = 0.0, dynamic_friction: float = 0.0, lanes: int = 0) -> None:
        """
        `lanes`: width of the registers as for run_cells, 0: the widest; the forces do not depend on it.
        """

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the friction forces on the contact nodes of the last step (n, 3), N.
        """

    def reset(self) -> None: ...

    def node_response(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the displacement of a node along its inward normal after each period, m. The forces [N] are constant over each period.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """Return the mean displacement of each node's patch (n, 3), m."""

    def positions(self) -> NDArray[numpy.float64]:
        """Return the positions of the vertices (N, 3), m."""

    def set_state(self, positions: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], velocities: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> None:
        """
        Set the positions (N, 3), m, and velocities (N, 3), m/s, of the vertices.
        """

    @property
    def energy(self) -> float:
        """Kinetic plus stored energy, J."""

    @property
    def limited_steps(self) -> int:
        """
        Number of periods whose speed was reduced to keep the energy from rising.
        """

class SupportedBody(DeformableBody):
    """A linear body whose supports and touched nodes change."""

    @overload
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], steps: Sequence[int], roles: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None:
        """
        `steps`: first step of each phase. `roles`: of each node in each phase, 0: deforms only, 1: touched, 2: held.
        """

    @overload
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], steps: Sequence[int], roles: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], vertices: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], node: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], modulus: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], poisson: float, sideways: float = 1.0, lanes: int = 0, contact_points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)] | None = None, static_friction: float = 0.0, dynamic_friction: float = 0.0, period: float = 0.001, instantaneous_ratio: float = 1.0, retardation_time: float = 1.0, shapes: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None = None, frequencies: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, rayleigh_alpha: float = 0.0, rayleigh_beta: float = 0.0) -> None:
        """
        The same with contact by signed distance; a standard linear solid if `instantaneous_ratio` exceeds 1. With the `shapes` (3n, m) and `frequencies` of modes it has inertia; it does not relax then.
        """

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool, tool: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)] | None = None) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the direction of the normal force, or the normal of the nearest node. `tool`: centers of the tips of a tool less the position of the path (m, tips, 3), m; none: where they are.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """Return the displacement of each node after the last step (n, 3), m."""

    def change_supports(self, role: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Change the roles of the nodes at the next step: 0: deforms only, 1: touched, 2: held.
        """

    @property
    def has_memory(self) -> bool:
        """Whether the body creeps or swings."""

    @property
    def changes(self) -> int:
        """Number of changes since the body was at rest."""

    def reset(self) -> None: ...

class MultirateBody(DeformableBody):
    """Linear body whose model is updated at a low rate, after the ticks."""

    @staticmethod
    def mass_spring(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], positions: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], masses: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fixed: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], springs: Annotated[NDArray[numpy.int32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], stiffness: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], rest_lengths: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], damping: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int32], dict(shape=(None, 4), order='C', device='cpu', writable=False)], pressure: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_begin: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_vertices: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], patch_compliance: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], period: float, rayleigh_alpha: float, rayleigh_beta: float, hardening_strain: float = 0.0, exponent: float = 0.0, stiffness_limit: float = 1.0, *, static_friction: float, dynamic_friction: float, update_interval: int) -> MultirateBody:
        """`compliance`: static, of the nodes, for friction only."""

    @staticmethod
    def modal(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], shapes: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], frequencies: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], period: float, rayleigh_alpha: float, rayleigh_beta: float, instantaneous_ratio: float, retardation_time: float, static_friction: float, dynamic_friction: float, update_interval: int) -> MultirateBody: ...

    @staticmethod
    def viscoelastic(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], instantaneous_ratio: float, retardation_time: float, period: float, static_friction: float, dynamic_friction: float, update_interval: int) -> MultirateBody: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.
        """

    def step_durations(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Return the duration of each step without the model updates, s, including the clock's own.
        """

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def friction_forces(self) -> NDArray[numpy.float64]:
        """
        Return the friction forces on the contact nodes of the last step (n, 3), N.
        """

    @property
    def tank_energy(self) -> float:
        """Level of the energy tank after the last step, J."""

    def reset(self) -> None: ...

@overload
def scatter_add(to: Annotated[NDArray[numpy.float64], dict(shape=(None, None), device='cpu')], from_: Annotated[NDArray[numpy.float64], dict(shape=(None, None), device='cpu', writable=False)], rows: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], columns: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], lower: bool = False) -> None: ...

@overload
def scatter_add(to: Annotated[NDArray[numpy.float32], dict(shape=(None, None), device='cpu')], from_: Annotated[NDArray[numpy.float32], dict(shape=(None, None), device='cpu', writable=False)], rows: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], columns: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], lower: bool = False) -> None:
    """
    Add from_ to to[rows, columns], both in Fortran order. lower: skip the entries above the diagonal.
    """

class ContactObject:
    """An object that a tip touches."""

def force_law(depth: Sequence[float], force: Sequence[float], point: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], normal: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> ContactObject:
    """Plane with a table from depth, m, to force, N."""

def force_law_values(depth: Sequence[float], force: Sequence[float], at: float) -> tuple:
    """Force, N, slope, N/m, and energy, J, of a table at a depth, m."""

def constant_field(force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> ContactObject:
    """The same force on the tip everywhere, N."""

def gravity_well(center: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], stiffness: float, radius: float, cap: float) -> ContactObject:
    """Capped spring to a center, without force beyond a radius."""

def vibration(force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], frequency: float, decay: float, at_contact: bool, point: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], normal: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> ContactObject:
    """Sinusoidal force on the tip, N, that may decay."""

def virtual_mass(mass: float, stiffness: float, damping: float, period: float) -> ContactObject:
    """Free mass on a spring and a damper."""

def textured_wall(point: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], normal: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], across: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], stiffness: float, damping: float, wavelength: float, height: float, lateral_force: float) -> ContactObject:
    """Plane wall with a sinusoidal texture."""

class QuasiStaticSolver:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fixed: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool, node_points: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], modulus: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], nodes_per_tip: int) -> None: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, update_interval: int) -> NDArray[numpy.float64]:
        """
        Step along a path; update the model every `update_interval` ticks and publish it after as many. Return rows: for each tip force (3), deflection (3), energy, nodes, touching, solved; then potential energy, tank level, blend, tank empty.
        """

    def settle(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, max_updates: int) -> NDArray[numpy.float64]:
        """
        Return the equilibrium at each position, after at most `max_updates` model updates: rows as of simulate_path, and whether it converged.
        """

    def simulate_realtime(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, period: float, thread: bool) -> tuple:
        """
        Step along a path, one tick each period of wall-clock time, with model updates in a thread, or with none but the first. Return rows as of simulate_path; lateness and duration of each tick, s; duration of each model update, s.
        """

    def last_report(self) -> NDArray[numpy.float64]:
        """
        Return the report of the last model update: residual before it, N; conjugate gradient steps of the equilibrium and of the compliance; error of the compliance.
        """

    def displacement(self) -> NDArray[numpy.float64]: ...

    def energy(self) -> float: ...

    def local_model(self) -> tuple:
        """
        Return the local model of the servo: surface nodes, their normals, compliance along the inward normals, m/N, and a mask of inner nodes.
        """

    def reset(self) -> None: ...

class DeformationFrames:
    """
    Displacements of all points of a hyperelastic body after its last model update.
    """

    def __init__(self, points: int) -> None: ...

    def latest(self) -> tuple:
        """
        Return the last frame: number of model updates, servo tick of their tip position, displacements of all points (p, 3), m.
        """

class HyperelasticBody(DeformableBody):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fixed: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool, node_points: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], modulus: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], nodes_per_tip: int, update_interval: int, static_friction: float, dynamic_friction: float, compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], poisson: float, density: float = 0.0, rayleigh_alpha: float = 0.0, rayleigh_beta: float = 0.0, instantaneous_ratio: float = 1.0, retardation_time: float = 1.0, period: float = 0.001) -> None: ...

    def simulate_path(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions, a sphere takes the mean normal of its contact nodes, as in a loop.
        """

    def settle(self, centers: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool, max_updates: int) -> NDArray[numpy.float64]:
        """
        Return the equilibrium at each position, after at most `max_updates` model updates: rows as of simulate_path, and whether it converged.
        """

    def contact_forces(self) -> tuple:
        """
        Return the contact nodes of the last step and the forces along their inward normals, N.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """
        Return the displacements of all points at the last model update (p, 3), m.
        """

    def energy(self) -> float:
        """
        Return the energy of the body and its layer at the last model update, kinetic energy included, J.
        """

    def reset(self) -> None: ...

class HyperelasticModel:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fixed: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool, instantaneous_ratio: float = 1.0, retardation_time: float = 1.0) -> None: ...

    def evaluate(self, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], duration: float = float('inf')) -> tuple:
        """
        Return the energy, J, and the internal forces on the free points (p, 3), N, at the end of a step of a duration, s.
        """

    def tangent(self, direction: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Return the derivative of the internal forces along `direction`, N, at the last evaluated displacement, in single precision.
        """

    def solve_equilibrium(self, load: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tolerance: float = 1e-08, max_steps: int = 60, duration: float = float('inf')) -> int:
        """
        Solve for the equilibrium under a load, N, at the end of a step of a duration, s. Return the number of Newton steps, or -1 if they do not converge.
        """

    def displacement(self) -> NDArray[numpy.float64]: ...

    def reset(self) -> None: ...

class FieldKind(enum.Enum):
    discrete = 0

    continuous = 1

class Surface:
    def __init__(self) -> None: ...

    @property
    def stiffness(self) -> list[float]: ...

    @stiffness.setter
    def stiffness(self, arg: Sequence[float], /) -> None: ...

    @property
    def damping(self) -> list[float]: ...

    @damping.setter
    def damping(self, arg: Sequence[float], /) -> None: ...

    @property
    def tangential(self) -> float: ...

    @tangential.setter
    def tangential(self, arg: float, /) -> None: ...

    @property
    def static_friction(self) -> float: ...

    @static_friction.setter
    def static_friction(self, arg: float, /) -> None: ...

    @property
    def dynamic_friction(self) -> float: ...

    @dynamic_friction.setter
    def dynamic_friction(self, arg: float, /) -> None: ...

    @property
    def viscous(self) -> float: ...

    @viscous.setter
    def viscous(self, arg: float, /) -> None: ...

    @property
    def field(self) -> FieldKind: ...

    @field.setter
    def field(self, arg: FieldKind, /) -> None: ...

    @property
    def shading(self) -> float: ...

    @shading.setter
    def shading(self, arg: float, /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

class TriangleMesh:
    def __init__(self, vertices: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], open: bool) -> None: ...

    @property
    def usable(self) -> bool: ...

    @property
    def fault(self) -> int: ...

    @property
    def extent(self) -> float: ...

    def diagnosis(self) -> dict: ...

    def pinched_vertices(self) -> tuple: ...

    def self_intersections(self) -> tuple: ...

    def move(self, vertices: Sequence[int], to: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> int:
        """
        Move vertices. Return -1, or the first triangle that would lose its area; then nothing moves.
        """

    def nearest(self, x: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple: ...

def repair_mesh(vertices: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple: ...

class MeshModel:
    def __init__(self, mesh: TriangleMesh, surface: Surface, radius: float) -> None: ...

class Proxy:
    def __init__(self, mesh: TriangleMesh, surface: Surface, radius: float) -> None: ...

    def simulate_path(self, path: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Step along a path (n, 3), m. Return rows of position (3), normal (3), force (3), depth, stiffness; and triangles, -1 without contact.
        """

    def step_durations(self, path: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """Return the duration of each step, s, including the clock's own."""

    def reset(self) -> None: ...

    @property
    def invalid_input_count(self) -> int: ...

    @property
    def iteration_limit_count(self) -> int: ...

    @property
    def sliding(self) -> bool: ...

class SpringWallParameters:
    def __init__(self) -> None: ...

    class Kind(enum.Enum):
        none = 0

        point = 1

        half_space = 2

    @property
    def kind(self) -> SpringWallParameters.Kind: ...

    @kind.setter
    def kind(self, arg: SpringWallParameters.Kind, /) -> None: ...

    @property
    def point(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @point.setter
    def point(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @normal.setter
    def normal(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class ObjectSetup:
    """One object of a scene."""

    def __init__(self) -> None: ...

    @property
    def wall(self) -> SpringWallParameters: ...

    @wall.setter
    def wall(self, arg: SpringWallParameters, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> CouplingDifference: ...

    @difference.setter
    def difference(self, arg: CouplingDifference, /) -> None: ...

    def set_mesh(self, surface: MeshModel) -> None:
        """Use a mesh as the object."""

    def set_object(self, object: ContactObject) -> None:
        """Use a force law, a field or a textured wall as the object."""

    def set_body(self, body: PlacedBody) -> None:
        """Use a deformable body as the object."""

    def set_motion(self, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order='C', writable=False)]) -> None:
        """
        Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, then y, then z of the device, rad.
        """

class CouplingDifference(enum.Enum):
    backward = 0

    bilinear = 1

class StateSpace:
    @overload
    def __init__(self) -> None: ...

    @overload
    def __init__(self, a: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], b: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], c: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], d: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], antiwindup: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]) -> None: ...

    def normalize(self, design_stiffness: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> None:
        """
        Scale reference and object force of each tick to an object of this stiffness per axis, N/m.
        """

    @property
    def order(self) -> int: ...

    def output(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    def advance(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class WorkspaceParameters:
    def __init__(self) -> None: ...

    @property
    def bandwidth(self) -> float: ...

    @bandwidth.setter
    def bandwidth(self, arg: float, /) -> None: ...

    @property
    def damping(self) -> float: ...

    @damping.setter
    def damping(self, arg: float, /) -> None: ...

    @property
    def observer(self) -> float: ...

    @observer.setter
    def observer(self, arg: float, /) -> None: ...

    @property
    def disturbance(self) -> float: ...

    @disturbance.setter
    def disturbance(self, arg: float, /) -> None: ...

    @property
    def reference(self) -> float: ...

    @reference.setter
    def reference(self, arg: float, /) -> None: ...

    @property
    def reference_damping(self) -> float: ...

    @reference_damping.setter
    def reference_damping(self, arg: float, /) -> None: ...

    @property
    def share(self) -> float: ...

    @share.setter
    def share(self, arg: float, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def normal_only(self) -> bool: ...

    @normal_only.setter
    def normal_only(self, arg: bool, /) -> None: ...

    @property
    def operator_mass(self) -> float: ...

    @operator_mass.setter
    def operator_mass(self, arg: float, /) -> None: ...

    def fault(self) -> str:
        """Return the first thing that is wrong; None if nothing is."""

class WorkspaceGains:
    """Gains of a workspace controller for one axis."""

    def __init__(self, parameters: WorkspaceParameters, period: float) -> None: ...

    @property
    def position(self) -> float: ...

    @property
    def velocity(self) -> float: ...

    @property
    def observer(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @property
    def reference_position(self) -> float: ...

    @property
    def reference_velocity(self) -> float: ...

class VelocityEstimate(enum.Enum):
    backward = 0

    adaptive_window = 1

    observer = 2

class TickSignals:
    """Signals of one servo tick: SI units, device frame."""

    @property
    def time(self) -> float:
        """Since the first tick, s."""

    @property
    def reference(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """Force that the object should feel (3,), N."""

    @property
    def object_force(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """Force of the tip on the object (3,), N."""

    @property
    def deflection(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """Displacement of the touched surface (3,), m."""

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """
        Outward normal of the touched surface (3,); zero: no contact, or no surface.
        """

    @property
    def depth(self) -> float:
        """Penetration along the normal, m; negative: outside."""

    @property
    def stiffness(self) -> float:
        """Of the object along the normal, N/m; zero: not known."""

    @property
    def tip(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """Measured tip position (3,), m."""

    @property
    def velocity(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """Tip velocity by backward difference (3,), m/s."""

class TipSignals:
    """The tip at one sample: SI units, device frame."""

    @property
    def time(self) -> float:
        """Since the first sample, s."""

    @property
    def position(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """(3,), m."""

    @property
    def velocity(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]:
        """By backward difference (3,), m/s."""

class ContactResult:
    """Contact of the tip with an object at one sample."""

    def __init__(self, force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], deflection: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')] = ..., normal: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')] = ..., depth: float = 0.0, stiffness: float = 0.0, touching: bool | None = None) -> None:
        """
        force: of the tip on the object, N. Without `touching` the tip touches if the force is not zero.
        """

    @property
    def force(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @force.setter
    def force(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def deflection(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @deflection.setter
    def deflection(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @normal.setter
    def normal(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def depth(self) -> float: ...

    @depth.setter
    def depth(self, arg: float, /) -> None: ...

    @property
    def stiffness(self) -> float: ...

    @stiffness.setter
    def stiffness(self, arg: float, /) -> None: ...

    @property
    def touching(self) -> bool: ...

    @touching.setter
    def touching(self, arg: bool, /) -> None: ...

class HumanArm:
    def __init__(self) -> None: ...

    @property
    def mass(self) -> float: ...

    @mass.setter
    def mass(self, arg: float, /) -> None: ...

    @property
    def damping(self) -> float: ...

    @damping.setter
    def damping(self, arg: float, /) -> None: ...

    @property
    def stiffness(self) -> float: ...

    @stiffness.setter
    def stiffness(self, arg: float, /) -> None: ...

    @property
    def tissue(self) -> bool: ...

    @tissue.setter
    def tissue(self, arg: bool, /) -> None: ...

    @property
    def tissue_stiffness(self) -> float: ...

    @tissue_stiffness.setter
    def tissue_stiffness(self, arg: float, /) -> None: ...

    @property
    def tissue_damping(self) -> float: ...

    @tissue_damping.setter
    def tissue_damping(self, arg: float, /) -> None: ...

    @property
    def rest(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @rest.setter
    def rest(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class FlexibleMode:
    """Lowest mode between motors and tip."""

    def __init__(self, frequency: float, tip_share: float, damping_ratio: float) -> None:
        """frequency: with motors and tip free, Hz."""

    @property
    def frequency(self) -> float: ...

    @property
    def tip_share(self) -> float: ...

    @property
    def damping_ratio(self) -> float: ...

    def fault(self, period: float) -> str:
        """
        Return the first thing that is wrong with a servo period, s; None if nothing is.
        """

class PremiumFriction:
    def __init__(self) -> None: ...

    @property
    def viscous(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @viscous.setter
    def viscous(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def coulomb(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @coulomb.setter
    def coulomb(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def breakaway(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @breakaway.setter
    def breakaway(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def stribeck_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stribeck_speed.setter
    def stribeck_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class PremiumLimits:
    def __init__(self) -> None: ...

    @property
    def peak_force(self) -> float: ...

    @peak_force.setter
    def peak_force(self, arg: float, /) -> None: ...

    @property
    def continuous_force(self) -> float: ...

    @continuous_force.setter
    def continuous_force(self, arg: float, /) -> None: ...

    @property
    def thermal_time(self) -> float: ...

    @thermal_time.setter
    def thermal_time(self, arg: float, /) -> None: ...

    @property
    def peak_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @peak_torque.setter
    def peak_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class PremiumSetup:
    def __init__(self) -> None: ...

    @property
    def wall(self) -> SpringWallParameters: ...

    @wall.setter
    def wall(self, arg: SpringWallParameters, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> CouplingDifference: ...

    @difference.setter
    def difference(self, arg: CouplingDifference, /) -> None: ...

    def set_mesh(self, surface: MeshModel) -> None:
        """Use a mesh as the object."""

    def set_object(self, object: ContactObject) -> None:
        """Use a force law, a field or a textured wall as the object."""

    def set_body(self, body: PlacedBody) -> None:
        """Use a deformable body as the object."""

    def set_motion(self, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order='C', writable=False)]) -> None:
        """
        Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, then y, then z of the device, rad.
        """

    def set_energy_bound(self, damping: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], coulomb: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], lateness: float) -> None:
        """
        Guard the loop by an energy bound that relies on this friction of the joints.
        """

    def set_passivity_controller(self, cap: float) -> None:
        """
        Guard the loop by a passivity controller with at most this damping, times tip inertia over period.
        """

    def set_half_sample(self, velocity: VelocityEstimate, horizon: float, observer: float, deadbeat: bool = False) -> None:
        """
        Hand the object the tip position after `horizon` servo periods; rate of the observer in rad/s; deadbeat exit of a wall.
        """

    def set_sample_estimate_hold(self, correction: float) -> None:
        """Hold the estimated mean of the force over the next period."""

    def set_workspace_controller(self, mechanism: Premium, friction: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], parameters: WorkspaceParameters) -> None:
        """
        Use a workspace controller that knows this mechanism and viscous friction; set the period before.
        """

    def set_admittance_controller(self, mechanism: Premium, friction: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], parameters: WorkspaceParameters, mass: float, damping: float) -> None:
        """
        Use an admittance display with a tool of this mass, kg, and damping, N s/m; set the period before.
        """

    @property
    def mechanism(self) -> Premium: ...

    @mechanism.setter
    def mechanism(self, arg: Premium, /) -> None: ...

    @property
    def friction(self) -> PremiumFriction: ...

    @friction.setter
    def friction(self, arg: PremiumFriction, /) -> None: ...

    @property
    def human_arm(self) -> HumanArm: ...

    @human_arm.setter
    def human_arm(self, arg: HumanArm, /) -> None: ...

    @property
    def flexible(self) -> FlexibleMode | None: ...

    @flexible.setter
    def flexible(self, arg: FlexibleMode | None, /) -> None: ...

    @property
    def encoder_step(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @encoder_step.setter
    def encoder_step(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def limits(self) -> PremiumLimits: ...

    @limits.setter
    def limits(self, arg: PremiumLimits, /) -> None: ...

    @property
    def delay(self) -> int: ...

    @delay.setter
    def delay(self, arg: int, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def gravity_compensation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @gravity_compensation.setter
    def gravity_compensation(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def fixed(self) -> bool: ...

    @fixed.setter
    def fixed(self, arg: bool, /) -> None: ...

    @property
    def linear(self) -> bool: ...

    @linear.setter
    def linear(self, arg: bool, /) -> None: ...

    @property
    def plant_a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_a.setter
    def plant_a(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_b(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_b.setter
    def plant_b(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_c(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_c.setter
    def plant_c(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def working_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @working_torque.setter
    def working_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def start(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @start.setter
    def start(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def start_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @start_speed.setter
    def start_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

    @property
    def substeps(self) -> int: ...

    @substeps.setter
    def substeps(self, arg: int, /) -> None: ...

    @property
    def record_every(self) -> int: ...

    @record_every.setter
    def record_every(self, arg: int, /) -> None: ...

    @property
    def speed_limit(self) -> float: ...

    @speed_limit.setter
    def speed_limit(self, arg: float, /) -> None: ...

    @property
    def window_start(self) -> int: ...

    @window_start.setter
    def window_start(self, arg: int, /) -> None: ...

    @property
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """Return the lateness of ticks 0 to `ticks`, s."""

    def add_object(self, object: ObjectSetup) -> None:
        """
        Add an object to the scene, which then replaces the single object of the setup.
        """

    def set_python_object(self, object: object) -> None:
        """
        Use an object written in Python: a callable from TipSignals to a force, N, or an object with `step`.
        """

    def set_python_controller(self, controller: object) -> None:
        """
        Use a controller written in Python: a callable from TickSignals to a force, N, or an object with `command`.
        """

    @overload
    def set_observer(self, frames: SurfaceFrames) -> None:
        """Compute the displacement of the body's surface in a thread."""

    @overload
    def set_observer(self, frames: DeformationFrames) -> None:
        """Publish each model update of the body."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        Return the duration of each servo tick, s, including the clock's own. paced: one tick each period, as on a device.
        """

    def outcome(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Run the loop with any object and controller; return its outcome as a batch does.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Run the loop. Return (rows, number of rows written, tick of divergence or -1).
        """

class PremiumLoop:
    def __init__(self, setup: PremiumSetup) -> None: ...

    def reset(self) -> None:
        """Return to the first sample."""

    def tick(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> NDArray[numpy.float64]:
        """
        Run the servo's tick at this sample; return its row, as `run` records it.
        """

    def advance(self, begin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], end: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> bool:
        """
        Move the plant by one period under the operator's force, N, linear from `begin` to `end`; false once the loop has diverged.
        """

    def change_supports(self, roles: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Change the supports of the body at the next tick; roles of its nodes as in SupportedBody.
        """

    def move_tool(self, angles: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], opening: float) -> None:
        """
        Turn, open or close the tool from the next tick on, in place of its motion; see ToolMotion.
        """

    @property
    def angles(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @property
    def speeds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @property
    def time(self) -> float: ...

    @property
    def count(self) -> int: ...

    @property
    def diverged(self) -> bool: ...

class SliderFriction:
    def __init__(self) -> None: ...

    @property
    def viscous(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @viscous.setter
    def viscous(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def coulomb(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @coulomb.setter
    def coulomb(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def breakaway(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @breakaway.setter
    def breakaway(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def stribeck_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @stribeck_speed.setter
    def stribeck_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

class SliderLimits:
    def __init__(self) -> None: ...

    @property
    def peak_force(self) -> float: ...

    @peak_force.setter
    def peak_force(self, arg: float, /) -> None: ...

    @property
    def continuous_force(self) -> float: ...

    @continuous_force.setter
    def continuous_force(self, arg: float, /) -> None: ...

    @property
    def thermal_time(self) -> float: ...

    @thermal_time.setter
    def thermal_time(self, arg: float, /) -> None: ...

    @property
    def peak_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @peak_torque.setter
    def peak_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

class SliderSetup:
    def __init__(self) -> None: ...

    @property
    def wall(self) -> SpringWallParameters: ...

    @wall.setter
    def wall(self, arg: SpringWallParameters, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> CouplingDifference: ...

    @difference.setter
    def difference(self, arg: CouplingDifference, /) -> None: ...

    def set_mesh(self, surface: MeshModel) -> None:
        """Use a mesh as the object."""

    def set_object(self, object: ContactObject) -> None:
        """Use a force law, a field or a textured wall as the object."""

    def set_body(self, body: PlacedBody) -> None:
        """Use a deformable body as the object."""

    def set_motion(self, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order='C', writable=False)]) -> None:
        """
        Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, then y, then z of the device, rad.
        """

    def set_energy_bound(self, damping: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], coulomb: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], lateness: float) -> None:
        """
        Guard the loop by an energy bound that relies on this friction of the joints.
        """

    def set_passivity_controller(self, cap: float) -> None:
        """
        Guard the loop by a passivity controller with at most this damping, times tip inertia over period.
        """

    def set_half_sample(self, velocity: VelocityEstimate, horizon: float, observer: float, deadbeat: bool = False) -> None:
        """
        Hand the object the tip position after `horizon` servo periods; rate of the observer in rad/s; deadbeat exit of a wall.
        """

    def set_sample_estimate_hold(self, correction: float) -> None:
        """Hold the estimated mean of the force over the next period."""

    def set_workspace_controller(self, mechanism: Slider, friction: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], parameters: WorkspaceParameters) -> None:
        """
        Use a workspace controller that knows this mechanism and viscous friction; set the period before.
        """

    def set_admittance_controller(self, mechanism: Slider, friction: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], parameters: WorkspaceParameters, mass: float, damping: float) -> None:
        """
        Use an admittance display with a tool of this mass, kg, and damping, N s/m; set the period before.
        """

    @property
    def mechanism(self) -> Slider: ...

    @mechanism.setter
    def mechanism(self, arg: Slider, /) -> None: ...

    @property
    def friction(self) -> SliderFriction: ...

    @friction.setter
    def friction(self, arg: SliderFriction, /) -> None: ...

    @property
    def human_arm(self) -> HumanArm: ...

    @human_arm.setter
    def human_arm(self, arg: HumanArm, /) -> None: ...

    @property
    def flexible(self) -> FlexibleMode | None: ...

    @flexible.setter
    def flexible(self, arg: FlexibleMode | None, /) -> None: ...

    @property
    def encoder_step(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @encoder_step.setter
    def encoder_step(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def limits(self) -> SliderLimits: ...

    @limits.setter
    def limits(self, arg: SliderLimits, /) -> None: ...

    @property
    def delay(self) -> int: ...

    @delay.setter
    def delay(self, arg: int, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def gravity_compensation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @gravity_compensation.setter
    def gravity_compensation(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def fixed(self) -> bool: ...

    @fixed.setter
    def fixed(self, arg: bool, /) -> None: ...

    @property
    def linear(self) -> bool: ...

    @linear.setter
    def linear(self, arg: bool, /) -> None: ...

    @property
    def plant_a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_a.setter
    def plant_a(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_b(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_b.setter
    def plant_b(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_c(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_c.setter
    def plant_c(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def working_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @working_torque.setter
    def working_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def start(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @start.setter
    def start(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def start_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @start_speed.setter
    def start_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

    @property
    def substeps(self) -> int: ...

    @substeps.setter
    def substeps(self, arg: int, /) -> None: ...

    @property
    def record_every(self) -> int: ...

    @record_every.setter
    def record_every(self, arg: int, /) -> None: ...

    @property
    def speed_limit(self) -> float: ...

    @speed_limit.setter
    def speed_limit(self, arg: float, /) -> None: ...

    @property
    def window_start(self) -> int: ...

    @window_start.setter
    def window_start(self, arg: int, /) -> None: ...

    @property
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """Return the lateness of ticks 0 to `ticks`, s."""

    def add_object(self, object: ObjectSetup) -> None:
        """
        Add an object to the scene, which then replaces the single object of the setup.
        """

    def set_python_object(self, object: object) -> None:
        """
        Use an object written in Python: a callable from TipSignals to a force, N, or an object with `step`.
        """

    def set_python_controller(self, controller: object) -> None:
        """
        Use a controller written in Python: a callable from TickSignals to a force, N, or an object with `command`.
        """

    @overload
    def set_observer(self, frames: SurfaceFrames) -> None:
        """Compute the displacement of the body's surface in a thread."""

    @overload
    def set_observer(self, frames: DeformationFrames) -> None:
        """Publish each model update of the body."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        Return the duration of each servo tick, s, including the clock's own. paced: one tick each period, as on a device.
        """

    def outcome(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Run the loop with any object and controller; return its outcome as a batch does.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Run the loop. Return (rows, number of rows written, tick of divergence or -1).
        """

class SliderLoop:
    def __init__(self, setup: SliderSetup) -> None: ...

    def reset(self) -> None:
        """Return to the first sample."""

    def tick(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> NDArray[numpy.float64]:
        """
        Run the servo's tick at this sample; return its row, as `run` records it.
        """

    def advance(self, begin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], end: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> bool:
        """
        Move the plant by one period under the operator's force, N, linear from `begin` to `end`; false once the loop has diverged.
        """

    def change_supports(self, roles: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Change the supports of the body at the next tick; roles of its nodes as in SupportedBody.
        """

    def move_tool(self, angles: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], opening: float) -> None:
        """
        Turn, open or close the tool from the next tick on, in place of its motion; see ToolMotion.
        """

    @property
    def angles(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @property
    def speeds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]: ...

    @property
    def time(self) -> float: ...

    @property
    def count(self) -> int: ...

    @property
    def diverged(self) -> bool: ...

class FiveBarFriction:
    def __init__(self) -> None: ...

    @property
    def viscous(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @viscous.setter
    def viscous(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def coulomb(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @coulomb.setter
    def coulomb(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def breakaway(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @breakaway.setter
    def breakaway(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def stribeck_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @stribeck_speed.setter
    def stribeck_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

class FiveBarLimits:
    def __init__(self) -> None: ...

    @property
    def peak_force(self) -> float: ...

    @peak_force.setter
    def peak_force(self, arg: float, /) -> None: ...

    @property
    def continuous_force(self) -> float: ...

    @continuous_force.setter
    def continuous_force(self, arg: float, /) -> None: ...

    @property
    def thermal_time(self) -> float: ...

    @thermal_time.setter
    def thermal_time(self, arg: float, /) -> None: ...

    @property
    def peak_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @peak_torque.setter
    def peak_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

class FiveBarSetup:
    def __init__(self) -> None: ...

    @property
    def wall(self) -> SpringWallParameters: ...

    @wall.setter
    def wall(self, arg: SpringWallParameters, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> CouplingDifference: ...

    @difference.setter
    def difference(self, arg: CouplingDifference, /) -> None: ...

    def set_mesh(self, surface: MeshModel) -> None:
        """Use a mesh as the object."""

    def set_object(self, object: ContactObject) -> None:
        """Use a force law, a field or a textured wall as the object."""

    def set_body(self, body: PlacedBody) -> None:
        """Use a deformable body as the object."""

    def set_motion(self, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order='C', writable=False)]) -> None:
        """
        Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, then y, then z of the device, rad.
        """

    def set_energy_bound(self, damping: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], coulomb: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], lateness: float) -> None:
        """
        Guard the loop by an energy bound that relies on this friction of the joints.
        """

    def set_passivity_controller(self, cap: float) -> None:
        """
        Guard the loop by a passivity controller with at most this damping, times tip inertia over period.
        """

    def set_half_sample(self, velocity: VelocityEstimate, horizon: float, observer: float, deadbeat: bool = False) -> None:
        """
        Hand the object the tip position after `horizon` servo periods; rate of the observer in rad/s; deadbeat exit of a wall.
        """

    def set_sample_estimate_hold(self, correction: float) -> None:
        """Hold the estimated mean of the force over the next period."""

    def set_workspace_controller(self, mechanism: FiveBar, friction: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], parameters: WorkspaceParameters) -> None:
        """
        Use a workspace controller that knows this mechanism and viscous friction; set the period before.
        """

    def set_admittance_controller(self, mechanism: FiveBar, friction: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], parameters: WorkspaceParameters, mass: float, damping: float) -> None:
        """
        Use an admittance display with a tool of this mass, kg, and damping, N s/m; set the period before.
        """

    @property
    def mechanism(self) -> FiveBar: ...

    @mechanism.setter
    def mechanism(self, arg: FiveBar, /) -> None: ...

    @property
    def friction(self) -> FiveBarFriction: ...

    @friction.setter
    def friction(self, arg: FiveBarFriction, /) -> None: ...

    @property
    def human_arm(self) -> HumanArm: ...

    @human_arm.setter
    def human_arm(self, arg: HumanArm, /) -> None: ...

    @property
    def flexible(self) -> FlexibleMode | None: ...

    @flexible.setter
    def flexible(self, arg: FlexibleMode | None, /) -> None: ...

    @property
    def encoder_step(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @encoder_step.setter
    def encoder_step(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def limits(self) -> FiveBarLimits: ...

    @limits.setter
    def limits(self, arg: FiveBarLimits, /) -> None: ...

    @property
    def delay(self) -> int: ...

    @delay.setter
    def delay(self, arg: int, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def gravity_compensation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @gravity_compensation.setter
    def gravity_compensation(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def fixed(self) -> bool: ...

    @fixed.setter
    def fixed(self, arg: bool, /) -> None: ...

    @property
    def linear(self) -> bool: ...

    @linear.setter
    def linear(self, arg: bool, /) -> None: ...

    @property
    def plant_a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_a.setter
    def plant_a(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_b(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_b.setter
    def plant_b(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_c(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_c.setter
    def plant_c(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def working_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @working_torque.setter
    def working_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def start(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @start.setter
    def start(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def start_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @start_speed.setter
    def start_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

    @property
    def substeps(self) -> int: ...

    @substeps.setter
    def substeps(self, arg: int, /) -> None: ...

    @property
    def record_every(self) -> int: ...

    @record_every.setter
    def record_every(self, arg: int, /) -> None: ...

    @property
    def speed_limit(self) -> float: ...

    @speed_limit.setter
    def speed_limit(self, arg: float, /) -> None: ...

    @property
    def window_start(self) -> int: ...

    @window_start.setter
    def window_start(self, arg: int, /) -> None: ...

    @property
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """Return the lateness of ticks 0 to `ticks`, s."""

    def add_object(self, object: ObjectSetup) -> None:
        """
        Add an object to the scene, which then replaces the single object of the setup.
        """

    def set_python_object(self, object: object) -> None:
        """
        Use an object written in Python: a callable from TipSignals to a force, N, or an object with `step`.
        """

    def set_python_controller(self, controller: object) -> None:
        """
        Use a controller written in Python: a callable from TickSignals to a force, N, or an object with `command`.
        """

    @overload
    def set_observer(self, frames: SurfaceFrames) -> None:
        """Compute the displacement of the body's surface in a thread."""

    @overload
    def set_observer(self, frames: DeformationFrames) -> None:
        """Publish each model update of the body."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        Return the duration of each servo tick, s, including the clock's own. paced: one tick each period, as on a device.
        """

    def outcome(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Run the loop with any object and controller; return its outcome as a batch does.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Run the loop. Return (rows, number of rows written, tick of divergence or -1).
        """

class FiveBarLoop:
    def __init__(self, setup: FiveBarSetup) -> None: ...

    def reset(self) -> None:
        """Return to the first sample."""

    def tick(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> NDArray[numpy.float64]:
        """
        Run the servo's tick at this sample; return its row, as `run` records it.
        """

    def advance(self, begin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], end: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> bool:
        """
        Move the plant by one period under the operator's force, N, linear from `begin` to `end`; false once the loop has diverged.
        """

    def change_supports(self, roles: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Change the supports of the body at the next tick; roles of its nodes as in SupportedBody.
        """

    def move_tool(self, angles: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], opening: float) -> None:
        """
        Turn, open or close the tool from the next tick on, in place of its motion; see ToolMotion.
        """

    @property
    def angles(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @property
    def speeds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]: ...

    @property
    def time(self) -> float: ...

    @property
    def count(self) -> int: ...

    @property
    def diverged(self) -> bool: ...

TipDeviceFriction: TypeAlias = PremiumFriction

TipDeviceLimits: TypeAlias = PremiumLimits

class TipDeviceSetup:
    def __init__(self) -> None: ...

    @property
    def wall(self) -> SpringWallParameters: ...

    @wall.setter
    def wall(self, arg: SpringWallParameters, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> CouplingDifference: ...

    @difference.setter
    def difference(self, arg: CouplingDifference, /) -> None: ...

    def set_mesh(self, surface: MeshModel) -> None:
        """Use a mesh as the object."""

    def set_object(self, object: ContactObject) -> None:
        """Use a force law, a field or a textured wall as the object."""

    def set_body(self, body: PlacedBody) -> None:
        """Use a deformable body as the object."""

    def set_motion(self, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order='C', writable=False)]) -> None:
        """
        Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, then y, then z of the device, rad.
        """

    def set_energy_bound(self, damping: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], coulomb: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], lateness: float) -> None:
        """
        Guard the loop by an energy bound that relies on this friction of the joints.
        """

    def set_passivity_controller(self, cap: float) -> None:
        """
        Guard the loop by a passivity controller with at most this damping, times tip inertia over period.
        """

    def set_half_sample(self, velocity: VelocityEstimate, horizon: float, observer: float, deadbeat: bool = False) -> None:
        """
        Hand the object the tip position after `horizon` servo periods; rate of the observer in rad/s; deadbeat exit of a wall.
        """

    def set_sample_estimate_hold(self, correction: float) -> None:
        """Hold the estimated mean of the force over the next period."""

    def set_workspace_controller(self, mechanism: TipDevice, friction: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], parameters: WorkspaceParameters) -> None:
        """
        Use a workspace controller that knows this mechanism and viscous friction; set the period before.
        """

    def set_admittance_controller(self, mechanism: TipDevice, friction: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], parameters: WorkspaceParameters, mass: float, damping: float) -> None:
        """
        Use an admittance display with a tool of this mass, kg, and damping, N s/m; set the period before.
        """

    @property
    def mechanism(self) -> TipDevice: ...

    @mechanism.setter
    def mechanism(self, arg: TipDevice, /) -> None: ...

    @property
    def friction(self) -> PremiumFriction: ...

    @friction.setter
    def friction(self, arg: PremiumFriction, /) -> None: ...

    @property
    def human_arm(self) -> HumanArm: ...

    @human_arm.setter
    def human_arm(self, arg: HumanArm, /) -> None: ...

    @property
    def flexible(self) -> FlexibleMode | None: ...

    @flexible.setter
    def flexible(self, arg: FlexibleMode | None, /) -> None: ...

    @property
    def encoder_step(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @encoder_step.setter
    def encoder_step(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def limits(self) -> PremiumLimits: ...

    @limits.setter
    def limits(self, arg: PremiumLimits, /) -> None: ...

    @property
    def delay(self) -> int: ...

    @delay.setter
    def delay(self, arg: int, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def gravity_compensation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @gravity_compensation.setter
    def gravity_compensation(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def fixed(self) -> bool: ...

    @fixed.setter
    def fixed(self, arg: bool, /) -> None: ...

    @property
    def linear(self) -> bool: ...

    @linear.setter
    def linear(self, arg: bool, /) -> None: ...

    @property
    def plant_a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_a.setter
    def plant_a(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_b(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_b.setter
    def plant_b(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def plant_c(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    @plant_c.setter
    def plant_c(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], /) -> None: ...

    @property
    def working_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @working_torque.setter
    def working_torque(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def start(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @start.setter
    def start(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def start_speed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @start_speed.setter
    def start_speed(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

    @property
    def substeps(self) -> int: ...

    @substeps.setter
    def substeps(self, arg: int, /) -> None: ...

    @property
    def record_every(self) -> int: ...

    @record_every.setter
    def record_every(self, arg: int, /) -> None: ...

    @property
    def speed_limit(self) -> float: ...

    @speed_limit.setter
    def speed_limit(self, arg: float, /) -> None: ...

    @property
    def window_start(self) -> int: ...

    @window_start.setter
    def window_start(self, arg: int, /) -> None: ...

    @property
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """Return the lateness of ticks 0 to `ticks`, s."""

    def add_object(self, object: ObjectSetup) -> None:
        """
        Add an object to the scene, which then replaces the single object of the setup.
        """

    def set_python_object(self, object: object) -> None:
        """
        Use an object written in Python: a callable from TipSignals to a force, N, or an object with `step`.
        """

    def set_python_controller(self, controller: object) -> None:
        """
        Use a controller written in Python: a callable from TickSignals to a force, N, or an object with `command`.
        """

    @overload
    def set_observer(self, frames: SurfaceFrames) -> None:
        """Compute the displacement of the body's surface in a thread."""

    @overload
    def set_observer(self, frames: DeformationFrames) -> None:
        """Publish each model update of the body."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        Return the duration of each servo tick, s, including the clock's own. paced: one tick each period, as on a device.
        """

    def outcome(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Run the loop with any object and controller; return its outcome as a batch does.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Run the loop. Return (rows, number of rows written, tick of divergence or -1).
        """

class TipDeviceLoop:
    def __init__(self, setup: TipDeviceSetup) -> None: ...

    def reset(self) -> None:
        """Return to the first sample."""

    def tick(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> NDArray[numpy.float64]:
        """
        Run the servo's tick at this sample; return its row, as `run` records it.
        """

    def advance(self, begin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], end: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> bool:
        """
        Move the plant by one period under the operator's force, N, linear from `begin` to `end`; false once the loop has diverged.
        """

    def change_supports(self, roles: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """
        Change the supports of the body at the next tick; roles of its nodes as in SupportedBody.
        """

    def move_tool(self, angles: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], opening: float) -> None:
        """
        Turn, open or close the tool from the next tick on, in place of its motion; see ToolMotion.
        """

    @property
    def angles(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @property
    def speeds(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @property
    def time(self) -> float: ...

    @property
    def count(self) -> int: ...

    @property
    def diverged(self) -> bool: ...

class ParameterInfo:
    @property
    def key(self) -> str: ...

    @property
    def unit(self) -> str: ...

    @property
    def range(self) -> str: ...

    @property
    def description(self) -> str: ...

    @property
    def size(self) -> int: ...

    @property
    def required(self) -> bool: ...

    @property
    def default_value(self) -> list[float]: ...

class MechanismInfo:
    @property
    def name(self) -> str: ...

    @property
    def class_name(self) -> str: ...

    @property
    def dof(self) -> int: ...

    @property
    def joints(self) -> list[str]: ...

    @property
    def working_pose(self) -> list[float]: ...

    @property
    def parameters(self) -> list[ParameterInfo]: ...

def mechanisms() -> list[MechanismInfo]:
    """
    Return the mechanisms of the registry with their joints and parameters.
    """

def phantom_premium_1_5a() -> dict[str, list[float]]:
    """Return the parameters of the C++ catalog entry by key."""

class Premium:
    def __init__(self, values: Mapping[str, Sequence[float]]) -> None:
        """
        Create the mechanism from its parameters in SI units; see mechanisms().
        """

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: PremiumFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    def inverse(self, p: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], nearest_to: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> tuple:
        """Return (poses with the tip at p, reason why there are none)."""

class FlexiblePremium:
    def __init__(self, rigid: Premium, mode: FlexibleMode) -> None: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

class Slider:
    def __init__(self, values: Mapping[str, Sequence[float]]) -> None:
        """
        Create the mechanism from its parameters in SI units; see mechanisms().
        """

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: SliderFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    def inverse(self, p: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], nearest_to: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')]) -> tuple:
        """Return (poses with the tip at p, reason why there are none)."""

class FlexibleSlider:
    def __init__(self, rigid: Slider, mode: FlexibleMode) -> None: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

class FiveBar:
    def __init__(self, values: Mapping[str, Sequence[float]]) -> None:
        """
        Create the mechanism from its parameters in SI units; see mechanisms().
        """

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: FiveBarFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    def inverse(self, p: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], nearest_to: Annotated[NDArray[numpy.float64], dict(shape=(2), order='C')]) -> tuple:
        """Return (poses with the tip at p, reason why there are none)."""

class FlexibleFiveBar:
    def __init__(self, rigid: FiveBar, mode: FlexibleMode) -> None: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

class TipDevice:
    def __init__(self, values: Mapping[str, Sequence[float]]) -> None:
        """
        Create the mechanism from its parameters in SI units; see mechanisms().
        """

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: PremiumFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    def inverse(self, p: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], nearest_to: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]) -> tuple:
        """Return (poses with the tip at p, reason why there are none)."""

class FlexibleTipDevice:
    def __init__(self, rigid: TipDevice, mode: FlexibleMode) -> None: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(6), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

def max_lanes() -> int:
    """Loops that run side by side in one thread on this machine."""

@overload
def run_cells(base: PremiumSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object: ...

@overload
def run_cells(base: SliderSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object: ...

@overload
def run_cells(base: FiveBarSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object: ...

@overload
def run_cells(base: TipDeviceSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object:
    """Runs cells of one base setup; returns a row of outcomes for each."""
