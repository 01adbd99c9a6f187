"""Solids under large displacements: closed forms, derivatives, linear elasticity, another program, the elastica."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate.fem import BodyError, HyperelasticModel, Law, Material, block, build
from palpate.fem.selectors import half_space
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
LAWS: tuple[Law, ...] = get_args(Law)
MATERIAL = Material(8e3, 0.4)
MU, LAMBDA = 8e3 / 2.8, 8e3 * 0.4 / (1.4 * 0.2)
BOTTOM = half_space("z", "<", 1e-9)


def shaken(law: Law, seed: int = 0) -> HyperelasticModel:
    """A small block whose inner points are moved, held at its bottom."""
    volume = block((0.03, 0.02, 0.03), 0.01)
    rng = np.random.default_rng(seed)
    inside = (volume.points > 1e-9).all(axis=1) & (volume.points < np.array([0.03, 0.02, 0.03]) - 1e-9).all(axis=1)
    points = volume.points + 2e-3 * rng.standard_normal(volume.points.shape) * inside[:, None]
    return HyperelasticModel(type(volume)(points, volume.tetrahedra), MATERIAL, BOTTOM, law=law)


def homogeneous(solid: HyperelasticModel, gradient: Array) -> Array:
    return solid.points @ (gradient - np.eye(3)).T


def stress_of(law: Law, f: Array) -> Array:
    """First Piola-Kirchhoff by the textbook, with numpy's singular values and inverse."""
    if law == "neo-hookean":
        j = np.linalg.det(f)
        return MU * f + (-MU + (LAMBDA + MU) * (j - 1)) * j * np.linalg.inv(f).T
    u, s, v = np.linalg.svd(f)
    u[:, -1] *= np.sign(np.linalg.det(u @ v))
    s[-1] *= np.sign(np.linalg.det(f))
    return 2 * MU * (f - u @ v) + LAMBDA * (s.sum() - 3) * (u @ v)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("base", [1e3, 1e5, 1e6])
def test_a_column_of_two_materials_is_two_springs_in_series(law: Law, base: float) -> None:
    """Smoothing over both materials made it 16 to 52 % too stiff. The flat end covers the top; nu is 0."""
    solid = block((0.02, 0.02, 0.02), 5e-3)
    column = build(
        solid, young=1e4, poisson=0.0, fixed=BOTTOM, touch="z > 19.99 mm", regions=[f"z < 10 mm = {base} Pa"]
    )
    felt = column.hyperelastic("1 ms", law=law).indent([0.01, 0.01, 0.02], 16e-3, 2e-4, tip="flat").force[2]
    assert felt == pytest.approx(2e-4 * 0.02**2 / (0.01 / 1e4 + 0.01 / base), rel=0.05)


@pytest.mark.parametrize("law", LAWS)
def test_a_graded_material_does_not_lock(law: Law) -> None:
    """Forty layers, 2 % in all. With a smoothing domain for each a body of nu 0.49 was 49 % too stiff."""
    solid, top = block((0.04, 0.04, 0.02), 5e-3), "z > 19.99 mm"
    layers = [f"z > {0.5 * k} mm = {10 + 0.005 * k} kPa" for k in range(1, 40)]
    forces = [
        build(solid, young="10 kPa", poisson=0.49, fixed=BOTTOM, touch=top, regions=regions)
        .hyperelastic("1 ms", law=law)
        .indent([0.02, 0.02, 0.02], 8e-3, 1e-3)
        .force[2]
        for regions in ((), layers)
    ]
    assert forces[0] < forces[1] < 1.02 * forces[0]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("poisson", [-0.2, 0.4])
