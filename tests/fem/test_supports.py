"""Supports added to a condensed body: the laws of static elimination, and a new build with the same support."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import fem, simulate
from palpate.errors import ScenarioError
from palpate.fem import Body, BodyError
from palpate.metrics import summarize

LEFT, FRONT = "x < 11 mm", "y < 6 mm"


def pushed(body: Body, x: float = 20e-3) -> float:
    """Return the force of a sphere of 8 mm, 2 mm deep in the top at `x`, m."""
    return float(np.linalg.norm(body.signed_distance().indent((x, 20e-3, 20e-3), 8e-3, 2e-3).force))


def built(fixed: list[str], path: Path | None = None, **options: Any) -> Body:
    """40 x 40 x 20 mm of 10 kPa, touched on its top."""
    volume = fem.block(["40 mm", "40 mm", "20 mm"], "5 mm")
    return fem.build(volume, young="10 kPa", fixed=fixed, touch="z > 19.9 mm", output=path, **options)


@pytest.fixture(scope="module")
def body() -> Body:
    return built(["z < 0.1 mm"], modes=5)


def test_held_rows_are_struck_from_the_stiffness(body: Body) -> None:
    """(C'^-1) is C^-1 without the rows and columns of the held nodes."""
    keep = np.repeat(body.nodes[:, 0] > 11e-3, 3)
    stiffness = np.linalg.inv(body.compliance.astype(float))
    held = body.held(LEFT)
    np.testing.assert_array_equal(held.nodes, body.nodes[keep[::3]])
    np.testing.assert_array_equal(held.normals, body.normals[keep[::3]])
    np.testing.assert_array_equal(held.contents.areas, body.contents.areas[keep[::3]])
    np.testing.assert_array_equal(held.compliance, held.compliance.T)
    expected = np.linalg.inv(stiffness[np.ix_(keep, keep)])
    np.testing.assert_allclose(held.compliance, expected, atol=2e-6 * expected.max())


@pytest.mark.parametrize(("tip", "reach"), [("sphere", (8.0**2 - 6.0**2) ** 0.5), ("flat", 4.0)])
def test_a_tip_over_held_nodes_is_warned_of_where_it_overlaps_them(body: Body, tip: Any, reach: float) -> None:
    """A sphere of 8 mm, 2 mm deep, overlaps the surface up to a chord of 5.3 mm, and the held one ends at 10 mm."""

    def warned(of: Body, x: float) -> bool:
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            of.indent((x, 20e-3, 20e-3), 8e-3 if tip == "sphere" else 4e-3, 2e-3, tip=tip)
        return any("overlaps a part of the surface that is fixed, held" in str(one.message) for one in found)

    held = body.held(LEFT)
    for beside, there in ((1.2, False), (0.8, True), (-1.0, True)):
        x = 10e-3 + beside * 1e-3 * reach
        assert warned(held, x) is there
        assert not warned(body, x)


def test_a_tip_overlaps_what_is_held_if_any_held_vertex_is_in_it(body: Body) -> None:
    """Also if the vertex nearest to the middle of a tilted end lies beside it."""
    held, rng = body.held(LEFT), np.random.default_rng(0)
    top = held.points[held.points[:, 2] > 19.9e-3]
    still = top[top[:, 0] < 11e-3]
    centers = np.column_stack(
        [rng.uniform(0.0, 25e-3, 300), rng.uniform(0.0, 40e-3, 300), rng.uniform(17e-3, 22e-3, 300)]
    )
    offsets = still[None] - centers[:, None]
    distance = np.linalg.norm(offsets, axis=2)
    assert held.overlaps_untouched(centers, 4e-3)[distance.min(axis=1) < 3.99e-3].all()
    assert not held.overlaps_untouched(centers, 1e-3)[centers[:, 2] < 18.9e-3].any()
    nearest_is_beside = 0
    for tilt in (0.0, 0.5, 1.0):
        axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
        above = offsets @ axis
        inside = (above > 5e-6) & (np.sqrt(distance**2 - above**2) < 3.99e-3)
        assert held.overlaps_untouched(centers, 4e-3, axis)[inside.any(axis=1)].all()
        assert not held.overlaps_untouched(centers + 0.1 * axis, 4e-3, axis).any()
        nearest_is_beside += np.count_nonzero(inside.any(axis=1) & ~inside[np.arange(300), distance.argmin(axis=1)])
    assert nearest_is_beside > 10


@pytest.mark.parametrize(("x", "told"), [("-5 mm", True), ("8 mm", False)])
def test_a_run_whose_tip_overlaps_a_held_part_says_that_its_force_is_too_small(x: str, told: bool) -> None:
    """The held part ends 10 mm beside the middle of the block, to which the tip lies at `x`."""
    block = {"shape": "block", "size": ["40 mm", "40 mm", "20 mm"], "young": "10 kPa", "spacing": "5 mm"}
    rows = [["0 s", "0 mm", "0 mm", "0 mm"], ["0.2 s", "0 mm", "0 mm", "2 mm"]]
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "fixed"},
        "object": {
            "kind": "body",
            "position": [f"{-float(x.split(maxsplit=1)[0])} mm", "0 mm", "-8 mm"],
            "body": {**block, "held": ["x < 11 mm"], "radius": "8 mm"},
            "frame": {"displacement": rows},
        },
        "run": {"duration": "0.25 s"},
    }
    found = summarize(simulate(tables))
    assert ("overlaps a part of the surface that is fixed, held or not touched" in found["verdict"]) is told
    assert found["palpation"]["over_untouched"] is told


