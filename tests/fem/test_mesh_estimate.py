"""Estimates and refusals before a surface is meshed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from palpate import Mesh
from palpate import fem as bodies
from palpate.fem import BodyError, BodyWarning, builder
from palpate.fem.builder import _NODES, _check_extent, _spacing_of
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.elements import Elements
from palpate.fem.material import Material
from palpate.fem.mesh_estimate import (
    _MEMORY,
    _PROGRAM,
    MAX_SPACING,
    FineZone,
    _inner_samples,
    _needed,
    check_memory_before,
    check_parts,
    estimate,
    surface_samples,
)
from palpate.fem.modes_cost import fill, modes_cost
from palpate.fem.multifrontal import MultifrontalSolver
from palpate.fem.selectors import parse_selectors

trimesh = pytest.importorskip("trimesh")
SPHERE = trimesh.creation.icosphere(3, 0.03)


def surface_of(shape: Any) -> ClosedSurface:
    return ClosedSurface(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


@pytest.mark.parametrize(
    "shape",
    [SPHERE, trimesh.creation.box((0.06, 0.06, 0.02)), trimesh.creation.torus(0.04, 0.014)],
    ids=["sphere", "block", "torus"],
)
@pytest.mark.parametrize("order", [1, 2])
def test_the_estimated_nodes_are_those_of_the_body_within_a_third(shape: Any, order: int) -> None:
    surface = surface_of(shape)
    filled = bodies.fill(surface.vertices, surface.triangles, 0.008)
    elements = Elements(filled, Material("5 kPa"), parse_selectors("z < -8 mm"), None, order)
    guess = estimate(surface, 0.008, order)
    assert guess.nodes == pytest.approx(len(elements.nodes), rel=0.33)
    assert guess.contact_nodes == pytest.approx(len(np.unique(filled.surface)), rel=0.33)


@pytest.fixture
def unmeshed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No mesh is made here."""
    with monkeypatch.context() as patched:
        patched.setattr(builder, "fill_surface", lambda *given, **options: pytest.fail("a mesh was made"))
        yield


def test_a_build_over_the_budget_is_refused_before_the_mesh(unmeshed: None) -> None:
    with pytest.raises(BodyError, match=r"over the budget of 0\.4 GB: use a spacing of [\d.]+ mm or more"):
        bodies.build(Mesh(SPHERE.vertices, SPHERE.faces), young=5e3, fixed="z < -20 mm", spacing=1e-3, memory="0.4 GB")


def test_a_build_over_the_budget_is_refused_with_a_spacing_that_fits() -> None:
    with pytest.raises(BodyError, match=r"over the budget of 0\.4 GB: use a spacing of [\d.]+ mm or more") as refusal:
        bodies.build(Mesh(SPHERE.vertices, SPHERE.faces), young=5e3, fixed="z < -20 mm", spacing=1e-3, memory="0.4 GB")
    fits = float(str(refusal.value).split("spacing of ")[2].split()[0])
    body = bodies.build(
        Mesh(SPHERE.vertices, SPHERE.faces), young=5e3, fixed="z < -20 mm", spacing=f"{fits} mm", memory="0.4 GB"
    )
    assert body.record["memory_bytes"] < 0.4e9


@pytest.mark.parametrize("budget", ["30 MB", "0.15 GB"])
def test_no_spacing_is_named_where_none_fits(budget: str) -> None:
    """The program takes 0.15 GB by itself, which is more than seven tenths of these budgets."""
    surface = surface_of(SPHERE)
    with pytest.raises(BodyError) as refusal:
        check_memory_before(surface, 1e-3, 2, budget, touched=True)
    text = str(refusal.value)
    assert f"over the budget of {budget}: use a smaller contact surface (touch), or a larger budget, as no" in text
    assert "spacing of" not in text.split("use ")[1]
    zone = FineZone(1e-4, 1e-3, 0.3, 5e-3)
    with pytest.raises(BodyError, match=r"use a larger budget, as no spacing fits this one$"):
        check_memory_before(surface, 5e-3, 2, budget, touched=True, zone=zone)


