"""Pages of maps and performance show the numbers that they are given, in the units of their labels, and no others."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from given_results import OWN, PASSIVE, curve, grid_workspace, performance, simulated, zwidth
from palpate.report import html
from palpate.report.performance import performance_page, ripple_figure, stiffness_figure
from palpate.report.run import _axes
from palpate.report.workspace import _ticks, axes_figure, section_figure, workspace_page
from palpate.report.zwidth import close_figure, zwidth_figure, zwidth_page
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.zwidth_map import Corner


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without the drawings of their figures, which take seconds."""
    monkeypatch.setattr(html, "inline_svg", lambda *_: "<svg></svg>")


def drawn(panel: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): np.array(line.get_xydata()) for line in panel.lines}


def test_the_map_shows_each_curve_the_passive_region_the_dots_and_the_object_in_n_per_mm() -> None:
    other = curve(4.0, 1000.0)
    z = zwidth(curves={"a hand": OWN, "nobody": other}, passive=PASSIVE, not_passive="", simulated=simulated(OWN))
    (panel,) = zwidth_figure(z).axes
    lines = drawn(panel)
    for name, of in (("a hand, computed", OWN), ("nobody", other)):
        np.testing.assert_allclose(lines[name], np.column_stack([of.damping, of.stiffness / 1e3]))
    np.testing.assert_allclose(lines["the scenario's object"], [[2.0, 0.7]])
    dots = lines["simulated"]
    assert 20 <= len(dots) <= 40
    ours = np.column_stack([OWN.damping, OWN.stiffness / 1e3])
    assert np.abs(dots[:, None] - ours).max(axis=2).min(axis=1).max() < 1e-9
    labels = [area.get_label() for area in panel.collections]
    passive = panel.collections[labels.index("passive: stable with every operator")].get_paths()[0].vertices
    assert passive.max(axis=0) == pytest.approx([2.0, 0.3])
    assert panel.get_xlim() == pytest.approx((0.0, 11.2))
    assert panel.get_ylim() == pytest.approx((0.0, 1.12 * 2.001))
    styles = {line.get_label(): line.get_linestyle() for line in panel.lines}
    assert (styles["a hand, computed"], styles["nobody"]) == ("-", "--")
    colors = [line.get_color() for line in panel.lines[:2]]
    assert colors[0] != colors[1]
    far = zwidth(here=(40.0, 9000.0))
    assert zwidth_figure(far).axes[0].get_xlim()[1] == pytest.approx(44.0)
    assert zwidth_figure(far).axes[0].get_ylim()[1] == pytest.approx(9.9)


def test_a_curve_that_jumps_is_drawn_in_pieces_with_one_label() -> None:
    b = np.r_[np.linspace(0, 1, 30), np.linspace(8, 10, 30)]
    jumping = Boundary(b, np.r_[np.linspace(100, 120, 30), np.linspace(900, 1000, 30)], np.zeros(60), (0.1, 10.0))
    (panel,) = zwidth_figure(zwidth(curves={"a hand": jumping})).axes
    labels = [line.get_label() for line in panel.lines]
    assert labels.count("a hand, computed") == 1
    pieces = [line.get_xydata() for line in panel.lines if line.get_label() != "the scenario's object"]
    assert [len(piece) for piece in pieces] == [30, 30]


