"""Body of a scenario's [object.body]: read from a file, or built and cached."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from palpate import _core
from palpate import fem as bodies
from palpate.arrays import Array, Flags, Indices
from palpate.contact import Mesh
from palpate.contact.simplices import area_vectors, barycentric, half_edges, unique_rows
from palpate.errors import OutputError, PalpateError, ScenarioError
from palpate.fem.contact_accuracy import unresolved
from palpate.fem.support_changes import TOUCHED, SupportChange
from palpate.scenario import Scenario
from palpate.scenario.body import BodyChoice
from palpate.simulation.moving_frame import touching_tip
from palpate.simulation.recorded import Recorded, recorded_scenario
from palpate.simulation.support_phase import support_phase
from palpate.simulation.tool_motion import step_body, tick_times, tool_in_body

if TYPE_CHECKING:
    from palpate.fem import Body
    from palpate.fem.condensed_body import CondensedBody

Tell = Callable[[str, float], None]
_ESTIMATED = ("compliance", "viscoelastic", "modal", "signed_distance")  # models with a known error by the mesh
_FEW = 3  # nodes of a body that stands for a spring: its extent tells nothing of a tip
_DENTED = 10.0  # retardation times after a contact in which a body may keep a dent
_BORDER = 1e-6  # of a face: barycentric coordinate below which a point is on its edge
_SLIGHT = 0.01  # of the radius of a tip: depth below the surface that does not count
_DEEP = 0.1  # of the radius of a tip: depth from which on the body must yield
_LEAST_YIELD = 0.05  # of the depth of a tip: mean displacement of a body that it presses
_RINGS = ((0.0, 1), (0.45, 8), (0.9, 8))  # radii on a flat end, of its own, and points on each, at which it is tested
_MAKING = 3  # version of the construction; a new one invalidates cached bodies


class Pressed(NamedTuple):
    """A body at one sample of a run, in its own frame."""

    body: Body
    tip: Array  # center of the tip (3,), m
    displacement: Array  # of the nodes (n, 3), m
    pressure: Array  # of the tip on each node's patch (n,), Pa


def pressed_at(trace: Recorded, row: int) -> Pressed:
    """Return the body of a trace's scenario at sample `row`, by repeating the path of the tip up to it.

    A body with a state needs a record of every tick, other bodies only the sample itself. A hyperelastic body that
    moves is repeated within about 2 %: rounding changes the effort of its slow steps. Samples whose contact force was
    not found ("solved" is 0) are repeated like the others.
    """
    scenario = Scenario.from_dict(trace.metadata["scenario"])
    choice = scenario.object.body
    assert choice is not None
    body = scenario_body(scenario)
    way = _tip_in_body(trace, scenario, body)[: row % len(trace.time) + 1]
    body.core.reset()
    if choice.supports:  # they change at ticks: between two records the tip counts as already at the second one
        every = scenario.run.record_every
        way = way[-(-np.arange((len(way) - 1) * every + 1) // every)]
    step_body(body.core, way, choice, tick_times(scenario.period, trace.time[: len(way)]))
    return Pressed(body, way[-1], body.displacement(), body.pressure())


def mesh_error(trace: Recorded, row: int, nodes: int) -> float | None:
    """Return the relative error by the mesh of a sphere's force on a trace's body at sample `row`.

    None if it is not known, as where the tip is over a part of the surface without contact, and if the body is no
    longer there.

    Args:
        trace: of a run.
        row: sample.
        nodes: number of nodes in contact.
    """
    if (found := _recorded_body(trace)) is None:
        return None
    scenario, choice, body = found
    if choice.tip != "sphere" or choice.contact_points or choice.kind not in _ESTIMATED:
        return None
    if overlaps_untouched(trace, np.array([row])):
        return None
    center = _tips_in_body(trace, scenario, body, np.array([row]))[0, 0]
    if unresolved(body.nodes, center, choice.radius, choice.tip):
        return None
    return body.mesh_error(nodes, center, choice.radius, float(depths_at_rest(body, center[None], choice.radius)[0]))


def overlaps_untouched(trace: Recorded, rows: Array) -> bool:
    """Return whether the tip overlaps a part of the surface without contact of a trace's body at any of `rows` (m,).

    False also if the body is no longer there.
    """
    if (found := _recorded_body(trace)) is None:
        return False
    scenario, choice, body = found
    axis = np.array([0.0, 0.0, 1.0]) if choice.tip == "flat" else None
    centers = _tips_in_body(trace, scenario, body, rows)
    phase = support_phase(scenario, trace.time[rows])
    for number in np.unique(phase):
        there = centers[phase == number].reshape(-1, 3)
        if _in_phase(body, number).overlaps_untouched(there, choice.radius, axis).any():
            return True
    return False


def tip_depths(trace: Recorded, rows: slice = slice(None)) -> Array | None:
    """Return how deep the tip is below the surface of its body at rest in `rows` of a trace (n,), m; 0 outside of it.

    It is the depth of the lowest point of a sphere, of the middle of a flat end, or of the deepest tip of a tool. The
    surface under it moves less: a sphere presses its neighborhood in by less, and an elastic layer lies between. None
    without a body, and if the body is no longer there.
    """
    if (found := _recorded_body(trace)) is None:
        return None
    scenario, choice, body = found
    centers = _tips_in_body(trace, scenario, body, rows)
    depth = depths_at_rest(body, centers.reshape(-1, 3), 0.0 if choice.tip == "flat" else choice.radius)
    return np.asarray(depth.reshape(len(centers), -1).max(axis=1))


def is_behind_fixed(trace: Recorded) -> bool:
    """Return whether a trace's body is pressed in, at its end, through a part that is fixed, held or much stiffer.

    No body can be; one of small strains yields on, whatever its thickness. False also if the body is no longer there.
    """
    if (found := _recorded_body(trace)) is None:
        return False
    scenario, choice, body = found
    turn = Rotation.from_euler("xyz", choice.rotation).as_matrix()
    way = trace["deflection"][-1] @ turn
    length = float(np.linalg.norm(way))
    if not length > 0.0:
        return False
    reach = 0.0 if choice.tip == "flat" else choice.radius
    ends = _tips_in_body(trace, scenario, body, slice(-1, None))[0] + reach / length * way
    still = _in_phase(body, support_phase(scenario, trace.time[-1:])[0])
    return any(still.is_behind_fixed(end - way, end) for end in ends)


def depth_at_end(trace: Recorded) -> float:
    """Return how deep the tip is below the surface of its body at rest at the end of a trace, m; 0 outside of it.

    Unlike `tip_depths` it measures a flat end along its axis: near the other side of a thin body the nearest surface is
    that one. 0 also if the body is no longer there.
    """
    if (found := _recorded_body(trace)) is None or (depths := tip_depths(trace, slice(-1, None))) is None:
        return 0.0
    scenario, choice, body = found
    if choice.tip != "flat":
        return float(depths[-1])
    axis = np.array([0.0, 0.0, 1.0])
    ends = _tips_in_body(trace, scenario, body, slice(-1, None))[0]
    return max(float(depths[-1]), *(body.depth_along(end, axis) for end in ends))


def depth_without_contact(trace: Recorded) -> float:
    """Return how deep a tip that touches nothing is below the surface of its body at the end of a trace, m.

    It is 0 outside of the body, less than `_SLIGHT` of the radius, and without a body. A body that relaxes keeps a dent
    for some retardation times after a contact: 0 as well.
    """
    touching = np.flatnonzero(trace["touching"][:, 0])
    if (len(touching) and touching[-1] == len(trace.time) - 1) or (found := _recorded_body(trace)) is None:
        return 0.0
    choice, depth = found[1], tip_depths(trace, slice(-1, None))
    dent = _DENTED * float(choice.options.get("retardation_time", 0.0)) if len(touching) else 0.0
    if depth is None or (dent > 0.0 and trace.time[-1] - trace.time[touching[-1]] < dent):
        return 0.0
    return float(depth[0]) if depth[0] > _SLIGHT * choice.radius else 0.0


def depth_in_unmoved_body(trace: Recorded) -> float:
    """Return how deep a tip that touches a body without displacing it is below its surface at the end of a trace, m.

    It is 0 if the body yields by a twentieth of the depth, and below a tenth of the radius. Such a tip grazes a node
    beside a support that was released under it. Of several tips it is not known: 0.
    """
    if (found := _recorded_body(trace)) is None or not trace["touching"][-1, 0] > 0.0:
        return 0.0
    if len(found[1].contact_points) > 1:  # displacements under tips that press against each other cancel
        return 0.0
    depth, moved = depth_at_end(trace), float(np.linalg.norm(trace["deflection"][-1]))
    return depth if depth > _DEEP * found[1].radius and moved < _LEAST_YIELD * depth else 0.0


def depth_where_untouched(trace: Recorded) -> float:
    """Return how deep a tip is, at the end of a trace, where the surface of a body is fixed, held or not touched, m.

    The surface there is the point nearest to the center of a sphere, or what lies outward of a flat end at its middle
    or at points around it. It exerts no force. The depth is 0 below a tenth of the radius, and if the body is no longer
    there. Between nodes that are touched and others the nearer ones count, under a flat end those that are touched.
    """
    if (found := _recorded_body(trace)) is None:
        return 0.0
    scenario, choice, body = found
    ends = _tips_in_body(trace, scenario, body, slice(-1, None))[0]
    touched = _touched(body, int(support_phase(scenario, trace.time[-1:])[0]))
    if choice.tip == "flat":
        turns = [(r, 2.0 * np.pi * k / count) for r, count in _RINGS for k in range(count)]
        ring = choice.radius * np.array([[r * np.cos(turn), r * np.sin(turn), 0.0] for r, turn in turns])
        places = [body.surface_along(end + place, np.array([0.0, 0.0, 1.0])) for end in ends for place in ring]
        depths = [depth for depth, corners in places if depth > 0.0 and not touched[corners].any()]
    else:
        depth, weights, corners = _depths(body, body.whole_surface, ends, choice.radius)
        depths = depth[(weights * touched[corners]).sum(axis=1) < 0.5].tolist()
    deepest = max(depths, default=0.0)
    return float(deepest) if deepest > _DEEP * choice.radius else 0.0


def _touched(body: Body, phase: int) -> Flags:
    """Return whether each point of the whole surface (s,) is a node that can be touched."""
    found = np.zeros(len(body.points), dtype=bool)
    changes = body.kind.supports
    found[body.contents.nodes] = True if changes is None else changes.roles(body.nodes)[phase] == TOUCHED
    return found


def depths_at_rest(body: Body, centers: Array, radius: float) -> Array:
    """Return how deep spheres are below the surface of a body at rest (n,), m; 0 outside of it.

    Args:
        body: of any kind.
        centers: of the spheres (n, 3), m, body frame.
        radius: of the spheres, m.
    """
    depth, weights, corners = _depths(body, body.surface, centers, radius)
    beyond = ((weights < _BORDER) | _at_border(body.surface)[corners]).all(axis=1) & (weights < _BORDER).any(axis=1)
    if beyond.any():  # the touched part of the surface ends there, the body does not
        depth[beyond] = _depths(body, body.whole_surface, centers[beyond], radius)[0]
    return depth


def _depths(body: Body, surface: Mesh, centers: Array, radius: float) -> tuple[Array, Array, Indices]:
    """Return the depths (n,), m, of spheres below a part of the surface, and the points of it nearest to their centers.

    A point is given by its barycentric coordinates (n, 3) and the corners (n, 3) of its triangle.
    """
    nearest, faces = surface.nearest(centers)
    corners = surface.triangles[faces]
    weights = barycentric(nearest, surface.vertices[corners])
    distance = np.linalg.norm(centers - nearest, axis=1)
    inside = np.einsum("ij,ij->i", centers - nearest, area_vectors(surface.vertices, corners)) <= 0.0
    edge = (weights < _BORDER).any(axis=1)  # there the normal of one face does not tell
    inside[edge] = [body.contains(center) for center in centers[edge]]
    return np.maximum(radius + np.where(inside, distance, -distance), 0.0), weights, corners


def _at_border(surface: Mesh) -> Flags:
    """Return whether each vertex (v,) is at the border of an open surface."""
    halves = half_edges(surface.triangles)
    number = unique_rows(np.sort(halves, axis=1))[1]
    found = np.zeros(len(surface.vertices), dtype=bool)
    found[halves[np.bincount(number)[number] == 1]] = True
    return found


def surface_normal(trace: Recorded, row: int) -> Array | None:
    """Return the normal (3,) of a trace's body at the node nearest to the tip at sample `row`, device frame.

    It is that of the body at rest. None for several objects or a moving one, and if the body is no longer there.
    """
    if (found := _recorded_body(trace)) is None or found[0].objects is not None or found[0].object.frame is not None:
        return None
    scenario, choice, body = found
    nearest = body.nearest_node(_tip_in_body(trace, scenario, body)[row])
    return np.asarray(Rotation.from_euler("xyz", choice.rotation).apply(body.normals[nearest]))


def _recorded_body(trace: Recorded) -> tuple[Scenario, BodyChoice, Body] | None:
    """Return the scenario of a trace, its choice of a body and the body, or None if there is none or it is gone."""
    scenario = recorded_scenario(trace)
    if scenario is None or (choice := scenario.object.body) is None or not _is_there(choice):
        return None
    try:
        return scenario, choice, scenario_body(scenario)
    except PalpateError:
        return None


def _in_phase(body: Body, number: int) -> CondensedBody:
    """Return a body's geometry after a number of changes of its supports."""
    return body if body.kind.supports is None else body.in_phase(int(number))


