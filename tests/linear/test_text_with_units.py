"""Numbers are SI; text carries its unit: both give the same result wherever a person passes a quantity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate import control, devices, linear
from palpate.control import Controller
from palpate.errors import PalpateError

ARM = devices.load("phantom-premium-1.5a")
SLIDER = devices.load("slider")
DEGREES = ["0 deg", "120 deg", "190 deg"]
POSE = np.radians([0.0, 120.0, 190.0])
PLANT = linear.rendering_plant(ARM, POSE, stiffness=1000.0, period=5e-4)


def matrices(result: Any) -> list[np.ndarray]:
    if isinstance(result, Controller):
        result = result.system
    return [np.asarray(getattr(result, name)) for name in "ABCD"] if hasattr(result, "A") else [np.asarray(result)]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        (lambda: ARM.forward(DEGREES), lambda: ARM.forward(POSE)),
        (lambda: ARM.forward([DEGREES, DEGREES]), lambda: ARM.forward([POSE, POSE])),
        (lambda: ARM.energy(DEGREES, ["0 rad/s", "10 deg/s", 0.0]), lambda: ARM.energy(POSE, np.radians([0, 10, 0]))),
        (
            lambda: ARM.acceleration(DEGREES, [0, 0, 0], ["1 N*mm"] * 3),
            lambda: ARM.acceleration(POSE, [0, 0, 0], [1e-3] * 3),
        ),
        (lambda: SLIDER.forward(["5 mm"]), lambda: SLIDER.forward([5e-3])),
        (lambda: SLIDER.inverse(["5 mm", "0 m", "0 m"]), lambda: SLIDER.inverse([5e-3, 0, 0])),
        (lambda: SLIDER.with_friction(viscous="2 N*s/m").viscous, lambda: SLIDER.with_viscous(2.0).viscous),
        (lambda: linear.linearize(ARM, DEGREES), lambda: linear.linearize(ARM, POSE)),
        (
            lambda: linear.linearize(ARM, DEGREES, inputs="force", outputs="object_force", stiffness="1 N/mm"),
            lambda: linear.linearize(ARM, POSE, inputs="force", outputs="object_force", stiffness=1000.0),
        ),
        (
            lambda: linear.linearize(ARM, DEGREES, tau=["10 N*mm", 0.0, "1 N*mm"]),
            lambda: linear.linearize(ARM, POSE, tau=[1e-2, 0.0, 1e-3]),
        ),
        (lambda: linear.rendering_plant(ARM, DEGREES, stiffness="1 N/mm", period="0.5 ms"), lambda: PLANT),
        (
            lambda: linear.discretize(linear.linearize(ARM, POSE), "1 ms"),
            lambda: linear.discretize(linear.linearize(ARM, POSE), 1e-3),
        ),
        (
            lambda: control.lqg(PLANT, integral_rate="8 1/s", windup_time="10 ms", disturbance="1 N", noise="10 mN"),
            lambda: control.lqg(PLANT),
        ),
        (
            lambda: control.lead_lag(PLANT, crossover="180 rad/s", phase_margin="60 deg", steady_error="0.1 %"),
            lambda: control.lead_lag(PLANT),
        ),
        (
            lambda: control.virtual_coupling("1 N/mm", "2 N*s/m", "1 ms"),
            lambda: control.virtual_coupling(1000.0, 2.0, 1e-3),
        ),
        (lambda: Controller.gain(2.0, "1 ms"), lambda: Controller.gain(2.0, 1e-3)),
    ],
)
def test_text_is_the_number_in_si(text: Any, number: Any) -> None:
    for one, two in zip(matrices(text()), matrices(number()), strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: linear.linearize(ARM, ["0 mm", "1 rad", "2 rad"]), r"q: \"0 mm\" is a length .*; an angle is needed"),
        (lambda: linear.linearize(ARM, ["a", "b", "c"]), "q: .* cannot be read"),
        (lambda: ARM.forward("30"), 'q: "30" has no unit, and an angle is needed; write it as "30 rad"'),
        (lambda: ARM.forward([[1.0], [1.0, 2.0]]), "q: .* is not made of numbers"),
        (lambda: ARM.inverse(["1 mm", "2 s", "0 m"]), 'inverse: p: "2 s" is a time'),
        (lambda: control.lqg(PLANT, windup_time="1 mm"), "lqg: windup_time: .* a time is needed"),
        (lambda: control.lead_lag(PLANT, crossover="30 Hz"), "lead_lag: crossover: .* angular velocity is needed"),
        (lambda: control.lead_lag(PLANT, phase_margin="30 mm"), "lead_lag: phase_margin: .* an angle is needed"),
        (lambda: control.virtual_coupling("much", 0.0, 1e-3), "virtual_coupling: stiffness: .* cannot be read"),
        (lambda: linear.discretize(linear.linearize(ARM, POSE), "1 mm"), "discretize: period: .* a time is needed"),
        (lambda: SLIDER.with_friction(coulomb="1 m"), "coulomb: .* a force is needed"),
    ],
)
def test_a_wrong_unit_is_refused_in_a_sentence(call: Any, says: str) -> None:
    with pytest.raises(PalpateError, match=says) as caught:
        call()
    assert "\n" not in str(caught.value)
