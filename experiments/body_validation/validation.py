"""Validation of bodies against converged finite elements, closed forms, and conservation of energy.

It takes minutes, so it is a command, not a test: `python -m experiments.body_validation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from palpate.arrays import Array
from palpate.fem.body import Body
from palpate.fem.builder import build
from palpate.fem.checks import whole
from palpate.fem.material import SurfaceLayer
from palpate.fem.selectors import box, half_space
from palpate.fem.volume import Volume, block, grid
from scipy import sparse
from scipy.sparse.linalg import splu

from experiments.body_validation import indenter as punch
from experiments.body_validation.axisymmetric import LayeredCylinder
from experiments.body_validation.neo_hookean import NeoHookeanCylinder
from experiments.body_validation.passivity import energy_out, small_body

__all__ = [
    "Deviations",
    "flat_end",
    "hertz",
    "hyperelastic_on_skin",
    "lattice_rows",
    "linearized_mass_spring",
    "on_cylinder",
    "on_skin",
    "validate",
]

Progress = Callable[[str, float], None]
Row = dict[str, Any]
_BOTTOM: Final = half_space("z", "<", 1e-9)
_SPACINGS: Final = (punch.SIDE / 20, punch.SIDE / 24, punch.SIDE / 30)  # even counts, so that a node is at the center
_HEIGHT: Final = 0.03  # of the block of `lattice_rows`, m
_REFINED: Final = (4, 6, 9)  # cells under the end in the reference, refined by 1.5


def flat_end(spacing: float, aside: float = 0.0, radius: float = 10e-3) -> float:
    """Return the stiffness, N/m, of a flat end on a body: a block of 100 x 100 x 50 mm, 20 kPa, nu 0.45.

    Args:
        spacing: of the cells, m.
        aside: distance of the end from the center of the block, where a node is, m.
        radius: of the end, m.
    """
    middle, top, half = punch.SIDE / 2, punch.HEIGHT, radius + 2.01 * spacing  # all nodes that can be in contact
    patch = box((middle - half, middle - half, top - 1e-6), (middle + half, middle + half, top + 1e-6))
    planes = np.linspace(0.0, punch.SIDE, round(punch.SIDE / spacing) + 1)
    volume = grid([planes, planes, top - _graded(spacing, 2 * spacing, top)[::-1]], "block")
    body = build(volume, young=punch.YOUNG, poisson=punch.POISSON, fixed=_BOTTOM, touch=patch, memory="16 GB")
    indentation = body.indent([middle + aside, middle + 0.6 * aside, top], radius, 1e-3, tip="flat")
    return float(indentation.force[2] / 1e-3)


def hertz(spacing: float, depth: float = 1.25e-3, radius: float = 20e-3) -> float:
    """Return the force of a sphere on a block of 100 mm over Hertz's 4/3 E* sqrt(R) d^(3/2)."""
    side, young, poisson = 0.1, 10e3, 0.45
    half = _graded(spacing, 7e-3, side / 2)
    planes = np.concatenate([side / 2 - half[:0:-1], side / 2 + half])
    volume = grid([planes, planes, side - _graded(spacing, 5e-3, side)[::-1]], "deep block")
    patch = box((side / 2 - 8e-3, side / 2 - 8e-3, side - 1e-6), (side / 2 + 8e-3, side / 2 + 8e-3, side + 1e-6))
    body = build(volume, young=young, poisson=poisson, fixed=_BOTTOM, touch=patch, memory="16 GB")
    indentation = body.indent([side / 2, side / 2, side], radius, depth)
    return float(indentation.force[2] / (4 / 3 * young / (1 - poisson**2) * np.sqrt(radius) * depth**1.5))


_UNIFORM: Final = LayeredCylinder(10e3, 10e3, 2e-3)
_SKINS: Final = (LayeredCylinder(8e3, 60e3, 1.5e-3), LayeredCylinder(20e3, 5e3, 3e-3))  # others than those fitted
_sphere, _flat_end = cache(LayeredCylinder.sphere), cache(LayeredCylinder.flat_end)  # the same for every spacing
_large_sphere, _large_flat_end = cache(NeoHookeanCylinder.sphere_force), cache(NeoHookeanCylinder.flat_end_force)