def without_modes(body: Body) -> Body:
    none = {"frequencies": np.empty(0), "residual_frequencies": np.empty(0)}
    shapes = {"shapes": np.empty((3 * len(body.nodes), 0), np.float32), "residual_shapes": np.empty((0, 0), np.float32)}
    return Body(replace(body.contents, **none, **shapes))


def test_supports_add_up_in_any_order(body: Body) -> None:
    for of, error in ((without_modes(body), 5e-6), (body, 5e-5)):  # with modes the supports yield a little
        both = of.held([LEFT, FRONT])
        for one, other in ((LEFT, FRONT), (FRONT, LEFT)):
            after = of.held(one).held(other)
            np.testing.assert_array_equal(after.nodes, both.nodes)
            np.testing.assert_allclose(after.compliance, both.compliance, atol=error * both.compliance.max())
            assert after.record["held"] == [one, other]
        assert of.held([]).contents is of.contents
    held = body.held([LEFT, FRONT]).compliance
    np.testing.assert_allclose(held, without_modes(body).held([LEFT, FRONT]).compliance, atol=5e-5 * held.max())


def test_a_held_body_is_that_of_a_new_build(body: Body) -> None:
    """Springs and tetrahedra hold the same vertices; the condensed force differs by the edge of the support."""
    held, new = body.held(LEFT), built(["z < 0.1 mm", "surface box -1 -1 19.9 to 11 41 21 mm"])
    np.testing.assert_array_equal(held.nodes, new.nodes)
    np.testing.assert_array_equal(held.contents.dirichlet, new.contents.dirichlet)
    assert pushed(held) == pytest.approx(pushed(new), rel=0.03)
    assert pushed(held) > 1.01 * pushed(body)
    assert pushed(held, 30e-3) == pytest.approx(pushed(new, 30e-3), rel=1e-3)


@pytest.fixture(scope="module")
def swinging() -> tuple[Body, Body]:
    """A block, and one that is also fixed on its left side, with 20 modes."""
    volume = fem.block(["60 mm", "40 mm", "20 mm"], "5 mm")
    base, both = (
        fem.build(volume, young="10 kPa", fixed=fixed, touch="z > 2 mm", density="1000 kg/m^3", modes=20)
        for fixed in (["z < 0.1 mm"], ["z < 0.1 mm", "x < 0.1 mm"])
    )
    return base, both


def test_a_held_body_has_the_frequencies_of_a_new_build(swinging: tuple[Body, Body]) -> None:
    """Each patch keeps its mean displacement, so the frequencies differ by the edge of the support; with fewer too."""
    base, new = swinging
    held = base.held("x < 0.1 mm")
    np.testing.assert_array_equal(held.nodes, new.nodes)
    np.testing.assert_allclose(held.contents.frequencies, new.contents.frequencies, rtol=0.015)
    assert held.contents.frequencies[0] > 1.03 * base.contents.frequencies[0]
    assert np.abs(held.contents.frequencies[:10] / new.contents.frequencies[:10] - 1.0).max() < 0.01
    bare = replace(base.contents, residual_frequencies=np.empty(0), residual_shapes=np.empty((0, 0), np.float32))
    fewer = Body(bare).held("x < 0.1 mm").contents
    np.testing.assert_allclose(fewer.frequencies[:5], new.contents.frequencies[:5], rtol=0.02)
    assert fewer.residual_frequencies.size == 0


def test_the_modes_of_a_held_body_leave_a_compliance_without_negative_part(swinging: tuple[Body, Body]) -> None:
    held = swinging[0].held("x < 0.1 mm").contents
    shapes = np.hstack([held.shapes, held.residual_shapes]).astype(float)
    frequencies = np.concatenate([held.frequencies, held.residual_frequencies])
    rest = held.compliance - shapes / frequencies**2 @ shapes.T
    assert np.linalg.eigvalsh(rest).min() > -2e-5 * held.compliance.max()


