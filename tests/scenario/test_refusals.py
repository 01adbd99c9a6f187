"""Refusals of scenarios: each combination that makes no experiment, with its whole sentence, and what is just right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from palpate.errors import ScenarioError
from palpate.scenario import Scenario

ARM: dict[str, Any] = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
PRESS: dict[str, Any] = {"operator": {"kind": "force", "force": "1 N"}}
WALL: dict[str, Any] = {"kind": "wall", "normal": [0, 0, 1]}
BOX = {"shape": "box", "edge": "40 mm", "divisions": 2}
MESH: dict[str, Any] = {"kind": "mesh", "stiffness": None, "mesh": BOX}
TOOL: dict[str, Any] = {
    "servo": {"topology": "admittance_display", "tool": {"mass": "0.1 kg", "damping": "1 N*s/m"}},
    "controller": {"kind": "workspace"},
    **PRESS,
}


def tables(**changes: Any) -> dict[str, Any]:
    """Return a press on a spring; a change lays keys over a table, and None removes a key or a table."""
    out: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "0.5 ms"},
        "reference": {"force": ["0 N", "0 N", "-2 N"]},
        "object": {"stiffness": "3.5 N/mm"},
        "run": {"duration": "0.1 s"},
    }
    for name, change in changes.items():
        if isinstance(change, dict) and name != "objects":
            laid = {**out.get(name, {}), **change}
            out[name] = {key: value for key, value in laid.items() if value is not None}
        else:
            out[name] = change
    return {name: table for name, table in out.items() if table is not None}


def display(**changes: Any) -> dict[str, Any]:
    """Return the same arm as an impedance display."""
    return tables(**{"reference": None, "servo": {"topology": "impedance_display"}, **changes})


def body(**keys: Any) -> dict[str, Any]:
    return {"kind": "body", "stiffness": None, "body": {"shape": "phantom", "radius": "8 mm", **keys}}


def law(**keys: Any) -> dict[str, Any]:
    return {"kind": "force_law", "stiffness": None, "normal": [0, 0, 1], "law": keys}


def field(**keys: Any) -> dict[str, Any]:
    return {"kind": "field", "stiffness": None, "field": keys}


def texture(**keys: Any) -> dict[str, Any]:
    varies = {"wavelength": "2 mm", "across": [1, 0, 0], **keys}
    return {"kind": "textured_wall", "normal": [0, 0, 1], "texture": varies}


def mesh(**keys: Any) -> dict[str, Any]:
    return {**MESH, "surface": {"stiffness": "1 N/mm", **keys}}


def ss(**matrices: Any) -> dict[str, Any]:
    """Return a controller with one state; None removes a matrix."""
    one = {"A": [[0.5]], "B": [[0.0] * 6], "C": [[1.0]] * 3, "D": [[0.0] * 6] * 3, **matrices}
    return {"kind": "state_space", **{name: matrix for name, matrix in one.items() if matrix is not None}}


def adm(**changes: Any) -> dict[str, Any]:
    """Return an admittance display; a change lays keys over its tables."""
    return {**TOOL, **{name: {**TOOL.get(name, {}), **change} for name, change in changes.items()}}


KEYS = "title, description, device, start, servo, reference, operator, object, objects, controller, guard, run"  # all
REFUSED: list[tuple[Callable[..., dict[str, Any]], dict[str, Any], str]] = [
    (tables, {"device": None},
     "the table [device] is missing"),
    (tables, {"mechanism": "slider"},
     f'unknown key "mechanism" in the scenario; there are {KEYS}'),
    (tables, {"device": None, "mechanism": "slider"},
     'a device file; a scenario names it as [device] name = "scenario" (palpate new scenario writes a '
     "scenario)"),
    (tables, {"device": None, "based_on": 3},
     f'the table [device] is missing\nscenario: unknown key "based_on" in the scenario; there are {KEYS}'),
    (tables, {"object": body(kind="modal", sideways_fraction=0.5)},
     'unknown key "sideways_fraction" in [object.body]; modal does not take it, only signed_distance'),
    (tables, {"object": body(radiu="1 mm")},
     'unknown key "radiu" in [object.body]; did you mean radius?'),
    (tables, {"object": body(xyzzy="1 mm")},
     'unknown key "xyzzy" in [object.body]; there are shape, file, size, young, poisson, spacing, '
     "modes, contrast, depth, diameter, layer_thickness, layer_young, kind, contact, origin, "
     "rotation, tip, radius, contact_points, tool, stiffness_scale, held, supports, update_interval, "
     "static_friction, dynamic_friction"),
    (tables, {"object": body(options=3)},
     "object.body.options: 3 is not a table"),
    (tables, {"object": body(options={"radius": 1})},
     'unknown key "radius" in [object.body]; compliance takes update_interval, static_friction, '
     "dynamic_friction"),
    (tables, {"object": body(update_interval="1 mm")},
     'object.body.update_interval: "1 mm" is a length [m]; a time is needed, for example "0.5 ms"'),
    (tables, {"object": body(update_interval="0 s")},
     'object.body.update_interval: "0 s" must be positive'),
    (tables, {"object": body(static_friction=-0.1)},
     "object.body.static_friction: -0.1 must not be negative"),
    (tables, {"object": body(kind="modal", instantaneous_ratio=0.99)},
     "object.body.instantaneous_ratio: 0.99 must be 1 or more: the instantaneous stiffness is at "
     "least the long-term stiffness"),
    (tables, {"object": body(kind="corotational", nodes_per_tip=3)},
     "object.body.nodes_per_tip: 3 must be a whole number, from 4 to 64"),
    (tables, {"object": body(kind="corotational", nodes_per_tip=65)},
     "object.body.nodes_per_tip: 65 must be a whole number, from 4 to 64"),
    (tables, {"object": body(kind="corotational", nodes_per_tip=4.5)},
     "object.body.nodes_per_tip: 4.5 must be a whole number, from 4 to 64"),
    (tables, {"object": body(kind="mass_spring", exponent=0)},
     "object.body.exponent: 0 must not be zero"),
    (tables, {"object": body(kind="mass_spring", stiffness_limit=1)},
     "object.body.stiffness_limit: 1 must be above 1 and at most 100"),
    (tables, {"object": body(kind="mass_spring", stiffness_limit=100.5)},
     "object.body.stiffness_limit: 100.5 must be above 1 and at most 100"),
    (tables, {"object": body(kind="complianse")},
     'object.body.kind: "complianse" is not one of compliance, signed_distance, modal, mass_spring, '
     "viscoelastic, neo-hookean, corotational; did you mean compliance?"),
    (tables, {"object": body(kind="xyzzy")},
     'object.body.kind: "xyzzy" is not one of compliance, signed_distance, modal, mass_spring, '
     "viscoelastic, neo-hookean, corotational"),
    (tables, {"object": body(shape="block", young="10 kPa", spacing="5 mm")},
     'object.body.size is missing; write for example size = ["100 mm", "100 mm", "50 mm"]'),
    (tables, {"object": body(shape="block", size="10 mm", spacing="5 mm")},
     'object.body.young is missing; write for example young = "10 kPa"'),
    (tables, {"object": body(shape="block", size="10 mm", young="10 kPa")},
     'object.body.spacing is missing; write for example spacing = "5 mm"'),
    (tables, {"object": body(shape="file")},
     'object.body.file is missing; write for example file = "liver.h5"'),
    (tables, {"object": body(size="10 mm")},
     'object.body.size has no meaning for shape = "phantom"'),
    (tables, {"object": body(shape="block", size="10 mm", young="10 kPa", spacing="5 mm", contrast=2)},
     'object.body.contrast has no meaning for shape = "block"'),
    (tables, {"object": body(poisson=0.5)},
     "object.body.poisson: 0.5 must be below 0.5 (soft tissue: 0.45 to 0.495)"),
    (tables, {"object": body(modes=-1)},
     "object.body.modes: -1 must not be negative"),
    (tables, {"object": body(contrast=0)},
     "object.body.contrast: 0 must be positive"),
    (tables, {"object": body(contact="signed_distance")},
     "object.body.contact has no meaning for compliance, only for modal, viscoelastic"),
    (tables, {"object": body(contact_points=["1 mm"])},
     "object.body.contact_points: a tool needs the contact by signed distance; write kind = "
     '"signed_distance", or contact = "signed_distance" with modal or viscoelastic'),
    (tables, {"object": body(kind="signed_distance", contact_points=["1 mm"] * 2)},
     "object.body.contact_points: points 1 and 2 are in the same place; remove one"),
    (tables, {"object": body(kind="signed_distance", contact_points=["1 mm", "1.2 mm"])},
     "object.body.contact_points: points 1 and 2 are nearer than a tenth of their radius, so the body would feel "
     "stiffer, as each presses a layer of its own; remove one"),
    (tables, {"object": body(kind="viscoelastic", instantaneous_ratio=2)},
     "object.body.retardation_time is missing: viscoelastic needs it, for example retardation_time = "
     '"20 s"'),
    (tables, {"object": body(kind="viscoelastic", retardation_time="1 s")},
     "object.body.instantaneous_ratio is missing: viscoelastic needs it, for example "
     "instantaneous_ratio = 2.0"),
    (tables, {"object": body(kind="neo-hookean", rayleigh_alpha="0.5 1/s")},
     "object.body.rayleigh_alpha: without density neo-hookean has no inertia, so it takes no damping;"
     ' write for example density = "1000 kg/m^3"'),
    (tables, {"object": body(kind="corotational", rayleigh_beta="1 ms")},
     "object.body.rayleigh_beta: without density corotational has no inertia, so it takes no damping;"
     ' write for example density = "1000 kg/m^3"'),
    (tables, {"object": body(dynamic_friction=0.2, static_friction=0.1)},
     "object.body.dynamic_friction: 0.2 must not exceed static_friction (0.1)"),
    (tables, {"object": body(dynamic_friction=0.2)},
     "object.body.dynamic_friction: 0.2 must not exceed static_friction (0)"),
    (tables, {"object": body(kind="modal", supports=[{"at": "1 s", "held": "x < 1 mm"}])},
     "object.body.supports: supports that change at run time need the contact by signed distance; write "
     'contact = "signed_distance"; held holds nodes of any kind over the whole run'),
    (tables, {"object": body(kind="modal", contact="signed_distance", instantaneous_ratio=2, retardation_time="1 s",
                             supports=[{"at": "1 s", "held": "x < 1 mm"}])},
     "object.body.supports: the supports of a body with inertia that relaxes do not change; remove "
     'instantaneous_ratio, or write kind = "viscoelastic"; held holds nodes of any kind over the whole run'),
    (tables, {"object": body(kind="mass_spring", supports=[{"at": "1 s", "held": "x < 1 mm"}])},
     "object.body.supports: supports that change at run time need a body of the kind compliance, signed_distance, "
     "viscoelastic or modal; held holds nodes of any kind over the whole run"),
    (tables, {"object": body(kind="viscoelastic", instantaneous_ratio=2, retardation_time="1 s",
                             supports=[{"at": "1 s", "held": "x < 1 mm"}])},
     "object.body.supports: supports that change at run time need the contact by signed distance; write "
     'contact = "signed_distance"; held holds nodes of any kind over the whole run'),
    (tables, {"object": body(static_friction=0.1, supports=[{"at": "1 s", "held": "x < 1 mm"}])},
     'object.body.supports: with friction, supports that change at run time need kind = "signed_distance";'
     " held holds nodes of any kind over the whole run"),
    (tables, {"object": body(supports=[{"at": "1 s"}])},
     'object.body.supports: it changes nothing; write for example held = ["x < 10 mm"], or held = [] '
     "to release"),
    (tables, {"object": body(supports=[{"held": []}])},
     'object.body.supports.at is missing; write for example at = "1 s"'),
    (tables, {"object": body(supports=[{"at": "1 s", "held": []}, {"at": "1 s", "held": "x < 1 mm"}])},
     "object.body.supports: the times must increase, and 1 s follows 1 s"),
    (tables, {"object": body(supports=[{"at": "1 s", "held": []}, {"at": "2 s", "touchable": "x < 1 mm"},
     {"at": "1.5 s", "held": []}])},
     "object.body.supports: the times must increase, and 1.5 s follows 2 s"),
    (tables, {"object": body(stiffness_scale=0)},
     "object.body.stiffness_scale: 0 must be positive"),
    (tables, {"object": {"kind": "body", "stiffness": None, "body": {"shape": "phantom"}}},
     'object.body.radius is missing; write for example radius = "8 mm"'),
    (tables, {"object": {"kind": "body", "body": {"shape": "phantom", "radius": "1 mm"}}},
     "object.stiffness has no meaning for kind = \"body\" (a body's follows from its material)"),
    (tables, {"object": {"kind": "body", "stiffness": None}},
     'object.body is missing; write a table [object.body] with for example shape = "phantom" and '
     'radius = "8 mm"'),
    (tables, {"object": law()},
     'object.law: give depth and force, a table, or formula and deepest, for example formula = "500 *'
     ' x"'),
    (tables, {"object": law(formula="x", depth=["0 mm", "1 mm"], deepest="1 mm")},
     'object.law: give depth and force, a table, or formula and deepest, for example formula = "500 *'
     ' x"'),
    (tables, {"object": law(depth=["0 mm", "1 mm"])},
     "object.law.force is missing: a table has depth and force"),
    (tables, {"object": law(force=["0 N", "1 N"])},
     "object.law.depth is missing: a table has depth and force"),
    (tables, {"object": law(depth=["0 mm", "1 mm"], force=["0 N", "1 N"], deepest="1 mm")},
     "object.law: deepest belongs to a formula"),
    (tables, {"object": law(formula="500 * x")},
     'object.law.deepest is missing: the last depth of the formula, for example deepest = "10 mm"'),
    (tables, {"object": law(formula="500 * y", deepest="1 mm")},
     'object.law.formula: "y" is no number, no variable and no function; known are x, pi, abs, atan, '
     "cos, exp, log, sin, sqrt, tanh"),
    (tables, {"object": law(formula="500 * (x", deepest="1 mm")},
     'object.law.formula: the bracket of "(" is not closed'),
    (tables, {"object": law(formula="-x", deepest="1 mm")},
     "object.law: force must rise from entry to entry, but it goes from -0 to -1e-06 N at entry 2; "
     "sort or smooth the table"),
    (tables, {"object": law(formula="x", deepest="1 mm", entries=1)},
     "object.law.entries: 1 entries; it must be between 2 and 100000"),
    (tables, {"object": law(formula="x", deepest="1 mm", entries=100001)},
     "object.law.entries: 100001 entries; it must be between 2 and 100000"),
    (tables, {"object": law(depth=["0 mm"], force=["0 N", "1 N"])},
     'object.law.depth: a list of 2 to 100000 values such as ["0 mm", "1 mm", "3 mm"]'),
    (tables, {"object": law(depth="0 mm", force=["0 N", "1 N"])},
     'object.law.depth: a list of 2 to 100000 values such as ["0 mm", "1 mm", "3 mm"]'),
    (tables, {"object": law(depth=["0 mm", "1 mm", "1 mm"], force=["0 N", "1 N", "2 N"])},
     "object.law: depth must rise from entry to entry, but it goes from 0.001 to 0.001 m at entry 3; "
     "sort or smooth the table"),
    (tables, {"object": law(depth=["0 mm", "1 mm", "2 mm"], force=["0 N", "1 N"])},
     "object.law: depth and force need the same number of entries, at least two, not (3,) and (2,)"),
    (tables, {"object": {"kind": "force_law", "stiffness": None, "law": {"formula": "x", "deepest": "1 mm"}}},
     "object: a force law needs its outward normal, for example normal = [0, 0, 1]"),
    (tables, {"object": {"kind": "force_law", "law": {"formula": "x", "deepest": "1 mm"}, "normal": [0, 0, 1]}},
     'object.stiffness has no meaning for kind = "force_law" (the law has its own in [object.law])'),
    (tables, {"object": field(kind="constant")},
     'object.field.force is missing: kind = "constant" needs for example force = ["0 N", "-1 N", "0 '
     'N"]'),
    (tables, {"object": field(kind="viscous")},
     'object.field.damping is missing: kind = "viscous" needs for example damping = "2 N*s/m"'),
    (tables, {"object": field(kind="gravity_well", radius="1 mm")},
     'object.field.stiffness is missing: kind = "gravity_well" needs for example stiffness = "200 '
     'N/m"'),
    (tables, {"object": field(kind="gravity_well", stiffness="1 N/m")},
     'object.field.radius is missing: kind = "gravity_well" needs for example radius = "20 mm"'),
    (tables, {"object": field(kind="vibration", force="1 N")},
     'object.field.frequency is missing: kind = "vibration" needs for example frequency = "150 Hz"'),
    (tables, {"object": field(kind="vibration", frequency="9 Hz")},
     'object.field.force is missing: kind = "vibration" needs for example force = ["0 N", "0 N", "0.5'
     ' N"]'),
    (tables, {"object": field(kind="virtual_mass", mass="1 kg")},
     'object.field.stiffness is missing: kind = "virtual_mass" needs for example stiffness = "500 '
     'N/m"'),
    (tables, {"object": field(kind="virtual_mass", stiffness="1 N/m")},
     'object.field.mass is missing: kind = "virtual_mass" needs for example mass = "0.2 kg"'),
    (tables, {"object": field(kind="constant", force="1 N", radius="1 mm")},
     'object.field.radius has no meaning for kind = "constant"'),
    (tables, {"object": field(kind="constant", force="1 N", decay="1 s", radius="1 mm")},
     'object.field.decay has no meaning for kind = "constant"'),
    (tables, {"object": field(kind="gravity_well", stiffness="0 N/m", radius="1 mm")},
     "object.field: stiffness must be positive"),
    (tables, {"object": field(kind="gravity_well", stiffness="1 N/m", radius="1 mm", largest_force="0 N")},
     "object.field: largest_force must be positive"),
    (tables, {"object": field(kind="virtual_mass", stiffness="1 N/m", mass="0 kg")},
     "object.field: mass must be positive"),
    (tables, {"object": field(kind="vibration", force="1 N", frequency="9 Hz", at_contact=True)},
     "object: a vibration at contact needs its outward normal, for example normal = [0, 0, 1]"),
    (tables, {"object": {**field(kind="vibration", force="1 N", frequency="9 Hz"), "normal": [0, 0, 1]}},
     'object: normal belongs to kind = "wall", "textured_wall" and "force_law"'),
    (tables, {"object": {"kind": "field", "field": {"kind": "constant", "force": "1 N"}}},
     'object.stiffness has no meaning for kind = "field" (a field has its own in [object.field])'),
    (tables, {"object": texture()},
     'object.texture.height is missing; write height = "0.1 mm" or lateral_force = "0.2 N"'),
    (tables, {"object": texture(lateral_force="-1 N", height="1 mm")},
     "object.texture: lateral_force must not be negative"),
    (tables, {"object": {**texture(height="1 mm"), "texture": {"wavelength": "2 mm", "across": [0, 0, 2],
     "height": "1 mm"}}},
     "object.texture.across: it must not be along the normal, for example [1, 0, 0]"),
    (tables, {"object": {**texture(height="1 mm"), "texture": {"wavelength": "2 mm", "across": [0, 0, 0],
     "height": "1 mm"}}},
     "object.texture.across: it must not be along the normal, for example [1, 0, 0]"),
    (tables, {"object": {**texture(height="1 mm"), "texture": {"wavelength": "2 mm", "across": [1, 0],
     "height": "1 mm"}}},
     "object.texture.across: [1, 0] is not a list of three plain numbers, such as [0, 0, 1]"),
    (tables, {"object": {**texture(height="1 mm"), "damping": ["1 N*s/m", "2 N*s/m", "1 N*s/m"]}},
     "object: a wall has one damping, along its normal"),
    (tables, {"object": {**texture(height="1 mm"), "stiffness": None}},
     'object.stiffness is missing; write for example stiffness = "3.5 N/mm"'),
    (tables, {"object": {**texture(height="1 mm"), "normal": None}},
     "object: a wall needs its outward normal, for example normal = [0, 0, 1]"),
    (tables, {"object": {**WALL, "stiffness": ["1 N/m", "2 N/m", "1 N/m"]}},
     "object: a wall has one stiffness, along its normal"),
    (tables, {"object": {"stiffness": None}},
     'object.stiffness is missing; write for example stiffness = "3.5 N/mm"'),
    (tables, {"object": {**WALL, "stiffness": None}},
     'object.stiffness is missing; write for example stiffness = "3.5 N/mm"'),
    (tables, {"object": {"mesh": MESH["mesh"]}},
     'object: mesh belongs to kind = "mesh"'),
    (tables, {"object": {"surface": {"stiffness": "1 N/mm"}}},
     'object: surface belongs to kind = "mesh"'),
    (tables, {"object": {"body": {"shape": "phantom", "radius": "1 mm"}}},
     'object: body belongs to kind = "body"'),
    (tables, {"object": {"law": {"formula": "x", "deepest": "1 mm"}}},
     'object: law belongs to kind = "force_law"'),
    (tables, {"object": {"field": {"kind": "constant", "force": "1 N"}}},
     'object: field belongs to kind = "field"'),
    (tables, {"object": {"texture": {"wavelength": "2 mm", "across": [1, 0, 0], "height": "1 mm"}}},
     'object: texture belongs to kind = "textured_wall"'),
    (tables, {"object": {"kind": "mesh", "stiffness": None, "surface": {"stiffness": "1 N/mm"}}},
     'object.mesh is missing; write a table [object.mesh] with for example shape = "box"'),
    (tables, {"object": MESH},
     'object.surface is missing; write a table [object.surface] with for example stiffness = "1 N/mm"'),
    (tables, {"object": {**mesh(), "damping": "1 N*s/m"}},
     'object.damping has no meaning for kind = "mesh" (a mesh has its own in [object.surface])'),
    (tables, {"object": {**mesh(), "coupling": "backward"}},
     'object.coupling has no meaning for kind = "mesh"'),
    (tables, {"object": {**body(kind="signed_distance", contact_points=["1 mm"]), "frame": {"rotation": [["0 s",
     "0 deg", "0 deg", "0 deg"], ["1 s", "1 deg", "0 deg", "0 deg"]]}}},
     "object.body.contact_points: a tool does not go with a body that turns; remove frame.rotation"),
    (tables, {"object": {"kind": "none", "stiffness": None, "position": "1 mm"}},
     'object.position has no meaning for kind = "none"'),
    (tables, {"objects": {"a": {"stiffness": "1 N/mm"}}},
     "object: with [objects.NAME] tables there is no [object]; give it a name among them"),
    (tables, {"object": None, "objects": {}},
     "objects: 0 tables [objects.NAME]; a scene has 1 to 64"),
    (tables, {"object": None, "objects": {"2a": {"stiffness": "1 N/mm"}}},
     'objects: "2a" cannot name an object, as its channels are NAME_force and so on: take letters, '
     "digits and underscores, and none of object, command, motor, reference, operator, frame"),
    (tables, {"object": None, "objects": {"object": {"stiffness": "1 N/mm"}}},
     'objects: "object" cannot name an object, as its channels are NAME_force and so on: take '
     "letters, digits and underscores, and none of object, command, motor, reference, operator, frame"),
    (tables, {"object": None, "objects": {"a"*33: {"stiffness": "1 N/mm"}}},
     'objects: "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa" cannot name an object, as its channels are '
     "NAME_force and so on: take letters, digits and underscores, and none of object, command, motor,"
     " reference, operator, frame"),
    (tables, {"object": None, "objects": {"a": {"kind": "none"}}},
     'objects: the object a has kind = "none"; remove its table'),
    (tables, {"object": None, "objects": {"a": {"stiffness": "1 N"}}},
     'objects.a.stiffness: "1 N" is a force [N]; a stiffness is needed, for example "3.5 N/mm"'),
    (tables, {"object": None, "objects": {"a": {"stifness": "1 N/mm"}}},
     'unknown key "stifness" in [objects.a]; did you mean stiffness?'),
    (tables, {"object": None, "objects": {"a": {"kind": "mesh", "mesh": {"shap": "box"},
     "surface": {"stiffness": "1 N/mm"}}}},
     'unknown key "shap" in [objects.a.mesh]; did you mean shape?'),
    (tables, {"object": None, "objects": {f"a{k}": {"stiffness": "1 N/mm"} for k in range(65)}},
     "objects: 65 tables [objects.NAME]; a scene has 1 to 64"),
    (tables, {"object": {"frame": {}}},
     'object.frame.displacement is missing; write for example displacement = [["0 s", "0 mm", "0 mm",'
     ' "0 mm"], ["1 s", "0 mm", "0 mm", "5 mm"]]'),
    (tables, {"object": {"frame": {"displacement": [["0 s", "0 mm", "0 mm", "0 mm"]]}}},
     'object.frame.displacement: a table needs at least two rows such as ["0.1 s", "1 mm", "0 mm", "0'
     ' mm"]'),
    (tables, {"object": {"frame": {"rotation": [["0 s", "0 mm", "0 mm", "0 mm"], ["1 s", "0 mm", "0 mm", "0 mm"]]}}},
     'object.frame.rotation: "0 mm" is a length [m]; an angle is needed, for example "30 deg"'),
    (tables, {"object": mesh(stiffness=["1 N/mm", "2 N/mm"])},
     'object.surface.pattern is missing: several values need one, for example pattern = "stripes"'),
    (tables, {"object": mesh(stiffness=[])},
     'object.surface.stiffness: there must be at least one value, such as "1 N/mm"'),
    (tables, {"object": mesh(stiffness=["1 N/mm", "2 N/mm"], pattern="stripes")},
     'object.surface.width is missing: the width of a field of the pattern, for example width = "10 '
     'mm"'),
    (tables, {"object": mesh(stiffness=["1 N/mm", "2 N/mm"], pattern="listed", width="1 mm")},
     "object.surface.width: belongs to a pattern of stripes or a checkerboard"),
    (tables, {"object": mesh(width="1 mm")},
     "object.surface.width: belongs to a pattern of stripes or a checkerboard"),
    (tables, {"object": mesh(static_friction=0.1, dynamic_friction=0.2)},
     "object.surface.dynamic_friction: 0.2 must not exceed static_friction (0.1)"),
    (tables, {"object": mesh(shading="85.1 deg")},
     "object.surface.shading: 85.1 deg; it must be at most 85 deg"),
    (tables, {"object": {**mesh(), "mesh": {"shape": "bumpy_ellipsoid", "size": "9 mm", "bump": 1.0, "divisions": 2}}},
     "object.mesh.bump: 1; it must be at least 0 and below 1"),
    (tables, {"object": {**mesh(), "surface": {}}},
     'object.surface.stiffness is missing; write for example stiffness = "1 N/mm"'),
    (tables, {"controller": {"kind": "workspace", "normalize": "1 N/mm"}},
     "controller.normalize: a workspace controller divides by the stiffness in any case; leave it out"),
    (tables, {"controller": {"kind": "none", "normalize": True}},
     'controller.normalize: kind = "none" has no design stiffness; write it, for example normalize = '
     '"1 N/mm"'),
    (tables, {"controller": {"kind": "lqg", "normalize": "0 N/mm"}},
     'controller.normalize: "0 N/mm" must be positive'),
    (tables, {"controller": {"kind": "none", "gain": 2.0}},
     'controller: gain belongs to kind = "gain"'),
    (tables, {"controller": {"kind": "gain", "gain": [1.0, 2.0]}},
     "controller.gain: [1.0, 2.0] is not a list of three plain numbers, such as [0, 0, 1]"),
    (tables, {"controller": {"kind": "none", "antiwindup": [[1.0]]}},
     'controller: A, B, C, D and antiwindup belong to kind = "state_space"'),
    (tables, {"controller": {"kind": "gain", "gain": 1.0, "D": [[1.0]]}},
     'controller: A, B, C, D and antiwindup belong to kind = "state_space"'),
    (tables, {"controller": ss(C=None)},
     "controller.C is missing: a state space needs A, B, C and D"),
    (tables, {"controller": ss(A=[[0.5, 0.5]])},
     "controller: A is 1 x 2; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 1 x "
     "1"),
    (tables, {"controller": ss(B=[[0.0] * 5])},
     "controller: B is 1 x 5; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 1 x "
     "6"),
    (tables, {"controller": ss(C=[[1.0]] * 2)},
     "controller: C is 2 x 1; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 3 x "
     "1"),
    (tables, {"controller": ss(D=[[0.0] * 5] * 3)},
     "controller: D is 3 x 5; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 3 x "
     "6"),
    (tables, {"controller": ss(D=[[0.0] * 6] * 4)},
     "controller: D is 4 x 6; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 3 x "
     "6"),
    (tables, {"controller": ss(A=[], B=[], C=[[], [], []], D=[[0.0] * 6] * 2)},
     "controller: D is 2 x 6; with 0 states, 6 inputs [F_ref; F_object] and 3 outputs it must be 3 x "
     "6"),
    (tables, {"controller": ss(antiwindup=[[0.0] * 2])},
     "controller: antiwindup is 1 x 2; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it "
     "must be 1 x 3"),
    (tables, {"controller": ss(antiwindup=[[0.0] * 3] * 2)},
     "controller: antiwindup is 2 x 3; with 1 states, 6 inputs [F_ref; F_object] and 3 outputs it "
     "must be 1 x 3"),
    (tables, {"controller": ss(A=3)},
     "controller.A: a matrix is a list of rows of plain numbers, such as [[1.0, 0.0], [0.0, 1.0]]"),
    (tables, {"controller": ss(A=[3])},
     "controller.A: a matrix is a list of rows of plain numbers, such as [[1.0, 0.0], [0.0, 1.0]]"),
    (tables, {"controller": {"kind": "lqg", "options": 3}},
     "controller: options must be a table"),
    (tables, {"controller": {"kind": "lqg", "xyzzy": 3}},
     'unknown key "xyzzy" in [controller]; lqg takes stiffness, integrators, force_weight, '
     "speed_weight, integral_rate, disturbance, noise, windup_time"),
    (tables, {"controller": {"kind": "lqg", "integrators": 1}},
     "controller.integrators: 1 is neither true nor false"),
    (tables, {"controller": {"kind": "lqg", "speed_weight": ["1 s", "1 s", "1 s"]}},
     "controller.speed_weight: ['1 s', '1 s', '1 s'] is not a quantity; write for example \"0.5 ms\""),
    (tables, {"controller": {"kind": "lqg", "noise": ["1 N", "1 N"]}},
     "controller.noise: 2 values where 3 are needed, or one value for all axes"),
    (tables, {"controller": {"kind": "workspace", "operator_mass": "1 m"}},
     'controller.operator_mass: "1 m" is a length [m]; a mass is needed, for example "0.15 kg"'),
    (tables, {"controller": {"kind": "gain", "gain": 1.0, "stiffness": "1 N/mm"}},
     'unknown key "stiffness" in [controller]; there are kind, gain, A, B, C, D, antiwindup, '
     "normalize"),
    (display, {"servo": {"topology": "impedance_display", "tool": {"mass": "1 kg", "damping": "1 N*s/m"}}},
     "servo.tool: only an admittance_display has a virtual tool; remove it, or write servo.topology ="
     ' "admittance_display"'),
    (display, {"servo": {"topology": "admittance_display"}, "controller": {"kind": "workspace"}, **PRESS},
     'servo.tool is missing: the operator moves a tool; write [servo.tool] with mass = "0.1 kg" and '
     'damping = "1 N*s/m", for example'),
    (display, adm(controller={"kind": "none"}),
     'controller.kind: the tip of an admittance_display follows the tool by the "workspace" '
     'controller; write it in place of "none"'),
    (display, adm(controller={"share": 0.5}),
     "controller.share: the tool is the reference model of an admittance_display, so it has no "
     "meaning; remove it"),
    (display, adm(operator={"kind": "fixed", "force": None}),
     "operator.kind: the force of the operator moves the tool of an admittance_display; write kind = "
     '"force" or "arm", not "fixed"'),
    (display, adm(operator={"kind": "none", "force": None}),
     "operator.kind: the force of the operator moves the tool of an admittance_display; write kind = "
     '"force" or "arm", not "none"'),
    (display, adm(servo={"tool": {"mass": "0 kg", "damping": "1 N*s/m"}}),
     "servo.tool.mass: 0 kg; it must be positive"),
    (display, adm(servo={"tool": {"mass": "1 kg"}}),
     "servo.tool.damping is missing"),
    (display, {"guard": [{"kind": "half_sample"}]},
     'guard: a loop has one guard, and several are given: keep one, for example kind = "energy_bound"'),
    (display, {"guard": {"kind": ["half_sample"]}},
     "guard.kind: a loop has one guard, and several are given: keep one, for example kind = "
     '"energy_bound"'),
    (display, {"guard": {"kind": "half_sample", "cap": 0.5}},
     'guard.cap has no meaning for kind = "half_sample"'),
    (display, {"guard": {"cap": 0.5}},
     'guard.cap has no meaning for kind = "none"'),
    (display, {"guard": {"kind": "half_sample", "observer": "1 rad/s"}},
     'guard: observer belongs to velocity = "observer"'),
    (display, {"guard": {"kind": "energy_bound", "viscous": 0}},
     "guard.viscous: 0; it must be above 0 and at most 1"),
    (display, {"guard": {"kind": "energy_bound", "viscous": 1.1}},
     "guard.viscous: 1.1; it must be above 0 and at most 1"),
    (display, {"guard": {"kind": "energy_bound", "coulomb": 1.1}},
     "guard.coulomb: 1.1; it must be between 0 and 1"),
    (display, {"guard": {"kind": "passivity_controller", "cap": 0}},
     "guard.cap: 0; it must be above 0 and at most 1"),
    (display, {"guard": {"kind": "half_sample", "horizon": 100.5}},
     "guard.horizon: 100.5 servo periods; it must be between 0 and 100"),
    (display, {"guard": {"kind": "sample_estimate_hold", "correction": 1.01}},
     "guard.correction: 1.01; it must be between 0 and 1"),
    (tables, {"guard": {"kind": "half_sample"}},
     "guard.kind: in force_tracking the motors supply energy by design, so there is nothing to guard;"
     ' remove [guard], or write servo.topology = "impedance_display"'),
    (display, adm(guard={"kind": "half_sample"}),
     "guard.kind: a guard bounds the force that the motors hold on an object, and the motors of an "
     "admittance_display position the tip; remove [guard]"),
    (display, {"device": {"model": "experimental"}, "guard": {"kind": "half_sample"}},
     'guard.kind: inertia and friction of the "experimental" model are not known; write device.model '
     '= "nonlinear"'),
    (display, {"device": {"model": "linear"}, "guard": {"kind": "energy_bound"}},
     'guard.kind: an energy bound relies on dry friction, which the "linear" model does not have; '
     'write device.model = "nonlinear"'),
    (display, {"device": {"delay": 2}, "guard": {"kind": "half_sample", "deadbeat": True}},
     "guard.deadbeat: the two forces must act at once, and the device has a delay of 2 servo "
     "period(s); leave deadbeat out, or write device.delay = 0"),
    (display, {"device": {"delay": 1}, "guard": {"kind": "half_sample", "deadbeat": True}},
     "guard.deadbeat: the two forces must act at once, and the device has a delay of 1 servo "
     "period(s); leave deadbeat out, or write device.delay = 0"),
    (tables, {"reference": {"shape": "ramp"}},
     "reference: a ramp needs rise"),
    (tables, {"reference": {"shape": "sine"}},
     "reference: a sine needs frequency"),
    (tables, {"reference": {"shape": "table", "force": None}},
     "reference: a table needs table"),
    (tables, {"reference": {"rise": "1 s"}},
     'reference: rise belongs to shape = "ramp", not to "step"'),
    (tables, {"reference": {"table": [["0 s", "1 N", "0 N", "0 N"], ["1 s", "1 N", "0 N", "0 N"]]}},
     'reference: table belongs to shape = "table", not to "step"'),
    (tables, {"reference": {"shape": "table", "table": [["0 s", "1 N", "0 N", "0 N"], ["1 s", "1 N", "0 N", "0 N"]]}},
     "reference: a table carries its own forces; leave force out"),
    (tables, {"reference": {"shape": "table", "force": None, "table": [["0 s", "1 N", "0 N", "0 N"], ["1 s",
     "1 N", "0 N"]]}},
     'reference.table: row 2 must be a time and three forces, ["0.1 s", "1 N", "0 N", "0 N"]'),
    (tables, {"reference": {"shape": "table", "force": None, "table": [["0 s", "1 N", "0 N", "0 N"], 3]}},
     'reference.table: row 2 must be a time and three forces, ["0.1 s", "1 N", "0 N", "0 N"]'),
    (tables, {"reference": {"shape": "table", "force": None, "table": "x"}},
     'reference.table: a table needs at least two rows such as ["0.1 s", "1 N", "0 N", "0 N"]'),
    (tables, {"reference": {"shape": "table", "force": None, "table": [["0 s", "1 N", "0 N", "0 N"], ["0 s",
     "1 N", "0 N", "0 N"]]}},
     "reference.table: the time of row 2 (0 s) is not after that of the row before"),
    (tables, {"reference": {"start": "1 s", "stop": "1 s"}},
     "reference: stop must be after start"),
    (display, {"operator": {"kind": "none", "force": "1 N"}},
     'operator.force has no meaning for kind = "none"'),
    (display, {"operator": {"kind": "none", "rest": "1 mm"}},
     'operator.rest has no meaning for kind = "none"'),
    (display, {"operator": {"kind": "force", "force": "1 N", "rest": "1 mm", "mass": "1 kg"}},
     'operator: mass belongs to kind = "arm"'),
    (display, {"operator": {**ARM, "shape": "sine"}},
     "operator: a sine needs frequency"),
    (display, {"operator": {**ARM, "mass": None}},
     "operator.mass is missing: an arm has mass, damping and stiffness"),
    (display, {"operator": {**ARM, "stiffness": None}},
     "operator.stiffness is missing: an arm has mass, damping and stiffness"),
    (display, {"operator": {**ARM, "mass": "0 kg", "tissue_stiffness": "1 N/m"}},
     "operator: mass must be positive for an arm behind fingertip tissue"),
    (tables, {"device": {"name": "slider", "model": "experimental"}, "start": None},
     'device.model: "experimental" is the identified model of a device, and slider has none; use '
     '"nonlinear" or "linear"'),
    (tables, {"device": {"model": "linear"}, "controller": {"kind": "workspace"}},
     'controller.kind: "workspace" knows the mechanism itself; leave out device.model and '
     "device.kinematics"),
    (tables, {"device": {"kinematics": "linear"}, "controller": {"kind": "workspace"}},
     'controller.kind: "workspace" knows the mechanism itself; leave out device.model and '
     "device.kinematics"),
    (display, {"controller": {"kind": "workspace"}},
     'controller.kind: "workspace" tracks a force; write servo.topology = "force_tracking", or take '
     "another"),
    (tables, {"servo": {"jitter": "0.5 ms"}},
     "servo.jitter: a tick may come late by less than a servo period (0.0005 s), not by 0.0005 s"),
    (tables, {"servo": {"jitter": "0.1 ms"}, "device": {"model": "linear"}},
     'servo.jitter: a sampled model knows no time between ticks; write device.model = "nonlinear", '
     'not "linear"'),
    (tables, {"run": {"duration": "0.4 ms"}},
     "run.duration: shorter than one servo period"),
    (tables, {"run": {"duration": "10001 s", "record_every": 10}},
     "run.duration: more than 20 million servo periods; that would not fit in memory"),
    (tables, {"run": {"duration": "2501 s"}},
     "run.duration: more than 5 million samples; raise run.record_every"),
    (tables, {"run": {"substeps": 10001}},
     "run.substeps: 10001; it must be between 1 and 10000"),
    (tables, {"run": {"record_every": 0}},
     "run.record_every: 0; it must be between 1 and 10000"),
    (tables, {"run": {"seed": 2**53 + 1}},
     "run.seed: 9007199254740993; it must be between 0 and 2^53"),
    (tables, {"device": {"delay": -1}},
     "device.delay: -1 servo periods; it must be between 0 and 64"),
    (tables, {"device": {"delay": True}},
     "device.delay: True is not a whole number; write it bare, for example 2"),
    (tables, {"start": {"pose": ["1 rad"] * 2}},
     "start.pose: 2 values, but phantom-premium-1.5a has 3 joints"),
    (tables, {"start": {"pose": []}},
     'start.pose: a pose has one value per joint, ["0 rad", "2.2305 rad", "3.2776 rad"] or ["0 mm"]'),
    (tables, {"start": {"pose": ["1 rad", "1 N", "1 rad"]}},
     'start.pose: "1 N" is a force [N]; an angle is needed, for example "30 deg"'),
    (tables, {"start": {"pose": ["1 mm"] * 3}},
     "start.pose: the joints of phantom-premium-1.5a take angles, such as 2.2305 rad"),
    (tables, {"device": {"name": "slider"}, "start": {"pose": ["1 rad"]}},
     "start.pose: the joints of slider take lengths, such as 5 mm"),
    (tables, {"start": {"pose": None, "tip": "1 m"}},
     "start.tip: the tip cannot be at [1000., 1000., 1000.] mm: 1779.1 mm from the shoulder, and the "
     "arm reaches 385.0 mm"),
    (tables, {"operator": {"kind": "force", "force": "1 N"}},
     "operator: a force_tracking loop takes the operator's force as [reference]; remove [operator], "
     'hold the stylus in a hand with kind = "arm", or write servo.topology = "impedance_display"'),
    (display, adm(reference={"force": "1 N"}),
     "reference: an admittance_display has no reference force; the operator pushes: write [operator] "
     'kind = "force" or "arm" instead'),
    (tables, {"object": {"stiffness": {}}},
     'object.stiffness: {} is not a quantity; write for example "3.5 N/mm"'),
    (tables, {"object": {"normal": [1, 2]}, },
     "object.normal: [1, 2] is not a list of three plain numbers, such as [0, 0, 1]"),
    (tables, {"description": ["x"]},
     "description: ['x'] must be text in quotation marks"),
    (tables, {"controler": {"kind": "none"}},
     'unknown key "controler" in the scenario; did you mean controller?'),
    (tables, {"xyzzy": {"kind": "none"}},
     'unknown key "xyzzy" in the scenario; there are title, description, device, start, servo, '
     "reference, operator, object, objects, controller, guard, run"),
    (tables, {"device": {"name": None, "nam": "slider"}},
     'unknown key "nam" in [device]; did you mean name?'),
    (tables, {"run": "x"},
     "run must be a table, written [run]"),
    (tables, {"run": {"duratoin": "1 s"}},
     'unknown key "duratoin" in [run]; did you mean duration?'),
    (tables, {"servo": {"topology": "impedence_display"}},
     'servo.topology: "impedence_display" is not one of force_tracking, impedance_display, '
     "admittance_display; did you mean impedance_display?"),
    (tables, {"servo": {"topology": "xyzzy"}},
     'servo.topology: "xyzzy" is not one of force_tracking, impedance_display, admittance_display'),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "changes", "says"), REFUSED, ids=range(len(REFUSED)))
def test_a_combination_that_makes_no_experiment_is_refused_with_this_sentence(
    kind: Callable[..., dict[str, Any]], changes: dict[str, Any], says: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(kind(**changes))
    assert str(caught.value) == f"scenario: {says}"


ACCEPTED: list[tuple[Callable[..., dict[str, Any]], dict[str, Any], Callable[[Scenario], Any], Any]] = [
    (tables, {"object": body(update_interval="2 ms", static_friction=0.2, dynamic_friction=0.2)},
     lambda s: s.object.body.options, {"update_interval": 2e-3, "static_friction": 0.2, "dynamic_friction": 0.2}),
    (tables, {"object": body(options={"update_interval": "2 ms"}, static_friction=0.1)},
     lambda s: s.object.body.options, {"update_interval": 2e-3, "static_friction": 0.1}),
    (tables, {"object": body(kind="modal", instantaneous_ratio=1, rayleigh_beta="3 ms", rayleigh_alpha="2 1/s")},
     lambda s: s.object.body.options, {"instantaneous_ratio": 1.0, "rayleigh_beta": 3e-3, "rayleigh_alpha": 2.0}),
    (tables, {"object": body(kind="corotational", nodes_per_tip=4, density="1 g/cm^3", rayleigh_beta="1 ms")},
     lambda s: s.object.body.options, {"nodes_per_tip": 4.0, "density": 1000.0, "rayleigh_beta": 1e-3}),
    (tables, {"object": body(kind="neo-hookean", nodes_per_tip=64, rayleigh_alpha="0 1/s")},
     lambda s: s.object.body.options, {"nodes_per_tip": 64.0, "rayleigh_alpha": 0.0}),
    (tables, {"object": body(kind="mass_spring", exponent=0.5, stiffness_limit=100, hardening_strain=0.1)},
     lambda s: s.object.body.options, {"exponent": 0.5, "stiffness_limit": 100.0, "hardening_strain": 0.1}),
    (tables, {"object": body(kind="modal", contact="signed_distance", contact_points=["1 mm", "2 mm"])},
     lambda s: s.object.body.contact_points, ((1e-3,) * 3, (2e-3,) * 3)),
    (tables, {"object": body(kind="signed_distance", supports=[{"at": "0 s", "held": "x < 1 mm"}])},
     lambda s: [(one.at, one.held, one.touchable) for one in s.object.body.supports], [(0.0, ("x < 1 mm",), None)]),
    (tables, {"object": body(supports=[{"at": "1 s", "held": []}, {"at": "2 s", "touchable": ["a", "b"]}])},
     lambda s: [(one.at, one.held, one.touchable) for one in s.object.body.supports],
     [(1.0, (), None), (2.0, None, ("a", "b"))]),
    (tables, {"object": body(held="x < 1 mm", modes=0, poisson=0.49, layer_thickness="0 mm")},
     lambda s: (s.object.body.held, s.object.body.modes, s.object.body.poisson, s.object.body.layer_thickness),
     (("x < 1 mm",), 0, 0.49, 0.0)),
    (tables, {"object": law(formula="500 * x", deepest="2 mm", entries=3)},
     lambda s: [column.tolist() for column in s.object.law.table()], [[0.0, 1e-3, 2e-3], [0.0, 0.5, 1.0]]),
    (tables, {"object": law(formula="500 * x", deepest="2 mm", entries=2)}, lambda s: len(s.object.law.table()[0]), 2),
    (tables, {"object": law(formula="500 * x", deepest="2 mm")}, lambda s: len(s.object.law.table()[0]), 1001),
    (tables, {"object": law(depth=["0 mm", "1 mm"], force=["0 N", "3 N"])},
     lambda s: [column.tolist() for column in s.object.law.table()], [[0.0, 1e-3], [0.0, 3.0]]),
    (tables, {"object": field(kind="gravity_well", stiffness="0.1 N/m", radius="1 mm")},
     lambda s: s.object.field.cap, np.inf),
    (tables, {"object": field(kind="gravity_well", stiffness="1 N/m", radius="1 mm", largest_force="0.5 N")},
     lambda s: s.object.field.cap, 0.5),
    (tables, {"object": field(kind="vibration", force="1 N", frequency="9 Hz", decay="1 s")},
     lambda s: (s.object.field.decay, s.object.field.at_contact), (1.0, False)),
    (tables, {"object": {**field(kind="vibration", force="1 N", frequency="9 Hz", at_contact=True),
                         "normal": [0, 0, 2]}},
     lambda s: s.object.normal, (0.0, 0.0, 1.0)),
    (tables, {"object": field(kind="virtual_mass", stiffness="500 N/m", mass="0.5 kg", coupling_damping="1 N*s/m")},
     lambda s: (s.object.field.mass, s.object.field.coupling_damping), (0.5, 1.0)),
    (tables, {"object": {**texture(height="0.1 mm"), "damping": "2 N*s/m"}},
     lambda s: (s.object.texture.height, s.object.texture.lateral_force, s.object.damping), (1e-4, 0.0, (2.0,) * 3)),
    (tables, {"object": texture(lateral_force="0.5 N")}, lambda s: s.object.texture.lateral_force, 0.5),
    (tables, {"object": {**WALL, "damping": ["1 N*s/m", "2 N*s/m", "3 N*s/m"]}},
     lambda s: s.object.damping, (1.0, 2.0, 3.0)),
    (tables, {"object": None, "objects": {"a" * 32: {"stiffness": "1 N/mm"}, "B_2": {**WALL, "stiffness": "2 N/m"}}},
     lambda s: (list(s.each_object), s.contact_kind, s.object.kind), (["a" * 32, "B_2"], "scene", "none")),
    (tables, {"object": None, "objects": {f"a{k}": {"stiffness": "1 N/mm"} for k in range(64)}},
     lambda s: len(s.objects), 64),
    (tables, {"object": mesh(stiffness=["1 N/mm", "2 N/mm"], pattern="stripes", width="1 mm", shading="85 deg")},
     lambda s: (s.object.surface.stiffness, s.object.surface.width), ((1000.0, 2000.0), 1e-3)),
    (tables, {"object": mesh(static_friction=0.2, dynamic_friction=0.2)},
     lambda s: s.object.surface.dynamic_friction, 0.2),
    (tables, {"controller": ss(antiwindup=[[0.1] * 3])}, lambda s: s.controller.antiwindup, ((0.1, 0.1, 0.1),)),
    (tables, {"controller": ss(A=[], B=[], C=[[], [], []])}, lambda s: s.controller.D, ((0.0,) * 6,) * 3),
    (tables, {"controller": {"kind": "gain", "gain": 2}}, lambda s: s.controller.gain, (2.0,) * 3),
    (tables, {"controller": {"kind": "gain", "gain": [1, 2, 3], "normalize": "1 N/mm"}},
     lambda s: (s.controller.gain, s.controller.normalize, s.controller.normalizes),
     ((1.0, 2.0, 3.0), (1e3,) * 3, True)),
    (tables, {"controller": {"kind": "lqg", "normalize": True}}, lambda s: s.controller.normalizes, True),
    (tables, {"controller": {"kind": "lqg"}}, lambda s: s.controller.normalizes, False),
    (tables, {"controller": {"kind": "workspace", "operator_mass": "100 g", "normal_only": True}},
     lambda s: (s.controller.normalizes, s.controller.options), (True, {"operator_mass": 0.1, "normal_only": True})),
    (tables, {"controller": {"kind": "lqg", "options": {"noise": "1 mN"}, "stiffness": ["1 N/m", "2 N/m", "3 N/m"]}},
     lambda s: s.controller.options, {"noise": 1e-3, "stiffness": (1.0, 2.0, 3.0)}),
    (display, adm(controller={"bandwidth": "9 rad/s"}), lambda s: s.controller.options, {"bandwidth": 9.0}),
    (display, adm(operator={**ARM, "force": None}), lambda s: (s.operator.moves, s.servo.tool.mass), (False, 0.1)),
    (display, {"guard": {"kind": "energy_bound", "viscous": 1, "coulomb": 0}},
     lambda s: (s.guard.viscous, s.guard.coulomb), (1.0, 0.0)),
    (display, {"guard": {"kind": "half_sample", "velocity": "observer", "observer": "1 rad/s", "horizon": 100}},
     lambda s: (s.guard.observer, s.guard.horizon, s.guard.deadbeat), (1.0, 100.0, False)),
    (display, {"device": {"model": "linear"}, "guard": {"kind": "half_sample", "deadbeat": True}},
     lambda s: s.guard.deadbeat, True),
    (display, {"device": {"delay": 2}, "guard": {"kind": "half_sample"}}, lambda s: s.guard.horizon, 0.5),
    (display, {"guard": {"kind": "passivity_controller", "cap": 1}}, lambda s: s.guard.cap, 1.0),
    (display, {"guard": {"kind": "sample_estimate_hold", "correction": 0}}, lambda s: s.guard.correction, 0.0),
    (tables, {"servo": {"jitter": "0.499 ms"}}, lambda s: s.servo.jitter, 0.499e-3),
    (tables, {"run": {"duration": "0.5 ms"}}, lambda s: s.run.duration, 0.5e-3),
    (tables, {"run": {"duration": "10000 s", "record_every": 4}}, lambda s: s.run.record_every, 4),
    (tables, {"run": {"duration": "2500 s", "substeps": 10000, "seed": 2**53}},
     lambda s: (s.run.seed, s.run.substeps, s.run.record_every), (2**53, 10000, 1)),
    (tables, {"run": {"record_every": 10000, "substeps": 1, "seed": 0}}, lambda s: s.run.record_every, 10000),
    (tables, {"run": None}, lambda s: (s.run.duration, s.run.substeps, s.run.seed), (1.0, 2, 0)),
    (tables, {"device": {"delay": 64}}, lambda s: s.device.delay, 64),
    (tables, {"device": {"delay": 0}}, lambda s: (s.title, s.source), ("Untitled scenario", "")),
    (display, {"operator": {**ARM, "mass": "0 kg", "rest": "1 mm"}}, lambda s: s.operator.rest, (1e-3,) * 3),
    (display, {"operator": {**ARM, "tissue_stiffness": "1 N/m", "tissue_damping": "0 N*s/m"}},
     lambda s: (s.operator.tissue_stiffness, s.operator.moves), (1.0, False)),
    (display, {"operator": {**ARM, "force": "1 N"}}, lambda s: s.operator.moves, True),
    (tables, {"reference": {"start": "0.5 s", "stop": "0.6 s"}}, lambda s: s.reference.stop, 0.6),
    (tables, {"object": {"frame": {"rotation": [["0 s", "0 deg", "0 deg", "0 deg"],
                                                ["2 s", "0 deg", "0 deg", "180 deg"]]}}},
     lambda s: (s.object.frame.rows().tolist(), s.contact_kind),
     ([[0.0] * 7, [2.0, *[0.0] * 5, np.pi]], "moving")),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "changes", "read", "expected"), ACCEPTED, ids=range(len(ACCEPTED)))
def test_what_is_just_right_is_read_in_si_and_survives_the_way_to_text(
    kind: Callable[..., dict[str, Any]], changes: dict[str, Any], read: Callable[[Scenario], Any], expected: Any
) -> None:
    scenario = Scenario.from_dict(kind(**changes))
    assert read(scenario) == expected
    again = Scenario.from_dict(scenario.to_dict())
    assert again == scenario
    assert read(again) == expected


def test_a_moving_frame_is_given_at_the_times_of_both_of_its_tables() -> None:
    frame = {
        "displacement": [["0 s", "0 mm", "2 mm", "0 mm"], ["2 s", "4 mm", "0 mm", "-8 mm"]],
        "rotation": [["1 s", "0 rad", "1 rad", "2 rad"], ["3 s", "4 rad", "0 rad", "0 rad"]],
    }
    rows = Scenario.from_dict(tables(object={"frame": frame})).object.frame
    assert rows is not None
    np.testing.assert_allclose(
        rows.rows(),
        [
            [0.0, 0.0, 2e-3, 0.0, 0.0, 1.0, 2.0],
            [1.0, 2e-3, 1e-3, -4e-3, 0.0, 1.0, 2.0],
            [2.0, 4e-3, 0.0, -8e-3, 2.0, 0.5, 1.0],
            [3.0, 4e-3, 0.0, -8e-3, 4.0, 0.0, 0.0],
        ],
    )


def test_a_texture_varies_along_the_part_of_its_direction_in_the_plane() -> None:
    """Nearly along the normal it still has one, and of unit length."""
    for across, normal, expected in (
        ([3.0, 0.0, 4.0], [0, 0, 1], [1.0, 0.0, 0.0]),
        ([1.0, 1.0, 0.0], [0.6, 0.0, 0.8], np.array([0.64, 1.0, -0.48]) / np.sqrt(1.64)),
        ([2e-6, 0.0, 1.0], [0, 0, 1], [1.0, 0.0, 0.0]),
        ([0.0, -2e-150, 0.0], [0, 0, 1], [0.0, -1.0, 0.0]),
    ):
        given = texture(height="1 mm", across=across)
        found = Scenario.from_dict(tables(object={**given, "normal": normal})).object
        assert found.texture is not None
        assert found.normal is not None
        np.testing.assert_allclose(found.texture.direction(found.normal), expected, atol=1e-12)
    with pytest.raises(ScenarioError, match="it must not be along the normal"):
        Scenario.from_dict(tables(object=texture(height="1 mm", across=[0.9e-6, 0.0, 1.0])))


def test_a_signal_begins_and_ends_at_samples_that_rounding_put_just_before() -> None:
    """By a nanosecond; sines begin at zero, and tables are cut as well."""
    for shape, expected in (
        ({"shape": "step"}, [0.0, 2.0, 2.0, 2.0, 0.0, 0.0]),
        ({"shape": "ramp", "rise": "0.5 s"}, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        ({"shape": "sine", "frequency": "1 Hz"}, [0.0, 0.0, 0.0, 2.0, 0.0, 0.0]),
        ({"shape": "table", "force": None, "table": [["0 s", "0 N", "9 N", "0 N"], ["2 s", "4 N", "9 N", "1 N"]]},
         [0.0, 2.0, 2.0, 2.5, 0.0, 0.0]),
    ):  # fmt: skip
        given = {"force": ["2 N", "0 N", "0 N"], **shape, "start": "1 s", "stop": "1.5 s"}
        signal = Scenario.from_dict(tables(reference=given)).reference
        assert signal is not None
        at = [1.0 - 1.5e-9, 1.0 - 0.5e-9, 1.0, 1.25, 1.5 - 0.5e-9, 1.6]
        np.testing.assert_allclose(signal.values(at)[:, 0], expected, atol=1e-7)
        assert signal.values(1.5 - 1.5e-9)[0, 0] > 1.9 or shape["shape"] == "sine"


def test_an_object_of_a_scene_is_named_with_its_table_and_line() -> None:
    text = """
[device]
name = "slider"
[reference]
force = "1 N"
[objects.a]
stiffness = "1 N/mm"
[objects.b]
stiffness = "2 N/mm"
"""
    scenario = Scenario.from_text(text, "it.toml")
    alone = scenario.each_object
    assert [(name, one.object.stiffness[0]) for name, one in alone.items() if one.object.stiffness] == [
        ("a", 1000.0),
        ("b", 2000.0),
    ]
    told = str(alone["b"].mistake("object.stiffness", "no"))
    assert told == "it.toml, line 9: objects.b.stiffness: no"
    assert str(alone["b"].mistake("servo.period", "no")) == "it.toml: servo.period: no"
    assert str(scenario.mistake("object.stiffness", "no")) == "it.toml: object.stiffness: no"
    single = Scenario.from_dict(tables())
    assert single.each_object == {"": single}
    assert str(single.mistake("object.stiffness", "no")) == "object.stiffness: no"
    assert (single.contact_kind, single.source) == ("spring", "")
