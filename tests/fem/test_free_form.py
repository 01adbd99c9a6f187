"""Bodies as free-form deformations: what the spline does, its law of force, and how far that is from a solid."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import Body, BodyError, BodyWarning, block
from palpate.fem.free_form import check_fit, weights
from palpate.fem.selectors import half_space
from scipy.spatial.transform import Rotation

HEIGHT = 0.02
BOTTOM, TOP = half_space("z", "<", 1e-9), half_space("z", ">", HEIGHT - 1e-9)
MIDDLE = [0.02, 0.02, HEIGHT]


@pytest.fixture(scope="module")
def body() -> Body:
    return bodies.build(block((0.04, 0.04, HEIGHT), 0.004), young=5e3, fixed=BOTTOM, touch=TOP)


@pytest.fixture(scope="module")
def spline(body: Body) -> Body:
    return body.free_form()


def test_control_points_moved_as_a_straight_map_move_all_points_so() -> None:
    """Weights sum to one, and reproduce straight lines: sum_c B_c p_c is the point itself."""
    points = np.random.default_rng(1).uniform(-0.03, 0.05, (50, 3))
    b = weights(points, 7e-3)
    assert np.asarray(b.sum(axis=1)).ravel() == pytest.approx(np.ones(50), abs=1e-14)
    assert b.min() >= 0
    assert (np.diff(b.indptr) == 64).all()
    turned = weights(points + 1.25 * 7e-3, 7e-3)
    assert abs((b @ b.T) - (weights(points + 7e-3, 7e-3) @ weights(points + 7e-3, 7e-3).T)).max() < 1e-15
    assert abs((b @ b.T) - (turned @ turned.T)).max() > 1e-3  # it is the grid's cells that it knows


def test_the_core_moves_nodes_by_the_least_change_of_control_points(spline: Body) -> None:
    """Hsu, Hughes & Kaufman's least squares, solved densely, on top of the layer: the same displacement."""
    law = spline.free_form_law
    displacement = spline.indent(MIDDLE, "8 mm", "1 mm").displacement
    nodes, forces = spline.core.contact_forces()
    b = weights(spline.nodes, law.spacing)
    goal = -displacement[nodes, 2] - forces * law.layer_compliance / spline.contents.areas[nodes]
    least = np.linalg.pinv(b[nodes].toarray()) @ goal
    moved = b @ least
    moved[nodes] += forces * law.layer_compliance / spline.contents.areas[nodes]
    assert -displacement[:, 2] == pytest.approx(moved, abs=1e-9)
    assert law.control_compliance * (b[nodes].T @ forces) == pytest.approx(least, abs=1e-8)


def test_force_is_the_slope_of_stored_energy(spline: Body) -> None:
    step = 1e-7
    for tip in ("sphere", "flat"):
        top = 0.008 if tip == "sphere" else 0.0
        centre = np.array([0.0213, 0.0187, HEIGHT + top - 1.2e-3])
        felt = spline.simulate_path(centre[None], 0.008, outward=[0, 0, 1], tip=tip)
        for axis in range(3):
            way = centre + np.outer([-1, 1], step * np.eye(3)[axis])
            low, high = spline.simulate_path(way, 0.008, outward=[0, 0, 1], tip=tip).energy
            assert felt.force[0, axis] == pytest.approx(-(high - low) / (2 * step), rel=2e-3, abs=1e-5)


def test_closed_paths_give_no_work(spline: Body) -> None:
    t = np.linspace(0, 2 * np.pi, 4001)
    random = np.random.default_rng(2)
    for _ in range(20):
        a, b = random.normal(size=(2, 3)) * [3e-3, 3e-3, 8e-4]
        way = np.outer(1 - np.cos(t), a) + np.outer(np.sin(2 * t), b) + [0.02, 0.02, HEIGHT + 0.0075]
        force = spline.simulate_path(way, 0.008, outward=[0, 0, 1]).force
        parts = (0.5 * (force[1:] + force[:-1]) * np.diff(way, axis=0)).sum(axis=1)
        assert abs(parts.sum()) < 1e-4 * np.abs(parts).sum() + 1e-12


