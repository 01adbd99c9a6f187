"""Palpation in closed loop: the linear verdict on a contact, bodies soft to stiff, and a nodule found by a sweep."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from one_node import one_node
from palpate import fem as bodies
from palpate import simulate
from palpate.errors import ScenarioError, StabilityError
from palpate.fem import BodyError
from palpate.metrics import summarize
from palpate.stability import certify, contact_stability

from experiments.palpation_phantom import (
    PalpationSweep,
    palpation_page,
    press_all,
    press_scenario,
    stiffness_profile,
    sweep_phantom,
    sweep_scenario,
)
from experiments.palpation_phantom.stiffnesses import LAWS

YOUNG = 10e3  # Pa


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """[object.body] of 45 x 30 x 20 mm, bonded below."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = bodies.block((0.045, 0.03, 0.02), (0.005, 0.005, 0.01))
    bodies.build(volume, young=YOUNG, fixed="z < 0.001 mm", touch="z > 19.9 mm", output=path)
    return {"file": str(path), "origin": ["22.5 mm", "15 mm", "20 mm"], "radius": "8 mm", "tip": "flat"}


def test_a_body_is_as_many_times_as_stiff_as_its_material() -> None:
    """Against a body built of the stiffer material; its vibrations are faster by the root."""
    made = [
        bodies.build(bodies.block((0.03, 0.03, 0.01), 0.01), young=e, fixed="z < 0.001 mm", order=1, modes=3)
        for e in (2e3, 6e3)
    ]
    stiffer = made[0].scaled_stiffness(3.0)
    np.testing.assert_allclose(stiffer.compliance, made[1].compliance, atol=2e-6 * np.abs(made[1].compliance).max())
    np.testing.assert_allclose(stiffer.contents.frequencies, made[1].contents.frequencies, rtol=1e-6)
    with pytest.raises(BodyError, match="stiffness_scale: 0 must be positive"):
        made[0].scaled_stiffness(0.0)


def test_the_contact_with_one_node_is_judged_as_the_wall_is(tmp_path: Path) -> None:
    """The margin that a certificate gives the same wall where the run comes to rest."""
    path = one_node(512.0, tmp_path / "one.h5")
    tables = press_scenario(YOUNG, "lead–lag", 512.0, {"file": str(path), "radius": "20 mm", "tip": "flat"})
    tables["device"]["saturation"] = False
    judged = contact_stability(simulate(tables))
    wall = {"kind": "wall", "stiffness": "512 N/m", "position": tables["object"]["position"], "normal": [0, 0, 1]}
    margin = certify({**tables, "object": wall}).margin
    assert judged.static_stiffness == pytest.approx(512.0, rel=1e-6)
    assert judged.normal == pytest.approx([0, 0, 1], abs=1e-12)
    assert judged.radius == pytest.approx(margin["spectral_radius_at_rest"], abs=1e-6)
    assert judged.stiffness_margin == pytest.approx(margin["gain_margin_at_rest"], rel=1e-4)
    assert judged.stable


@pytest.mark.parametrize("law", ["impedance display", "LQG"])
def test_loops_oscillate_where_the_linear_contact_says(block: dict[str, Any], law: str) -> None:
    """The same light press on a body at 0.8 of the critical stiffness rests; at 1.3 it swings or bounces for ever."""

    def press(scale: float) -> Any:
        tables = press_scenario(YOUNG, law, 400.0, block)
        tables["object"]["body"]["stiffness_scale"] = scale
        return simulate(tables)

    factor = contact_stability(press(1.0)).stiffness_margin
    assert 5.0 < factor < 500.0
    below, above = press(0.8 * factor), press(1.3 * factor)
    assert summarize(below)["palpation"]["settled"]
    assert not summarize(above)["palpation"]["settled"]
    assert not summarize(above)["stable"]


def test_soft_and_stiff_bodies_are_stable_under_every_law(block: dict[str, Any]) -> None:
    """2 and 100 kPa; the body gives no energy and keeps none, beyond what adding up finite steps misses.

    All come to rest, but under the LQG: there the tip slides on across the smooth top.
    """
    held = press_all((2e3, 100e3), body=block)
    assert len(held) == 2 * len(LAWS)
    for one in held:
        assert one.contact is not None
        assert one.contact.stable
        if (one.law, one.young) == ("LQG", 100e3):
            x, _, z = (one.trace["tip"][-1] - one.trace["tip"][-1001]).tolist()  # in the last second
            assert abs(x) > 1e-5 > 10 * abs(z)
        assert one.stable, (one.law, one.young)
        assert one.rests == (one.law != "LQG")
        assert one.found.touches == 1
        assert 0.3e-3 < one.found.final_deflection < 1.3e-3
        assert abs(one.found.lost) < 1e-3 * one.found.work
        assert one.contact.critical_stiffness > 3.0 * one.contact.static_stiffness
    soft, stiff = held[0].contact, held[1].contact
    assert soft is not None
    assert stiff is not None
    assert stiff.static_stiffness == pytest.approx(50.0 * soft.static_stiffness, rel=0.1)