def _is_there(choice: BodyChoice) -> bool:
    """Return whether the file of a body exists, without building it."""
    return (Path(choice.file) if choice.file is not None else cache_path(choice)).is_file()


def _tip_in_body(trace: Recorded, scenario: Scenario, body: Body) -> Array:
    """Return the centers of the tip in the frame of the body (n, 3), m."""
    choice = scenario.object.body
    assert choice is not None
    moving = scenario.object.frame is not None
    anchor = np.zeros(3) if moving else trace["tip"][0] + np.array(scenario.object.position)
    turn = Rotation.from_euler("xyz", choice.rotation).as_matrix()
    return np.asarray((touching_tip(trace) - anchor) @ turn + origin_of(choice, body))


def _tips_in_body(trace: Recorded, scenario: Scenario, body: Body, rows: slice | Array) -> Array:
    """Return the centers of all tips of a tool in the frame of the body at `rows` (n, k, 3), m; of one tip, k = 1."""
    choice = scenario.object.body
    assert choice is not None
    times = tick_times(scenario.period, trace.time[rows])
    return np.asarray(_tip_in_body(trace, scenario, body)[rows][:, None] + tool_in_body(choice, times))


def touched_body(scenario: Scenario, origin: Array) -> _core.PlacedBody:
    """Return the body of an object of kind "body" for the core, with its origin at `origin` (3,), m, and its tip.

    Raises:
        ScenarioError: as `place_body`.
    """
    choice = scenario.object.body
    assert choice is not None
    body, at, turn = place_body(scenario, origin)
    placed = _core.PlacedBody(body.core, at, turn, choice.radius, choice.tip == "flat")
    if choice.tool is not None:
        placed.set_tool(choice.tool.core(choice.contact_points))
    return placed