def test_the_forces_on_a_body_of_several_materials_are_the_derivatives_of_its_energy(law: Law, poisson: float) -> None:
    material = Material(8e3, poisson, regions=["z < 10 mm = 80 kPa", "sphere 25 15 25 radius 9 mm = 1 kPa"])
    solid, rng = HyperelasticModel(block((0.03, 0.02, 0.03), 0.01), material, BOTTOM, law=law), np.random.default_rng(4)
    at, way = (1e-3 * rng.standard_normal(solid.points.shape) for _ in range(2))
    way[solid.elements.dirichlet] = 0.0
    slope = (solid.evaluate(at + 1e-4 * way).energy - solid.evaluate(at - 1e-4 * way).energy) / 2e-4
    assert (solid.evaluate(at).forces * way).sum() == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_a_rigid_turn_costs_nothing_and_a_stretched_body_turns_along(law: Law) -> None:
    solid = shaken(law)
    rng = np.random.default_rng(1)
    scale = 8e3 * 0.03**2
    stretched = homogeneous(solid, np.diag([1.1, 0.9, 1.2]))
    rest = solid.evaluate(stretched)
    held = solid.elements.dirichlet
    for turn in Rotation.random(5, rng=rng).as_matrix():
        rigid = solid.evaluate(solid.points @ (turn - np.eye(3)).T + 0.01)
        assert abs(rigid.energy) < 1e-12 * scale * 0.03
        assert np.abs(rigid.forces).max() < 1e-12 * scale
        turned = solid.evaluate((solid.points + stretched) @ turn.T - solid.points)
        assert turned.energy == pytest.approx(rest.energy, rel=1e-12)
        assert np.allclose(turned.forces[~held], (rest.forces @ turn.T)[~held], atol=1e-12 * scale)


@pytest.mark.parametrize("law", LAWS)
def test_homogeneous_deformations_have_the_textbooks_stress(law: Law) -> None:
    """Also an inverted one: inner forces vanish inside, and the top carries its stress."""
    solid = shaken(law)
    rng = np.random.default_rng(2)
    inside = (solid.points > 1e-9).all(axis=1) & (solid.points < np.array([0.03, 0.02, 0.03]) - 1e-9).all(axis=1)
    assert inside.any()
    gradients = [np.eye(3) + 0.3 * rng.standard_normal((3, 3)) for _ in range(4)] + [np.diag([1.0, 1.1, -0.4])]
    for f in gradients:
        forces = solid.evaluate(homogeneous(solid, f)).forces
        stress = stress_of(law, f)
        size = np.abs(stress).max() * 0.03**2
        assert np.abs(forces[inside]).max() < 1e-12 * size
        # The side faces share their traction with the edges of the top; over the whole body only the bottom is left.
        assert forces.sum(axis=0) == pytest.approx(
            stress[:, 2] * 0.03 * 0.02 + side_share(solid, stress), abs=1e-10 * size
        )


def side_share(solid: HyperelasticModel, stress: Array) -> Array:
    """What the tractions of the four sides give to the points that are held, taken off: their hats' integrals."""
    total = np.zeros(3)
    for face in solid.elements.volume.surface:
        a, b, c = solid.points[face]
        area = np.cross(b - a, c - a) / 2
        if abs(area[2]) > 1e-12:
            continue
        total += stress @ area * (~solid.elements.dirichlet[face]).sum() / 3
    return total


