"""Dry friction that encoder counts need: against motions across the edges of the counts that extract energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.devices import Device, load
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.stability import quantized_stiffness
from palpate.stability.encoder_counts import count_at_tip, friction_for_counts
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.zwidth_map import _passive

T = 1e-3  # s
POSE = [0.3, 2.2305, 3.2776]  # rad
NORMAL = np.array([0.36, 0.48, 0.8])


def arm(**tables: Any) -> Scenario:
    """Return a hand on an oblique wall of the arm with rotors and dry friction, seen through its encoders."""
    base = {
        "device": {"name": "phantom-premium-1.5a-rotors", "encoder": True},
        "start": {"pose": [f"{angle} rad" for angle in POSE]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"},
        "object": {"kind": "wall", "normal": NORMAL.tolist(), "stiffness": "1 N/m"},
        "run": {"duration": "0.1 s"},
    }
    return Scenario.from_dict({**base, **tables})


def extracted(force_of_counts: Any, step: np.ndarray, size: np.ndarray, friction: np.ndarray, delay: int) -> float:
    """Return the energy, J, that one cycle of joint motions across the edges of all counts extracts beyond friction.

    Args:
        force_of_counts: joint torques (dof,) from the counts of a tick and of the one before, in joint units.
        step: encoder steps (dof,) with the sign in which each joint moves.
        size: way of each joint across its edge (dof,).
        friction: of each joint (dof,).
        delay: n samples.
    """
    above = np.tile(np.repeat([1.0, 0.0], delay + 1), 6)  # the direction changes every n + 1 ticks
    angle = np.where(above > 0.0, 0.5, -0.5)[:, None] * np.sign(step) * size
    work = 0.0
    for k in range(len(above) - 1 - 2 * (delay + 1), len(above) - 1):
        move = angle[k + 1] - angle[k]
        torque = force_of_counts(above[k - delay] * step, above[k - delay - 1] * step)
        work += float(torque @ move - friction @ np.abs(move))
    return work


@pytest.mark.parametrize("delay", [0, 1, 2, 3])
@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_beyond_the_bound_a_motion_across_one_edge_extracts_energy_and_below_it_none(
    delay: int, damping: float
) -> None:
    count, coulomb = np.array([20e-6]), np.array([0.02])
    bound = quantized_stiffness(damping=50.0, coulomb=0.02, period=T, quantum=20e-6, virtual_damping=damping)
    assert bound == pytest.approx(2000.0 - 2.0 * damping / T)
    for share in (0.999, 1.001):
        stiffness = share * bound + (share - 1.0) * 2.0 * damping / T

        def force(now: Any, before: Any, k: float = stiffness) -> Any:
            return -k * now - damping / T * (now - before)

        assert (extracted(force, count, np.array([1e-9]), coulomb, delay) > 0.0) is (share > 1.0)


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize(("stiffness", "damping"), [(900.0, 0.0), (300.0, 0.5)])
def test_the_counts_of_all_joints_add_to_the_friction_that_one_joint_needs(
    joint: int, stiffness: float, damping: float
) -> None:
    """One joint moves, and the others cross their edges without a way. With less friction it gains energy."""
    scenario = arm()
    device = load("phantom-premium-1.5a-rotors")
    needed = friction_for_counts(scenario, scenario_loop(scenario), stiffness, damping)[joint]
    lever = NORMAL @ np.reshape(device.jacobian(np.array(POSE)), (3, 3))
    step = device.encoder_step * np.sign(lever)

    def torque(now: Any, before: Any) -> Any:
        return -lever * (stiffness * (lever @ now) + damping / T * (lever @ (now - before)))

    size = np.where(np.arange(3) == joint, 1e-9, 1e-18)
    for share in (0.999, 1.001):
        friction = np.full(3, share * needed)
        assert (extracted(torque, step, size, friction, 0) > 0.0) is (share < 1.0)
    assert count_at_tip(scenario, scenario_loop(scenario)) == pytest.approx(float(np.abs(lever) @ device.encoder_step))


def passive_walls(**tables: Any) -> tuple[tuple[np.ndarray, np.ndarray] | None, str]:
    scenario = arm(**tables)
    return _passive(scenario, scenario_loop(scenario), Boundary(*(np.array([0.0, 0.01]),) * 3, lambda *_: True))


def test_passive_walls_of_a_zwidth_have_the_friction_that_their_counts_need(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = arm()
    loop, own = scenario_loop(scenario), np.full(3, 2e-6)
    without, _ = passive_walls(device={"name": "phantom-premium-1.5a-rotors"})
    monkeypatch.setattr(Device, "coulomb", own)
    seen, _ = passive_walls()
    assert seen is not None
    assert without is not None
    shares = [(friction_for_counts(scenario, loop, k, b) / own).max() for b, k in zip(*seen, strict=True)]
    inside = (seen[1] > 0.0) & (seen[1] < 0.999 * without[1])
    assert inside.any()
    np.testing.assert_allclose(np.array(shares)[inside], 1.0)
    assert np.all(seen[1] <= without[1])


def test_no_wall_is_passive_through_the_encoders_of_a_joint_without_dry_friction() -> None:
    found, reason = passive_walls(device={"name": "phantom-premium-1.5a", "encoder": True})
    assert found is None
    assert "only dry friction dissipates" in reason


def test_late_ticks_shrink_the_passive_walls_of_a_zwidth_to_the_longest_interval() -> None:
    rigid = {"device": {"name": "phantom-premium-1.5a"}}
    servo = {"period": "1 ms", "topology": "impedance_display"}
    own = scenario_loop(arm(**rigid, servo=servo)).own
    for longest, more in ((1e-3, {}), (1.5e-3, {"jitter": "0.5 ms"})):
        found, _ = passive_walls(**rigid, servo=servo | more)
        assert found is not None
        np.testing.assert_allclose(found[1][0], 2.0 * own.felt(longest) / longest, rtol=1e-6)
    assert own.felt(1.5e-3) < own.felt(1e-3)  # the weight's torque turns later as well