def test_a_contact_that_is_not_there_is_not_judged(block: dict[str, Any]) -> None:
    trace = simulate(press_scenario(YOUNG, "LQG", 400.0, block))
    with pytest.raises(StabilityError, match="not in contact with the body at t = 0 s"):
        contact_stability(trace, 0)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> PalpationSweep:
    """Over slabs of 100 x 40 x 20 mm, one with a hard inclusion in its middle."""
    found = []
    for name, regions in (("lump", ["sphere 50 20 12 radius 7.5 mm = 400 kPa"]), ("plain", [])):
        path = tmp_path_factory.mktemp("slab") / f"{name}.h5"
        volume = bodies.block((0.1, 0.04, 0.02), (0.005, 0.01, 0.005))
        bodies.build(
            volume, young=YOUNG, fixed="z < 0.001 mm", touch="z > 19.9 mm", regions=regions, order=1, output=path
        )
        body = {"file": str(path), "origin": ["50 mm", "20 mm", "20 mm"], "radius": "8 mm", "tip": "flat"}
        rough = body | {"static_friction": 0.1}  # without friction the tip slides on for seconds after the sweep
        found.append(simulate(sweep_scenario(rough)))
    return PalpationSweep("A slab", found[0], stiffness_profile(found[0]), stiffness_profile(found[1]))


def test_a_sweep_finds_the_nodule_where_it_is(sweep: PalpationSweep) -> None:
    """The stiffness is largest over the nodule, symmetric about it, and the contrast is perceptible."""
    assert sweep.detectable
    assert abs(sweep.with_nodule.position[np.argmax(sweep.with_nodule.stiffness)]) < 7.5e-3
    assert sweep.without_nodule.contrast < 0.1
    left, right = (np.interp(side * 15e-3, sweep.with_nodule.position, sweep.with_nodule.stiffness) for side in (-1, 1))
    assert left == pytest.approx(right, rel=0.1)  # the mesh's diagonals all lean the same way
    run = summarize(sweep.trace)
    assert run["stable"], run["verdict"]
    felt_along = run["palpation"]
    assert felt_along["path_stiffness_max_N_per_m"] == pytest.approx(sweep.with_nodule.over, rel=0.02)
    assert felt_along["path_stiffness_max_N_per_m"] > 1.23 * felt_along["path_stiffness_median_N_per_m"]


def test_a_depth_is_told_with_the_force_of_its_moment(sweep: PalpationSweep) -> None:
    """Over a nodule a steady press is hardest where it is least deep: the verdict's two numbers are one moment's.

    Their ratio is the stiffness told beside them; the largest force stands apart.
    """
    run, trace = summarize(sweep.trace), sweep.trace
    found = run["palpation"]
    force, deep = (np.linalg.norm(trace[name], axis=1) for name in ("object_force", "deflection"))
    assert force.max() > 1.01 * force[np.argmax(deep)]
    assert found["deepest_force_N"] == pytest.approx(found["stiffness_N_per_m"] * found["deepest_m"], rel=1e-12)
    told = re.search(r"by (\S+) mm with (\S+) N \(largest force (\S+) N\)", run["verdict"])
    assert told is not None
    depth, there, most = (float(number) for number in told.groups())
    assert 1e3 * there / depth == pytest.approx(found["stiffness_N_per_m"], rel=0.01)
    assert depth == pytest.approx(1e3 * deep.max(), rel=0.01)
    assert most == pytest.approx(force.max(), rel=0.01)


def test_the_page_says_what_was_found(block: dict[str, Any], sweep: PalpationSweep, tmp_path: Path) -> None:
    held = press_all((10e3,), ("LQG",), body=block)
    html = palpation_page(held, sweep).save(tmp_path / "page.html").read_text("utf-8")
    assert "1 of 1 loops, on bodies of 10 to 10 kPa, are bounded" in html
    assert "In 0 runs the tip rests; in the others it slides on" in html
    assert "which is detectable" in html
    assert html.count("<figure") == 5
    assert 0.0 < sweep.to_dict()["contrast"] < 10.0


def test_what_is_given_to_the_experiments_is_text_or_si() -> None:
    """The same scenario from text as from numbers; what cannot be is one sentence, before anything is made."""
    assert press_scenario("10 kPa", "LQG", "0.4 N/mm") == press_scenario(YOUNG, "LQG", 400.0)
    assert sweep_scenario({}, press="600 mN") == sweep_scenario({}, press=0.6)
    for wrong, sentence in (
        (lambda: press_scenario("10", "LQG", 400.0), 'young: "10" has no unit'),
        (lambda: press_scenario(YOUNG, "PID", 400.0), 'law: "PID" is not one of impedance display, lead–lag, LQG'),
        (lambda: press_scenario(YOUNG, "LQG", 0.0), "stiffness: 0 N/m must be positive"),
        (lambda: press_all(["2 kPa", -1.0]), "young: -1 Pa must be positive"),
        (lambda: sweep_scenario({}, law="PID"), 'law: "PID" is not one of'),
        (lambda: sweep_phantom(depth="5"), 'depth: "5" has no unit'),
        (lambda: sweep_phantom(contrast=0.0), "contrast: 0.0 must be positive"),
        (lambda: sweep_phantom(depth="1 m"), "depth: 1000 mm; the nodule lies between"),
    ):
        with pytest.raises(ScenarioError, match=sentence):
            wrong()


def test_what_is_no_sweep_is_told(block: dict[str, Any]) -> None:
    """A press that slides 10 mm never is 20 mm beside its middle."""
    trace = simulate(press_scenario(YOUNG, "LQG", 400.0, block))
    with pytest.raises(ScenarioError, match="give the trace of a sweep over a phantom"):
        stiffness_profile(trace)
