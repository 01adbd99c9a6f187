"""Supports and contact areas that change along a path: a dense finite-element solution, and bodies built so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem
from palpate import fem
from palpate.fem import Body, BodyError, SupportChange
from skfem.helpers import ddot, sym_grad, trace

LEFT, RIGHT = "x < 11 mm", "x > 29 mm"
ELASTIC = ("compliance", "signed_distance")
PERIOD, RADIUS = "1 ms", 8e-3


def of_kind(body: Body, kind: str) -> Body:
    if kind == "viscoelastic":
        return body.viscoelastic(PERIOD, instantaneous_ratio=2.5, retardation_time="40 ms", contact="signed_distance")
    if kind == "modal":
        return body.modal(PERIOD, rayleigh_alpha=5.0, rayleigh_beta=1e-3, contact="signed_distance")
    return body.signed_distance() if kind == "signed_distance" else body


def down(deep: float, steps: int, start: float = 0.0, x: float = 20e-3) -> np.ndarray[Any, Any]:
    """Centers of a sphere over the middle of the top (steps, 3), m, from a depth of `start` to one of `deep`."""
    depth = start + (deep - start) * np.arange(1, steps + 1) / steps
    return np.column_stack([np.full(steps, x), np.full(steps, 20e-3), 20e-3 + RADIUS - depth])


def path(body: Body, centers: np.ndarray[Any, Any], go_on: bool = False) -> fem.ContactHistory:
    return body.simulate_path(centers, RADIUS, outward=(0.0, 0.0, 1.0), go_on=go_on)


def built(fixed: list[str], **options: Any) -> Body:
    volume = fem.block(["40 mm", "40 mm", "20 mm"], "5 mm")
    return fem.build(volume, young="10 kPa", fixed=fixed, touch="z > 19.9 mm", **options)


@pytest.fixture(scope="module")
def body() -> Body:
    return built(["z < 0.1 mm"], modes=10)


@pytest.fixture(scope="module")
def coarse() -> Body:
    return built(["z < 0.1 mm"], order=1)


@pytest.mark.parametrize("kind", [*ELASTIC, "viscoelastic", "modal"])
def test_a_grasp_at_rest_gives_the_body_held_from_the_start(body: Body, kind: str) -> None:
    changing = of_kind(body, kind).with_support_changes([{"at": "10 ms", "held": LEFT}], PERIOD)
    held = of_kind(body, kind).held(LEFT)
    way = np.vstack([down(-1e-3, 20, -2e-3), down(4e-3, 40, -1e-3)])
    found, expected = path(changing, way), path(held, way)
    np.testing.assert_allclose(found.force, expected.force, atol=2e-5 * np.abs(expected.force).max())
    np.testing.assert_allclose(found.energy, expected.energy, atol=2e-5 * expected.energy.max())
    assert expected.nodes[-1] >= 4


def test_a_grasp_at_rest_gives_the_body_of_a_new_build(body: Body) -> None:
    """The condensed force differs by the edge of the support (`tests/fem/test_supports.py`)."""
    new = built(["z < 0.1 mm", "surface box -1 -1 19.9 to 11 41 21 mm"]).signed_distance()
    changing = body.signed_distance().with_support_changes([{"at": "5 ms", "held": LEFT}], PERIOD)
    for x, error in ((20e-3, 0.03), (30e-3, 1e-3)):
        way = np.vstack([down(-1e-3, 10, -2e-3, x), down(2e-3, 40, -1e-3, x)])
        changing.core.reset()
        new.core.reset()
        found, expected = (np.linalg.norm(path(of, way).force[-1]) for of in (changing, new))
        assert found == pytest.approx(expected, rel=error)


class Dense:
    """Linear tetrahedra of a body by scikit-fem, with the tractions of its contact nodes."""

    def __init__(self, body: Body, young: float = 10e3, poisson: float = 0.45) -> None:
        mesh = skfem.MeshTet(body.volume.points.T, body.volume.tetrahedra.T, sort_t=True)
        basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
        shear, lame = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        stiffness = skfem.BilinearForm(
            lambda u, v, w: 2 * shear * ddot(sym_grad(u), sym_grad(v)) + lame * trace(sym_grad(u)) * trace(sym_grad(v))
        ).assemble(basis)
        self.free = basis.complement_dofs(basis.get_dofs(lambda x: x[2] < 1e-6))
        self.stiffness = stiffness.toarray()[np.ix_(self.free, self.free)]
        top = skfem.FacetBasis(mesh, skfem.ElementTetP1(), facets=mesh.facets_satisfying(lambda x: x[2] > 0.02 - 1e-6))
        mass = skfem.BilinearForm(lambda u, v, w: u * v).assemble(top).toarray()
        nodes = np.array([int(np.argmin(np.linalg.norm(mesh.p.T - node, axis=1))) for node in body.nodes])
        hats = mass[:, nodes] / mass[:, nodes].sum(axis=0)
        loads = np.zeros((basis.N, 3 * len(nodes)))
        for axis in range(3):
            loads[basis.nodal_dofs[axis], axis::3] = hats
        self.loads = loads[self.free]

    def solve(self, force: Any, held: Any = (), where: Any = ()) -> np.ndarray[Any, Any]:
        """Displacement of the nodes (n, 3), m, under forces (n, 3), N, with rows `held` kept at `where`, m."""
        rows = np.asarray(held, dtype=int)
        constraint = self.loads[:, rows]
        n, k = len(self.free), len(rows)
        system = np.block([[self.stiffness, -constraint], [constraint.T, np.zeros((k, k))]])
        right = np.concatenate([self.loads @ np.ravel(force), np.ravel(where)])
        return np.asarray(self.loads.T @ np.linalg.solve(system, right)[:n]).reshape(-1, 3)


def loads_of(body: Body) -> np.ndarray[Any, Any]:
    nodes, forces = body.core.contact_forces()
    force = np.zeros_like(body.nodes)
    np.add.at(force, nodes, -forces[:, None] * body.normals[nodes])
    return force


def test_a_grasp_of_a_deformed_body_obeys_finite_elements_with_prescribed_displacements(coarse: Body) -> None:
    """Press, grasp, press elsewhere; then also grasp the other side, release the first one, and leave."""
    changes = [
        {"at": "20 ms", "held": LEFT},
        {"at": "40 ms", "held": [LEFT, RIGHT]},
        {"at": "60 ms", "held": RIGHT},
        {"at": "80 ms", "held": []},
    ]
    body, dense = coarse.with_support_changes(changes, PERIOD), Dense(coarse)
    body.core.reset()
    rows = np.arange(3 * len(body.nodes)).reshape(-1, 3)
    left, right = rows[body.nodes[:, 0] < 11e-3].ravel(), rows[body.nodes[:, 0] > 29e-3].ravel()
    stages = [
        (down(4e-3, 20, x=18e-3), np.empty(0, dtype=int)),
        (down(2e-3, 20, 4e-3, x=24e-3), left),
        (down(4e-3, 20, 2e-3, x=18e-3), np.concatenate([left, right])),
        (down(-1e-3, 20, 4e-3, x=18e-3), right),
        (down(-1e-3, 2, -1e-3), np.empty(0, dtype=int)),
    ]
    displacement, largest = np.zeros((len(body.nodes), 3)), 0.0
    for centers, held in stages:
        where = displacement.ravel()[held]  # as they are when they are grasped
        path(body, centers, go_on=True)
        displacement, forces = body.displacement(), loads_of(body)
        largest = max(largest, float(np.abs(displacement).max()))
        expected = dense.solve(forces, held, where)
        np.testing.assert_allclose(displacement, expected, atol=2e-6 * largest)
        if len(held):
            assert np.abs(where).max() > 0.01 * largest
    np.testing.assert_allclose(displacement, 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", ELASTIC)
def test_press_grasp_leave_and_release_dissipate_what_the_supports_kept(body: Body, kind: str) -> None:
    """Up to the release the work of the tip is the energy of the body; the release loses what is left."""
    side = "sphere 20 20 20 mm radius 14 mm"
    changing = of_kind(body, kind).with_support_changes(
        [{"at": "205 ms", "held": side}, {"at": "700 ms", "held": []}], PERIOD
    )
    way = np.vstack([down(3e-3, 200, -1e-3), down(3e-3, 10, 3e-3), down(-1e-3, 400, 3e-3), down(-1e-3, 200, -1e-3)])
    found = path(changing, way)
    steps = np.einsum("ij,ij->i", 0.5 * (found.force[1:] + found.force[:-1]), np.diff(way, axis=0))
    work = -np.append(0.0, steps).cumsum()
    largest = found.energy.max()
    for phase in (slice(0, 205), slice(205, 700)):
        energy = found.energy[phase] - found.energy[phase.start]
        np.testing.assert_allclose(work[phase] - work[phase.start], energy, atol=2e-3 * largest)
    if kind == "compliance":  # also of the nodes under the tip
        assert found.energy[205] == pytest.approx(found.energy[204], rel=1e-5)
    assert found.energy[205] <= (1.0 + 1e-5) * found.energy[204]  # the layer under the tip expands
    assert found.energy[699] > 0.02 * largest
    np.testing.assert_array_equal(found.energy[700:], 0.0)
    assert work[-1] > 0.02 * largest


@pytest.mark.parametrize("kind", ELASTIC)
def test_a_body_is_touched_only_where_it_is_touchable(body: Body, kind: str) -> None:
    right = "x > 21 mm"
    changing = of_kind(body, kind).with_support_changes(
        [{"at": "0.02 s", "touchable": right}, {"at": "0.06 s", "touchable": []}], PERIOD
    )
    changing.core.reset()
    found = path(changing, np.vstack([down(4e-3, 20), down(4e-3, 39, 4e-3)]))
    nodes, _ = changing.core.contact_forces()
    assert (changing.nodes[nodes, 0] > 21e-3).all()
    assert len(nodes) > 0
    moved = changing.displacement()[changing.nodes[:, 0] < 21e-3]
    assert np.abs(moved).max() > 1e-4  # the others still deform
    assert 0.0 < np.linalg.norm(found.force[-1]) < 0.8 * np.linalg.norm(found.force[19])
    left = path(changing, np.vstack([down(-1e-3, 10, 4e-3), down(4e-3, 30, -1e-3)]), go_on=True)
    np.testing.assert_allclose(left.force[-1], found.force[19], rtol=1e-3, atol=1e-4)


def test_changes_survive_what_keeps_a_model(body: Body) -> None:
    changing = body.with_support_changes([SupportChange(0.01, (LEFT,))], PERIOD)
    assert str(changing.kind).endswith("1 change of supports")
    twice = changing.scaled_stiffness(2.0)
    way = np.vstack([down(-1e-3, 15), down(4e-3, 40, -1e-3)])
    ratio = path(twice, way).force[-1, 2] / path(changing, way).force[-1, 2]
    assert ratio == pytest.approx(2.0, rel=1e-5)
    assert changing.indent((20e-3, 20e-3, 20e-3), RADIUS, 4e-3).force == pytest.approx(
        body.indent((20e-3, 20e-3, 20e-3), RADIUS, 4e-3).force
    )
    assert changing.with_support_changes(None, PERIOD).kind == body.kind


def test_a_tool_of_several_tips_follows_changes(body: Body) -> None:
    points = [["-6 mm", "0 mm", "0 mm"], ["6 mm", "0 mm", "0 mm"]]
    tool = body.signed_distance().with_contact_points(points)
    changes = [{"at": "10 ms", "held": LEFT}]
    way = np.vstack([down(-2e-3, 20), down(1e-3, 40, -2e-3, x=25e-3)])
    forces = [
        path(of, way).force[-1]
        for of in (
            tool.with_support_changes(changes, PERIOD),
            body.signed_distance().with_support_changes(changes, PERIOD).with_contact_points(points),
            tool.held(LEFT),
        )
    ]
    np.testing.assert_array_equal(forces[0], forces[1])
    np.testing.assert_allclose(forces[0], forces[2], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda b: b.with_support_changes([{"at": "1 ms", "held": "x < -1 mm"}], PERIOD), "no contact node lies in"),
        (
            lambda b: b.with_support_changes([{"at": "1 ms", "held": "left"}], PERIOD),
            'supports: held: "left" is no region',
        ),
        (
            lambda b: b.with_support_changes([{"at": "1 ms", "touchable": "z < 1 mm"}], PERIOD),
            "touchable: no contact node",
        ),
        (
            lambda b: b.with_support_changes([{"at": "0 s", "held": LEFT}], PERIOD),
            "is that of the start: hold a region",
        ),
        (
            lambda b: b.with_support_changes([{"at": "2 ms", "held": LEFT}, {"at": "2 ms", "held": []}], PERIOD),
            "give increasing times",
        ),
        (lambda b: b.with_support_changes([{"at": "1 ms"}], PERIOD), "changes nothing: give held or touchable"),
        (lambda b: b.with_support_changes([{"held": LEFT}], PERIOD), "at is missing"),
        (lambda b: b.with_support_changes(5, PERIOD), "a list of changes is needed, not 5"),
        (lambda b: b.with_support_changes({"at": "1 s", "held": LEFT}, PERIOD), "a list of changes is needed"),
        (lambda b: b.with_support_changes([LEFT], PERIOD), "a change is a table such as"),
        (lambda b: b.with_support_changes([{"at": "1 s", "held": 5}], PERIOD), "regions are text such as"),
        (lambda b: b.with_support_changes([{"at": "1 s", "hold": LEFT}], PERIOD), 'unknown key "hold"'),
        (
            lambda b: b.with_support_changes([{"at": "1 s", "held": "z > 0 mm"}], PERIOD),
            "no node of the body can be touched",
        ),
        (
            lambda b: b.viscoelastic("1 ms", instantaneous_ratio=2, retardation_time="1 s").with_support_changes(
                [], PERIOD
            ),
            "or compliance without friction; not viscoelastic",
        ),
        (
            lambda b: b.viscoelastic(
                "1 ms", instantaneous_ratio=2, retardation_time="1 s", contact="signed_distance"
            ).with_support_changes([], "2 ms"),
            "period: ticks of 0.002 s; those of the model are 0.001 s",
        ),
        (lambda b: b.with_friction(0.5).with_support_changes([], PERIOD), "without friction"),
        (lambda b: b.with_support_changes([], PERIOD).with_friction(0.5), "without friction"),
    ],
)
def test_a_change_that_is_none_is_refused(coarse: Body, change: Any, sentence: str) -> None:
    with pytest.raises(BodyError, match=sentence):
        change(coarse)


def test_the_first_phase_in_which_no_node_can_be_touched_is_named(coarse: Body) -> None:
    """Phases before and after it have nodes that can be touched."""
    everything = "z > -1000 mm"
    changes = [{"at": "1 ms", "held": LEFT}, {"at": "2 ms", "held": everything}, {"at": "3 ms", "held": LEFT}]
    with pytest.raises(BodyError, match=r"^supports: from 0\.002 s on, no node of the body can be touched$"):
        coarse.with_support_changes(changes, "1 ms")


def test_friction_continues_over_a_grasp(coarse: Body) -> None:
    """A grasp under a tip that drags the surface keeps force and friction; the held body then resists more."""
    top = coarse.nodes[:, 2].max()
    middle = coarse.nodes.mean(axis=0)
    ticks = np.arange(160)
    way = np.stack(
        [
            middle[0] + 2e-4 * np.clip((ticks - 40) / 40, 0.0, 1.0) + 1e-4 * np.clip((ticks - 100) / 40, 0.0, 1.0),
            np.full(len(ticks), middle[1]),
            top + 8e-3 - 1e-3 * np.minimum(ticks / 40, 1.0),
        ],
        axis=1,
    )
    rough = coarse.signed_distance("1 ms", static_friction=1.0)
    free = rough.simulate_path(way, 8e-3)
    held = rough.with_support_changes([{"at": "95 ms", "held": LEFT}], PERIOD).simulate_path(way, 8e-3)
    np.testing.assert_array_equal(held.force[:95], free.force[:95])
    assert np.linalg.norm(free.friction[94]) > 0.05 * np.linalg.norm(free.force[94])
    assert np.linalg.norm(held.force[95] - free.force[95]) < 2e-3 * np.linalg.norm(free.force[95])
    assert np.linalg.norm(held.friction[95] - free.friction[95]) < 1e-2 * np.linalg.norm(free.friction[95])
    assert np.linalg.norm(held.friction[-1]) > 1.002 * np.linalg.norm(free.friction[-1])


def test_a_grasp_at_rest_holds_the_nodes_of_any_selector() -> None:
    """The text of a half space rounds its plane, and one of the user's own has no text that says where it is."""
    body = fem.build(fem.block((0.04, 0.04, 0.02), 0.04 / 6), young=1e4, fixed="z < 0.1 mm", touch="z > 19.9 mm")
    path = np.array([0.024, 0.02, 0.028]) + np.linspace(1e-3, -2.5e-3, 60)[:, None] * [0.0, 0.0, 1.0]
    jaw = fem.Selector("jaw", lambda x: (x[:, 0] < 14e-3) & (x[:, 1] < 21e-3))
    for region in (fem.half_space("x", "<=", 0.04 / 3), jaw):
        held = body.signed_distance().held(region).simulate_path(path, 8e-3).force
        changed = body.signed_distance().with_support_changes([{"at": "1 ms", "held": region}], "1 ms")
        assert changed.simulate_path(path, 8e-3).force == pytest.approx(held, abs=1e-6 * np.abs(held).max())


