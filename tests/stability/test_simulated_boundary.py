"""The exact boundary against the simulated loop: below it a swing dies, above it grows, at random devices and hands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate import _core
from palpate.linear import HumanArm, LinearDevice, WallLoop, wall_loop
from palpate.scenario import Scenario
from palpate.simulation.simulator import build_simulation
from palpate.stability import coulomb_amplitude, critical_stiffness, stability_boundary
from palpate.stability.contact_run import _last_change
from palpate.stability.maps import zwidth_map

Array = NDArray[np.float64]
SETS = 100


def experiment(mass: float, damping: float, period: float, delay: int, arm: HumanArm | None) -> Any:
    """Return a slider of these numbers against a spring, ready to run with `palpate.simulate`'s machinery."""
    operator: dict[str, Any] = {"kind": "none"}
    if arm is not None:
        operator = {
            "kind": "arm",
            "mass": f"{arm.mass!r} kg",
            "damping": f"{arm.damping!r} N*s/m",
            "stiffness": f"{arm.stiffness!r} N/m",
        }
        if arm.tissue_stiffness is not None:
            operator["tissue_stiffness"] = f"{arm.tissue_stiffness!r} N/m"
            operator["tissue_damping"] = f"{arm.tissue_damping!r} N*s/m"
    ready = build_simulation(
        {
            "device": {"name": "slider", "delay": delay},
            "servo": {"period": f"{period!r} s", "topology": "impedance_display"},
            "operator": operator,
            "object": {"kind": "spring", "stiffness": "1 N/m"},
            "run": {"duration": f"{2 * period!r} s", "substeps": 8},
        }
    )
    ready.setup.mechanism = _core.Slider({"mass.tip": [mass]})
    ready.setup.friction = ready.device.with_viscous([damping]).core_friction
    ready.setup.start_speed = np.array([1e-4])
    return ready


def grows(ready: Any, stiffness: float, damping: float, ticks: int) -> bool:
    """Whether the swing of a run is larger at its end than at two fifths; third differences leave the fast one."""
    ready.setup.stiffness = np.array([stiffness, 0.0, 0.0])
    ready.setup.damping = np.array([damping, 0.0, 0.0])
    still = np.zeros((ticks + 1, 3))
    rows, count, unstable = ready.setup.run(still, still)
    if unstable >= 0:
        return True
    moved = np.abs(np.diff(np.asarray(rows)[:count, 0], n=3))
    fifth = len(moved) // 5
    return bool(moved[-fifth:].max() > moved[fifth : 2 * fifth].max())


def enough(loop: WallLoop, stiffness: float, damping: float, angle: float) -> int | None:
    """Ticks after which only the critical swing is left; None if another of its speed hardly decays."""
    values = np.linalg.eigvals(loop.matrix(stiffness, damping))
    on = np.abs(np.abs(values) - 1) < 1e-6
    assert on.sum() == 2  # the curve does what it says
    fast = np.abs(values - 1) > np.abs(values[on] - 1).max() / 5
    other = np.abs(values[~on & fast]).max(initial=0.0)
    ticks = 5 * max(10 / max(1 - other, 1e-9), 30 * 2 * np.pi / angle)
    return int(max(ticks, 300)) if ticks < 12_000 else None


def test_boundary_at_random_devices_delays_and_hands() -> None:
    """The stiffness at which the simulated swing neither grows nor dies is the exact one, within 0.2 %."""
    rng = np.random.default_rng(4)
    errors: list[float] = []
    kinds = set()
    while len(errors) < SETS:
        mass, period = float(10 ** rng.uniform(-1.7, 0)), float(10 ** rng.uniform(-3.7, -2.5))
        b = float(10 ** rng.uniform(-2, -0.5) * mass / 0.06)
        delay, kind = int(rng.integers(0, 5)), int(rng.integers(0, 3))
        arm = None
        if kind:
            scale = (10 ** rng.uniform(-0.3, 0.3, 3)).tolist()
            arm = HumanArm(0.15 * scale[0], 4.5 * scale[1], 560 * scale[2])
            if kind == 2:
                arm = HumanArm(arm.mass, arm.damping, arm.stiffness, 500 * scale[2], 0.5 * scale[1])
        loop = wall_loop(LinearDevice.of_mass(mass, b, arm), period, delay)
        curve = stability_boundary(loop, points=200)
        at = rng.choice(np.flatnonzero(curve.stiffness > 0.1 * curve.stiffness.max()))
        damping, exact, angle = float(curve.damping[at]), float(curve.stiffness[at]), float(curve.angle[at])
        ticks = enough(loop, exact, damping, angle)
        if ticks is None:
            continue
        ready = experiment(mass, b, period, delay, arm)
        low, high = 0.93 * exact, 1.1 * exact
        assert not grows(ready, low, damping, ticks)
        assert grows(ready, high, damping, ticks)
        for _ in range(8):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if grows(ready, middle, damping, ticks) else (middle, high)
        errors.append(0.5 * (low + high) / exact - 1)
        kinds.add((delay, kind))
    assert len(kinds) >= 12  # every delay and hand had its turn
    assert np.abs(errors).max() < 2e-3, f"{len(errors)} sets, worst {np.abs(errors).max():.2e}"


