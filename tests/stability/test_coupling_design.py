"""Virtual couplings of both displays: closed forms, Llewellyn's criterion on a grid, and exact sampled loops."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.control import workspace
from palpate.devices import load
from palpate.errors import StabilityError
from palpate.linear import HumanArm
from palpate.stability import (
    admittance_coupling,
    certify_coupling,
    design_couplings,
    impedance_coupling,
    llewellyn,
    two_port_margin,
)
from palpate.stability.passivity.coupling_design import (
    SensedPlant,
    TipFeedback,
    _AdmittanceLoop,
    _motion,
    admittance_loop,
)


def test_an_impedance_coupling_is_at_the_limit_of_the_two_port() -> None:
    """Golden: k_c = 9.3506 b/T with b_c = 1.1673 b; without damping 8 b/T, and exactly 2 b/T."""
    b, t = 0.35, 1e-3
    found = impedance_coupling(damping=b, period=t)
    assert (found.stiffness * t / b, found.damping / b) == pytest.approx((9.35056, 1.16728), rel=1e-4)
    assert (found.undamped * t / b, found.exact * t / b) == pytest.approx((8.0, 2.0))
    for share, accepted in ((0.999, True), (1.01, False)):
        coupling = {"coupling_stiffness": share * found.stiffness, "coupling_damping": found.damping}
        assert (two_port_margin(damping=b, period=t, **coupling) >= -1e-9) is accepted
        assert not certify_coupling(damping=b, period=t, **coupling).passive
    best = max(
        k
        for k in np.linspace(1.0, 12.0, 45) * b / t
        for c in np.linspace(0.0, 4.0, 17) * b
        if two_port_margin(damping=b, period=t, coupling_stiffness=k, coupling_damping=c, angles=300) >= -1e-9
    )
    assert 0.95 * found.stiffness < best <= 1.001 * found.stiffness


def test_an_admittance_coupling_is_at_the_limit_of_llewellyn() -> None:
    m, b, t = 0.1, 0.35, 5e-4
    found = admittance_coupling(mass=m, damping=b, period=t)
    theta = np.linspace(1e-3, np.pi, 4000)
    gains = workspace(load("slider"), t).gains
    admittance, tracking = _AdmittanceLoop(m, b, t, gains.position, gains.velocity).ports(theta)
    one = np.ones_like(theta)
    for share, accepted in ((1.001, True), (0.99, False)):
        tool = share * found.mass / t * (1.0 - np.exp(-1j * theta))
        assert bool(llewellyn(admittance, tracking, -one, tool).min() >= 0.0) is accepted
        damper = share * found.damping * one
        assert bool(llewellyn(admittance, tracking, -one, damper).min() >= 0.0) is accepted
    double = admittance_coupling(mass=2.0 * m, damping=2.0 * b, period=t, operators=())
    assert (double.mass, double.damping) == pytest.approx((2.0 * found.mass, 2.0 * found.damping), rel=1e-9)
    assert (double.exact, double.heaviest, double.worst) == (0.0, float("inf"), None)  # without an operator


def tool_radius(tool: float, mass: float, grip: HumanArm) -> float:
    """Return the spectral radius of the loop of a virtual tool held by a grip, without damping, every 1 ms."""
    gains, one = workspace(load("slider"), 1e-3).gains, np.ones((1, 1))
    rates = (gains.position, gains.velocity, np.asarray(gains.observer))
    feedback = TipFeedback(np.eye(3, 1), one, mass * one, np.zeros(1), 0.0 * one, *rates, 1e-3)
    a, held = _motion(mass, 0.0, 1e-3, grip)
    total = mass + grip.mass
    felt = np.array([[-mass * grip.stiffness, -mass * grip.damping]]) / total
    plant = SensedPlant(a, held[:, None], np.eye(1, 2), felt, np.array([[mass / total - 1.0]]))
    return float(np.abs(np.linalg.eigvals(admittance_loop(plant, feedback, tool, 0.0)[0])).max())


def test_a_grip_much_heavier_than_the_tip_bounds_the_tool_from_above() -> None:
    found = admittance_coupling(mass=0.06, damping=0.0, period=1e-3, operators=[HumanArm(0.5, 4.5, 560.0)])
    assert 0.02 < found.exact < 0.06
    assert 1.0 < found.heaviest < 10.0
    radii = [tool_radius(share * found.heaviest, 0.06, HumanArm(0.5, 4.5, 560.0)) for share in (0.999, 1.001)]
    assert radii[0] < 1.0 < radii[1]
    soft = admittance_coupling(mass=0.06, damping=0.0, period=1e-3, operators=[HumanArm(0.15, 4.5, 560.0)])
    assert soft.heaviest == float("inf")


def test_without_damping_a_grip_with_a_spring_has_no_tool_without_a_damper() -> None:
    assert admittance_coupling(
        mass=0.1, damping=0.3, period=1e-3, operators=[HumanArm(0.0, 0.0, 560.0)]
    ).exact == float("inf")


def test_couplings_are_designed_along_the_axes_of_a_device() -> None:
    arm = design_couplings(load("phantom-premium-1.5a"), [0.0, 2.2305, 3.2776])
    assert [int(e.argmax()) for e, _, _ in arm] == [0, 1, 2]
    assert all(stiff.exact < stiff.undamped < stiff.stiffness for _, stiff, _ in arm)
    assert all(light.exact < light.mass for _, _, light in arm)
    assert len(design_couplings(load("slider"), [0.0])) == 1


def test_a_ratio_out_of_range_is_refused() -> None:
    with pytest.raises(StabilityError, match="damping_ratio must be above 0"):
        admittance_coupling(mass=0.1, damping=0.1, period=1e-3, damping_ratio=1.5)
