"""Objects of a scenario: their place in the core's setup, and their channels in a trace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from palpate import _core
from palpate.arrays import Array
from palpate.devices import Device
from palpate.scenario import Scenario
from palpate.simulation.bodies import touched_body
from palpate.simulation.force_objects import CHANNELS_OF, core_object, force_object
from palpate.simulation.meshes import sensed_tip, touched_mesh

# Channels that the core adds to a row, with their numbers of columns.
MESH: Final = {"proxy": 3, "normal": 3, "depth": 1, "surface_stiffness": 1, "triangle": 1}
BODY: Final = {
    "deflection": 3,
    "stored_energy": 1,
    "contact_nodes": 1,
    "solved": 1,
    "tank_energy": 1,
    "contact_lost": 1,
    "contact_moment": 3,
}
CONTACT: Final = {"force": 3, "touching": 1}  # of each object of a scene
POSE: Final = 12  # columns of a moving frame: origin (3), rotation matrix by rows (9)


@dataclass(frozen=True)
class PlacedObject:
    """One object of a scenario.

    Attributes:
        scenario: with the object as its [object].
        setup: of the object in the core.
        origin: position of the object at the start, of its frame if that moves (3,), m.
    """

    scenario: Scenario
    setup: Any
    origin: Array

    @property
    def parameters(self) -> dict[str, Any] | None:
        """Kind and parameters of a force law, field or textured wall; None for other objects."""
        return force_object(self.scenario, self.place)

    @property
    def kinds(self) -> dict[str, int]:
        """Channels of the object's kind, with their numbers of columns."""
        touched = self.scenario.object
        kind = touched.kind if touched.field is None else touched.field.kind
        points = 0 if touched.body is None else len(touched.body.contact_points)
        forces = {f"point{number}_force": 3 for number in range(1, points + 1)}
        return {"mesh": MESH, "body": BODY | forces, **CHANNELS_OF}.get(kind, {})

    @property
    def place(self) -> Array:
        """Position of the object in the frame in which its setup describes it (3,), m."""
        return np.zeros(3) if self.scenario.object.frame is not None else self.origin

    @property
    def width(self) -> int:
        """Number of columns of the object in a row of the core."""
        return sum(self.kinds.values()) + (POSE if self.scenario.object.frame is not None else 0)

    def channels(self, columns: Array, tip: Array) -> dict[str, Array]:
        """Return the channels of the object: its deflection first, then those of its kind, then those of its frame.

        Args:
            columns: of the object in the rows of the core (n, width).
            tip: positions (n, 3), m.
        """
        frame = self.scenario.object.frame is not None
        pose, own = np.split(columns, [POSE if frame else 0], axis=1)
        matrix = pose[:, 3:].reshape(-1, 3, 3)
        local = np.einsum("nji,nj->ni", matrix, tip - pose[:, :3]) if frame else tip
        kinds = self.kinds
        ends = np.cumsum([*kinds.values()])
        values = {name: own[:, end - width : end] for (name, width), end in zip(kinds.items(), ends, strict=True)}
        if "contact_moment" in values and not self._has_moment:
            del values["contact_moment"]
        if "proxy" in values:
            values = {"deflection": -values["depth"] * values["normal"], **values}
        elif "deflection" not in values:
            values = {"deflection": self._deflection(local, values), **values}
        if not frame:
            return values
        for name in ("deflection", "normal", "proxy", "mass_position", "contact_moment"):
            if name in values:
                values[name] = np.einsum("nij,nj->ni", matrix, values[name])
        for name in ("proxy", "mass_position"):
            if name in values:
                values[name] = values[name] + pose[:, :3]
        turned = Rotation.from_matrix(matrix).as_rotvec() if len(matrix) else np.zeros((0, 3))
        return {**values, "frame_position": pose[:, :3], "frame_rotation": turned}

    @property
    def _has_moment(self) -> bool:
        """Whether the core knows the moment of the contact: that by signed distance."""
        body = self.scenario.object.body
        return body is not None and body.by_distance

    def _deflection(self, tip: Array, values: Mapping[str, Array]) -> Array:
        """Return the deflection of a spring, a wall or a field (n, 3), m; without an object, the tip's displacement.

        Args:
            tip: positions in the object's frame (n, 3), m.
            values: other channels of the object.
        """
        touched = self.scenario.object
        if "depth" in values:
            return np.asarray(-np.maximum(values["depth"], 0.0) * np.array(touched.normal), dtype=float)
        if "mass_position" in values:
            return np.asarray(tip - values["mass_position"], dtype=float)
        away = tip - np.array(self.setup.wall.point)
        if touched.kind == "wall":
            normal = np.array(touched.normal)
            return np.asarray(np.minimum(away @ normal, 0.0)[:, None] * normal, dtype=float)
        if touched.field is not None and touched.field.kind in ("constant", "vibration"):
            return np.zeros_like(away)
        if touched.field is not None and touched.field.radius is not None:
            inside = np.linalg.norm(away, axis=1) < touched.field.radius
            return np.where(inside[:, None], away, 0.0)
        return np.asarray(away, dtype=float)


