"""palpate's core: device dynamics and the servo loop."""

from collections.abc import Mapping, Sequence
import enum
from typing import Annotated, overload

import numpy
from numpy.typing import NDArray


class BodyInLoop:
    """A body of any kind, as a servo loop takes it."""

class SurfaceFrames:
    """A thread that draws what a servo loop presses."""

    def __init__(self, compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], rate: float) -> None:
        """The compliance is not copied."""

    def latest(self) -> tuple:
        """
        The last frame: its number, the tick that it shows (-1: none yet), displacements of the nodes (n, 3), m.
        """

class TouchedBody:
    """
    A body, where it lies in the device's frame, and the tip that meets it.
    """

    def __init__(self, body: BodyInLoop, origin: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], turn: Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order='F')], radius: float, flat: bool) -> None: ...

class ElasticBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions a sphere faces as the nodes that it presses, or as the nearest one.
        """

    def time(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def dragged(self) -> NDArray[numpy.float64]:
        """The forces of friction on the nodes of pressed(), N."""

    def reset(self) -> None: ...

    def respond(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Where a node is along its inward normal after each period, m, under forces held over them, N.
        """

class ModalBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], shapes: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], frequencies: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], period: float, alpha: float, beta: float, instant: float = 1.0, creep: float = 1.0, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions a sphere faces as the nodes that it presses, or as the nearest one.
        """

    def time(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def dragged(self) -> NDArray[numpy.float64]:
        """The forces of friction on the nodes of pressed(), N."""

    def reset(self) -> None: ...

    def respond(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Where a node is along its inward normal after each period, m, under forces held over them, N.
        """

class RelaxingBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], compliance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], instant: float, creep: float, period: float, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions a sphere faces as the nodes that it presses, or as the nearest one.
        """

    def time(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def dragged(self) -> NDArray[numpy.float64]:
        """The forces of friction on the nodes of pressed(), N."""

    def reset(self) -> None: ...

    def respond(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Where a node is along its inward normal after each period, m, under forces held over them, N.
        """

class LatticeBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], places: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], masses: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], held: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], springs: Annotated[NDArray[numpy.int32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], stiffness: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int32], dict(shape=(None, 4), order='C', device='cpu', writable=False)], pressure: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], begin: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], vertices: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], shares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], period: float, alpha: float, beta: float, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions a sphere faces as the nodes that it presses, or as the nearest one.
        """

    def time(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def dragged(self) -> NDArray[numpy.float64]:
        """The forces of friction on the nodes of pressed(), N."""

    def reset(self) -> None: ...

    def respond(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Where a node is along its inward normal after each period, m, under forces held over them, N.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """Of the nodes' patches (n, 3), m."""

    def places(self) -> NDArray[numpy.float64]:
        """Of the vertices (N, 3), m."""

    def set(self, places: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], speeds: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> None:
        """Go on from here."""

    @property
    def energy(self) -> float:
        """Kinetic and stored, J."""

    @property
    def held_back(self) -> int:
        """Periods that lost speed because they would have made energy."""

class SplineBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], spacing: float, give: float, layer: float, give_across: float, layer_across: float, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without directions a sphere faces as the nodes that it presses, or as the nearest one.
        """

    def time(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def dragged(self) -> NDArray[numpy.float64]:
        """The forces of friction on the nodes of pressed(), N."""

    def reset(self) -> None: ...

    def respond(self, node: int, forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Where a node is along its inward normal after each period, m, under forces held over them, N.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """Of the nodes (n, 3), m."""

@overload
def add_at(to: Annotated[NDArray[numpy.float64], dict(shape=(None, None), device='cpu')], from_: Annotated[NDArray[numpy.float64], dict(shape=(None, None), device='cpu', writable=False)], rows: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], columns: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], lower: bool = False) -> None: ...

@overload
def add_at(to: Annotated[NDArray[numpy.float32], dict(shape=(None, None), device='cpu')], from_: Annotated[NDArray[numpy.float32], dict(shape=(None, None), device='cpu', writable=False)], rows: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], columns: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], lower: bool = False) -> None:
    """
    to[rows, columns] += from, columns in one piece (Fortran's order); lower: without what lies above the diagonal.
    """

class PressedSolid:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], held: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool, point: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], begin: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], shared: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], near: int) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, every: int) -> NDArray[numpy.float64]:
        """
        A slow step in turn with `every` ticks, handed over after them. Rows: for each tip force (3), deflection (3), energy, nodes, touching, solved; then potential, saved, share, waits.
        """

    def settle(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, steps: int) -> NDArray[numpy.float64]:
        """
        The body at rest at each place, after at most so many slow steps: rows as of follow, and whether it came to rest.
        """

    def live(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], radii: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], flat: bool, period: float, thread: bool) -> tuple:
        """
        One tick each period of wall-clock time, with slow steps in a thread of their own or none. Rows as of follow; lateness and length of each tick, s; length of each slow step, s.
        """

    def step(self) -> NDArray[numpy.float64]:
        """
        Of the last slow step: residual before it, N; steps of conjugate gradients for it and for the compliance; what that leaves.
        """

    def displacement(self) -> NDArray[numpy.float64]: ...

    def energy(self) -> float: ...

    def snapshot(self) -> tuple:
        """
        What the servo has: nodes (numbers on the surface), their normals, compliance along the inward ones, m/N, and which are solved for.
        """

    def reset(self) -> None: ...

class SolidFrames:
    """Where the last slow step of a loop's body left its points."""

    def __init__(self, points: int) -> None: ...

    def latest(self) -> tuple:
        """
        The last frame: slow steps so far, the servo's tick whose tip that one saw, displacements of all points (p, 3), m.
        """

class NonlinearBody(BodyInLoop):
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], held: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool, point: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], areas: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], begin: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], shared: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], near: int, every: int, ratio: float = 1.0, sway: float = 0.0, static_friction: float = 0.0, dynamic_friction: float = 0.0) -> None: ...

    def follow(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool) -> NDArray[numpy.float64]:
        """
        Rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. A sphere faces as the nodes do that it presses, as in a loop.
        """

    def settle(self, centres: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], outward: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], radius: float, flat: bool, steps: int) -> NDArray[numpy.float64]:
        """
        The body at rest at each place, after at most so many slow steps: rows as of follow, and whether it came to rest.
        """

    def pressed(self) -> tuple:
        """
        Of the last step: the pressed nodes, and the forces along their inward normals, N.
        """

    def displacement(self) -> NDArray[numpy.float64]:
        """Of all points at the last slow step, m."""

    def reset(self) -> None: ...