@pytest.mark.parametrize("budget", [0.23e9, 0.3e9, 0.5e9, 1e9])
def test_a_named_spacing_passes(budget: float) -> None:
    surface = surface_of(SPHERE)
    with pytest.raises(BodyError, match=r"use a spacing of [\d.]+ mm or more") as refusal:
        check_memory_before(surface, 0.5e-3, 2, budget, touched=True)
    fits = 1e-3 * float(str(refusal.value).split("use a spacing of ")[1].split()[0])
    assert _needed(surface, fits, 2, True, 0) <= budget
    assert fits <= MAX_SPACING * surface.thickness


def test_the_budget_before_the_mesh_counts_the_modes(unmeshed: None) -> None:
    mesh = Mesh(SPHERE.vertices, SPHERE.faces)
    with pytest.raises(BodyError, match=r"mm with 400 modes gives about .* over the budget of 1 GB") as refusal:
        bodies.build(mesh, young=5e3, fixed="z < -20 mm", spacing="3.5 mm", memory="1 GB", modes=400)
    assert "fewer modes" in str(refusal.value)
    surface = surface_of(SPHERE)
    check_memory_before(surface, 3.5e-3, 2, "1 GB", touched=True)  # without modes it fits
    needed = [_needed(surface, 3.5e-3, 2, True, count) for count in (0, 1, 100, 400)]
    assert needed == sorted(needed)
    assert needed[-1] > needed[-2]


@pytest.mark.parametrize("order", [1, 2])
def test_the_memory_is_that_of_the_factor_the_compliance_and_the_modes(order: int) -> None:
    """Three unknowns a node; the compliance has 8 bytes for each two of the unknowns that are touched."""
    surface = surface_of(SPHERE)
    size = estimate(surface, 4e-3, order)
    compliance, factor = 8.0 * (3.0 * size.contact_nodes) ** 2, _MEMORY * (3.0 * size.nodes) ** 1.25
    assert _needed(surface, 4e-3, order, False, 0) == pytest.approx(_PROGRAM + factor)
    assert _needed(surface, 4e-3, order, True, 0) == pytest.approx(_PROGRAM + compliance + factor)
    modes = modes_cost(3.0 * size.nodes, size.contact_nodes, 2000, fill(3.0 * size.nodes)).memory
    assert _needed(surface, 4e-3, order, True, 2000) == pytest.approx(_PROGRAM + modes)
    plate = surface_of(trimesh.creation.box((0.1, 0.1, 1e-3)))
    few = _needed(plate, 1e-3, order, True, 1)  # one mode costs less than the compliance of a plate
    assert few == _needed(plate, 1e-3, order, True, 0)
    for count in (0, 1):
        check_memory_before(plate, 1e-3, order, few / 1.49, touched=True, modes=count)
        with pytest.raises(BodyError, match=r"spacing of 1 mm gives about .* use a spacing of (.*) mm or more, a sma"):
            check_memory_before(plate, 1e-3, order, few / 1.51, touched=True, modes=count)


def test_the_named_spacing_needs_seven_tenths_of_the_budget_within_a_twentieth_of_spacing() -> None:
    surface = surface_of(SPHERE)
    for spacing, budget in ((1e-3, 0.4e9), (2e-3, 0.9e9)):
        with pytest.raises(BodyError) as refusal:
            check_memory_before(surface, spacing, 2, budget, touched=True)
        fits = 1e-3 * float(str(refusal.value).split("use a spacing of ")[1].split()[0])
        assert _needed(surface, 1.02 * fits, 2, True, 0) < 0.7 * budget < _needed(surface, fits / 1.08, 2, True, 0)