def cylinder(spacing: float, radius: float = 30e-3, height: float = 20e-3, skin: float | None = None) -> Volume:
    """Return a cylinder about the z axis: a block whose square sections are mapped to circles. A skin is one cell."""
    count = round(2.0 * radius / spacing)
    size, across = (2.0 * radius, 2.0 * radius, height), 2.0 * radius / count
    square = block(size, (across, across, spacing), layers=() if skin is None else (skin,))
    x, y, z = (square.points - [radius, radius, 0.0]).T
    return Volume(
        np.stack([x * np.sqrt(1.0 - 0.5 * (y / radius) ** 2), y * np.sqrt(1.0 - 0.5 * (x / radius) ** 2), z], axis=1),
        square.tetrahedra,
        "cylinder",
    )


def on_cylinder(spacing: float, positions: int = 10) -> list[Row]:
    """Return rows, as `validate`, of contact by signed distance, mean over positions near the middle.

    The references are axisymmetric elements. The body is a cylinder of 30 mm radius and 20 mm height, bonded below,
    10 kPa, nu 0.45.
    """
    made, at = _pressed_cylinder(spacing, _UNIFORM, positions)
    body, rows = made.signed_distance(), []
    for depth in (0.8e-3, 2e-3, 4e-3):
        mean = np.mean([body.indent(x, 8e-3, depth).force[2] for x in at]) / _sphere(_UNIFORM, 8e-3, depth)
        name = f"contact by signed distance, cells of {1e3 * spacing:g} mm, sphere {1e3 * depth:g} mm deep"
        rows.append(_row(name, float(mean) - 1.0, 0.08))
    for depth in (0.5e-3, 2e-3):
        stiffness = np.mean([body.indent(x, 5e-3, depth, tip="flat").force[2] for x in at]) / depth
        name = f"contact by signed distance, cells of {1e3 * spacing:g} mm, flat punch {1e3 * depth:g} mm deep"
        rows.append(_row(name, float(stiffness) / _flat_end(_UNIFORM, 5e-3) - 1.0, 0.04))
    return rows


def on_skin(spacing: float, positions: int = 10) -> list[Row]:
    """Return rows, as `validate`, of contact by signed distance on a stiff and on a soft skin, one cell thick."""
    rows = []
    for skin in _SKINS:
        made, at = _pressed_cylinder(spacing, skin, positions)
        body, name = (
            made.signed_distance(),
            f"contact by signed distance, cells of {1e3 * spacing:g} mm, {_words(skin)}",
        )
        for depth in (0.75e-3, 1.5e-3, 3e-3):
            mean = np.mean([body.indent(x, 10e-3, depth).force[2] for x in at]) / _sphere(skin, 10e-3, depth)
            rows.append(_row(f"{name}, sphere {1e3 * depth:g} mm deep", float(mean) - 1.0, 0.08))
        stiffness = np.mean([body.indent(x, 6e-3, 1e-3, tip="flat").force[2] for x in at]) / 1e-3
        rows.append(_row(f"{name}, flat punch", float(stiffness) / _flat_end(skin, 6e-3) - 1.0, 0.08))
    return rows


def hyperelastic_on_skin(
    spacing: float, positions: int = 10, depths: Sequence[float] = (0.75e-3, 1.5e-3, 3e-3)
) -> list[Row]:
    """Return rows, as `validate`, of hyperelastic bodies with the same skins, against neo-Hookean elements."""
    rows = []
    for skin in _SKINS:
        made, at = _pressed_cylinder(spacing, skin, positions)
        body, large = made.hyperelastic("1 ms"), NeoHookeanCylinder(skin.young, skin.skin_young, skin.skin)
        name = f"hyperelastic, cells of {1e3 * spacing:g} mm, {_words(skin)}"
        for depth in depths:
            mean = np.mean([body.indent(x, 10e-3, depth).force[2] for x in at]) / _large_sphere(large, 10e-3, depth)
            rows.append(_row(f"{name}, sphere {1e3 * depth:g} mm deep", float(mean) - 1.0, 0.25))
        force = np.mean([body.indent(x, 6e-3, 0.5e-3, tip="flat").force[2] for x in at])
        rows.append(_row(f"{name}, flat punch", float(force) / _large_flat_end(large, 6e-3, 0.5e-3) - 1.0, 0.1))
    return rows