@pytest.mark.usefixtures("undrawn")
def test_panels_of_details_appear_exactly_where_details_would_not_be_seen() -> None:
    corner = Corner((0.5, 20.0), curve(0.5, 18.0), simulated(curve(0.5, 18.0)))
    assert close_figure(zwidth()) is None
    for size, larger in ((1.15 * 1.12 * 0.99, False), (1.15 * 1.12 * 1.01, True)):
        wide = {"a hand": OWN, "stiff": curve(10.0 * size, 500.0)}
        high = {"a hand": OWN, "stiff": curve(5.0, 2001.0 * size - 1.0)}
        for curves in (wide, high):
            panels = close_figure(zwidth(curves=curves))
            assert (panels is not None) == larger
            page = zwidth_page(zwidth(curves=curves)).html()
            assert ("Complete curves of other operators" in page) == larger
    both = close_figure(zwidth(curves=wide, corner=corner, passive=PASSIVE, not_passive=""))
    assert both is not None
    whole, near = both.axes
    assert whole.get_xlim()[1] == pytest.approx(1.05 * 10.0 * size)
    assert whole.get_ylim()[1] == pytest.approx(1.05e-3 * 2001.0)
    assert [panel.get_title(loc="left") for panel in (whole, near)] == ["complete curves", "near the origin"]
    assert near.get_xlim() + near.get_ylim() == pytest.approx((0.0, 0.5, 0.0, 20.0))
    assert near.get_ylabel() == "stiffness K [N/m]"
    assert whole.get_ylabel() == "stiffness K [N/mm]"
    lines = drawn(near)
    assert "the scenario's object" not in lines  # 2 N s/m and 700 N/m are outside of this panel
    assert lines[", computed"][:, 1].max() == pytest.approx(19.0)
    assert len(lines["simulated"]) <= 20
    assert "passive" in [text.get_text() for text in near.texts]
    for window in ((2.5, 800.0), (20.0, 500.0), (5.0, 3000.0)):
        around = replace(corner, window=window)
        (panel,) = close_figure(zwidth(corner=around, passive=PASSIVE, not_passive="")).axes  # type: ignore[union-attr]
        (label,) = (text for text in panel.texts if text.get_text() == "passive")
        panel.figure.draw_without_rendering()
        within, axes = label.get_window_extent(), panel.get_window_extent()
        assert within.x0 > axes.x0
        assert within.y0 > axes.y0
    (only,) = close_figure(zwidth(corner=corner)).axes  # type: ignore[union-attr]
    assert only.get_title(loc="left") == "near the origin"
    (holding,) = close_figure(zwidth(corner=replace(corner, window=(2.5, 800.0)))).axes  # type: ignore[union-attr]
    np.testing.assert_allclose(drawn(holding)["the scenario's object"], [[2.0, 700.0]])
    assert not only.texts
    assert [text.get_text() for text in zwidth_figure(zwidth(corner=corner)).axes[0].texts] == ["enlarged below"]
    assert not zwidth_figure(zwidth()).axes[0].texts


@pytest.mark.usefixtures("undrawn")
def test_the_page_of_a_z_width_states_what_there_is_and_not_what_there_is_not() -> None:
    corner = Corner((0.5, 20.0), curve(0.5, 18.0), None)
    full = zwidth(
        curves={"a hand": OWN, "nobody": curve(4.0, 1000.0)}, passive=PASSIVE, not_passive="", not_simulated="",
        simulated=simulated(OWN), never=("a ghost",), min_stable_stiffness=3.0,
    )  # fmt: skip
    plain, modes = zwidth(), zwidth(curves={"every contact mode": OWN, "sliding": curve(4.0, 1000.0)})
    sentences = {
        "The curve is computed from the linearized loop.": (plain, modes),
        "the dots come from simulations": (full,),
        "Dashed: the same loop with other operators. ": (full,),
        "Dashed: modes of one kind. ": (modes,),
        "Dark: passive, and therefore stable": (full,),
        "Dots: stability limit of the simulated loop (1,234 runs of 0.25 s)": (full,),
        "There is no simulated boundary: no wish.": (plain, modes),
        "1,234 runs instead of 65,536": (full,),
        "of the map off the computed curve (median), at most 0.4 %": (full,),
        "No passive region</b>: the reason.": (plain, modes),
        "a ghost</b>: no wall is stable": (full,),
        "softest stable object</dt><dd>3 N/m": (full,),
        "stiffest passive object</dt><dd>300 N/m": (full,),
        "stiffest object at B = 0 N·s/m, the peak of the curve</dt><dd>2.001 N/mm": (plain, full, modes),
        "The forces of the surface are scaled": (modes,),
        "Contact modes</h2>": (modes,),
        "Operators</h2>": (plain, full),
    }
    for page in (plain, full, modes):
        text = zwidth_page(page).html()
        for sentence, pages in sentences.items():
            assert (sentence in text) == any(page is one for one in pages), sentence
    assert "K = 700 N/m and B = 2 N·s/m, is stable." in zwidth_page(zwidth()).html()
    unstable = zwidth_page(zwidth(stable_here=False)).html()
    assert "is unstable." in unstable
    assert 'class="verdict bad"' in unstable
    assert 'class="verdict good"' in zwidth_page(zwidth()).html()
    with_corner = zwidth_page(replace(full, corner=corner)).html()
    assert with_corner.index("Dark: passive") > with_corner.index("The map near its origin")
    rows = re.findall(r"<tr><td>(a hand|nobody)</td>(.*?)</tr>", zwidth_page(full).html())
    numbers = {name: re.findall(r">([\d.]+)<", row) for name, row in rows}
    assert numbers == {"a hand": ["2.001", "0", "2001"], "nobody": ["1.001", "0", "1001"]}
    late = replace(OWN, damping=OWN.damping + 0.5)
    assert "–</td></tr>" in zwidth_page(zwidth(curves={"a hand": late})).html()  # the curve does not reach B = 0