def test_a_surface_is_sampled_at_least_every_step_within_the_number_of_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """(n + 1)(n + 2)/2 points for each triangle whose longest edge has n steps; its corners are three of them."""
    corners = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.0, 0.04, 0.0], [0.0, 0.0, 0.01]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    surface = ClosedSurface(corners, faces)
    points, owner = surface_samples(surface, 0.0101)
    for triangle in range(4):
        a, b, c = surface.vertices[surface.triangles[triangle]]
        longest = max(float(np.linalg.norm(one)) for one in (b - a, c - b, a - c))
        own, n = points[owner == triangle], int(np.ceil(longest / 0.0101))
        assert len(own) == len(np.unique(own.round(12), axis=0)) == (n + 1) * (n + 2) // 2
        weights = np.linalg.lstsq(np.column_stack([b - a, c - a]), (own - a).T, rcond=None)[0]
        np.testing.assert_allclose(n * weights, (n * weights).round(), atol=1e-9)
        assert weights.min() >= -1e-12
        assert weights.sum(axis=0).max() <= 1.0 + 1e-12
        np.testing.assert_allclose(np.column_stack([b - a, c - a]) @ weights, (own - a).T, atol=1e-12)
    assert len(surface_samples(surface, 1e-6)[0]) == 4 * 61 * 62 // 2  # not more, however fine
    assert len(surface_samples(surface, 1.0)[0]) == 4 * 3
    for allowed, n in ((1e5, 60), (600, 15), (200, 7), (60, 3), (1, 1)):  # halved until few enough
        monkeypatch.setattr("palpate.fem.mesh_estimate._SAMPLES", allowed)
        assert len(surface_samples(surface, 1e-6)[0]) == 4 * (n + 1) * (n + 2) // 2


def test_the_budget_of_a_given_mesh_counts_the_modes_before_it_is_condensed() -> None:
    volume, stages = bodies.block(("40 mm", "40 mm", "20 mm"), "5 mm"), []
    with pytest.raises(BodyError, match=r"memory: 500 modes need about .* budget of 220 MB: use fewer modes"):
        bodies.build(
            volume,
            young=5e3,
            fixed="z <= 0 mm",
            modes=500,
            memory="220 MB",
            progress=lambda text, _: stages.append(text),
        )
    assert stages
    assert not any("condensing" in text for text in stages)


