"""Lowest flexible mode: golden bands, the exact axis, device files, certificates and the constraint of a design."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from flexible_device import device_file
from palpate.control import workspace
from palpate.devices import Device, load
from palpate.devices.device import Parameters
from palpate.devices.flexible_mode import FlexibleMode
from palpate.errors import DesignError, DeviceError, ScenarioError, StabilityError
from palpate.linear import LinearDevice
from palpate.linear.flexible_tip import sampled_axis
from palpate.simulation.verdict import State
from palpate.stability import certify
from palpate.stability.workspace_certificate import workspace_loops
from palpate.tuning import AxisData, flexible_bands, tune_axis
from scipy.integrate import solve_ivp

SLIDER = load("slider")
MASS = Device("mass", "", "tip_device", Parameters({"mass.apparent": (0.1,) * 3, "friction.viscous": (0.0,) * 3}))
# bandwidth, rad/s: unstable bands, Hz, for (period, delay) and a tip share of 0.3 and of 0.6; damping ratio 0.01
GOLDEN: dict[int, dict[tuple[float, int], tuple[tuple[float, float] | None, tuple[float, float]]]] = {
    60: {(5e-4, 0): (None, (72, 142)), (5e-4, 1): (None, (53, 164)), (1e-3, 0): (None, (69, 145)),
         (1e-3, 1): ((58, 97), (42, 160))},
    100: {(5e-4, 0): (None, (116, 240)), (5e-4, 1): ((105, 154), (75, 276)), (1e-3, 0): (None, (107, 254)),
          (1e-3, 1): ((72, 170), (51, 240))},
    200: {(5e-4, 0): (None, (212, 513)), (5e-4, 1): ((145, 337), (101, 474)), (1e-3, 0): ((254, 276), (167, 524)),
          (1e-3, 1): ((88, 281), (15, 337))},
}  # fmt: skip


@pytest.mark.parametrize("bandwidth", GOLDEN)
def test_unstable_bands_are_the_golden_ones(bandwidth: int) -> None:
    """To 2 %, the step of frequency of the golden table."""
    for (period, delay), expected in GOLDEN[bandwidth].items():
        law = workspace(MASS, period, bandwidth=bandwidth)
        for share, band in zip((0.3, 0.6), expected, strict=True):
            found = flexible_bands(law, delay=delay, tip_share=share, damping_ratio=0.01, highest=600.0)
            if band is None:
                assert found.size == 0
            else:
                assert found == pytest.approx(np.array([band]), rel=0.02, abs=1.0)


def test_the_sampled_axis_is_the_motion_of_two_masses() -> None:
    mode, period, inertia = FlexibleMode(80.0, 0.4, 0.05), 1e-3, 1.2
    a, b = sampled_axis(mode, inertia, period)
    motor, tip = 0.6 * inertia, 0.4 * inertia
    reduced = motor * tip / inertia
    k, c = (2 * np.pi * 80.0) ** 2 * reduced, 2 * 0.05 * 2 * np.pi * 80.0 * reduced

    def moves(_: float, x: np.ndarray) -> list[float]:
        f = k * (x[1] - x[0]) + c * (x[3] - x[2])
        return [x[2], x[3], (1.0 + f) / motor, -f / tip]

    start = [1e-3, -2e-3, 0.1, 0.3]
    end = solve_ivp(moves, (0.0, period), start, rtol=1e-11, atol=1e-14).y[:, -1]
    assert a @ start + b == pytest.approx(end, abs=1e-9)
    ringing = np.log(np.linalg.eigvals(a).astype(complex))[np.argsort(np.abs(np.linalg.eigvals(a)))[0]] / period
    assert abs(ringing) == pytest.approx(2 * np.pi * 80.0, rel=1e-9)
    assert -ringing.real / abs(ringing) == pytest.approx(0.05, rel=1e-7)


def flexible(folder: Path, device: Device, frequency: float, share: float = 0.6, damping: float = 0.01) -> str:
    """Write a device with a mode; return the path of its file."""
    path = device_file(folder, device, frequency, share, damping)
    assert load(path).flexible == FlexibleMode(frequency, share, damping)
    assert load(path).rigid().flexible is None
    return path


def tracking(name: str, **device: Any) -> dict[str, Any]:
    return {
        "device": {"name": name, **device},
        "servo": {"period": "0.5 ms"},
        "reference": {"force": ["0.3 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "controller": {"kind": "workspace"},
        "run": {"duration": "0.2 s"},
    }


def test_a_certificate_judges_the_loop_with_the_mode_of_the_device_file(tmp_path: Path) -> None:
    """The band of 200 rad/s at 0.5 ms is 212 to 513 Hz; friction of the slider hardly moves its edges."""
    stable = {190.0: True, 300.0: False, 560.0: True}
    for frequency, rests in stable.items():
        found = certify(tracking(flexible(tmp_path, SLIDER, frequency)))
        assert found.verdict.state is (State.STABLE if rests else State.UNSTABLE)
        assert any("lowest mode" in one for one in found.assumptions)
        assert any("full scenario was run" in one for one in found.method)
        assert (found.counter_example is None) is rests


def test_a_mode_is_refused_where_it_would_be_ignored(tmp_path: Path) -> None:
    name = flexible(tmp_path, SLIDER, 300.0)
    linear = tracking(name, model="linear") | {"controller": {"kind": "lead_lag"}}
    with pytest.raises(ScenarioError, match=r"lowest mode of 300 Hz.*a model of the rigid device"):
        palpate.simulate(linear)
    with pytest.raises(StabilityError, match=r"a model of the rigid device.*lowest mode of 300 Hz"):
        certify(linear)
    with pytest.raises(StabilityError, match=r"pass device\.rigid"):
        LinearDevice.at_pose(name, [0.0])
    rigid, plain = palpate.simulate(tracking(name, rigid=True)), palpate.simulate(tracking("slider"))
    assert rigid["tip"].tobytes() == plain["tip"].tobytes()


def test_a_mode_without_all_its_numbers_is_no_device() -> None:
    for values, says in (
        ({"flexible.frequency": (50.0,)}, "tip_share is missing"),
        ({"flexible.frequency": (50.0,), "flexible.tip_share": (1.2,), "flexible.damping_ratio": (0.1,)}, "below 1"),
    ):
        device = replace(SLIDER, parameters=Parameters(dict(SLIDER.parameters.values) | values))
        with pytest.raises(DeviceError, match=says):
            device.check()
    with pytest.raises(DesignError, match="tip_share must be above 0"):
        flexible_bands(workspace(MASS, 5e-4), tip_share=1.0, damping_ratio=0.01)


def test_a_stiff_mode_leaves_the_loops_of_the_workspace_alone_and_a_soft_one_does_not() -> None:
    arm = load("phantom-premium-1.5a")
    law, pose = workspace(arm, 5e-4), [0.0, 2.2305, 3.2776]

    def radius(frequency: float, share: float) -> float:
        mode = {"flexible.frequency": (frequency,), "flexible.tip_share": (share,), "flexible.damping_ratio": (0.01,)}
        real = replace(arm, parameters=Parameters(dict(arm.parameters.values) | mode))
        return float(np.abs(np.linalg.eigvals(workspace_loops(law, [pose], real)[0])).max())

    rigid = float(np.abs(np.linalg.eigvals(workspace_loops(law, [pose])[0])).max())
    assert radius(1e5, 0.3) == pytest.approx(rigid, abs=1e-6)
    assert radius(300.0, 0.6) > 1.0
    assert radius(300.0, 0.3) < 1.0


def test_a_design_avoids_the_mode_or_names_it() -> None:
    data = AxisData((0.1,), 0.0, operators=())
    rigid = tune_axis(5e-4, 1, data)
    assert rigid is not None
    for frequency, share in ((200.0, 0.3),):
        mode = FlexibleMode(frequency, share, 0.01)
        found = tune_axis(5e-4, 1, replace(data, mode=mode))
        assert found is not None
        assert found.limit == "flexible mode"
        assert "a mode of" in found.reason
        assert found.options["bandwidth"] < rigid.options["bandwidth"]
        law = workspace(MASS, 5e-4, **found.options)
        for low, high in flexible_bands(law, delay=1, tip_share=share, damping_ratio=0.01):
            assert not low <= frequency <= high
