"""Surfaces in 3D: the colour of each piece is that of the nodes' values where it lies, and the scale is the nodes'."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from palpate import fem as bodies
from palpate.fem import Body
from palpate.plotting.body_contact import deformed_surface
from palpate.plotting.style import FAINT
from palpate.plotting.surface import divided, draw_colored, frame, new_space, stretched

values_at_corners = st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 3), min_size=1, max_size=6)


@given(values=values_at_corners)
def test_pieces_tile_their_triangle_and_none_spans_more_than_a_step_of_colour(values: list[tuple[float, ...]]) -> None:
    """Areas add up to the whole, without overlap; so does the integral of what is linear in it."""
    table = np.array(values)
    seen: list[int] = []
    for which, weights in divided(table, 1.0):
        seen += which.tolist()
        assert weights.min() >= -1e-12
        np.testing.assert_allclose(weights.sum(axis=2), 1.0)
        (a, b, c) = np.moveaxis(weights[:, :, 1:], 1, 0)
        first, second = b - a, c - a
        area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]  # as a part of the triangle's, with its sign
        assert area.min() > 0.0
        assert area.sum() == pytest.approx(1.0)
        at = np.einsum("pcw,kw->kpc", weights, table[which])
        assert np.ptp(at, axis=2).max() <= 1.0 / 16.0 + 1e-9
        np.testing.assert_allclose(at.mean(axis=2) @ area, table[which].mean(axis=1), atol=1e-12)
    assert sorted(seen) == list(range(len(table)))


def test_a_colour_is_right_where_it_is() -> None:
    """x + 2 y over a square of two triangles: each piece has the colour of its middle; the mesh's lines have none."""
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
    scale = ScalarMappable(Normalize(0.0, 3.0), "cividis")
    _, (space,) = new_space()
    drawn = draw_colored(space, corners, corners @ [1.0, 2.0, 0.0], scale)
    frame(space, corners.reshape(-1, 3), 0.2)
    pieces, inner, outer = np.array(drawn._faces), drawn._facecolor3d, drawn._edgecolor3d
    filled = inner[:, 3] > 0.0
    across = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])[:, 2] / 2.0
    assert across[filled].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(across[~filled], 0.0, atol=1e-15)
    np.testing.assert_allclose(inner[filled], scale.to_rgba(pieces[filled].mean(axis=1) @ [1.0, 2.0, 0.0]))
    faint = np.all(outer == np.array(to_rgba(FAINT)), axis=1)
    assert np.array_equal(faint, ~filled)
    lengths = np.linalg.norm(pieces[~filled, 1] - pieces[~filled, 0], axis=1)
    assert lengths.sum() == pytest.approx(4.0 + 2.0 * np.sqrt(2.0))  # the diagonal belongs to both


@pytest.fixture(scope="module")
def block() -> Body:
    """40 x 40 x 20 mm, bonded below, of coarse cells: the tip presses few nodes."""
    return bodies.build(bodies.block((0.04, 0.04, 0.02), 0.01), young=5e3, fixed="z < 0.001 mm", touch="z > 19.9 mm")


def scale_ends(figure: Any) -> list[float]:
    return [axes.get_xlim()[1] for axes in figure.axes if axes.get_label() == "<colorbar>"]


def test_the_colour_scales_end_at_the_nodes_largest_values_and_the_picture_reaches_them(block: Body) -> None:
    """The mean of a facet under the edge of a tip is a third or two of what its nodes have."""
    felt = block.indent([0.02, 0.02, 0.02], 8e-3, 2e-3, tip="flat")
    pressure = block.pressure()
    figure = deformed_surface(block, felt.displacement, pressure)
    most = (1e3 * np.linalg.norm(felt.displacement, axis=1).max(), 1e-3 * pressure.max())
    assert scale_ends(figure) == pytest.approx(most)
    solids = [axes for axes in figure.axes if axes.name == "3d"]
    for axes, name in zip(solids, ("cividis", "magma_r"), strict=True):
        (drawn,) = axes.collections
        steps = colormaps[name](np.arange(256))
        shown = drawn._facecolor3d[drawn._facecolor3d[:, 3] > 0.0]
        nearest = np.linalg.norm(shown[:, None] - steps, axis=2).argmin(axis=1)
        assert nearest.max() >= 255 * (1.0 - 2.0 / 3.0 / 16.0) - 1.0