class Solid:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tetrahedra: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], shear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], lame: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], held: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)], corotational: bool) -> None: ...

    def evaluate(self, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple:
        """Energy, J, and inner forces on the free points, N."""

    def tangent(self, way: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        Change of the inner forces along `way`, N, where it was evaluated last; single precision.
        """

    def relax(self, load: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], tolerance: float = 1e-08, most: int = 60) -> int:
        """
        Newton's steps to rest under a load, N; how many, or -1 if it did not come to rest.
        """

    def displacement(self) -> NDArray[numpy.float64]: ...

    def reset(self) -> None: ...

class Field(enum.Enum):
    discrete = 0

    continuous = 1

class TouchSurface:
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
    def field(self) -> Field: ...

    @field.setter
    def field(self, arg: Field, /) -> None: ...

    @property
    def shading(self) -> float: ...

    @shading.setter
    def shading(self, arg: float, /) -> None: ...

    @property
    def period(self) -> float: ...

    @period.setter
    def period(self, arg: float, /) -> None: ...

class TouchMesh:
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
        The first triangle that would lose its area, and then nothing has moved; or -1.
        """

    def nearest(self, x: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple: ...

def mend_mesh(vertices: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple: ...

class TouchedSurface:
    def __init__(self, mesh: TouchMesh, surface: TouchSurface, radius: float) -> None: ...

class TouchProxy:
    def __init__(self, mesh: TouchMesh, surface: TouchSurface, radius: float) -> None: ...

    def follow(self, path: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Rows of position (3), normal (3), force (3), depth, stiffness; and the triangle, -1 where apart.
        """

    def time(self, path: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """How long each step took, s, the clock's own time included."""

    def reset(self) -> None: ...

    @property
    def faults(self) -> int: ...

    @property
    def unfinished(self) -> int: ...

    @property
    def sliding(self) -> bool: ...

class Hand:
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

class Anchor:
    def __init__(self) -> None: ...

    class Kind(enum.Enum):
        none = 0

        point = 1

        half_space = 2

    @property
    def kind(self) -> Anchor.Kind: ...

    @kind.setter
    def kind(self, arg: Anchor.Kind, /) -> None: ...

    @property
    def point(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @point.setter
    def point(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def normal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @normal.setter
    def normal(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class Difference(enum.Enum):
    backward = 0

    bilinear = 1

class StateSpace:
    @overload
    def __init__(self) -> None: ...

    @overload
    def __init__(self, a: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], b: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], c: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], d: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], antiwindup: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]) -> None: ...

    @property
    def order(self) -> int: ...

    def output(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    def advance(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

class PremiumParameters:
    def __init__(self) -> None: ...

    @property
    def l1(self) -> float: ...

    @l1.setter
    def l1(self, arg: float, /) -> None: ...

    @property
    def l2(self) -> float: ...

    @l2.setter
    def l2(self, arg: float, /) -> None: ...

    @property
    def l3(self) -> float: ...

    @l3.setter
    def l3(self, arg: float, /) -> None: ...

    @property
    def l5(self) -> float: ...

    @l5.setter
    def l5(self, arg: float, /) -> None: ...

    @property
    def l6(self) -> float: ...

    @l6.setter
    def l6(self, arg: float, /) -> None: ...

    @property
    def mass_a(self) -> float: ...

    @mass_a.setter
    def mass_a(self, arg: float, /) -> None: ...

    @property
    def mass_c(self) -> float: ...

    @mass_c.setter
    def mass_c(self, arg: float, /) -> None: ...

    @property
    def mass_be(self) -> float: ...

    @mass_be.setter
    def mass_be(self, arg: float, /) -> None: ...

    @property
    def mass_df(self) -> float: ...

    @mass_df.setter
    def mass_df(self, arg: float, /) -> None: ...

    @property
    def inertia_a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @inertia_a.setter
    def inertia_a(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def inertia_c(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @inertia_c.setter
    def inertia_c(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def inertia_be(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @inertia_be.setter
    def inertia_be(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def inertia_df(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @inertia_df.setter
    def inertia_df(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def inertia_base(self) -> float: ...

    @inertia_base.setter
    def inertia_base(self, arg: float, /) -> None: ...

    @property
    def rotor_inertia(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @rotor_inertia.setter
    def rotor_inertia(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def gravity(self) -> float: ...

    @gravity.setter
    def gravity(self, arg: float, /) -> None: ...

def phantom_premium_1_5a() -> PremiumParameters:
    """The C++ catalogue's entry."""

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
    def mechanism(self) -> Premium: ...

    @mechanism.setter
    def mechanism(self, arg: Premium, /) -> None: ...

    @property
    def friction(self) -> PremiumFriction: ...

    @friction.setter
    def friction(self, arg: PremiumFriction, /) -> None: ...

    @property
    def hand(self) -> Hand: ...

    @hand.setter
    def hand(self, arg: Hand, /) -> None: ...

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
    def anchor(self) -> Anchor: ...

    @anchor.setter
    def anchor(self, arg: Anchor, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> Difference: ...

    @difference.setter
    def difference(self, arg: Difference, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def hold(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @hold.setter
    def hold(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def held(self) -> bool: ...

    @held.setter
    def held(self, arg: bool, /) -> None: ...

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
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """How late each tick comes, 0 to `ticks`, s."""

    def touch(self, surface: TouchedSurface) -> None:
        """Puts a mesh in the anchor's place."""

    def touch_body(self, body: TouchedBody) -> None:
        """Puts a body that yields in the anchor's place."""

    @overload
    def watch(self, frames: SurfaceFrames) -> None:
        """Lets a thread draw the body that was put there."""

    @overload
    def watch(self, frames: SolidFrames) -> None:
        """Shows each slow step of the body that was put there."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        How long each of the servo's ticks took, s, the clock's own time included; paced: one a period, as on a device.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Runs the loop; returns (rows, number of rows written, tick of divergence or -1).
        """

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
    def mechanism(self) -> Slider: ...

    @mechanism.setter
    def mechanism(self, arg: Slider, /) -> None: ...

    @property
    def friction(self) -> SliderFriction: ...

    @friction.setter
    def friction(self, arg: SliderFriction, /) -> None: ...

    @property
    def hand(self) -> Hand: ...

    @hand.setter
    def hand(self, arg: Hand, /) -> None: ...

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
    def anchor(self) -> Anchor: ...

    @anchor.setter
    def anchor(self, arg: Anchor, /) -> None: ...

    @property
    def stiffness(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @stiffness.setter
    def stiffness(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @damping.setter
    def damping(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def difference(self) -> Difference: ...

    @difference.setter
    def difference(self, arg: Difference, /) -> None: ...

    @property
    def controller(self) -> StateSpace: ...

    @controller.setter
    def controller(self, arg: StateSpace, /) -> None: ...

    @property
    def hold(self) -> Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]: ...

    @hold.setter
    def hold(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> None: ...

    @property
    def frozen_kinematics(self) -> bool: ...

    @frozen_kinematics.setter
    def frozen_kinematics(self, arg: bool, /) -> None: ...

    @property
    def held(self) -> bool: ...

    @held.setter
    def held(self, arg: bool, /) -> None: ...

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
    def jitter(self) -> float: ...

    @jitter.setter
    def jitter(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    def lateness(self, ticks: int) -> NDArray[numpy.float64]:
        """How late each tick comes, 0 to `ticks`, s."""

    def touch(self, surface: TouchedSurface) -> None:
        """Puts a mesh in the anchor's place."""

    def touch_body(self, body: TouchedBody) -> None:
        """Puts a body that yields in the anchor's place."""

    @overload
    def watch(self, frames: SurfaceFrames) -> None:
        """Lets a thread draw the body that was put there."""

    @overload
    def watch(self, frames: SolidFrames) -> None:
        """Shows each slow step of the body that was put there."""

    def time_ticks(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], paced: bool) -> NDArray[numpy.float64]:
        """
        How long each of the servo's ticks took, s, the clock's own time included; paced: one a period, as on a device.
        """

    def run(self, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
        """
        Runs the loop; returns (rows, number of rows written, tick of divergence or -1).
        """

class Premium:
    def __init__(self, arg: PremiumParameters, /) -> None: ...

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: PremiumFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

    def inverse(self, p: Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], behind: bool, elbow_down: bool) -> tuple: ...

class Slider:
    def __init__(self, mass: float) -> None: ...

    def forward(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def jacobian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def tip_hessian(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def mass_matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def coriolis(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def gravity(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def energy(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def acceleration(self, arg0: SliderFriction, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

    def linearization(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg1: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg2: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], arg3: Annotated[NDArray[numpy.float64], dict(shape=(1), order='C')], /) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]: ...

def most_lanes() -> int:
    """Loops that run side by side in one thread on this machine."""

@overload
def run_cells(base: PremiumSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object: ...

@overload
def run_cells(base: SliderSetup, reference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], operator_force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], columns: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]], count: int, threads: int = 1, lanes: int = 0) -> object:
    """Runs cells of one base setup; returns a row of outcomes for each."""
