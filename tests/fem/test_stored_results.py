"""Bodies, meshes, estimates and presses are as stored: each array and each number."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from fingerprint import fingerprint
from palpate import Mesh, fem
from palpate.fem import Body
from palpate.fem.checks import TipShape
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.contact_accuracy import force_error, node_distance, spacing_for, unresolved
from palpate.fem.mesh_estimate import estimate, surface_samples
from palpate.fem.mesh_improvement import min_angles
from palpate.fem.model_data import model_data
from palpate.fem.modes_cost import fill, groups, modes_cost
from palpate.fem.selectors import parse_selector
from stored import check_stored

STORED = Path(__file__).with_name("stored")
TIPS: dict[TipShape, float] = {"sphere": 7e-3, "flat": 5e-3}


def summary(value: Any) -> Any:
    """Return a result as plain values; an array with more than 6 numbers as its shape and fingerprint."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: summary(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, dict):
        return {str(key): summary(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [summary(entry) for entry in value]
    if isinstance(value, np.ndarray):
        if value.size <= 6:
            return [float(x) for x in value.ravel()]
        return [*value.shape, fingerprint(value.astype(float), smallest=1e-3)]
    return value if value is None or isinstance(value, str | bool | int | float) else str(value)


def mesh(shape: Any) -> Mesh:
    return Mesh(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


def surface(shape: Any) -> ClosedSurface:
    return ClosedSurface(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


def notched() -> Body:
    """Return a block without the cells in one corner of its top, touched on all sides of it."""
    whole = fem.block((0.03, 0.024, 0.018), 0.006)
    middle = whole.points[whole.tetrahedra].mean(axis=1)
    kept = whole.tetrahedra[~((middle[:, 0] < 0.012) & (middle[:, 2] > 0.006))]
    used, cells = np.unique(kept, return_inverse=True)
    volume = replace(whole, points=whole.points[used], tetrahedra=cells.reshape(-1, 4))
    return fem.build(volume, young=8e3, poisson=0.3, fixed="surface z < 0.001 mm", touch="z > 6.1 mm", order=2, modes=4)


def ellipsoid() -> Any:
    ball = trimesh.creation.icosphere(3, 1.0)
    ball.apply_scale((0.03, 0.02, 0.015))
    return ball


def contents(body: Body) -> Any:
    """Return the data of a body; of modes the sum of their squares over the nodes, because their signs are free."""
    found = {one.name: getattr(body.contents, one.name) for one in fields(body.contents) if one.name != "source"}
    for name in ("shapes", "residual_shapes"):
        if found.get(name) is not None and np.size(found[name]):
            shapes = np.reshape(found[name], (len(found[name]), -1)).astype(float)
            found[name] = np.sum(shapes**2, axis=1)
    record = summary(found.pop("record"))
    kept = {key: entry for key, entry in record.items() if key not in ("seconds", "memory_bytes", "operations")}
    return {**summary(found), "record": kept}


@cache
def plain(order: int = 1) -> Body:
    return fem.build(
        fem.block((0.03, 0.024, 0.018), (0.006, 0.008, 0.006)), young="8 kPa", poisson=0.4, density=1100.0, order=order,
        fixed=["z < 0.001 mm", "sphere 0 0 18 radius 7 mm"], touch="box 8 8 17.9 to 30 24 18.1 mm",
        regions="sphere 15 12 9 radius 6 mm = 30 kPa", surface_layer="6 mm = 20 kPa", modes=6,
    )  # fmt: skip


def filled(**options: Any) -> Body:
    given = {"young": "5 kPa", "unit": "m", "fixed": "z < -8 mm", "touch": "z > 3 mm", "order": 1, "spacing": "6 mm"}
    return fem.build(mesh(ellipsoid()), **{**given, **options})


def sphere() -> Body:
    ball = mesh(trimesh.creation.icosphere(2, 0.02))
    return fem.build_boundary(ball, young=5e3, unit="m", fixed="z < -12 mm", order=1)


def network() -> Body:
    """Return a network of springs, one of which has its middle at the origin."""
    cells = fem.block((0.02, 0.02, 0.01), 0.005)
    edges = np.unique(
        np.sort(cells.tetrahedra[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)), axis=0
    )
    top = np.flatnonzero(cells.points[:, 2] > 0.0099)
    middle = cells.points[edges[0]].mean(axis=0)
    return fem.build_springs(
        cells.points - middle, edges, stiffness=np.linspace(20.0, 40.0, len(edges)), masses=1e-4, damping=0.01,
        fixed=cells.points[:, 2] < 1e-6, triangles=top[[[0, 1, 5], [1, 6, 5]]] if len(top) else [],
    )  # fmt: skip


def models(body: Body) -> Any:
    """Return the data from which a program in C++ makes each kind of a body."""
    held = body.with_support_changes([{"at": "10 ms", "held": "x < 12.1 mm"}], "1 ms")
    kinds = [
        body, body.with_friction(0.3), body.signed_distance(), body.signed_distance(static_friction=0.4),
        body.mass_spring("1 ms"), body.hyperelastic("1 ms", density=900.0), held, *remembering(body),
        body.modal("1 ms", update_interval="4 ms"),
    ]  # fmt: skip
    found = [model_data(kind) for kind in kinds]
    for one in found:
        if "shapes" in one.arrays:
            one.arrays["shapes"] = np.sum(one.arrays["shapes"].astype(float) ** 2, axis=1)  # their signs are free
    return summary([one._asdict() for one in found])


def presses(body: Body) -> Any:
    rough = body.signed_distance(static_friction=0.4)
    kinds = [body, body.signed_distance(), body.mass_spring("1 ms")]
    place = np.array([0.018, 0.014, 0.018])
    way = place + np.linspace([0.0, 0.0, 8e-3], [2e-3, -1e-3, 5.5e-3], 60)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pressed = [kind.indent(place, size, 1.2e-3, tip=tip) for kind in kinds for tip, size in TIPS.items()]
        tips = rough.simulate_tips(way[:, None] + [[0.0, 0.0, 0.0], [0.0, -8e-3, 0.3e-3]], [7e-3, 5e-3])
        paths = [kind.simulate_path(way, 7e-3) for kind in (*kinds, rough, *remembering(body))]
    return summary([pressed, list(tips), paths, [body.displacement(), body.pressure(), rough.pressure()]])


def remembering(body: Body) -> list[Body]:
    return [
        body.viscoelastic("1 ms", instantaneous_ratio=2.0, retardation_time="20 ms"),
        body.modal("1 ms", rayleigh_alpha=10.0, rayleigh_beta=1e-3),
        body.modal("1 ms", instantaneous_ratio=1.5, retardation_time="30 ms"),
    ]


def large_press(body: Body) -> Any:
    """Return a press of a hyperelastic body, whose iterations stop at other places in wider registers."""
    kind = body.hyperelastic("1 ms", law="corotational")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return float(np.linalg.norm(kind.indent(np.array([0.018, 0.014, 0.018]), 7e-3, 1.2e-3).force))


def estimates() -> Any:
    of, cost = surface(ellipsoid()), modes_cost(9e3, 300.0, 20, 4e6, 0.2)
    steps = [(h, order) for h in (2e-3, 4e-3) for order in (1, 2)]
    nodes = plain().nodes
    return summary(
        [
            [estimate(of, h, order) for h, order in steps],
            [of.extent, of.area, of.volume, of.thickness, of.shells, of.simple],
            surface_samples(of, 3e-3),
            [fill(x) for x in (1e3, 1e5)], [groups(x, y) for x, y in ((1e3, 50.0), (1e6, 4e3), (3e5, 900.0))],
            [cost.count, cost.memory, cost.seconds],
            [force_error(k, signed_distance=far) for k in range(1, 40, 3) for far in (True, False)],
            node_distance(nodes, nodes[3] + 1e-3),
            [unresolved(nodes, nodes[3], r, "sphere") for r in (1e-3, 2e-2)],
            [spacing_for(r, d, a) for r in (4e-3, 1e-2) for d in (None, 1e-3) for a in (None, 0.05)],
        ]
    )  # fmt: skip


def regions() -> Any:
    points = 0.02 * np.random.default_rng(4).normal(size=(400, 3))
    texts = ("x < 3 mm", "y > -2 mm", "sphere 1 2 3 radius 15 mm", "box -5 -6 -7 to 8 9 10 mm", "surface z < 1 mm")
    return summary([[one.text, one.surface, one.inside(points)] for one in map(parse_selector, texts)])


CASES: dict[str, Callable[[], Any]] = {
    "block-linear": lambda: contents(plain()),
    "block-quadratic": lambda: contents(plain(2)),
    "filled": lambda: contents(filled()),
    "filled-graded": lambda: contents(
        filled(tip_radius="4 mm", touch="sphere 0 0 15 radius 6 mm", growth=0.4, spacing=None)
    ),
    "boundary": lambda: contents(sphere()),
    "boundary-held": lambda: contents(sphere().held("sphere 0 20 0 radius 8 mm")),
    "block-held": lambda: contents(plain().held("sphere 30 24 18 radius 8 mm")),
    "notched": lambda: contents(notched()),
    "network": lambda: contents(network()),
    "models": lambda: models(plain()),
    "presses": lambda: presses(plain()),
    "large-press": lambda: large_press(plain()),
    "estimates": estimates,
    "regions": regions,
    "angles": lambda: summary(min_angles(fem.block((0.03, 0.024, 0.018), (0.006, 0.008, 0.005)).points,
                                         fem.block((0.03, 0.024, 0.018), (0.006, 0.008, 0.005)).tetrahedra)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_as_stored(name: str) -> None:
    """Compliances have single precision."""
    check_stored(STORED / f"{name}.json", CASES[name](), 2e-2 if name == "large-press" else 1e-3)