def place_body(scenario: Scenario, origin: Array) -> tuple[Body, Array, Array]:
    """Return the body of an object of kind "body", and its pose in the device's frame.

    Args:
        scenario: its object is a body.
        origin: position of the body's own origin (3,), m.

    Returns:
        The body, the origin of its frame (3,), m, and its rotation (3, 3), body frame to device frame.

    Raises:
        ScenarioError: the body cannot be read or built, does not have the kind, is smaller than the tip, or contains
            the whole tip at the start.
    """
    choice = scenario.object.body
    assert choice is not None
    if choice.supports and choice.supports[-1].at > scenario.run.duration:
        late = f"the change at {choice.supports[-1].at:g} s comes after the run of {scenario.run.duration:g} s"
        raise scenario.mistake("object.body.supports", late)
    body = scenario_body(scenario)
    _check_tip(scenario, choice, body)
    turn = Rotation.from_euler("xyz", choice.rotation).as_matrix()
    return body, origin - turn @ origin_of(choice, body), turn


def _check_tip(scenario: Scenario, choice: BodyChoice, body: Body) -> None:
    """Raise ScenarioError if the tip is larger than the body, or starts so deep that it does not reach the surface."""
    if choice.radius > body.extent and len(body.nodes) > _FEW:
        large = f"{choice.radius:g} m exceeds the body's extent of {body.extent:.3g} m: use a smaller tip"
        raise scenario.mistake("object.body.radius", large)
    turn = Rotation.from_euler("xyz", choice.rotation).as_matrix()
    start = origin_of(choice, body) - turn.T @ np.array(scenario.object.position)
    beside = 0.5 * float(np.sqrt(body.contents.areas.max())) if choice.tip == "flat" else 0.0
    for tip in start + tool_in_body(choice)[0]:
        if not body.contains(tip):
            continue
        deep = float(np.linalg.norm(body.surface.nearest(tip)[0] - tip))
        if deep > choice.radius + beside:
            raise ScenarioError(
                f"object.position: the tip starts inside the body, its center {1e3 * deep:.3g} mm below the surface; "
                "the position is that of the body's origin from the center of the start tip: move the body away from it"
            )