def cells(panel: Any) -> dict[tuple[float, float], float]:
    """Return the value of each square of a map by its middle, mm."""
    (mesh,) = [one for one in panel.collections if hasattr(one, "get_coordinates")]
    corners, values = mesh.get_coordinates(), np.ma.filled(mesh.get_array(), np.nan)
    middle = 0.25 * (corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:] + corners[1:, 1:])
    pairs = zip(middle.reshape(-1, 2), values.reshape(-1), strict=True)
    return {(round(x, 6) + 0.0, round(y, 6) + 0.0): float(value) for (x, y), value in pairs}


def test_each_square_of_a_workspace_map_has_the_value_of_its_pose() -> None:
    w = grid_workspace()
    side, top = section_figure(w).axes[:2]
    for panel, name, across, up in ((side, "y-z", 2, 1), (top, "x-z", 0, 2)):
        found = cells(panel)
        assert len(found) == 49
        for i in w.sections[name]:
            place = tuple(round(1e3 * w.tips[i, axis], 6) + 0.0 for axis in (across, up))
            assert found[place] == pytest.approx(w.stiffness[i].min() / 1e3)
    assert [panel.get_title(loc="left") for panel in (side, top)] == ["side view", "top view"]
    assert (side.get_xlabel(), side.get_ylabel()) == ("z, toward the operator [mm]", "y, up [mm]")
    assert (top.get_xlabel(), top.get_ylabel()) == ("x, right [mm]", "z, toward the operator [mm]")
    for k, panel in enumerate(axes_figure(w).axes[:3]):
        found = cells(panel)
        i = int(w.sections["y-z"][5])
        place = (round(1e3 * w.tips[i, 2], 6) + 0.0, round(1e3 * w.tips[i, 1], 6) + 0.0)
        assert found[place] == pytest.approx(w.stiffness[i, k] / 1e3)
        assert panel.get_title(loc="left") == f"walls normal to {'xyz'[k]}"
        assert bool(panel.get_ylabel()) == (k == 0)


def test_the_colors_of_a_workspace_map_span_its_values() -> None:
    """From the least to the 98th percentile of those shown, and at least over 5 %."""
    w = grid_workspace()
    shown = np.concatenate([w.worst[index] for index in w.sections.values()]) / 1e3
    for of, top in ((w, np.percentile(shown, 98)), (replace(w, stiffness=0 * w.stiffness + 700.0), 1.05 * 0.7)):
        for panel in section_figure(of).axes[:2]:
            (mesh,) = [one for one in panel.collections if hasattr(one, "get_coordinates")]
            assert mesh.norm.vmin == pytest.approx(of.worst[of.sections["y-z"]].min() / 1e3)
            assert mesh.norm.vmax == pytest.approx(top)


