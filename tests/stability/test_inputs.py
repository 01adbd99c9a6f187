"""What a certificate takes into account and what it leaves out, and what is asked wrongly: each said in a sentence."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.errors import PalpateError, StabilityError
from palpate.linear import HumanArm, discretize_zoh
from palpate.linear.linear_device import LinearDevice
from palpate.scenario import Scenario
from palpate.stability import (
    MeasuredResponse,
    certify,
    field_damping,
    positive_real_margin,
    routh,
    stability_boundary,
    wall_spectral_radius,
)

ARM = {"name": "phantom-premium-1.5a-rotors"}


def slider(**tables: Any) -> dict[str, Any]:
    return {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.1 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "50 N/m"},
        "run": {"duration": "0.3 s"},
        **tables,
    }


def said(tables: dict[str, Any]) -> str:
    return " ".join(certify(tables).assumptions)


def test_neglected_effects_are_named() -> None:
    """Dry friction, counts with their size at the tip, the drive's limits, late ticks: each only where it applies."""
    hand = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
    tables = slider(
        device={**ARM, "encoder": True, "saturation": True, "delay": 1},
        start={"tip": ["0 mm", "-30 mm", "30 mm"]},
        operator=hand,
    )
    words = said(tables)
    for part in (
        "every tick on time",
        "1 sample of delay",
        "dry friction",
        "limit cycle (hunting)",
        "µm at the tip",
        "drive's limits",
    ):
        assert part in words, part
    assert "560 N/m that grips rigidly" in words
    plain = said(slider())
    assert "Neglected" not in plain
    assert "Links and transmission are rigid" in plain
    assert "a hand that only pushes" in plain


def test_how_late_a_tick_may_come() -> None:
    """A passive wall of 50 N/m and 0.05 N s/m bears T_max = 2b/K = 2 ms between ticks, by the field's bound."""
    certificate = certify(slider())
    late = certificate.margin["max_passive_interval_s"]
    assert late == pytest.approx(2e-3, rel=1e-9)
    assert field_damping(lipschitz=50.0, longest_period=late) == pytest.approx(0.05, rel=1e-9)
    assert "2 ms after the one before" in " ".join(certificate.method)
    damped = certify(slider(object={"kind": "spring", "stiffness": "50 N/m", "damping": "0.01 N*s/m"}))
    late = damped.margin["max_passive_interval_s"]  # the servo's difference over T_max, divided by T
    assert field_damping(lipschitz=50.0, longest_period=late, virtual_damping=0.01 * late / 1e-3) == pytest.approx(0.05)


def test_a_controller_that_is_unstable_by_itself() -> None:
    """Closed it may be stable; the certificate says that it is not so when the loop opens."""
    gain = np.zeros((3, 6))
    gain[:, 3:] = -np.eye(3)
    table = {"kind": "state_space", "A": [[1.05]], "B": [[0.0] * 6], "C": [[0.0]] * 3, "D": gain.tolist()}
    words = said(slider(controller=table))
    assert "controller by itself is unstable (a pole of modulus 1.05)" in words
    stable = {**table, "A": [[0.95]]}
    assert "by itself is unstable" not in said(slider(controller=stable))


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({"servo": {"period": "0 s", "topology": "impedance_display"}}, "servo.period"),
        ({"servo": {"period": "-1 ms", "topology": "impedance_display"}}, "servo.period"),
        ({"device": {"name": "slider", "delay": -1}}, "device.delay"),
        ({"device": {"name": "slider", "delay": 1.5}}, "device.delay"),
        ({"object": {"kind": "spring", "stiffness": "-5 N/m"}}, "object.stiffness"),
        ({"operator": {"kind": "arm", "mass": "-0.1 kg", "damping": "0 N*s/m", "stiffness": "1 N/m"}}, "operator.mass"),
        ({"object": {"kind": "none"}}, "nothing is touched"),
    ],
)
def test_a_wrong_scenario_is_told_where(tables: dict[str, Any], says: str) -> None:
    with pytest.raises(PalpateError) as problem:
        certify(Scenario.from_dict(slider(**tables)))
    assert says in str(problem.value)
    assert "\n" not in str(problem.value)