@pytest.mark.parametrize("share", [0.7, 1.4])
def test_coulomb_friction_holds_small_swings_only(share: float) -> None:
    """Beyond b = KT/2 dry friction alone steadies: a swing of .7 A* dies, one of 1.4 A* grows."""
    mass, stiffness, b, coulomb, period = 0.06, 400.0, 0.1, 0.01, 1e-3
    amplitude = coulomb_amplitude(mass=mass, stiffness=stiffness, damping=b, coulomb=coulomb, period=period)
    assert stiffness > critical_stiffness(LinearDevice.of_mass(mass, b), period=period)
    ready = experiment(mass, b, period, 0, None)
    ready.setup.friction = ready.device.with_friction(viscous=[b], coulomb=[coulomb]).core_friction
    ready.setup.stiffness = np.array([stiffness, 0.0, 0.0])
    ready.setup.damping = np.zeros(3)
    ready.setup.start_speed = np.array([share * amplitude * np.sqrt(stiffness / mass)])
    still = np.zeros((2001, 3))
    rows, count, _ = ready.setup.run(still, still)
    x = np.abs(np.asarray(rows)[:count, 0])
    first, last = x[:80].max(), x[-80:].max()
    assert first == pytest.approx(share * amplitude, rel=0.15)
    assert (last > 1.05 * first) if share > 1 else (last < 0.5 * first)


def test_other_operators_share_the_arm_and_change_the_grip() -> None:
    tables: dict[str, Any] = {
        "device": {"name": "slider"},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.2 kg", "damping": "3 N*s/m", "stiffness": "150 N/m"},
        "object": {"kind": "spring", "stiffness": "100 N/m"},
    }

    def others(**operator: str) -> dict[str, Any]:
        s = Scenario.from_dict({**tables, "operator": {**tables["operator"], **operator}})
        return dict(zwidth_map.other_operators(s))

    nobody = HumanArm(0.0, 0.0, 0.0)
    assert others() == {
        "the same arm, through tissue": HumanArm(0.2, 3.0, 150.0, *zwidth_map.TISSUE),
        "nobody holds it": nobody,
    }
    soft = others(tissue_stiffness="600 N/m", tissue_damping="2 N*s/m")
    assert soft == {"the same arm, rigid grip": HumanArm(0.2, 3.0, 150.0), "nobody holds it": nobody}
    free = Scenario.from_dict({**tables, "operator": {"kind": "none"}})
    hand = zwidth_map.HAND
    assert dict(zwidth_map.other_operators(free)) == {
        "a rigid grip": hand,
        "through fingertip tissue": HumanArm(hand.mass, hand.damping, hand.stiffness, *zwidth_map.TISSUE),
    }
    assert (
        zwidth_map.other_operators(Scenario.from_dict({**tables, "device": {"name": "slider", "model": "linear"}}))
        == []
    )


def test_forces_are_constant_after_their_last_change() -> None:
    def last(**tables: Any) -> float | None:
        base = {"device": {"name": "slider"}, "object": {"kind": "spring", "stiffness": "100 N/m"}}
        return _last_change(Scenario.from_dict({**base, "run": {"duration": "1 s"}, **tables}))

    ramp = {"shape": "ramp", "start": "0.1 s", "rise": "0.3 s", "force": "1 N"}
    table = {"shape": "table", "table": [["0.2 s", "0 N", "0 N", "0 N"], ["0.7 s", "1 N", "0 N", "0 N"]]}
    arm = {"kind": "arm", "mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "10 N/m"}
    sine = {"shape": "sine", "frequency": "2 Hz", "force": "1 N"}
    assert last(reference=ramp) == pytest.approx(0.4)
    assert last(reference=table) == pytest.approx(0.7)
    assert last(reference=sine) is None
    assert last(reference={**sine, "stop": "0.5 s"}) == pytest.approx(0.5)
    assert last(reference=ramp, operator={**arm, **table}) == pytest.approx(0.7)
    assert last(reference={"shape": "step", "force": "1 N"}) == 0.0
