"""A scalar argument is SI or text with a unit; both give the same result."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from palpate import devices, linear, stability
from palpate.errors import StabilityError

SI = {
    "mass": (0.06, "60 g"),
    "damping": (0.05, "0.05 N*s/m"),
    "min_damping": (0.05, "50 mN*s/m"),
    "stiffness": (90.0, "0.09 N/mm"),
    "virtual_damping": (0.02, "20 mN*s/m"),
    "coupling_stiffness": (50.0, "0.05 N/mm"),
    "coupling_damping": (0.5, "0.5 N*s/m"),
    "coulomb": (0.02, "20 mN"),
    "quantum": (23e-6, "23 um"),
    "period": (1e-3, "1 ms"),
    "longest_period": (2e-3, "2 ms"),
    "lipschitz": (90.0, "0.09 N/mm"),
    "virtual_mass": (1e-3, "1 g"),
    "max_damping": (5.0, "5 N*s/m"),
    "credit": (1e-3, "1 mJ"),
    "tissue_stiffness": (1000.0, "1 N/mm"),
    "tissue_damping": (2.0, "2 N*s/m"),
}
MASS = linear.LinearDevice.of_mass(0.06, 0.05)
LOOP = linear.wall_loop(MASS, 1e-3)
FREQUENCY = np.linspace(2.0, 400.0, 200)
PREMIUM = devices.load("phantom-premium-1.5a")


def measured(period: Any, virtual_damping: Any) -> Any:
    tip = linear.discretize_zoh(MASS, 1e-3)
    response = tip.response(2 * np.pi * FREQUENCY * 1e-3)
    return stability.MeasuredResponse(FREQUENCY, response, period).critical_stiffness(virtual_damping)


CALLS: dict[str, tuple[Callable[..., Any], str]] = {
    "HumanArm": (linear.HumanArm, "mass damping stiffness tissue_stiffness tissue_damping"),
    "LinearDevice.of_mass": (linear.LinearDevice.of_mass, "mass damping"),
    "discretize_zoh": (lambda **x: linear.discretize_zoh(MASS, **x), "period"),
    "wall_loop": (lambda **x: linear.wall_loop(MASS, **x), "period"),
    "WallLoop.matrix": (LOOP.matrix, "stiffness damping"),
    "WallLoop.spectral_radius": (LOOP.spectral_radius, "stiffness damping"),
    "rendering_plant": (lambda **x: linear.rendering_plant(PREMIUM, [0.0, 2.2, 3.2], **x), "stiffness period"),
    "certify_coupling": (stability.certify_coupling, "damping coupling_stiffness coupling_damping period"),
    "coulomb_amplitude": (stability.coulomb_amplitude, "mass stiffness damping coulomb period"),
    "coupling_damping": (stability.coupling_damping, "coupling_stiffness coupling_damping period"),
    "critical_stiffness": (lambda **x: stability.critical_stiffness(MASS, **x), "virtual_damping period"),
    "field_damping": (stability.field_damping, "lipschitz longest_period virtual_damping"),
    "passive_damping": (stability.passive_damping, "stiffness virtual_damping period virtual_mass"),
    "passive_stiffness": (stability.passive_stiffness, "damping period virtual_damping"),
    "positive_real_margin": (lambda **x: stability.positive_real_margin(_admittance(), **x), "period"),
    "quantized_stiffness": (stability.quantized_stiffness, "damping coulomb period quantum"),
    "stability_boundary": (lambda **x: stability.stability_boundary(MASS, points=20, **x), "min_damping period"),
    "Boundary.up_to": (stability.stability_boundary(MASS, points=20, period=1e-3).up_to, "damping"),
    "stability_interval": (lambda **x: stability.stability_interval(LOOP, **x), "virtual_damping"),
    "sufficient_damping": (stability.sufficient_damping, "stiffness virtual_damping period"),
    "two_port_limit": (stability.two_port_limit, "damping period"),
    "two_port_margin": (stability.two_port_margin, "damping coupling_stiffness coupling_damping period"),
    "wall_limit": (stability.wall_limit, "mass damping period virtual_damping"),
    "wall_polynomial": (stability.wall_polynomial, "mass damping period stiffness virtual_damping"),
    "wall_spectral_radius": (lambda **x: stability.wall_spectral_radius(MASS, **x), "stiffness virtual_damping period"),
    "MeasuredResponse": (measured, "period virtual_damping"),
}


def _admittance() -> Any:
    import control

    return control.ss([[1.0]], [[1.0]], [[1e-3]], [[1e-3]], 1e-3)


@pytest.mark.parametrize("name", CALLS)
def test_text_with_a_unit_is_the_number_in_si(name: str) -> None:
    function, keys = CALLS[name]
    in_si, in_text = ({key: SI[key][place] for key in keys.split()} for place in (0, 1))
    assert repr(function(**in_text)) == repr(function(**in_si))


@pytest.mark.parametrize("name", CALLS)
def test_text_with_another_dimension_names_the_argument_and_the_unit(name: str) -> None:
    function, keys = CALLS[name]
    for key in keys.split():
        wrong = {other: SI[other][0] for other in keys.split()} | {key: "3 kelvin"}
        with pytest.raises(ValueError, match=key.rpartition("_")[2]) as raised:
            function(**wrong)
        assert type(raised.value).__module__ == StabilityError.__module__