def test_no_model_is_chosen_after_changes_or_contact_points(coarse: Body) -> None:
    """They belong to a model, so they would be lost."""
    changing = coarse.signed_distance().with_support_changes([{"at": "10 ms", "held": LEFT}], PERIOD)
    tool = coarse.signed_distance().with_contact_points([["0 mm"] * 3, ["9 mm", "0 mm", "0 mm"]])
    for body, method in ((changing, "with_support_changes"), (tool, "with_contact_points")):
        for choose in (
            lambda body: body.signed_distance(),
            lambda body: body.viscoelastic(PERIOD, instantaneous_ratio=2.0, retardation_time="1 s"),
            lambda body: body.mass_spring(PERIOD),
            lambda body: body.hyperelastic(PERIOD),
        ):
            with pytest.raises(BodyError, match=f"choose the model before {method}"):
                choose(body)
        assert body.scaled_stiffness(2.0).with_friction(0.3).kind.supports == body.kind.supports


def test_several_tips_on_a_body_whose_supports_change_are_refused_for_that_reason(coarse: Body) -> None:
    changing = coarse.signed_distance().with_support_changes([{"at": "10 ms", "held": LEFT}], PERIOD)
    with pytest.raises(BodyError, match="supports: several paths on a body whose supports change"):
        changing.simulate_tips(down(1e-3, 5)[:, None], [RADIUS])
