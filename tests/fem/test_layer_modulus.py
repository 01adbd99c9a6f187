"""Modulus of the contact's layer where the stiffness varies with the depth, and the force on a skin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nightly import nightly
from palpate.arrays import Array
from palpate.fem import build
from palpate.fem.layer_modulus import layer_moduli
from palpate.fem.material import SurfaceLayer
from palpate.fem.selectors import half_space
from palpate.fem.volume import Volume, block

from experiments.body_validation.axisymmetric import LayeredCylinder
from experiments.body_validation.neo_hookean import NeoHookeanCylinder, Solid
from experiments.body_validation.validation import hyperelastic_on_skin, on_skin

TOP = 0.04


def block_moduli(thickness: float, skin: float, tissue: float, turn: Array | None = None, size: float = 1.0) -> Array:
    """Return the moduli (2,), Pa, at the middle of a block of 40 mm with a skin, turned and scaled."""
    solid = block((0.04, 0.04, TOP), 4e-3, layers=(thickness,))
    depth = TOP - solid.points[solid.tetrahedra].mean(axis=1)[:, 2]
    young = np.where(depth < thickness, skin, tissue)
    turn = np.eye(3) if turn is None else turn
    moved = Volume(size * solid.points @ turn.T, solid.tetrahedra, "turned block")
    node = size * turn @ [[0.021], [0.022], [TOP]]
    return layer_moduli(node.T, turn[:, 2][None], np.array([size**2 * 16e-6]), moved, young)[0]


@given(st.floats(1e-3, 8e-3), st.floats(1e3, 1e5), st.floats(1e3, 1e5), st.floats(0.1, 10.0), st.integers(0, 2**32 - 1))
def test_the_modulus_lies_between_skin_and_tissue_and_follows_scale_and_rotation(
    thickness: float, skin: float, tissue: float, size: float, seed: int
) -> None:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    round_tip, flat_end = block_moduli(thickness, skin, tissue)
    for found in (round_tip, flat_end):
        assert min(skin, tissue) * (1 - 1e-9) <= found <= max(skin, tissue) * (1 + 1e-9)
    assert block_moduli(thickness, 2 * skin, 2 * tissue) == pytest.approx([2 * round_tip, 2 * flat_end], rel=1e-9)
    assert block_moduli(thickness, skin, tissue, turn, size) == pytest.approx([round_tip, flat_end], rel=1e-6)


@pytest.mark.parametrize("thickness", [1e-3, 2e-3, 5e-3])
def test_the_modulus_under_a_skin_is_the_mean_with_the_stated_weights(thickness: float) -> None:
    radius = 4e-3 / np.sqrt(np.pi)
    series = (1.0 - np.exp(-thickness / (1.15 * radius))) / (1.0 - np.exp(-4.0 / 1.15))
    flat = thickness / (thickness + 3.0 * radius) / (4.0 / 7.0)
    for skin, tissue in ((50e3, 10e3), (10e3, 50e3)):
        expected = 1.0 / (series / skin + (1.0 - series) / tissue), (flat * skin**0.25 + (1 - flat) * tissue**0.25) ** 4
        assert block_moduli(thickness, skin, tissue) == pytest.approx(expected, rel=0.06)  # 32 depths


@pytest.mark.parametrize("base", ["50 kPa", "10 MPa"])
def test_a_flat_end_does_not_feel_a_stiff_part_deep_below_in_its_layer(base: str) -> None:
    """A base of 10 MPa yields as little as a fixed one. The layer had its stiffness: forces of up to 2.2 times."""
    solid, top = block((0.04, 0.04, 0.02), 5e-3), "surface z > 19.9 mm"
    fixed = build(solid, young=10e3, touch=top, fixed="z < 10.01 mm")
    stiff = build(solid, young=10e3, touch=top, fixed="z < 0.01 mm", regions=[f"z < 10 mm = {base}"])
    for radius in (5e-3, 8e-3):
        by_distance, by_normals = (
            [body.indent([0.02, 0.02, 0.02], radius, 5e-4, tip="flat").force[2] for body in bodies]
            for bodies in ((stiff.signed_distance(), fixed.signed_distance()), (stiff, fixed))
        )
        assert by_distance[0] / by_distance[1] == pytest.approx(by_normals[0] / by_normals[1], rel=0.12)


def test_a_sphere_does_not_feel_a_soft_part_deep_below_in_its_layer() -> None:
    """50 Pa below 10 mm: on cells of 5 mm the force was 38 % lower than on cells of 2 mm."""
    forces = [
        build(block((0.04, 0.04, 0.02), cell), young=10e3, fixed="z < 0.01 mm", touch="surface z > 19.9 mm",
              regions=["z < 10 mm = 50 Pa"]).signed_distance().indent([0.02, 0.02, 0.02], 8e-3, 2e-3).force[2]
        for cell in (5e-3, 2.5e-3)
    ]  # fmt: skip
    assert forces[0] == pytest.approx(forces[1], rel=0.08)


def test_the_modulus_does_not_depend_on_the_order_of_the_mesh() -> None:
    """A border along faces of the mesh, straight below nodes: each depth lies on a face of soft and stiff cells."""
    solid = block((0.04, 0.04, 0.02), 5e-3)
    nodes = solid.points[np.isclose(solid.points[:, 2], 0.02) & np.isclose(solid.points[:, 0], 0.02)]
    random, found = np.random.default_rng(1), []
    for _ in range(4):
        order, cells = random.permutation(len(solid.points)), random.permutation(len(solid.tetrahedra))
        rank = np.argsort(order)
        mesh = Volume(solid.points[order], rank[solid.tetrahedra[cells]])
        young = np.where(mesh.points[mesh.tetrahedra].mean(axis=1)[:, 0] < 0.02, 1e4, 1e5)
        normals, areas = np.tile([0.0, 0.0, 1.0], (len(nodes), 1)), np.full(len(nodes), 25e-6)
        found.append(layer_moduli(nodes, normals, areas, mesh, young))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-9)


def test_a_thick_skin_is_its_own_modulus_and_a_thin_one_that_of_the_tissue() -> None:
    assert block_moduli(36e-3, 50e3, 10e3) == pytest.approx([50e3, 50e3], rel=0.1)
    assert block_moduli(1e-4, 50e3, 10e3) == pytest.approx([10e3, 10e3], rel=0.1)


def test_a_uniform_body_has_the_modulus_of_its_material() -> None:
    solid = block((0.02, 0.02, 0.02), 5e-3)
    top = half_space("z", ">", 0.02 - 1e-6)
    body = build(solid, young=7e3, fixed=half_space("z", "<", 1e-6), touch=top)
    assert (body._layer_moduli() == 7e3).all()
    coated = build(
        solid, young=7e3, surface_layer=SurfaceLayer("20 mm", "7 kPa"), fixed=half_space("z", "<", 1e-6), touch=top
    )
    assert (coated._layer_moduli() == 7e3).all()
    assert coated.signed_distance()._layer_moduli() is coated._layer_moduli()  # computed once for all models of a body


@nightly
def test_tips_on_stiff_and_soft_skins_feel_the_force_of_axisymmetric_elements() -> None:
    """Skins thinner than the cells of 5 mm; with the modulus of the skin alone the forces are 15 to 68 % off."""
    rows = on_skin(5e-3, positions=5)
    assert len(rows) == 8
    for row in rows:
        assert abs(row["deviation"]) < row["tolerance"], row["name"]


@nightly
def test_the_axisymmetric_reference_nears_hertz_and_a_rigid_punch_on_a_deep_cylinder() -> None:
    deep = LayeredCylinder(10e3, 10e3, 1e-3, radius=0.06, height=0.06)
    plane_strain = 10e3 / (1.0 - 0.45**2)
    hertz = 4.0 / 3.0 * plane_strain * np.sqrt(5e-3) * 1e-4**1.5
    assert deep.sphere(5e-3, 1e-4, cell=2e-4) == pytest.approx(hertz, rel=0.03)
    assert deep.flat_end(2e-3, cell=1e-4) == pytest.approx(2.0 * plane_strain * 2e-3, rel=0.04)


@nightly
def test_tips_on_hyperelastic_skins_feel_the_force_of_neo_hookean_axisymmetric_elements() -> None:
    """With the modulus of the skin alone, the sphere and the flat end on the stiff skin are 32 and 16 % off."""
    rows = hyperelastic_on_skin(5e-3, positions=3, depths=(1.5e-3,))
    assert len(rows) == 4
    for row in rows:
        assert abs(row["deviation"]) < row["tolerance"], row["name"]


@nightly
def test_the_neo_hookean_reference_is_the_linear_one_at_small_depths_and_stiffer_at_large_ones() -> None:
    linear, large = LayeredCylinder(10e3, 10e3, 2e-3), NeoHookeanCylinder(10e3, 10e3, 2e-3)
    assert large.flat_end_force(5e-3, 1e-5) == pytest.approx(1e-5 * linear.flat_end(5e-3), rel=2e-3)
    assert large.sphere_force(8e-3, 1e-4) == pytest.approx(linear.sphere(8e-3, 1e-4), rel=0.012)
    assert large.sphere_force(8e-3, 4e-3) == pytest.approx(1.16 * linear.sphere(8e-3, 4e-3), rel=0.02)


def test_the_forces_of_the_neo_hookean_reference_are_the_derivatives_of_its_energy() -> None:
    cylinder = NeoHookeanCylinder(10e3, 30e3, 2e-3, radius=8e-3, height=6e-3)
    basis = cylinder._elements(4e-3, 2e-3)[0]
    solid, random = Solid(cylinder, basis), np.random.default_rng(3)
    at, way = (1e-4 * random.normal(size=basis.N) for _ in range(2))
    slope = (solid.energy(at + 1e-3 * way) - solid.energy(at - 1e-3 * way)) / 2e-3
    assert solid.force(at) @ way == pytest.approx(slope, rel=1e-6)
    change = (solid.force(at + 1e-3 * way) - solid.force(at - 1e-3 * way)) / 2e-3
    assert solid.tangent(at) @ way == pytest.approx(change, abs=1e-6 * np.abs(change).max())
