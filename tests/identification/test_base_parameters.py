"""Base parameters: the dynamics are linear in them, and the fictitious devices have one each."""

from dataclasses import replace

import numpy as np
import pytest
from palpate import devices
from palpate.errors import RecordingError
from palpate.identification import base_parameters, base_values, with_base_values
from palpate.identification.base import fictitious


@pytest.fixture(params=["phantom-premium-1.5a", "phantom-premium-1.5a-rotors", "slider"])
def device(request):
    return devices.load(request.param)


def states(device, count=50):
    return np.random.default_rng(7).normal(0.0, 2.0, (2, count, device.dof))


def test_dynamics_are_the_sum_of_the_fictitious_devices(device):
    q, qd = states(device)
    parts, values = fictitious(device), base_values(device)
    for what in ("mass_matrix", "coriolis", "gravity"):
        arguments = (q, qd) if what == "coriolis" else (q,)
        whole = getattr(device, what)(*arguments)
        summed = sum(v * getattr(part, what)(*arguments) for v, part in zip(values, parts, strict=True))
        np.testing.assert_allclose(summed, whole, atol=1e-13 * np.abs(values).max() + 1e-15)


def test_base_parameters_are_independent(device):
    q, qd = states(device)
    columns = np.column_stack(
        [
            np.concatenate([np.einsum("nij,nj->ni", one.mass_matrix(q), qd).ravel(), one.gravity(q).ravel()])
            for one in fictitious(device)
        ]
    )
    assert np.linalg.cond(columns / np.linalg.norm(columns, axis=0)) < 20


def test_published_arm_has_its_published_combinations():
    # At theta = 0: M = diag(A + P - Q, M22, M33) = diag(35.73, 24.26, 9.32)e-4 kg m^2 and N2 = n2 = -.0163 N m.
    arm = devices.load("phantom-premium-1.5a")
    value = dict(zip([p.name for p in base_parameters(arm)], base_values(arm), strict=True))
    assert value["A"] + value["P"] - value["Q"] == pytest.approx(35.73e-4, abs=5e-7)
    assert value["M22"] == pytest.approx(24.26e-4, abs=5e-7)
    assert value["M33"] == pytest.approx(9.32e-4, abs=5e-7)
    assert value["n2"] == pytest.approx(-0.0163, abs=5e-5)
    # h = l1 (l2 ma + l3 mc)
    assert value["h"] == pytest.approx(0.215 * (0.170 * 0.0202 + 0.0325 * 0.0249), rel=1e-12)


def test_a_device_with_given_base_parameters_moves_accordingly(device):
    wanted = base_values(device) * np.linspace(0.95, 1.06, len(base_values(device)))
    other = with_base_values(device, wanted, viscous=np.full(device.dof, 0.02))
    np.testing.assert_allclose(base_values(other), wanted, rtol=1e-12)
    np.testing.assert_array_equal(other.viscous, 0.02)
    same = with_base_values(device, base_values(device))
    q, qd = states(device, 20)
    np.testing.assert_allclose(same.acceleration(q, qd, 0 * q), device.acceleration(q, qd, 0 * q), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("change", [{"environment__gravity": 0.0}, {"geometry__l5": 0.0}, {"geometry__l6": 0.0}])
def test_a_device_without_gravity_has_none_to_fit(change):
    arm = devices.load("phantom-premium-1.5a")
    values = base_values(arm)
    light = replace(arm, parameters=arm.parameters.with_values(environment__gravity=1.0))
    np.testing.assert_allclose(base_values(with_base_values(light, values)), values, rtol=1e-9)
    bare = replace(arm, parameters=arm.parameters.with_values(**change))
    with pytest.raises(RecordingError, match=r"has no gravity to fit: its g, l5 or l6 is zero$"):
        with_base_values(bare, values)
