"""One axis of the tuner: the golden rows, and each constraint binds where it should."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from palpate.control import loop_margins
from palpate.linear.linear_device import HumanArm
from palpate.tuning import OPERATORS, AxisData, AxisDesign, tune_axis
from palpate.tuning.axis import _Axis, first_limit

DATA = AxisData((0.035, 0.1, 0.22), 0.1 * 25e-6)  # 0.1 kg and counts of 25 um

# period, delay: bandwidth, observer, disturbance; disk, phase margin, crossover, gain from and to, delay, N per count
ROWS: list[tuple[float, int, tuple[float, float, float], dict[str, float]]] = [
    (5e-4, 0, (280, 2.5, 0.03), {"disk": 0.791, "phase": 43.5, "crossover": 292, "down": 0.187, "up": 31, "n": 0.297}),
    (5e-4, 1, (280, 2.5, 0.03), {"disk": 0.607, "phase": 35.2, "crossover": 292, "down": 0.336, "up": 29, "n": 0.297}),
    (1e-3, 0, (240, 2.5, 0.03), {"disk": 0.779, "phase": 43.0, "crossover": 248, "down": 0.207, "up": 30, "n": 0.280}),
    (1e-3, 1, (170, 4.0, 0.03), {"disk": 0.601, "phase": 35.2, "crossover": 206, "down": 0.353, "up": 33, "n": 0.220}),
]


@pytest.fixture(scope="module")
def tuned() -> dict[tuple[float, int], AxisDesign]:
    found = {(period, delay): tune_axis(period, delay, DATA) for period, delay, _, _ in ROWS}
    return {key: one for key, one in found.items() if one is not None}


@pytest.mark.parametrize(("period", "delay", "rates", "wanted"), ROWS)
def test_the_golden_rows_are_found_again(
    period: float, delay: int, rates: tuple[float, float, float], wanted: dict[str, float], tuned: Any
) -> None:
    found = tuned[period, delay]
    assert found.options["bandwidth"] == pytest.approx(rates[0], rel=0.05)
    assert (found.options["observer"], found.options["disturbance"]) == rates[1:]
    m = found.margins
    numbers = {"disk": m.disk, "phase": m.phase, "crossover": m.crossover, "n": found.count_force}
    if (period, delay) != (1e-3, 0):  # its bandwidth is rounded down to 240: see the next test
        assert numbers == pytest.approx({key: wanted[key] for key in numbers}, rel=0.05)
    assert 1.0 / m.gain_up == pytest.approx(wanted["down"], rel=0.05)  # a mass ratio is the inverse of a gain
    assert 1.0 / m.gain_down == pytest.approx(wanted["up"], rel=0.05)
    assert m.delay >= 2 * period


@pytest.mark.parametrize(("period", "delay", "rates", "wanted"), ROWS)
def test_the_golden_rows_have_their_margins_at_their_own_bandwidth_which_is_rounded_down(
    period: float, delay: int, rates: tuple[float, float, float], wanted: dict[str, float], tuned: Any
) -> None:
    """Law: the printed bandwidth has the printed margins to a unit of the last digit; the tuner's is < 10 more."""
    axis = _Axis(period, delay, DATA)
    law = axis.law(dict(zip(("bandwidth", "observer", "disturbance"), rates, strict=True)))
    assert axis.violation(law) is None
    assert axis.count_force(law) == pytest.approx(wanted["n"], abs=1e-3)
    loop = axis.loop(law, delay)
    assert loop_margins(loop).disk == pytest.approx(wanted["disk"], abs=1e-3)
    assert loop_margins(loop).phase == pytest.approx(wanted["phase"], abs=0.1)
    assert rates[0] <= tuned[period, delay].options["bandwidth"] < rates[0] + 10.0


def test_the_binding_constraint_is_named_and_met_just_below(tuned: Any) -> None:
    assert [tuned[key].limit for key in tuned] == ["encoder", "encoder", "encoder", "sampling"]
    for (period, delay), found in tuned.items():
        axis = _Axis(period, delay, DATA)
        assert axis.violation(axis.law(found.options)) is None
        faster = axis.violation(axis.law({**found.options, "bandwidth": 1.01 * found.options["bandwidth"]}))
        assert faster is not None
        assert (faster.limit, faster.reason.split("(")[0]) == (found.limit, found.reason.split("(")[0])


def test_finer_counts_move_the_limit_to_the_sampling(tuned: Any) -> None:
    finer = tune_axis(5e-4, 0, replace(DATA, count=0.0))
    assert finer is not None
    assert finer.limit == "sampling"
    assert "2 more samples of delay" in finer.reason
    assert finer.margins.delay == pytest.approx(2 * 5e-4, rel=0.01)
    assert finer.options["bandwidth"] > 1.2 * tuned[5e-4, 0].options["bandwidth"]


def test_a_heavy_free_operator_binds_and_is_named() -> None:
    """The loop tolerates 30 times the known inertia: a free mass of 8 kg at a tip of 35 g is beyond that."""
    heavy = replace(DATA, operators=(*OPERATORS[:2], HumanArm(8.0, 0.0, 0.0)))
    assert tune_axis(5e-4, 0, heavy) is None
    limit, reason = first_limit(5e-4, 0, heavy)
    assert limit == "operator"
    assert "an operator of 8 kg" in reason


def test_an_operator_behind_fingertip_tissue_is_judged_too() -> None:
    """A stiff tissue is a rigid grip: the same mass ratio decides."""
    assert tune_axis(5e-4, 0, replace(DATA, operators=(HumanArm(8.0, 1.0, 0.0, 2e5, 5.0),))) is None
    assert tune_axis(5e-4, 0, replace(DATA, operators=(HumanArm(0.15, 4.5, 560.0, 500.0, 0.5),))) is not None


def test_the_reference_model_is_the_fastest_within_the_overshoot(tuned: Any) -> None:
    late = tuned[1e-3, 1]
    assert late.overshoot <= 0.05
    axis = _Axis(1e-3, 1, DATA)
    faster = axis.law({**late.options, "reference": 1.03 * late.options["reference"]})
    ratio = late.options["reference"] / late.options["bandwidth"]
    assert ratio > 1.49 or max(axis.step(faster, inertia).max() for inertia in (0.83, 1.0, 1.17)) > 1.05


def test_a_step_settles_as_the_reference_model_without_delay(tuned: Any) -> None:
    """Critically damped at rate w: within 5 % after 4.744/w."""
    found = tuned[5e-4, 0]
    assert found.settling == pytest.approx(4.744 / found.options["reference"], abs=1e-3)


def test_a_step_is_settled_from_the_first_sample_from_which_it_stays_in_the_band(tuned: Any) -> None:
    for (period, delay), found in tuned.items():
        axis = _Axis(period, delay, DATA)
        law = axis.law(found.options)
        off, first = np.abs(axis.step(law, 1.0) - 1.0), round(axis.settling(law) / period)
        assert off[first - 1] > 0.05 >= off[first:].max()


def test_the_share_of_the_optimum_is_that_of_the_axis(tuned: Any) -> None:
    for found in tuned.values():
        assert 0.75 < found.robustness.share < 0.92
    assert np.argmin([one.robustness.share for one in tuned.values()]) == 1