def test_a_law_that_looks_ahead_or_runs_away_is_no_object_behind_a_coupling() -> None:
    with pytest.raises(StabilityError, match="samples of the future"):
        positive_real_margin(control.TransferFunction([1, 0, 0], [1, 0.5], 1e-3), 1e-3)
    with pytest.raises(StabilityError, match="itself is unstable"):
        positive_real_margin(control.TransferFunction([1], [1, -1.2], 1e-3), 1e-3)


@pytest.mark.parametrize(
    ("frequencies", "noise", "says"),
    [
        (np.linspace(2, 499, 8), 0.0, "8 frequencies"),
        (np.linspace(2, 15, 60), 0.0, "too short"),
        (np.linspace(2, 499, 300), 0.7, "too noisy"),
        (np.geomspace(2, 499, 17), 0.0, "too far apart|too noisy"),
    ],
)
def test_a_measured_response_that_cannot_tell(frequencies: Any, noise: float, says: str) -> None:
    """No number is given, and the reason names what would be right."""
    rng = np.random.default_rng(0)
    g = discretize_zoh(LinearDevice.of_mass(0.06, 0.5), 1e-3, 1).response(2e-3 * np.pi * frequencies)
    g = g * (1 + noise * (rng.normal(size=len(g)) + 1j * rng.normal(size=len(g))))
    verdict = MeasuredResponse(frequencies, g, 1e-3).critical_stiffness(2.0)
    assert not verdict.known
    assert np.isnan(verdict.critical_stiffness)
    assert any(part in verdict.sentence for part in says.split("|")), verdict.sentence


def test_what_is_no_number_or_too_long_is_told() -> None:
    frequencies, response = np.linspace(2, 499, 50), np.ones(50) * 1e-3
    with pytest.raises(StabilityError, match="numbers in Hz"):
        MeasuredResponse("low", response, 1e-3)  # type: ignore[arg-type]
    with pytest.raises(StabilityError, match="one for each frequency, 50"):
        MeasuredResponse(frequencies, response + 0j, 1e-3, np.array([1e-5, 1e-5]))
    with pytest.raises(StabilityError, match="the most is 1000"):
        discretize_zoh(LinearDevice.of_mass(0.06, 0.05), 1e-3, 1e6)
    with pytest.raises(StabilityError, match="at most half the sampling rate, 500 Hz"):
        MeasuredResponse(np.linspace(2, 501, 50), response, 1e-3)
    with pytest.raises(StabilityError, match=r"LinearDevice\.at_pose"):
        discretize_zoh(devices.load("slider"), 1e-3)  # type: ignore[arg-type]
    with pytest.raises(StabilityError, match="must be numbers"):
        routh("abc")  # type: ignore[arg-type]
    bare = 1 / (
        0.06 * (2j * np.pi * frequencies) ** 2 + 0.5 * 2j * np.pi * frequencies
    )  # without a hold none is too stiff
    verdict = MeasuredResponse(frequencies, bare, 1e-3).critical_stiffness()
    assert not verdict.known
    assert "the hold and the delay of the loop" in str(verdict)


def test_options_and_devices_that_a_loop_does_not_have_are_told() -> None:
    with pytest.raises(StabilityError, match="the wall's damping is virtual_damping"):
        wall_spectral_radius(LinearDevice.of_mass(0.06, 0.05), stiffness=1.0, damping=1.0, period=1e-3)
    for wall in ({"stiffness": np.nan}, {"stiffness": 1.0, "virtual_damping": np.inf}):
        with pytest.raises(StabilityError, match="must be finite, in N/m"):
            wall_spectral_radius(LinearDevice.of_mass(0.06, 0.05), period=1e-3, **wall)
    arm = devices.load("phantom-premium-1.5a")
    alone = LinearDevice.at_pose(arm, (0.0, 0.3, 0.2), along=(0, 0, 1))  # gravity throws it along the wall
    with pytest.raises(StabilityError, match="give the tip an arm"):
        stability_boundary(alone, period=1e-3)
    held = LinearDevice.at_pose(arm, (0.0, 0.3, 0.2), along=(0, 0, 1), arm=HumanArm(0.15, 4.5, 560.0))
    assert "The stiffest stable wall has" in str(stability_boundary(held, period=1e-3))
