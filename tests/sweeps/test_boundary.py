"""The simulated boundary of stability: on the exact one where nothing is nonlinear, and off it as theory says."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import linear, stability
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.sweeps import SweepError, refine, sweep
from palpate.sweeps.refinement import follow
from readers import SLIDER
from scipy.optimize import brentq

T, MASS = 1e-3, 0.06
ARM = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
PULSE = {"shape": "step", "force": "1 mN", "stop": "5 ms"}


@pytest.fixture
def slider(tmp_path: Path) -> Callable[..., str]:
    """A slider with friction of one's own, N*s/m and N."""

    def make(viscous: float, coulomb: float) -> str:
        text = files("palpate.devices").joinpath("slider.toml").read_text("utf-8")
        text = text.replace('"0.05 N*s/m"', f'"{viscous} N*s/m"').replace('"0 N"', f'"{coulomb} N"')
        path = tmp_path / f"slider-{viscous}-{coulomb}.toml"
        path.write_text(text, "utf-8")
        return str(path)

    return make


@pytest.mark.parametrize("delay", [0, 1])
def test_the_sliders_boundary_is_the_exact_one(delay: int) -> None:
    """Law: without counts, dry friction and limits the loop is linear; asked within 2 %, held to 0.2 %."""
    scenario = {
        "device": {"name": "slider", "delay": delay},
        "servo": {"topology": "impedance_display"},
        "operator": {**ARM, **PULSE},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "run": {"duration": "2 s"},
    }
    over = {"object.damping": "0 N*s/m..20 N*s/m:3", "object.stiffness": "0 N/m..64 N/mm:17"}
    found = refine(scenario, over, levels=5)
    assert found.ran.mean() < 0.2
    tip = linear.LinearDevice.of_mass(MASS, 0.05, linear.HumanArm(0.15, 4.5, 560.0))
    assert len(found.boundary) >= len(found.values[0])
    for damping, stiffness in found.boundary[::8]:
        exact = stability.critical_stiffness(tip, period=T, delay=delay, virtual_damping=damping)
        assert stiffness == pytest.approx(exact, rel=2e-3)


def test_the_arms_boundary_at_a_pose_is_the_exact_one() -> None:
    """Law: as the slider's; a millinewton moves the nonlinear arm little enough to be its linearisation."""
    scenario = {
        "device": {"name": "phantom-premium-1.5a", "delay": 1},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
        "operator": {**ARM, **PULSE},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "run": {"duration": "1 s"},
    }
    over = {"object.damping": "0 N*s/m..10 N*s/m:3", "object.stiffness": "0 N/m..16 N/mm:9"}
    found = refine(scenario, over, levels=4)
    loop = scenario_loop(Scenario.from_dict(scenario))
    assert len(found.boundary) == len(found.values[0])
    for damping, stiffness in found.boundary[::4]:
        exact = brentq(lambda k, b=damping: loop.spectral_radius(k, b) - 1, 0.8 * stiffness, 1.2 * stiffness)
        assert stiffness == pytest.approx(exact, rel=5e-3)


def test_dry_friction_holds_small_swings_beyond_the_boundary(slider: Callable[..., str]) -> None:
    """Law (describing function): with b < KT/2, swings below 4 f_c / (pi sqrt(K/m) (KT/2 - b)) die, larger grow."""
    damping, coulomb, stiffness = 0.05, 2e-3, 200.0
    swing = 4 * coulomb / (np.pi * np.sqrt(stiffness / MASS) * (stiffness * T / 2 - damping))
    scenario: dict[str, Any] = {
        "device": {"name": slider(damping, coulomb)},
        "servo": {"topology": "impedance_display"},
        "object": {"kind": "spring", "stiffness": f"{stiffness} N/m", "position": ["1 mm", "0 mm", "0 mm"]},
        "run": {"duration": "1 s"},
    }
    times = np.linspace(0.8, 1.2, 41)
    found = sweep(scenario, {"object.position.x": [f"{float(x * swing)!r} m" for x in times]})
    grows = found.outcomes.growth > 1.0
    assert np.all(np.diff(grows.astype(int)) >= 0)
    assert not grows[0]
    assert not found.settled.any()  # the linear loop is unstable: friction alone holds the small ones
    assert times[np.argmax(grows)] == pytest.approx(1.0, abs=0.03)