def test_neo_hookean_uniaxial_and_simple_shear() -> None:
    """A bar pulled with free sides: the lateral stretch and the stress of the closed form; shear: mu gamma."""
    volume = block((0.02, 0.02, 0.02), 0.01)
    solid = HyperelasticModel(volume, MATERIAL, BOTTOM)
    top = np.abs(volume.points[:, 2] - 0.02) < 1e-9
    side = np.abs(volume.points[:, 0] - 0.02) < 1e-9
    for stretch in (0.6, 0.9, 1.5, 2.5):

        def lateral(w: float, stretch: float = stretch) -> float:
            return MU * w + (-MU + (LAMBDA + MU) * (w * w * stretch - 1)) * w * stretch

        w = brentq(lateral, 0.3, 2.0)
        forces = solid.evaluate(homogeneous(solid, np.diag([w, w, stretch]))).forces
        pull = MU * stretch + (-MU + (LAMBDA + MU) * (w * w * stretch - 1)) * w * w
        assert forces[top, 2].sum() == pytest.approx(pull * 0.02**2, rel=1e-12)
        assert np.abs(forces[side, 0]).max() < 1e-10 * MU * 0.02**2
    for gamma in (0.1, 1.0, 3.0):
        f = np.eye(3)
        f[0, 2] = gamma
        strain = solid.evaluate(homogeneous(solid, f))
        assert strain.energy == pytest.approx(0.5 * MU * gamma**2 * volume.size, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_gradient_and_tangent_are_derivatives(law: Law) -> None:
    solid = shaken(law)
    rng = np.random.default_rng(3)
    free = ~solid.elements.dirichlet[:, None]
    for size in (1e-3, 6e-3):  # the larger inverts tetrahedra
        at = size * rng.standard_normal(solid.points.shape) * free
        ways = rng.standard_normal((6, *at.shape)) * free
        here = solid.evaluate(at)
        pushed = np.array([solid.core.tangent(np.ascontiguousarray(way)) for way in ways])
        products = np.einsum("iab,jab->ij", ways, pushed)
        assert np.allclose(products, products.T, rtol=1e-5, atol=1e-5 * np.abs(products).max())
        h = 1e-7
        for way, push in zip(ways, pushed, strict=True):
            plus, minus = solid.evaluate(at + h * way), solid.evaluate(at - h * way)
            assert (plus.energy - minus.energy) / (2 * h) == pytest.approx((here.forces * way).sum(), rel=1e-5)
            assert np.allclose((plus.forces - minus.forces) / (2 * h), push, atol=2e-5 * np.abs(push).max())


def smoothed_stiffness(solid: HyperelasticModel) -> Array:
    """Assemble linear elasticity: strain averaged over the tetrahedra at an edge, divergence over those at a node."""
    points, cells = solid.points, solid.elements.volume.tetrahedra
    corners = np.concatenate([points[cells], np.ones((len(cells), 4, 1))], axis=2)
    slopes = np.linalg.inv(corners)[:, :3]  # of the hat functions
    sizes = np.abs(np.linalg.det(corners)) / 6.0
    strain = np.zeros((len(cells), 9, points.size))  # gradient of the displacement, row by row
    for i in range(4):
        for a in range(3):
            for b in range(3):
                strain[np.arange(len(cells)), 3 * a + b, 3 * cells[:, i] + a] = slopes[:, b, i]
    swap = np.arange(9).reshape(3, 3).T.ravel()
    shear = 0.5 * (strain + strain[:, swap])
    total = np.zeros((points.size, points.size))
    edges = {tuple(sorted((c[i], c[j]))) for c in cells.tolist() for i in range(4) for j in range(i)}
    for edge in edges:
        at = np.isin(cells, edge).sum(axis=1) == 2
        mean = np.tensordot(sizes[at], shear[at], 1) / sizes[at].sum()
        total += 2.0 * MU * sizes[at].sum() / 6.0 * mean.T @ mean
    for node in range(len(points)):
        at = (cells == node).any(axis=1)
        mean = np.tensordot(sizes[at], strain[at][:, [0, 4, 8]].sum(axis=1), 1) / sizes[at].sum()
        total += LAMBDA * sizes[at].sum() / 4.0 * np.outer(mean, mean)
    return total


@pytest.mark.parametrize("law", LAWS)
def test_small_loads_are_linear_smoothed_elements(law: Law) -> None:
    """Against an assembly by numpy of Liu & Nguyen-Thoi's edge domains and of nodal volumes."""
    solid = shaken(law)
    load = np.zeros_like(solid.points)
    load[np.argmax(solid.points.sum(axis=1))] = [1e-6, -2e-6, 1e-6]
    free = np.repeat(~solid.elements.dirichlet, 3)
    expected = np.linalg.solve(smoothed_stiffness(solid)[np.ix_(free, free)], load.ravel()[free])
    found = solid.solve_equilibrium(load).ravel()[free]
    assert np.abs(found - expected).max() < 1e-4 * np.abs(expected).max()


def test_a_large_bend_is_that_of_another_program() -> None:
    """A bar under a heavy end load: scikit-fem assembles the law from the textbook on quadratic elements."""
    import skfem
    from skfem.helpers import ddot, det, grad, inv, transpose

    volume = block((0.04, 0.01, 0.01), 0.005)
    wall = half_space("x", "<", 1e-9)
    solid = HyperelasticModel(volume, MATERIAL, wall)
    load = np.zeros_like(solid.points)
    end = np.abs(solid.points[:, 0] - 0.04) < 1e-9
    load[end, 2] = -0.02 / end.sum()
    found = solid.solve_equilibrium(load)

    mesh = skfem.MeshTet(volume.points.T, volume.tetrahedra.T, sort_t=False)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)
    eye = np.eye(3)[:, :, None, None]

    @skfem.LinearForm
    def inner(v, w):  # type: ignore[no-untyped-def]
        f = grad(w["u"]) + eye
        j = det(f)
        p = MU * f + (-MU + (LAMBDA + MU) * (j - 1)) * j * transpose(inv(f))
        return ddot(p, grad(v))

    @skfem.BilinearForm
    def change(u, v, w):  # type: ignore[no-untyped-def]
        f = grad(w["u"]) + eye
        j, g = det(f), transpose(inv(f))
        dj = j * ddot(g, grad(u))
        dg = -np.einsum("ij...,kj...,kl...->il...", g, grad(u), g)
        c = -MU + (LAMBDA + MU) * (j - 1)
        return ddot(MU * grad(u) + ((LAMBDA + MU) * dj * j + c * dj) * g + c * j * dg, grad(v))

    dofs = basis.nodal_dofs  # 3 x points
    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda x: x[0] < 1e-9).flatten())
    u, push = np.zeros(basis.N), np.zeros(basis.N)
    push[dofs] = load.T
    for share in (0.15, 0.35, 0.6, 1.0):
        for _ in range(12):
            left = share * push - inner.assemble(basis, u=basis.interpolate(u))
            if np.abs(left[free]).max() < 1e-7:
                break
            k = change.assemble(basis, u=basis.interpolate(u))
            u[free] += spsolve(k[free][:, free].tocsc(), left[free])
    assert np.abs(left[free]).max() < 1e-7
    assert np.abs(found).max() > 0.015
    assert found[end].mean(axis=0) == pytest.approx(u[dofs].T[end].mean(axis=0), abs=0.03 * np.abs(found).max())