def scenario_body(scenario: Scenario, tell: Tell | None = None) -> Body:
    """Return the body of a scenario in its own frame, with its kind; `tell` is called with the progress of a build.

    A block or phantom is cached in `cache_path`.

    Raises:
        ScenarioError: as `touched_body`.
    """
    choice = scenario.object.body
    assert choice is not None
    field = "object.body" if choice.file is None else "object.body.file"
    path = Path(choice.file) if choice.file is not None else cache_path(choice)
    try:
        if choice.file is None and not path.is_file():
            _make(choice, path, tell)
        _read(_state(path))
        field = "object.body.kind"
        chosen = {} if choice.contact is None else {"contact": choice.contact}
        options = tuple(sorted({**choice.options, **chosen}.items()))
        supported = (_state(path), choice.held)
        tool = tuple(map(tuple, tool_in_body(choice)[0].tolist())) if choice.contact_points else ()
        body = _of_kind(supported, choice.stiffness_scale, choice.kind, options, scenario.period, tool)
        return body if choice.supports is None else _changing(body, support_changes(choice), scenario.period)
    except PalpateError as problem:
        key, _, sentence = str(problem).partition(": ")  # the message about a number begins with its name
        if key in choice.options or key in _recipe(choice) or key in ("stiffness_scale", "held", "supports"):
            raise scenario.mistake(f"object.body.{key}", sentence) from None
        hint = ""
        if field == "object.body" and path.is_file():
            hint = ": delete that file, and it is built again"
        elif isinstance(problem, OutputError):
            hint = "; blocks and phantoms are cached there: XDG_CACHE_HOME selects another folder"
        raise scenario.mistake(field, f"{problem}{hint}") from None