def test_counts_keep_a_swing_alive_unless_dry_friction_eats_it(slider: Callable[..., str]) -> None:
    """Law (Abbott & Okamura 2005): K <= min(2b/T, 2 f_c/count) leaves no limit cycle; beyond, some starts keep one."""
    count, coulomb, damping = 23e-6, 5e-3, 1.0
    stiffness = np.linspace(50.0, 1900.0, 38)
    over = {"object.stiffness": stiffness, "object.position.x": ["0.3 mm", "0.503 mm", "1 mm", "1.607 mm"]}

    def resting(friction: float) -> Any:
        scenario: dict[str, Any] = {
            "device": {"name": slider(damping, friction), "encoder": True},
            "servo": {"topology": "impedance_display"},
            "object": {"kind": "spring", "stiffness": "1 N/mm", "position": ["1 mm", "0 mm", "0 mm"]},
            "run": {"duration": "2 s"},
        }
        found = sweep(scenario, over)
        small = found["ripple"][stiffness < 1000.0] < count
        assert small.all()  # what is left is less than a count, far inside the linear boundary 2b/T = 2000 N/m
        return (found["oscillation_5"] == 0.0).all(axis=1)

    assert not resting(0.0).any()
    rests = resting(coulomb)
    bound = stability.quantized_stiffness(damping=damping, coulomb=coulomb, period=T, quantum=count)
    assert bound == pytest.approx(2 * coulomb / count)
    assert rests[stiffness <= bound].all()
    assert not rests[stiffness > 1.2 * bound].any()


def test_an_impact_does_not_hide_the_chatter_after_it() -> None:
    """An arm on a wall: what still moves in a run six times as long was not said to die out in the short one."""
    push = {"kind": "force", "force": ["0 N", "0 N", "-1 N"]}
    wall = {"kind": "wall", "stiffness": "1 N/mm", "normal": [0, 0, 1], "position": ["0 mm", "0 mm", "-5 mm"]}
    scenario: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
        "operator": push,
        "object": wall,
    }
    over = {"object.stiffness": "1 N/mm..12 N/mm:40", "object.damping": [0.0, 1.0, 2.0, 4.0]}
    short, long = (sweep({**scenario, "run": {"duration": t}}, over) for t in ("3 s", "18 s"))
    alive = (long["ripple"] > 1e-4) | ~np.isnan(long["unstable_from"])
    assert 50 < alive.sum() < alive.size - 20
    assert (short["oscillation_5"] < 0.8 * short["oscillation_2"])[
        alive
    ].sum() > 2  # an impact that is hard to see past
    assert not short.settled[alive].any()
    assert not short.unstable[~alive].any()
    assert short.settled[~alive].mean() > 0.95


def test_a_refined_map_is_shown_in_a_line() -> None:
    """Its sizes, and how many of its cells were run; a cell is unstable where both values add up to more than 4."""
    values = (np.arange(9.0), np.arange(5.0))
    found = follow(("object.damping", "object.stiffness"), values, 2, lambda i, j: np.where(i + j > 4, 2.0, 0.5))
    assert repr(found) == (
        f"<Refined: object.damping (9) × object.stiffness (5); {int(found.ran.sum())} of 45 cells run, 67% of the map "
        "unstable>"
    )
    assert 0 < found.ran.sum() < 45


def test_refining_needs_two_axes() -> None:
    with pytest.raises(SweepError, match="two axes"):
        refine({"device": {"name": "slider"}, "object": {"kind": "none"}}, {"object.stiffness": [1.0, 2.0]})
    fine, other, single = {"object.damping": [0.0, 1.0]}, {"object.normal.x": [0.5, 1.0]}, [80.0]
    for over in (fine | other, other | fine, fine | {"object.stiffness": single}, {"object.stiffness": single} | fine):
        with pytest.raises(SweepError, match=r"a boundary needs two axes of two values or more, of .*object\.damping"):
            refine(SLIDER, over)


def test_the_steps_of_a_grid_are_halved_as_often_as_asked() -> None:
    """From never, which runs the grid itself, to ten times."""
    over = {"object.damping": "0 N*s/m..1 N*s/m:2", "object.stiffness": "50 N/m..100 N/m:3"}
    assert [len(values) for values in refine(SLIDER, over, levels=0).values] == [2, 3]
    assert [len(values) for values in refine(SLIDER, over, levels=2).values] == [5, 9]
    for levels in (-1, 11):
        with pytest.raises(SweepError, match=f"^levels: {levels}; from 0 to 10$"):
            refine(SLIDER, over, levels=levels)