@pytest.mark.parametrize("law", LAWS)
def test_a_cantilever_bends_as_the_elastica(law: Law) -> None:
    """A slender bar, nu = 0, bent by more than half its length: meshes of h and h/2 extrapolated."""
    long, thick, young = 0.1, 0.005, 1e6
    inertia = thick**4 / 12
    force = 3.0 * young * inertia / long**2
    down = []
    for cells in (2, 4):
        volume = block((long, thick, thick), thick / cells)
        solid = HyperelasticModel(volume, Material(young, 0.0), half_space("x", "<", 1e-9), law=law)
        load = np.zeros_like(solid.points)
        end = np.abs(solid.points[:, 0] - long) < 1e-9
        for share in np.linspace(0.2, 1, 5):
            load[end, 2] = -share * force / end.sum()
            bent = solid.solve_equilibrium(load, tolerance=1e-6)
        down.append(-bent[end, 2].mean())

    def end_moment(curvature: float) -> float:
        return float(rod(curvature)[1, -1])

    def rod(curvature: float) -> Array:  # angle, its slope, height, by arc length
        law = lambda _s, y: [y[1], -force / (young * inertia) * np.cos(y[0]), np.sin(y[0])]  # noqa: E731
        return np.asarray(solve_ivp(law, (0, long), [0, curvature, 0], rtol=1e-9, atol=1e-12).y)

    expected = rod(brentq(end_moment, 1.0, 60.0))[2, -1]
    assert expected > 0.55 * long
    assert (4 * down[1] - down[0]) / 3 == pytest.approx(expected, rel=0.03)


def test_what_is_refused() -> None:
    volume = block((0.02, 0.02, 0.02), 0.01)
    with pytest.raises(BodyError, match="neo-hookean or corotational"):
        HyperelasticModel(volume, MATERIAL, BOTTOM, law="rubber")  # type: ignore[arg-type]
    with pytest.raises(BodyError, match="fixed: no node"):
        HyperelasticModel(volume, MATERIAL, half_space("z", "<", -1.0))
    solid = HyperelasticModel(volume, MATERIAL, BOTTOM)
    with pytest.raises(BodyError, match="one finite vector"):
        solid.solve_equilibrium(np.zeros((3, 3)))
    load = np.zeros_like(solid.points)
    load[-1] = [1e9, 0, 0]
    with pytest.raises(BodyError, match="no equilibrium was found"):
        solid.solve_equilibrium(load, max_steps=2)