def test_a_body_at_rest_is_drawn(block: Body) -> None:
    """Flat and without pressure: nothing to divide by is divided by."""
    zero = np.zeros(len(block.nodes))
    figure = deformed_surface(block, np.zeros((len(zero), 3)), zero)
    solid = next(axes for axes in figure.axes if axes.name == "3d")
    assert np.ptp(solid.get_zlim()) > 0.0


def test_values_beyond_the_color_scale_do_not_divide_triangles() -> None:
    """Under a tip that was pushed through a body the pressure is negative, and its scale ends at zero."""
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    for values, low, high, most in (([-20.0, -10.0, 0.0], 0.0, 1.0, 4), ([-1.5, 0.0, 0.0], 0.0, 1e-12, 4)):
        _, (space,) = new_space()
        drawn = draw_colored(space, corners, [values], ScalarMappable(Normalize(low, high), "magma_r"))
        assert len(drawn._faces) <= most


def test_a_flat_axis_has_round_ticks_within_the_data_and_room_for_all_of_it() -> None:
    for low, high in ((0.013, 0.094), (-0.31, 0.26), (3.1, 8.7)):
        _, (space,) = new_space()
        frame(space, np.array([[0.0, 0.0, low], [100.0, 100.0, high]]), 0.15)
        step = 10.0 ** np.floor(np.log10(high - low))
        first, last = space.get_zticks()
        assert low <= first < low + step
        assert high - step < last <= high
        assert np.array([first, last]) / step == pytest.approx(np.round(np.array([first, last]) / step))
        assert space.get_zlim() == pytest.approx((low, high))
        assert len(space.get_xticks()) > 2


def test_a_caption_says_how_far_a_flat_surface_is_stretched(block: Body) -> None:
    """0.15 of the longest extent is the least that one is drawn: 40 mm wide and 2 mm high, it is three times as high.

    A surface that no extent of is shorter is drawn as it is, and nothing is said.
    """
    felt = block.indent([0.02, 0.02, 0.02], 8e-3, 2e-3, tip="flat")
    figure = deformed_surface(block, felt.displacement, block.pressure())
    x = block.surface.vertices + block.on_surface(felt.displacement)
    high, wide = np.ptp(x[:, 2]), max(np.ptp(x[:, 0]), np.ptp(x[:, 1]))
    assert stretched(figure) == f" For visibility, z is stretched {0.15 * wide / high:.3g} times."
    other, (space,) = new_space()
    frame(space, np.array([[0.0, 0.0, 0.0], [3.0, 1.0, 2.0]]), 0.3)
    assert stretched(other) == ""
    frame(space, np.array([[0.0, 0.0, 0.0], [0.25, 10.0, 0.5]]), 0.3)
    assert stretched(other) == " For visibility, x is stretched 12 times and z is stretched 6 times."


def test_pieces_do_not_depend_on_where_the_scale_begins() -> None:
    """Values and the ends of their scale moved together have the same pieces and colors."""
    corners = np.random.default_rng(0).normal(size=(4, 3, 3))
    values = np.random.default_rng(1).uniform(0.0, 1.0, (4, 3))
    drawn = []
    for begin in (0.0, 0.75, -5.0):
        solid = new_space()[1][0]
        scale = ScalarMappable(Normalize(begin, begin + 1.0), colormaps["viridis"])
        drawn.append(draw_colored(solid, corners, values + begin, scale))
    counts = [len(one.get_facecolor()) for one in drawn]
    assert counts[0] == counts[1] == counts[2] > 4 * 4