def test_marks_of_a_workspace_map_stand_where_the_page_says() -> None:
    """Circle: start. Dashed line and cross: hinge. Triangle: the minimum, where it lies in the plane."""
    w = grid_workspace()
    for of, triangles in ((w, (True, False)), (replace(w, start=w.start - np.array([0.0, 0.03, 0.0])), (True, True))):
        panels = section_figure(of).axes[:2]
        for panel, (across, up), seen in zip(panels, ((2, 1), (0, 2)), triangles, strict=True):
            marks = {line.get_marker(): 1e-3 * np.array(line.get_xydata())[0] for line in panel.lines}
            assert marks["o"] == pytest.approx(of.start[[across, up]])
            assert ("^" in marks) == seen
            if seen:
                assert marks["^"] == pytest.approx(of.tips[of.least[0]][[across, up]])
            if across == 0:
                assert marks["P"] == pytest.approx(of.hinge[[across, up]])
            else:
                assert marks["None"][0] == pytest.approx(of.hinge[across])


def test_places_where_no_wall_is_stable_are_hatched_and_have_no_color() -> None:
    w = grid_workspace()
    stiffness = w.stiffness.copy()
    none = w.sections["y-z"][[3, 17]]
    stiffness[none] = 0.0
    side = section_figure(replace(w, stiffness=stiffness)).axes[0]
    (hatched,) = [one for one in side.collections if one.get_hatch()]
    middles = {tuple(np.round(path.get_extents().get_points().mean(axis=0), 6) + 0.0) for path in hatched.get_paths()}
    assert middles == {(round(1e3 * w.tips[i, 2], 6) + 0.0, round(1e3 * w.tips[i, 1], 6) + 0.0) for i in none}
    assert {place for place, value in cells(side).items() if np.isnan(value)} == middles
    assert not [one for one in section_figure(w).axes[0].collections if one.get_hatch() and one.get_paths()]


@pytest.mark.usefixtures("undrawn")
def test_the_page_of_a_workspace_states_minimum_median_and_start() -> None:
    w = grid_workspace()
    page = workspace_page(w).html()
    worst = w.stiffness[:, 0]
    for label, value in (("minimum", worst.min()), ("median", np.median(worst)), ("at the start", worst[0])):
        assert f"<dt>{label}</dt><dd>{value / 1e3:.4g} N/mm</dd>" in page
    assert f"<dt>walls evaluated</dt><dd>{w.stiffness.size}</dd>" in page
    assert 'class="verdict good"' in page
    i = int(np.argmin(worst))
    tip = ", ".join(f"{1e3 * part:.0f}" for part in w.tips[i]).replace("-", "−")
    rows = dict(re.findall(r"<tr><td>([^<]*)</td>(.*?)</tr>", page))
    assert len(rows) == 7
    assert tip in rows["x"]
    for k, name in enumerate(("x", "y", "z")):
        numbers = re.findall(r">([\d.]+)<", rows[name])[:3]
        values = w.stiffness[:, k]
        assert [float(one) for one in numbers] == pytest.approx(
            [values.min(), np.median(values), values.max()], rel=1e-4
        )
    falls = replace(w, stiffness=np.where(np.arange(len(worst))[:, None] == 9, 0.0, w.stiffness))
    assert 'class="verdict bad"' in workspace_page(falls).html()


@pytest.mark.parametrize(("low", "high"), [(0.5, 3.0), (1.0, 900.0), (2.1, 2.6), (0.013, 0.4), (7.0, 7.2), (1.0, 1e5)])
def test_ticks_are_three_to_eight_round_numbers_within_the_scale(low: float, high: float) -> None:
    ticks = _ticks(low, high)
    assert ticks == sorted(set(ticks))
    assert 2 <= len(ticks) <= 8
    assert ticks[0] >= 0.999 * low
    assert ticks[-1] <= 1.001 * high
    if len(ticks) >= 3:
        assert all(float(f"{tick:.2g}") == pytest.approx(tick) for tick in ticks)