def _words(skin: LayeredCylinder) -> str:
    return f"skin of {1e3 * skin.skin:g} mm of {1e-3 * skin.skin_young:g} kPa on {1e-3 * skin.young:g} kPa"


def _pressed_cylinder(spacing: float, material: LayeredCylinder, positions: int) -> tuple[Body, Array]:
    """Return a body, and points (n, 3) near the middle of its top, m."""
    layered = material.skin_young != material.young
    body = build(
        cylinder(spacing, material.radius, material.height, material.skin if layered else None),
        young=material.young,
        poisson=material.poisson,
        surface_layer=SurfaceLayer(material.skin, material.skin_young) if layered else None,
        fixed=_BOTTOM,
        touch=half_space("z", ">", material.height - 1e-9),
    )
    aside = np.random.default_rng(1).uniform(-3e-3, 3e-3, (positions, 2))
    return body, np.column_stack([aside, np.full(positions, material.height)])


def validate(progress: Progress | None = None, *, paths: int = 10_000) -> list[Row]:
    """Return one row per comparison: "name", "deviation" (a fraction) and "tolerance". Takes minutes.

    Args:
        progress: called with a description and the fraction done.
        paths: number of random closed paths for each model.

    Raises:
        BodyError: `paths` is not a positive whole number.
    """
    whole(paths, "paths", 1)
    report = progress if progress is not None else (lambda _text, _fraction: None)
    report("sphere on a deep block", 0.0)
    rows = [_row("sphere on a deep block, over Hertz", hertz(5e-3 / 3) - 1.0, 0.05)]
    rows += _flat_ends(report)
    report("cylinders, contact by signed distance", 0.55)
    for spacing in (5e-3, 4e-3, 3e-3):
        rows += on_cylinder(spacing) + on_skin(spacing) + hyperelastic_on_skin(spacing)
    rows += lattice_rows(progress=report)
    return rows + _closed_paths(report, paths)


class Deviations(NamedTuple):
    """Deviations of a model from finite elements on a block of 60 x 60 x 30 mm, as fractions."""

    stretch: float  # mean displacement of the top under a uniform normal traction
    shear: float  # mean displacement of the top under a uniform traction along x
    press: float  # force of a flat end of 10 mm radius at a depth of 1 mm
    surface: float  # largest deviation of the displacement of the top under that end, over 1 mm


_TOLERANCES: Final = Deviations(0.05, 0.05, 0.15, 0.1)  # of the mass-spring model


def linearized_mass_spring(body: Body) -> Body:
    """Return a body with the static compliance of its mass-spring model for small displacements."""
    free = np.flatnonzero(np.repeat(~body.contents.dirichlet, 3))
    load = sparse.kron(body.patch_weights, sparse.eye(3), format="csr")[:, free]
    compliance = load @ splu(body.spring_network.matrix[free][:, free].tocsc()).solve(load.T.toarray())
    return Body(replace(body.contents, compliance=compliance.astype(np.float32)))


def lattice_rows(ratios: Sequence[float] = (0.0, 0.3, 0.45, 0.49), *, progress: Progress | None = None) -> list[Row]:
    """Return rows, as `validate`: the mass-spring model over quadratic finite elements.

    Args:
        ratios: Poisson's ratios.
        progress: called with a description and the fraction done.
    """
    rows = []
    for poisson in ratios:
        if progress is not None:
            progress(f"mass-spring model, Poisson's ratio {poisson:g}", 0.62)
        top = half_space("z", ">", _HEIGHT - 1e-9)
        solid = build(block((0.06, 0.06, _HEIGHT), 5e-3), young=5e3, poisson=poisson, fixed=_BOTTOM, touch=top)
        deviations = _deviations(linearized_mass_spring(solid), solid)._asdict()
        for (name, deviation), tolerance in zip(deviations.items(), _TOLERANCES, strict=True):
            text = f"mass_spring, Poisson's ratio {poisson:g}, {name}: over quadratic elements"
            rows.append(_row(text, deviation, tolerance))
    return rows