def test_the_cost_of_modes_grows_with_each_of_its_causes() -> None:
    base: dict[str, Any] = {"unknowns": 1e4, "contact_nodes": 60, "count": 50, "entries": 1e7}
    cost = modes_cost(**base)
    for cause, value in base.items():
        dearer = modes_cost(**{**base, cause: value * 1.3 // 1})
        assert dearer.memory > cost.memory
        assert dearer.seconds > cost.seconds or cause == "unknowns"
    assert cost.memory > 8.0 * base["entries"] + 8.0 * base["unknowns"] * 2 * base["count"]


def test_the_entries_of_the_factor_are_those_of_a_dense_factorization() -> None:
    """Cholesky's factor in the order of the fronts: fronts of up to 96 nodes count as dense, and as full squares."""
    elements = Elements(bodies.block(0.04, 0.01), Material("5 kPa"), parse_selectors("z <= 0 mm"), None, 1)
    free = ~elements.dirichlet
    stiffness = elements.stiffness[elements.free][:, elements.free]
    solver = MultifrontalSolver(stiffness, elements.load[free], elements.nodes[free])
    order = (3 * solver._order[:, None] + np.arange(3)).ravel()
    pattern = np.abs(stiffness[order][:, order].toarray()) > 0.0
    definite = np.where(pattern, -np.random.default_rng(0).uniform(0.5, 1.0, pattern.shape), 0.0)
    definite = np.tril(definite) + np.tril(definite, -1).T
    np.fill_diagonal(definite, 1e3)
    entries = np.count_nonzero(np.abs(np.linalg.cholesky(definite)) > 1e-40)
    squares = sum(front.sizes[0] * (front.sizes[0] - 1) / 2.0 for front in solver._fronts)  # above the diagonals
    assert entries <= solver.factor_entries - squares <= 1.6 * entries
    kept = solver.factor()._fronts
    assert solver.factor_entries == sum(front.diagonal.size + front.coupling.size for front in kept)
    assert solver.factor_operations > solver.factor_entries


def test_a_fixed_region_that_misses_the_body_is_named_with_the_extent() -> None:
    with pytest.raises(
        BodyError, match=r'fixed: "z < -80 mm" holds no place of the body, which has x from -30 to 30, '
    ):
        check_parts(surface_of(SPHERE), parse_selectors("z < -80 mm"), 0.01)


def test_a_part_without_a_fixed_place_is_refused_at_once() -> None:
    two = trimesh.util.concatenate([SPHERE, SPHERE.copy().apply_translation([0.1, 0.0, 0.0])])
    with pytest.raises(BodyError, match="1 of the 2 parts of the surface has no fixed place"):
        bodies.build(Mesh(two.vertices, two.faces), young=5e3, fixed="x < 0 mm", spacing=2e-3)
    check_parts(surface_of(two), parse_selectors("z < 0 mm"), 0.01)


@pytest.mark.parametrize("fixed", ["surface x < 0 mm", "sphere 0 0 0 radius 9 mm"])
def test_the_part_without_a_fixed_place_is_named_by_one_of_its_points(fixed: str) -> None:
    two = trimesh.util.concatenate([SPHERE, SPHERE.copy().apply_translation([0.1, 0.02, 0.0])])
    with pytest.raises(BodyError, match=r"1 of the 2 parts .* the first at \(.*\) mm") as refusal:
        check_parts(surface_of(two), parse_selectors(fixed), 0.01)
    place = [float(one) for one in str(refusal.value).split("at (")[1].split(")")[0].split(",")]
    assert np.linalg.norm(np.array(place) - [100.0, 20.0, 0.0]) == pytest.approx(30.0, abs=0.05)


def test_a_part_apart_from_two_that_intersect_needs_its_own_fixed_place() -> None:
    balls = [SPHERE.copy().apply_translation([x, 0.0, 0.0]) for x in (0.0, 0.03, 0.1)]
    surface = surface_of(trimesh.util.concatenate(balls))
    with pytest.raises(BodyError, match="1 of the 2 parts of the surface has no fixed place"):
        check_parts(surface, parse_selectors("x < -20 mm"), 0.01)
    check_parts(surface, parse_selectors(["x < -20 mm", "x > 125 mm"]), 0.01)


def test_parts_that_do_not_meet_need_a_place_each_although_their_boxes_meet() -> None:
    """Two balls aside along a diagonal; those that intersect are one part."""
    for shift, loose in ((0.05, True), (0.03, False)):
        two = trimesh.util.concatenate([SPHERE, SPHERE.copy().apply_translation([shift, shift, 0.0])])
        surface = surface_of(two)
        assert surface.simple == loose
        if loose:
            with pytest.raises(BodyError, match="1 of the 2 parts of the surface has no fixed place"):
                check_parts(surface, parse_selectors("x < -20 mm"), 0.01)
        else:
            check_parts(surface, parse_selectors("x < -20 mm"), 0.01)


@pytest.mark.parametrize("fixed", ["sphere 0 0 0 radius 5 mm", "surface z < -29 mm", "box -1 -1 28 to 1 1 31 mm"])
def test_a_fixed_place_within_or_on_a_large_triangle_counts(fixed: str) -> None:
    block = trimesh.creation.box((0.06, 0.06, 0.06))
    shell = trimesh.util.concatenate([block, trimesh.creation.icosphere(2, 0.01).apply_translation([0.015, 0.0, 0.0])])
    check_parts(surface_of(block), parse_selectors(fixed), 0.01)
    check_parts(surface_of(shell), parse_selectors(fixed), 0.01)  # the cavity needs no place


def test_the_grid_finds_every_fixed_ball_as_wide_as_half_a_spacing() -> None:
    """Its points are a quarter of a spacing apart, so a ball of half a spacing across holds one, wherever it lies."""
    surface = surface_of(trimesh.creation.box((0.06, 0.04, 0.02)).apply_translation([0.1, -0.2, 0.3]))
    rng = np.random.default_rng(8)
    for spacing in (4e-3, 10e-3):
        for _ in range(8):
            x, y, z = 1e3 * (np.array([0.1, -0.2, 0.3]) + rng.uniform(-0.45, 0.45, 3) * [0.06, 0.04, 0.02])
            ball = parse_selectors(f"sphere {x} {y} {z} mm radius {250 * spacing} mm")
            assert len(_inner_samples(surface, ball, spacing)) > 0
    whole = _inner_samples(surface, parse_selectors("z > -1 m"), 9e-3)
    assert len(whole) == 27 * 18 * 9  # 26.7, 17.8 and 8.9 quarters of a spacing
    np.testing.assert_allclose(whole.min(axis=0), [0.07, -0.22, 0.29])
    np.testing.assert_allclose(whole.max(axis=0), [0.13, -0.18, 0.31])
    assert len(_inner_samples(surface, parse_selectors("z > -1 m"), 1e-4)) == 60**3  # not more, however fine
    assert len(_inner_samples(surface, parse_selectors("z > -1 m"), 1.0)) == 2**3
    assert len(_inner_samples(surface, parse_selectors("surface z > -1 m"), 10e-3)) == 0


def test_the_default_spacing_is_a_fifteenth_of_a_body_or_half_of_a_thin_one() -> None:
    """But not less than a sixtieth of its extent, nor so small that the body has too many nodes."""
    ball = surface_of(SPHERE)
    assert _spacing_of(ball, None) == pytest.approx(ball.extent / 15.0)
    plate = surface_of(trimesh.creation.box((0.1, 0.1, 8e-3)))
    assert _spacing_of(plate, None) == pytest.approx(plate.thickness / 2.0)
    thin = surface_of(trimesh.creation.box((0.1, 0.1, 1e-3)))
    assert thin.extent / 60.0 <= _spacing_of(thin, None) < thin.extent / 15.0
    assert estimate(thin, _spacing_of(thin, None), 2).nodes <= _NODES
    assert _spacing_of(ball, "4 mm") == 4e-3
    assert _spacing_of(ball, ball.extent) == ball.extent
    with pytest.raises(BodyError, match=r"exceeds the extent of the body, 0\.10"):
        _spacing_of(ball, 1.001 * ball.extent)


def test_a_size_in_the_wrong_unit_is_asked_about() -> None:
    ball = trimesh.creation.icosphere(1, 30.0)
    with (
        pytest.warns(BodyWarning, match=r'extent of 10\d m: are its coordinates in mm\? Then give unit="mm"'),
        pytest.raises(BodyError, match="holds no place of the body"),
    ):
        bodies.build(Mesh(ball.vertices, ball.faces), young=5e3, fixed="z < -100 m")


def test_a_size_is_asked_about_once() -> None:
    ball = trimesh.creation.icosphere(1, 150.0)
    with pytest.warns(BodyWarning) as told:
        bodies.fill(ball.vertices, ball.faces, 40.0)
    assert len(told) == 1


def test_the_smallest_body_has_a_micrometre() -> None:
    _check_extent(1.01e-6, "body")
    with pytest.raises(BodyError, match=r"body: an extent of 9\.9e-07 m; a body has 1e-06 to"):
        _check_extent(0.99e-6, "body")


def test_a_modulus_of_metal_is_asked_about() -> None:
    with pytest.warns(BodyWarning, match="stiffer than any tissue but bone"):
        Material(5e9)
