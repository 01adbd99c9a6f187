"""The interval of stable stiffness of one wall: its lower end, its upper end and the angles of its search."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from palpate.linear import LinearDevice, wall_loop
from palpate.stability.maps.wall_interval import (
    _angle_grid,
    _static_limit,
    critical_stiffness,
    is_stable,
    stability_interval,
)

T = 1e-3


def hilltop(slope: float, damping: float = 0.5) -> Any:
    """60 g on a hilltop: a spring of negative stiffness."""
    return control.ss([[0.0, 1.0], [slope / 0.06, -damping / 0.06]], [[0.0], [1.0 / 0.06]], [[1.0, 0.0]], [[0.0]])


def lag(gain: float, pole: float) -> control.StateSpace:
    """gain (1 - p) / (z - p)"""
    return control.StateSpace([[pole]], [[1.0]], [[gain * (1.0 - pole)]], [[0.0]], T)


@pytest.mark.parametrize("slope", [5.0, 40.0])
@pytest.mark.parametrize(("gain", "pole"), [(1.0, None), (0.5, 0.2), (2.0, -0.3)])
def test_a_device_on_a_hilltop_is_stable_from_its_slope_over_the_gain_on(
    slope: float, gain: float, pole: float | None
) -> None:
    loop = wall_loop(hilltop(slope), T, controller=None if pole is None else lag(gain, pole))
    found = stability_interval(loop)
    assert found.min_stable_stiffness == pytest.approx(slope / gain, rel=1e-9)
    assert _static_limit(loop) == pytest.approx(slope / gain, rel=1e-9)
    assert found.stiffness > found.min_stable_stiffness
    for factor, stable in ((0.999, False), (1.001, True)):
        assert is_stable(loop, factor * found.min_stable_stiffness, 0.0) is stable
        assert is_stable(loop, factor * found.stiffness, 0.0) is not stable
    assert found.frequency == pytest.approx(np.sqrt(gain * found.stiffness / 0.06) / (2 * np.pi), rel=0.25)


def test_a_free_device_or_an_integrator_has_no_lower_end() -> None:
    free = wall_loop(LinearDevice.of_mass(0.06, 0.5), T)
    assert _static_limit(free) == 0.0
    integrator = control.StateSpace([[1.0]], [[1.0]], [[0.01]], [[0.5]], T)
    assert _static_limit(wall_loop(hilltop(5.0), T, controller=integrator)) == 0.0
    sprung = wall_loop(hilltop(-30.0), T)
    assert _static_limit(sprung) == pytest.approx(-30.0)
    assert stability_interval(sprung).min_stable_stiffness == 0.0
    proportional = control.StateSpace([], [], [], [[2.0]], T)
    assert critical_stiffness(LinearDevice.of_mass(0.06, 0.5), period=T, controller=proportional) == pytest.approx(
        0.5 * critical_stiffness(LinearDevice.of_mass(0.06, 0.5), period=T), rel=1e-9
    )


def test_a_device_that_no_wall_holds_has_an_empty_interval() -> None:
    """A hilltop without damping under a delay."""
    found = stability_interval(wall_loop(hilltop(4000.0, 0.0), 1e-2, 5))
    assert (found.stiffness, found.min_stable_stiffness) == (0.0, 0.0)
    assert np.isnan(found.frequency)


def test_the_angles_of_a_search_are_dense_about_a_resonance() -> None:
    """A mode at 0.7 rad per sample that decays by 1e-4 per sample: its half width is sampled many times."""
    omega, sigma = 700.0, 0.1
    device = control.ss([[0.0, 1.0], [-(omega**2), -2 * sigma]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    loop = wall_loop(device, T)
    for density in (1, 8):
        theta = _angle_grid(loop, density)
        assert np.all(np.diff(theta) > 0.0)
        assert 1e-6 < theta[0] < 2e-5
        assert 3.13 < theta[-1] < np.pi
        near = theta[np.abs(theta - 0.7) < 1.01e-4 * 8]
        assert len(near) >= 64 * density
        assert np.ptp(near) > 14e-4
        assert np.diff(theta).max() < 0.008 / density