def support_changes(choice: BodyChoice) -> tuple[SupportChange, ...]:
    """Return the changes of the supports of a body at run time."""
    return tuple(SupportChange(change.at, change.held, change.touchable) for change in choice.supports or ())


def origin_of(choice: BodyChoice, body: Body) -> Array:
    """Return the point of a body, in its own frame (3,), m, that lies at the object's position."""
    if choice.origin is not None:
        return np.array(choice.origin)
    if choice.shape == "file":
        return np.zeros(3)
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    return np.array([*(low + high)[:2] / 2.0, high[2]])


def cache_path(choice: BodyChoice) -> Path:
    """Return the file of a block or phantom in the user's cache (XDG_CACHE_HOME), by a hash of its recipe."""
    from palpate.fem.storage import VERSION

    made = {"version": VERSION, "making": _MAKING, "shape": choice.shape}
    recipe = json.dumps({**made, **_recipe(choice)}, sort_keys=True)
    name = f"{choice.shape}-{hashlib.sha256(recipe.encode()).hexdigest()[:16]}.h5"
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "palpate" / "bodies" / name


def _recipe(choice: BodyChoice) -> dict[str, Any]:
    geometry = ("size", "spacing", "depth", "diameter", "layer_thickness")
    material = ("young", "poisson", "contrast", "layer_young", "modes")
    given = {key: getattr(choice, key) for key in (*geometry, *material)}
    return {key: value for key, value in given.items() if value is not None}


def _make(choice: BodyChoice, path: Path, tell: Tell | None) -> None:
    recipe = _recipe(choice)
    if choice.shape == "phantom":
        bodies.phantom(**recipe, output=path, progress=tell)
        return
    size, spacing = recipe.pop("size"), recipe.pop("spacing")
    top = size[2] - 1e-6
    bodies.build(
        bodies.block(size, spacing),
        **recipe,
        fixed=bodies.half_space("z", "<", 1e-6),
        touch=bodies.half_space("z", ">", top),
        output=path,
        progress=tell,
    )


def _state(path: Path) -> tuple[str, int, int]:
    """Return path, time of modification and size of a file."""
    try:
        found = path.stat()
    except OSError:
        return str(path), 0, 0  # reading it raises
    return str(path), found.st_mtime_ns, found.st_size


@lru_cache(maxsize=2)
def _read(state: tuple[str, int, int]) -> Body:
    from palpate.fem import load

    return load(state[0])


@lru_cache(maxsize=2)
def _held(state: tuple[str, int, int], regions: tuple[str, ...]) -> Body:
    return _read(state).held(regions) if regions else _read(state)


@lru_cache(maxsize=4)
def _of_kind(
    supported: tuple[tuple[str, int, int], tuple[str, ...]],
    scale: float,
    kind: str,
    options: tuple[tuple[str, Any], ...],
    period: float,
    tool: tuple[tuple[float, ...], ...],
) -> Body:
    body = _held(*supported)
    body = body if scale == 1.0 else body.scaled_stiffness(scale)
    from palpate.fem import Law

    if kind == "compliance":
        given = {key: value for key, value in options if key != "update_interval"}  # without a state nothing is updated
        return body.with_friction(**{"static_friction": 0.0, **given}) if given else body
    if kind in get_args(Law):
        return body.hyperelastic(period, law=kind, **dict(options))  # type: ignore[arg-type]
    made: Body = getattr(body, kind)(period, **dict(options))
    return made.with_contact_points(tool) if tool else made


@lru_cache(maxsize=2)
def _changing(body: Body, changes: tuple[SupportChange, ...], period: float) -> Body:
    return body.with_support_changes(changes, period)