def test_the_steady_state_of_each_axis_stands_on_the_page_in_the_units_of_its_columns() -> None:
    one = {"steady_deflection_m": 1.23456e-3, "expected_deflection_m": 1.2e-3, "error_percent": 2.881,
           "overshoot_percent": 12.34, "settling_5_percent_s": 0.0567}  # fmt: skip
    none = dict.fromkeys(one)
    page = html.Page("a run")
    _axes(page, {"x": one, "y": none}, {"error_percent": 1.5, "settling_5_percent_s": 0.06})
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(<td.*?)</tr>", page.html())]
    assert rows == [
        ["x", "1.2346", "1.2000", "2.88", "12.3", "57"], ["y"] + 5 * ["–"], ["as a vector", "–", "–", "1.5", "–", "60"],
    ]  # fmt: skip
    heads = re.findall(r"<th[^>]*>(.*?)</th>", page.html())
    assert [re.sub("<.*?>", " ", head).split()[-1] for head in heads[1:]] == ["mm", "mm", "%", "%", "ms"]
    empty = html.Page("a run")
    _axes(empty, {}, None)
    assert "<table" not in empty.html()


def test_the_stiffness_figure_has_the_magnitudes_in_n_per_mm() -> None:
    p = performance()
    panels = stiffness_figure(p).axes
    assert [panel.get_title(loc="left") for panel in panels] == ["along x", "along (0.00, −0.60, 0.80)"]
    for panel, a in zip(panels, p.along, strict=True):
        lines = drawn(panel)
        for name, values in (("rendered", a.rendered), ("desired", a.desired), ("free device", a.free)):
            np.testing.assert_allclose(lines[name], np.column_stack([a.frequency, np.abs(values) / 1e3]))


def test_the_ripple_figure_has_micrometres_and_marks_the_most_perceptible_line() -> None:
    p = performance()
    assert p.ripple is not None
    (panel,) = ripple_figure(p).axes
    lines = drawn(panel)
    shown = lines["ripple of the tip"]
    np.testing.assert_allclose(shown[1:, 1], 1e6 * p.ripple.amplitude[1:])
    assert 0.0 < shown[0, 1] <= 1e-4 * 1e6 * p.ripple.threshold.min()  # a logarithm has no zero
    np.testing.assert_allclose(lines["detection threshold"][:, 1], 1e6 * p.ripple.threshold)
    assert set(lines["most perceptible"][:, 0]) == {333.0}
    assert [text.get_text() for text in panel.get_xticklabels()] == ["20", "50", "100", "200", "500"]


@pytest.mark.usefixtures("undrawn")
def test_the_page_of_a_performance_states_each_measure_and_no_number_that_is_not_finite() -> None:
    p = performance()
    page = performance_page(p).html()
    for words in (
        "<dt>stiffness at rest</dt><dd>0.31 N/mm</dd>", "<dd>12.3 Hz</dd>", "<dd>45.6 Hz</dd>", "290 to 305", "443 Hz",
        "−3 dB, command to hand", "Ripple of the tip in the half second",
    ):  # fmt: skip
        assert words in page
    rows = {
        name: re.findall(r"<td[^>]*>(.*?)</td>", row)
        for name, row in re.findall(r"<tr><td>([^<]*)</td>(.*?)</tr>", page)
    }
    assert rows["x"] == ["310", "290 to 305", "12.3 Hz", "55", "45.6 Hz", "1.2"]  # stiffness in N/m
    assert rows["continuous force [N]"] == ["1", "–"]
    assert rows["peak force [N]"] == ["8", "9"]
    assert rows["resolution [µm]"] == ["30", "–"]
    assert rows["dynamic range [dB]"] == ["46", "–"]
    assert 'class="verdict good"' in page
    assert p.ripple is not None
    loud = performance_page(performance(ripple=replace(p.ripple, ratio=1.5))).html()
    assert 'class="verdict note"' in loud
    unknown = replace(
        p.along[0], static_stiffness=np.inf, transparency_bandwidth=np.inf, rate_hardness=np.nan, precision=np.nan
    )
    other = performance_page(performance(along=(unknown,), ripple=None, topology="force_tracking")).html()
    assert "<dd>infinite</dd>" in other
    assert "above the Nyquist frequency" in other
    assert "−3 dB, reference to object" in other
    assert "Ripple of the tip in the half second" not in other
    assert 'class="verdict note"' in other
    assert re.search(r"<tr><td>x</td>.*?–</td>.*?–</td></tr>", other)
    assert "nan" not in re.sub(r"<svg.*?</svg>|<style>.*?</style>", "", other, flags=re.DOTALL)