def test_modes_are_those_of_all_regions_in_any_order_and_hold_for_changes_at_run_time(
    swinging: tuple[Body, Body],
) -> None:
    """The supports yield, in the compliance as in the modes, so rounding does not make the rest negative."""
    regions = ["x < 0.1 mm", "x > 54 mm", "y < 6 mm"]
    once, chain = swinging[0].held(regions), swinging[0]
    for region in regions:
        chain = chain.held(region)
    np.testing.assert_allclose(chain.contents.frequencies, once.contents.frequencies, rtol=1e-4)
    np.testing.assert_allclose(chain.compliance, once.compliance, atol=1e-4 * once.compliance.max())
    way = np.column_stack([np.full(60, 25e-3), np.full(60, 20e-3), 29e-3 - 3e-3 * np.minimum(np.arange(60) / 40, 1.0)])
    forces = [
        body.modal("1 ms", rayleigh_alpha=5, rayleigh_beta=1e-3, contact="signed_distance")
        .with_support_changes([{"at": "5 ms", "held": held}], "1 ms")
        .simulate_path(way, 8e-3)
        .force
        for body, held in ((swinging[0], regions), (swinging[0].held(regions[:2]), regions[2:]))
    ]
    np.testing.assert_allclose(forces[0], forces[1], atol=2e-4 * forces[0].max())


def test_nodes_held_one_by_one_until_rounding_adds_up_are_to_be_held_at_once() -> None:
    body = built(["z < 0.1 mm"], modes=20, order=1)
    one_by_one = [f"sphere {x:.3f} {y:.3f} 20 radius 0.1 mm" for x, y, _ in 1e3 * body.nodes[:40]]

    def hold_all(part: Body) -> None:
        for region in one_by_one:
            part = part.held(region)
            assert np.isfinite(part.contents.frequencies).all()

    with pytest.raises(BodyError, match=r"hold all regions in one call, held\(\[\.\.\.\]\)"):
        hold_all(body)


def test_a_tap_on_a_held_body_is_that_of_a_new_build(swinging: tuple[Body, Body]) -> None:
    base, new = swinging
    ticks = np.arange(60)
    sunk = 2e-3 * np.sin(np.pi * np.clip((ticks - 10) / 20, 0.0, 1.0))
    for x, error in ((15e-3, 0.03), (35e-3, 0.01)):
        way = np.column_stack([np.full(60, x), np.full(60, 20e-3), 28e-3 - sunk])
        of = (base.held("x < 0.1 mm"), new)
        force, expected = (
            body.modal("1 ms", rayleigh_alpha=5, rayleigh_beta=2e-4, contact="signed_distance")
            .simulate_path(way, 8e-3)
            .force[:, 2]
            for body in of
        )
        np.testing.assert_allclose(force, expected, atol=error * expected.max())


def test_a_held_body_keeps_its_model_and_its_file(body: Body, tmp_path: Path) -> None:
    rough = body.with_friction(0.5).signed_distance().held(LEFT)
    assert rough.kind.name == "signed_distance"
    assert rough.kind.friction == (0.5, 0.5)
    again = fem.load(body.held(LEFT).save(tmp_path / "held.h5"))
    assert again.record["held"] == [LEFT]
    np.testing.assert_array_equal(again.compliance, rough.compliance)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda body: body.held("x < -1 mm"), r'held: no contact node lies in "x < -1 mm"'),
        (lambda body: body.held([LEFT, "z < 10 mm"]), r'in "z < 10 mm"; they extend from .* and only they can be held'),
        (lambda body: body.held("z > 0 mm"), "held: all contact nodes are held"),
        (lambda body: body.held("left"), 'held: "left" is no region'),
    ],
)
def test_a_support_that_is_none_is_refused(body: Body, change: Any, sentence: str) -> None:
    with pytest.raises(BodyError, match=sentence):
        change(body)


def test_a_scenario_holds_regions(tmp_path: Path) -> None:
    """It runs on the body held; a mistake names the key."""
    path = tmp_path / "block.h5"
    body = built(["z < 0.1 mm"], path, order=1)
    pressed = {"kind": "signed_distance", "file": str(path), "origin": ["20 mm", "20 mm", "20 mm"], "radius": "8 mm"}
    scenario: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "fixed"},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-6 mm"], "body": pressed},
        "run": {"duration": "10 ms"},
    }
    for held in ([], FRONT, [LEFT, FRONT]):
        scenario["object"]["body"] = {**pressed, "held": held}
        force = np.linalg.norm(simulate(scenario)["object_force"][-1])
        assert force == pytest.approx(pushed(body.held(held)), rel=1e-3), held
    scenario["object"]["body"] = {**pressed, "held": "x < -1 mm"}
    with pytest.raises(ScenarioError, match=r"object\.body\.held: no contact node"):
        simulate(scenario)
