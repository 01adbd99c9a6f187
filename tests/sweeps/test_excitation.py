"""Forces under which the cells of a sweep are judged: the scenario's own if they last, else held ones with a pulse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.sweeps import SweepError
from palpate.sweeps.excitation import Excitation, _longest_load, excited

SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "50 N/m"},
    "run": {"duration": "0.099 s"},
}


def under(reference: Any, operator: Any, tables: dict[str, Any] | None = None) -> Simulation:
    return replace(build_simulation({**SLIDER, **(tables or {})}), reference=reference, operator=operator)


def stretches(*parts: tuple[int, float]) -> np.ndarray:
    """Return a force along x and -2 times it along z, constant over numbers of samples."""
    x = np.concatenate([np.full(count, value) for count, value in parts])
    return np.stack([x, 0.0 * x, -2.0 * x], axis=1)


@pytest.mark.parametrize(("last", "kept"), [(40, True), (39, False), (100, True)])
def test_forces_that_are_constant_over_the_last_two_fifths_are_kept(last: int, kept: bool) -> None:
    reference = stretches((100 - last, 3.0), (last, 1.0)) if last < 100 else stretches((100, 1.0))
    operator = 0.5 * stretches((100, 1.0))
    found, what = excited(under(reference, operator))
    if kept:
        assert what == Excitation(100 - last, None)
        assert found.reference is reference
        assert found.setup.window_start == 100 - last
        assert str(what) == "each cell runs under the forces of the scenario"
        return
    assert what == Excitation(0, 0.0)
    assert found.setup.window_start == 0
    np.testing.assert_array_equal(found.reference, np.tile(reference[0], (100, 1)))


@pytest.mark.parametrize(
    ("parts", "held"),
    [
        (((20, 3.0), (50, 1.0), (30, 2.0)), 20),  # the longest stretch
        (((50, 1.0), (20, 0.0), (30, 2.0)), 0),
        (((30, 1.0), (70, 0.0)), 0),  # without force at the end
        (((60, 0.0), (9, 1.0), (31, 2.0)), 69),
        (((91, 0.0), (9, 1.0)), 91),  # too short to be a stretch, but the only force
        (((90, 0.0), (10, 1.0)), 90),
    ],
)
def test_other_forces_are_held_from_the_beginning_of_their_longest_stretch(
    parts: tuple[tuple[int, float], ...], held: int
) -> None:
    """A pulse of 2 % of their size follows for five samples, and the run lasts for six tenths at least."""
    force = stretches(*parts)
    found, what = excited(under(force, 0.25 * force))
    assert (what.first, what.held) == (held, pytest.approx(held * 1e-3))
    assert found.setup.window_start == held
    length = max(100, held + 60)
    before = np.vstack([force[: held + 1], np.tile(force[held], (length - held - 1, 1))])
    size = np.linalg.norm([*force[held], *(0.25 * force[held])])
    pulse = np.zeros((length, 3))
    pulse[held + 1 : held + 6] = 0.02 * size / np.sqrt(3.0)
    np.testing.assert_array_equal(found.reference, before)
    np.testing.assert_allclose(found.operator, 0.25 * before + pulse, rtol=1e-12)
    assert np.linalg.norm(pulse[held + 1]) == pytest.approx(0.02 * size)
    assert str(what) == (
        f"each cell holds the forces of t = {held * 1e-3:.4g} s from then on, with a small pulse: the scenario's own "
        "forces change too late to judge the loop under them"
    )


def test_the_largest_of_forces_that_always_change_is_held() -> None:
    rng = np.random.default_rng(0)
    force = rng.normal(size=(100, 3))
    held = int(np.argmax(np.linalg.norm(force, axis=1)))
    assert excited(under(force, 0.0 * force))[1].first == held
    edges = np.arange(101)
    assert _longest_load(np.hstack([force, 0.0 * force]), edges) == held


def test_a_sweep_without_forces_needs_another_motion() -> None:
    """A position off the object, a taut arm or a weight moves the tip; with none of them no loop can be judged."""
    none = np.zeros((100, 3))
    with pytest.raises(SweepError, match=r"^scenario: no excitation, so no loop can be judged; give \[reference\] or"):
        excited(under(none, none))
    moved = {**SLIDER["object"], "position": ["0 mm", "0 mm", "1 mm"]}
    falls = {**SLIDER["servo"], "gravity_compensation": False}
    arm = {
        "kind": "arm",
        "mass": "0.1 kg",
        "damping": "1 N*s/m",
        "stiffness": "50 N/m",
        "rest": ["1 mm", "0 mm", "0 mm"],
    }
    for change in ({"object": moved}, {"servo": falls}, {"operator": arm}):
        simulation = under(none, none, change)
        found, what = excited(simulation)
        assert found is simulation
        assert what == Excitation(0, None)
