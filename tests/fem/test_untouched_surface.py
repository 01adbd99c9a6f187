"""A tip beside the border of the contact surface: refused, reported, or as on a body that is touched all over."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from palpate import Mesh, fem
from palpate.fem import Body, BodyError, BodyWarning, block
from palpate.simulation.bodies import _in_phase

Array = NDArray[np.float64]
BALL, TIP = 20e-3, 8e-3
OVERLAPS = "overlaps a part of the surface that is fixed, held or not touched"


@cache
def ball(touch: str | None) -> Body:
    """Return a ball of 20 mm, held below."""
    surface = trimesh.creation.icosphere(4, BALL)
    mesh = Mesh(surface.vertices, surface.faces)
    return fem.build(mesh, young=10e3, fixed="z < -12 mm", spacing=5e-3, touch=touch).signed_distance()


def place(x: float) -> Array:
    """Return a point of the ball, m, `x`, m, beside its middle plane."""
    return np.array([x, 0.0, np.sqrt(BALL**2 - x * x)])


def press(body: Body, point: Array, depth: float) -> tuple[float, bool, float | None]:
    """Return the force, N, whether an overlap is reported, and the stated error."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        pressed = body.indent(point, TIP, depth)
    return float(np.linalg.norm(pressed.force)), any(OVERLAPS in str(one.message) for one in found), pressed.error


@pytest.mark.parametrize("x", [-1e-3, -4e-3, -7e-3])
def test_a_press_on_a_part_that_is_not_touched_is_refused_even_within_a_radius_of_the_border(x: float) -> None:
    with pytest.raises(BodyError, match="from a part of the surface that is not touched"):
        ball("x > 0 mm").indent(place(x), TIP, 1e-3)


def test_a_press_beside_the_border_is_as_on_a_whole_body_or_says_that_its_force_is_too_small() -> None:
    reported = 0
    for x in (4e-3, 5e-3, 6e-3, 8e-3):
        for depth in (0.8e-3, 2.4e-3):
            force, over, error = press(ball("x > 0 mm"), place(x), depth)
            whole = press(ball(None), place(x), depth)
            assert not whole[1]
            if over:
                reported += 1
                assert error is None
            else:
                assert force == pytest.approx(whole[0], rel=0.06)
                assert error == whole[2]
    assert 2 <= reported <= 6


def test_a_touched_top_is_pressed_beside_its_edge_without_a_word_of_the_sides() -> None:
    """The sides turn away from the tip."""
    volume = block((0.04, 0.04, 0.02), (4e-3, 4e-3, 4e-3))
    body = fem.build(volume, young=10e3, fixed="z < 0.1 mm", touch="z > 19.9 mm", order=1)
    for tip in ("sphere", "flat"):
        with warnings.catch_warnings():
            warnings.filterwarnings("error", OVERLAPS, BodyWarning)
            body.indent((5e-3, 20e-3, 20e-3), 8e-3, 2e-3, tip=tip)  # type: ignore[arg-type]


def test_nodes_that_can_no_longer_be_touched_are_not_part_of_the_contact_surface() -> None:
    body = ball(None).with_support_changes([{"at": "10 ms", "touchable": "x > 0 mm"}], period="1 ms")
    center = (place(-4e-3) * (BALL + TIP - 1e-3) / BALL)[None]
    assert [_in_phase(body, phase).overlaps_untouched(center, TIP)[0] for phase in (0, 1)] == [False, True]
