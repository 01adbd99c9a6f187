"""Figures of contact hold the channels of the trace in the units of their labels; tables state the summary."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from given_runs import run_press, run_slide
from matplotlib import colormaps
from matplotlib.colors import to_hex, to_rgb
from palpate.metrics import summarize
from palpate.metrics.body_contact import JND, stiffness_along_path, work_so_far
from palpate.plotting.body_contact import body_energy, force_and_deflection, stiffness_along_path_figure
from palpate.plotting.figures import deflection, panels
from palpate.plotting.mesh_contact import profile, stiffness_and_depth, trajectory
from palpate.report import Page, contact, html
from palpate.simulation import Trace
from palpate.units import parse_quantity


@pytest.fixture(scope="module")
def slide() -> Trace:
    return run_slide()


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return run_press(tmp_path_factory.mktemp("body") / "block.h5")


def lines(axes: Any) -> list[np.ndarray]:
    return [np.array(line.get_xydata()) for line in axes.lines]


def test_the_paths_are_those_of_the_trace_in_mm_over_the_surface_that_faces_the_tip(slide: Trace) -> None:
    (space,) = trajectory(slide).axes
    contact = slide["touching"][:, 0] > 0.0
    assert 10 < contact.sum() < len(contact)
    tip, proxy = (np.array(line.get_data_3d()).T for line in space.lines)
    assert [text.get_text() for text in space.get_legend().get_texts()] == ["tip", "proxy"]
    np.testing.assert_allclose(tip, 1e3 * (slide["tip"] - slide["tip"][0]))
    np.testing.assert_allclose(proxy[contact], 1e3 * (slide["proxy"] - slide["tip"][0])[contact])
    assert np.isnan(proxy[~contact]).all()
    faces, colors = np.array(space.collections[0]._faces)[:, :3], space.collections[0]._facecolor3d[:, :3]
    level = faces[:, :, 2]
    assert np.abs(level - level[0, 0]).max() < 1e-9  # the top of the box, and no side of it
    path = np.vstack([tip, proxy[contact]])
    middle = faces.mean(axis=1)
    assert np.all(middle >= path.min(axis=0) - 6.0)
    assert np.all(middle <= path.max(axis=0) + 6.0)
    size = np.ptp(path, axis=0)[:2] + 12.0
    cell = 4.0 * 4.0 / 2.0
    assert len(faces) == pytest.approx(size.prod() / cell, rel=0.5)
    softest, stiffest = (to_rgb(to_hex(colormaps["Greys"](share))) for share in (0.1, 0.65))
    found = {tuple(np.round(color, 3).tolist()) for color in colors}
    assert found == {tuple(np.round(shade, 3).tolist()) for shade in (softest, stiffest)}


def test_the_profile_has_the_distance_of_tip_and_proxy(slide: Trace) -> None:
    """Normal and heading are orthonormal: along the normal, tip and proxy differ by the depth."""
    (side,) = profile(slide).axes
    contact = slide["touching"][:, 0] > 0.0
    tip, proxy = lines(side)
    np.testing.assert_allclose((proxy - tip)[contact, 1], 1e3 * slide["depth"][contact, 0], atol=1e-9)
    np.testing.assert_allclose(tip[:, 1], 1e3 * (slide["tip"] - slide["tip"][0])[:, 2], atol=1e-9)
    way = (slide["tip"][contact][-1] - slide["tip"][contact][0])[:2]
    assert tip[contact][-1, 0] - tip[contact][0, 0] == pytest.approx(1e3 * np.linalg.norm(way))
    assert np.isnan(proxy[~contact]).all()


def test_stiffness_depth_and_their_expectation_are_drawn(slide: Trace) -> None:
    above, below = stiffness_and_depth(slide).axes
    contact = slide["touching"][:, 0] > 0.0
    (stiffness,), (depth, expected) = lines(above), lines(below)
    np.testing.assert_allclose(stiffness[contact, 1], 1e-3 * slide["surface_stiffness"][contact, 0])
    assert np.isnan(stiffness[~contact, 1]).all()
    assert above.get_ylim() == pytest.approx((0.0, 1.08 * 1e-3 * slide["surface_stiffness"][contact].max()))
    np.testing.assert_allclose(depth, np.column_stack([slide.time, 1e3 * slide["depth"]]))
    wanted = 1e3 * -slide["reference_force"][contact, 2] / slide["surface_stiffness"][contact, 0]
    np.testing.assert_allclose(expected[contact, 1], wanted)
    assert np.isnan(expected[~contact, 1]).all()


def test_force_deflection_stiffness_and_energy_of_a_body_are_drawn(press: Trace) -> None:
    force, deflection, both = (lines(axes)[0] for axes in force_and_deflection(press).axes)
    size, deep = np.linalg.norm(press["object_force"], axis=1), 1e3 * np.linalg.norm(press["deflection"], axis=1)
    np.testing.assert_allclose(force, np.column_stack([press.time, size]))
    np.testing.assert_allclose(deflection, np.column_stack([press.time, deep]))
    np.testing.assert_allclose(both, np.column_stack([deep, size]))
    (panel,) = body_energy(press).axes
    work, stored = lines(panel)
    np.testing.assert_allclose(work[:, 1], 1e3 * work_so_far(press))
    np.testing.assert_allclose(stored[:, 1], 1e3 * press["stored_energy"][:, 0])
    path, stiffness = stiffness_along_path(press)
    (panel,) = stiffness_along_path_figure(press).axes
    np.testing.assert_allclose(lines(panel)[0], np.column_stack([1e3 * path, stiffness]))
    band = panel.patches[0].get_extents().transformed(panel.transData.inverted())
    assert (band.y0, band.y1) == pytest.approx((np.median(stiffness), (1.0 + JND) * np.median(stiffness)))
    assert panel.get_xlabel() == "path length normal to the force [mm]"
    assert panel.get_ylabel() == "force / deflection [N/m]"
    top = max(stiffness.max(), band.y1)
    assert panel.get_ylim() == pytest.approx((0.0, 1.1 * top))


def test_a_target_beyond_the_motion_is_in_sight(slide: Trace) -> None:
    """The deflection goes from 0 to some mm down: targets above, within and below it are all drawn."""
    motion = 1e3 * slide["deflection"][:, 2]
    for target in (-9.0, 0.5 * motion.min(), 9.0):
        figure = deflection(slide, [None, None, 1e-3 * target])
        low, high = figure.axes[-1].get_ylim()
        assert low <= min(target, motion.min())
        assert max(target, motion.max()) <= high


def test_each_panel_has_its_title() -> None:
    with pytest.raises(ValueError, match="shorter"):
        panels([0.0, 1.0], np.zeros((2, 2)), ["joint 1"], "angle")


SUFFIXES = {"_m": "m", "_N": "N", "_J": "J", "_N2": "N^2", "_N_per_m": "N/m", "_percent": "%", "_ticks": "", "": ""}


@pytest.mark.parametrize("numbers", [contact._SLIDING, contact._PALPATION])
def test_the_factor_of_a_number_is_that_of_its_unit(numbers: tuple[contact.Number, ...]) -> None:
    for _, key, unit, factor in numbers:
        suffix = next(end for end in sorted(SUFFIXES, key=len, reverse=True) if key.endswith(end))
        if unit in ("%", "ticks", ""):
            assert factor == 1.0
        elif unit == "mN²":
            assert (suffix, factor) == ("_N2", 1e6)
        else:
            assert factor * parse_quantity(f"1 {unit}", SUFFIXES[suffix]) == pytest.approx(1.0)


def test_sections_state_the_summary(slide: Trace, press: Trace) -> None:
    """Every number of the tables is that of the summary, and figures are numbered from 1 without gaps."""
    sliding, palpation = summarize(slide)["sliding"], summarize(press)["palpation"]
    slid, pressed = Page("a"), Page("b")
    contact.sliding_section(slid, slide, sliding)
    contact.palpation_section(pressed, press, palpation)
    for page, found, numbers in ((slid, sliding, contact._SLIDING), (pressed, palpation, contact._PALPATION)):
        text = page.html()
        for name, key, _, factor in numbers:
            if key in ("saved_J", "at_start_J", "final_tip_forces_N") and not found[key]:
                assert name.format(1) not in text
            elif found[key] is not None:
                row = text[text.index(f">{name}<") :].partition("</tr>")[0]
                assert f">{contact.in_column(found[key] * factor)}<" in row
    count = text.count("<figure>")
    assert count >= 3
    assert [f"Figure {k}." in text for k in range(1, count + 2)] == [True] * count + [False]
    assert "over its median" not in text
    deepest = int(np.argmax(np.linalg.norm(press["deflection"], axis=1)))
    assert f"Surface of the body at t = {press.time[deepest]:.3g} s" in text


def test_each_tip_of_a_tool_has_a_row() -> None:
    page = Page("a")
    numbers = [number for number in contact._PALPATION if number[1] == "final_tip_forces_N"]
    contact.numbers_table(page, numbers, {"final_tip_forces_N": (0.25, 0.5)}, "Forces.")
    text = page.html()
    for at, force in ((1, "0.25"), (2, "0.5")):
        row = text[text.index(f">force of tip {at} of the tool at the end<") :].partition("</tr>")[0]
        assert f">{force}<" in row


@pytest.mark.parametrize(("share", "word"), [(0.9, "less"), (1.1, "more")])
def test_a_stiffness_along_the_path_is_compared_with_the_just_noticeable_difference(
    press: Trace, share: float, word: str
) -> None:
    found = summarize(press)["palpation"]
    found |= {"path_stiffness_median_N_per_m": 50.0, "path_stiffness_max_N_per_m": 50.0 * (1.0 + share * JND)}
    page = Page("a")
    contact.palpation_section(page, press, found)
    assert f"at most {100 * share * JND:.3g} % over its median, {word} than the just-noticeable" in page.html()


def test_small_numbers_are_bounded() -> None:
    assert contact.in_column(9.9e-5) == f"under {html.number(1e-4)}"
    assert contact.in_column(-9.9e-5) == f"over {html.number(-1e-4)}"
    assert contact.in_column(1e-4) == html.number(1e-4)
    assert contact.in_column(0.0) == html.number(0.0)