def test_it_is_reciprocal_and_never_pulls(spline: Body) -> None:
    """Through the core: a force on one node moves another as far as the other way round."""
    law, n = spline.free_form_law, len(spline.nodes)
    b = weights(spline.nodes, law.spacing).toarray()
    whole = law.control_compliance * b @ b.T + np.diag(law.layer_compliance / spline.contents.areas)
    own = [spline.core.node_response(i, np.array([1.0]))[0] for i in range(n)]
    assert own == pytest.approx(np.diag(whole), rel=1e-12)
    assert np.linalg.eigvalsh(whole)[0] > 0
    spline.indent(MIDDLE, "8 mm", "1 mm")
    assert (spline.core.contact_forces()[1] > 0).all()


def test_near_the_tip_it_is_crudely_the_solid_and_far_away_it_is_still(body: Body, spline: Body) -> None:
    for radius in (5e-3, 8e-3):
        solid, shaped = body.indent(MIDDLE, radius, 1e-3, tip="flat"), spline.indent(MIDDLE, radius, 1e-3, tip="flat")
        assert shaped.force[2] == pytest.approx(solid.force[2], rel=0.45)
        assert np.linalg.norm(shaped.displacement - solid.displacement) < 0.4 * np.linalg.norm(solid.displacement)
    fine = body.free_form(control_spacing="3 mm")
    far = np.linalg.norm(fine.nodes - MIDDLE, axis=1) > 0.005 + 4 * 3e-3 * np.sqrt(2)
    assert far.any()
    moved = fine.indent(MIDDLE, 5e-3, 1e-3, tip="flat").displacement
    assert np.abs(moved[far]).max() == 0.0


def test_it_scales_with_stiffness_and_takes_any_period(body: Body, spline: Body) -> None:
    hard = bodies.build(block((0.04, 0.04, HEIGHT), 0.004), young=20e3, fixed=BOTTOM, touch=TOP).free_form("1 ms")
    soft = spline.indent(MIDDLE, "8 mm", "1 mm").force
    assert hard.indent(MIDDLE, "8 mm", "1 mm").force == pytest.approx(4.0 * soft, rel=1e-4, abs=1e-9)
    assert body.free_form("0.1 ms").indent(MIDDLE, "8 mm", "1 mm").force == pytest.approx(soft, rel=1e-12)
    with pytest.raises(BodyError, match="control_spacing: 0 m must be positive"):
        body.free_form(control_spacing=0.0)
    with pytest.raises(BodyError, match="period: -1 s must be positive"):
        body.free_form(-1.0)


def test_weights_do_not_care_for_the_order_of_points() -> None:
    points = Rotation.random(5, random_state=3).as_rotvec() * 0.01
    order = [3, 1, 4, 0, 2]
    gram = (weights(points, 4e-3) @ weights(points, 4e-3).T).toarray()
    assert (weights(points[order], 4e-3) @ weights(points[order], 4e-3).T).toarray() == pytest.approx(
        gram[np.ix_(order, order)], abs=1e-15
    )


def test_a_fit_that_misses_the_force_by_a_third_is_warned_of() -> None:
    """A plate clamped at two ends is soft in the middle, and the law is the same everywhere."""
    plate = bodies.build(block((0.06, 0.03, 0.006), 0.006), young=20e3, fixed=["x < 0.1 mm", "x > 59.9 mm"], order=1)
    with pytest.warns(BodyWarning, match="flat ends at 8 places need"):
        spline = plate.free_form()
    middle = [0.03, 0.015, 0.006]
    ratio = [kind.indent(middle, "8 mm", "1 mm", tip="flat").force[2] for kind in (spline, plate)]
    assert not 0.7 < ratio[0] / ratio[1] < 1.3


def test_the_check_of_a_fit_compares_forces(recwarn: pytest.WarningsRecorder) -> None:
    points, areas = np.random.default_rng(0).uniform(0, 1, (50, 3)), np.full(50, 1e-4)
    check_fit(points, areas, lambda *_: 1.2, lambda *_: 1.0)
    assert not recwarn.list
    with pytest.warns(BodyWarning, match="need 1 to 1.5 times"):
        check_fit(points, areas, lambda x, *_: 1.5 if x[0] > 0.5 else 1.0, lambda *_: 1.0)