def _deviations(other: Body, solid: Body) -> Deviations:
    weight = solid.contents.areas / solid.contents.areas.sum()
    means, indentations = [], []
    for body in (other, solid):
        compliance = body.compliance.reshape(len(weight), 3, len(weight), 3).astype(float)
        means.append(np.einsum("i,iajb,j->ab", weight, compliance, weight))
        indentation = body.indent([0.03, 0.03, _HEIGHT], 10e-3, 1e-3, tip="flat")
        indentations.append((indentation.force[2], indentation.displacement))
    (force, moved), (expected_force, expected) = indentations
    ratio = means[0] / np.where(np.eye(3), means[1], 1.0)
    surface = float(np.abs(moved - expected).max() / 1e-3)
    return Deviations(ratio[2, 2] - 1, ratio[0, 0] - 1, force / expected_force - 1, surface)


def _flat_ends(report: Progress) -> list[Row]:
    ends = []
    for i, cells in enumerate(_REFINED):
        report(f"reference of the flat end, {cells} cells under it", 0.05 + 0.1 * i)
        ends.append(punch.stiffness(10e-3, cells))
    limit, order = punch.extrapolate(ends, 1.5)
    steps = ", ".join(f"{end:.4g}" for end in ends)
    rows = [
        _row(
            f"reference of the flat end, {steps} N/m, order {order:.2f}: finest over limit", ends[-1] / limit - 1, 0.01
        )
    ]
    for aside, where in ((0.0, "on"), (0.5, "between")):
        found = []
        for i, spacing in enumerate(_SPACINGS):
            report(f"flat end {where} nodes, cells of {spacing * 1e3:.3g} mm", 0.35 + 0.05 * i + 0.15 * aside)
            found.append(flat_end(spacing, aside * spacing))
            text = f"flat end of 10 mm {where} nodes, cells of {spacing * 1e3:.3g} mm, over {limit:.4g} N/m"
            rows.append(_row(text, found[-1] / limit - 1.0, 0.05))
        rows.append(_row(f"the three {where} nodes: largest less smallest", np.ptp(found) / limit, 0.05))
    for i, radius in enumerate((7e-3, 15e-3)):
        report(f"flat end of {radius * 1e3:g} mm", 0.55 + 0.05 * i)
        coarse, fine = (punch.stiffness(radius, cells) for cells in _REFINED[:2])
        spacing = _SPACINGS[1]
        limit = fine - (coarse - fine) / (1.5**order - 1.0)  # of the same order
        text = f"flat end of {radius * 1e3:g} mm between nodes, cells of {spacing * 1e3:.3g} mm, over {limit:.4g} N/m"
        rows.append(_row(text, flat_end(spacing, spacing / 2, radius) / limit - 1.0, 0.05))
    return rows


def _closed_paths(report: Progress, paths: int) -> list[Row]:
    body, rows = small_body(), []
    kinds: dict[str, Callable[[float], Any]] = {
        "compliance": lambda _period: body,
        "contact by signed distance": lambda _period: body.signed_distance(),
        "modal": body.modal,
        "a standard linear solid": lambda period: body.viscoelastic(
            period, instantaneous_ratio=2.5, retardation_time="0.1 s"
        ),
    }
    for i, (name, kind) in enumerate(kinds.items()):
        text, begin = f"{paths} random closed paths on {name}", 0.65 + 0.0875 * i

        def report_part(part: float, text: str = text, begin: float = begin) -> None:
            report(text, begin + 0.0875 * part)

        energy = energy_out(
            kind, paths, piecewise_constant=name in {"modal", "a standard linear solid"}, progress=report_part
        )
        rows.append(_row(f"{text}: energy extracted over energy exchanged", energy, 1e-5))
    return rows


def _row(name: str, deviation: float, tolerance: float) -> Row:
    return {"name": name, "deviation": float(deviation), "tolerance": tolerance}


def _graded(step: float, uniform: float, end: float, growth: float = 1.35) -> Array:
    """Return coordinates from 0 to `end`, m, at a distance of `step` up to `uniform`, and growing beyond."""
    inner = np.linspace(0.0, uniform, max(1, round(uniform / step)) + 1)
    lines, width = [0.0], step
    while lines[-1] < end - uniform:
        width *= growth
        lines.append(lines[-1] + width)
    outer = np.array(lines[1:]) * (end - uniform) / lines[-1]
    return np.concatenate([inner, uniform + outer])
