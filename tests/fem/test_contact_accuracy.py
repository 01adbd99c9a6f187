"""Error of a force by the mesh: its table, the spacing chosen for a tip, and where it is stated."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from palpate import Mesh
from palpate import fem as bodies
from palpate.fem import BodyError, BodyWarning, block, force_error, spacing_for

trimesh = pytest.importorskip("trimesh")

FORCE = 0.1533  # N, converged axisymmetric elements: sphere of 8 mm, 2 mm deep, cylinder of 20 x 60 mm


def test_more_nodes_have_a_smaller_error_and_signed_distance_a_smaller_one() -> None:
    for signed_distance in (False, True):
        errors = [force_error(nodes, signed_distance=signed_distance) for nodes in range(1, 60)]
        assert all(a >= b for a, b in pairwise(errors))
    assert force_error(0, signed_distance=True) is None
    assert all(force_error(n, signed_distance=True) < force_error(n, signed_distance=False) for n in range(1, 60))


def test_the_spacing_grows_with_the_contact_radius_and_the_allowed_error() -> None:
    assert spacing_for("8 mm", "2 mm", 0.05) == spacing_for(8e-3, accuracy="5%") == spacing_for("8 mm")
    assert spacing_for("16 mm", "4 mm") == pytest.approx(2.0 * spacing_for("8 mm", "2 mm"))
    assert spacing_for("8 mm", accuracy="20%") > 1.5 * spacing_for("8 mm")
    with pytest.raises(BodyError, match="accuracy: 1 %; the error of the mesh is known from 4 to 33 %"):
        spacing_for("8 mm", accuracy="1%")


def test_a_body_built_for_a_tip_has_the_wished_accuracy() -> None:
    cylinder = trimesh.creation.cylinder(0.03, 0.02, sections=64).apply_translation([0.0, 0.0, 0.01])
    body = bodies.build(
        Mesh(cylinder.vertices, cylinder.faces),
        young="10 kPa",
        fixed="z < 0.1 mm",
        touch="box -12 -12 19.9 to 12 12 20.1 mm",
        tip_radius="8 mm",
        accuracy="10%",
    ).signed_distance()
    places = np.random.default_rng(0).uniform(-4e-3, 4e-3, (6, 2))
    presses = [body.indent([x, y, 0.02], "8 mm", "2 mm") for x, y in places]
    errors = np.array([press.force[2] / FORCE - 1.0 for press in presses])
    assert np.abs(errors).max() < 0.10
    assert all(press.error == force_error(press.nodes, signed_distance=True) for press in presses)


def test_contradicting_choices_of_the_spacing_are_refused() -> None:
    given = {"source": block(0.02, 0.01), "young": 5e3, "fixed": "z < 1 mm"}
    with pytest.raises(BodyError, match="give its radius too"):
        bodies.build(**given, accuracy="5%")
    with pytest.raises(BodyError, match="leave out one of them"):
        bodies.build(**given, tip_radius="8 mm", spacing="5 mm")


def test_a_press_on_few_nodes_states_its_error() -> None:
    body = bodies.build(block((0.04, 0.04, 0.02), 0.01), young=5e3, fixed="z < 0.1 mm")
    with pytest.warns(BodyWarning, match=r"only 1 of the body's nodes are in contact.*error up to 180 %"):
        assert body.indent([0.02, 0.02, 0.02], "4 mm", "0.5 mm").error == 1.8
    with pytest.warns(BodyWarning, match="too few for an accurate force: use"):
        assert body.indent([0.02, 0.02, 0.02], "4 mm", "0.5 mm", tip="flat").error is None