def place_objects(setup: Any, scenario: Scenario, device: Device, start: Array) -> dict[str, PlacedObject]:
    """Put the objects of a scenario into the core's setup; return them by name, a single one as "".

    Raises:
        ScenarioError: a mesh or body cannot be read or built.
    """
    tip = sensed_tip(scenario, device, start)
    placed = {}
    for name, alone in scenario.each_object.items():
        own = _core.ObjectSetup() if name else setup
        placed[name] = PlacedObject(alone, own, tip + np.array(alone.object.position))
        _describe(placed[name])
        if name:
            setup.add_object(own)
    return placed


def _describe(placed: PlacedObject) -> None:
    """Write an object into its setup."""
    scenario, setup, touched = placed.scenario, placed.setup, placed.scenario.object
    wall = _core.SpringWallParameters()
    kinds = {"spring": _core.SpringWallParameters.Kind.point, "wall": _core.SpringWallParameters.Kind.half_space}
    wall.kind = kinds.get(touched.kind, _core.SpringWallParameters.Kind.none)
    viscous = touched.field is not None and touched.field.kind == "viscous"  # a spring without stiffness
    if viscous:
        wall.kind = _core.SpringWallParameters.Kind.point
    wall.point = placed.place
    if touched.normal is not None:
        wall.normal = np.array(touched.normal)
    setup.wall = wall
    if touched.mesh is not None:
        mesh, surface = touched_mesh(scenario, placed.place)
        setup.set_mesh(_core.MeshModel(mesh.core, surface.core_for(mesh), touched.mesh.radius))
    if touched.body is not None:
        setup.set_body(touched_body(scenario, placed.place))
    if (parameters := placed.parameters) is not None:
        setup.set_object(core_object(scenario, parameters))
    if touched.field is not None and viscous:
        setup.damping = np.array(touched.field.damping)
    if touched.stiffness is not None:
        setup.stiffness, setup.damping = np.array(touched.stiffness), np.array(touched.damping)
    difference = _core.CouplingDifference
    setup.difference = difference.bilinear if touched.coupling == "bilinear" else difference.backward
    if touched.frame is not None:
        setup.set_motion(placed.origin, touched.frame.rows())


def columns_of(objects: Mapping[str, PlacedObject]) -> int:
    """Return the number of columns of objects, by name, in a row of the core."""
    return sum(placed.width + (sum(CONTACT.values()) if name else 0) for name, placed in objects.items())


def object_channels(objects: Mapping[str, PlacedObject], columns: Array, tip: Array) -> dict[str, Array]:
    """Return the channels of the objects: first the deflection, then those of each object.

    The channels of a scene begin with the name of their object. Its deflection is that of the object with the largest
    force, as the controller sees it.

    Args:
        objects: by name.
        columns: of the objects in the rows of the core (n, k).
        tip: positions (n, 3), m.
    """
    if "" in objects:
        return objects[""].channels(columns, tip)
    found: dict[str, Array] = {"deflection": np.zeros((len(tip), 3))}
    largest = np.zeros(len(tip))
    for name, placed in objects.items():
        contact, own, columns = np.split(columns, [4, 4 + placed.width], axis=1)
        values = {"force": contact[:, :3], "touching": contact[:, 3:], **placed.channels(own, tip)}
        force = np.where(contact[:, 3] > 0.0, np.linalg.norm(contact[:, :3], axis=1), 0.0)
        found["deflection"] = np.where((force > largest)[:, None], values["deflection"], found["deflection"])
        largest = np.maximum(largest, force)
        found |= {f"{name}_{channel}": value for channel, value in values.items()}
    return found
