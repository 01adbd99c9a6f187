"""Force laws by table or formula: exact forces and energies, refusals, and verdicts that a simulation confirms."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import palpate
import pytest
from palpate.errors import ScenarioError, StabilityError
from palpate.linear import HumanArm, LinearDevice
from palpate.scenario import Scenario
from palpate.simulation import ForceLaw, scenario_loop
from palpate.simulation.verdict import State
from palpate.stability import certify_force_law, critical_stiffness
from palpate.stability.force_law_verdict import _multiplier, _positive

ORIGIN, UP = [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]


def cubic(x: float) -> float:
    return 200.0 * x + 2e7 * x**3


def test_force_and_slopes_of_a_table() -> None:
    law = ForceLaw.table(["0 mm", "1 mm", "3 mm"], ["0 N", "0.5 N", "3.5 N"], ORIGIN, [0, 0, 2.0])
    assert law.slopes == pytest.approx([500.0, 1500.0])
    assert (law.softest, law.stiffest) == pytest.approx((500.0, 1500.0))
    assert [law.at(x) for x in (-1e-3, 0.5e-3, 2e-3, 4e-3)] == pytest.approx([0.0, 0.25, 2.0, 5.0])


def test_the_energy_is_the_integral_of_the_formula() -> None:
    law = ForceLaw.formula(cubic, "5 mm", ORIGIN, UP)
    assert law.energy(5e-3) == pytest.approx(100.0 * 5e-3**2 + 5e6 * 5e-3**4, rel=1e-5)
    assert law.energy(-1e-3) == 0.0
    assert law.stiffest == pytest.approx(200.0 + 6e7 * 5e-3**2, rel=3e-3)
    h = 1e-9
    assert (law.energy(2e-3 + h) - law.energy(2e-3 - h)) / (2 * h) == pytest.approx(law.at(2e-3), rel=1e-6)


@pytest.mark.parametrize(
    ("depth", "force", "says"),
    [
        (
            [0.0, 1e-3, 2e-3],
            [0.0, 1.0, 0.5],
            "it goes from 1 to 0.5 N at entry 3",
        ),
        ([0.0, 2e-3, 1e-3], [0.0, 1.0, 2.0], "depth must rise"),
        ([0.0, 1e-3, 2e-3], [0.0, 1.0, 1.0], "force must rise"),
        ([0.0, 1e-3, np.inf], [0.0, 1.0, 2.0], "depth 3 is inf; every entry must be finite"),
        ([0.0, 1e-3], [0.0, np.nan], "force 2 is nan"),
        ([1e-3, 2e-3], [0.0, 1.0], "the first depth must be 0 m"),
        ([0.0, 1e-3], [0.1, 1.0], "the first force must be 0 N"),
        ([0.0], [0.0], "at least two"),
        ([0.0, 1e-3], [0.0, 1.0, 2.0], "same number of entries"),
        ([0.0, 1e-320], [0.0, 1.0], "slope is not finite"),
        (["0 mm", "1 N"], [0.0, 1.0], "is a force"),
    ],
)
def test_a_table_that_is_no_law_is_refused(depth: list[Any], force: list[float], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        ForceLaw.table(depth, force, ORIGIN, UP)


def test_a_formula_and_a_plane_that_make_no_law_are_refused() -> None:
    with pytest.raises(ScenarioError, match="must rise"):
        ForceLaw.formula(lambda x: np.sin(1e3 * x), "5 mm", ORIGIN, UP)
    with pytest.raises(ScenarioError, match="one number for each depth"):
        ForceLaw.formula(lambda x: [x, x], "5 mm", ORIGIN, UP)  # type: ignore[arg-type, return-value]
    with pytest.raises(ScenarioError, match="no length"):
        ForceLaw.table([0, 1e-3], [0, 1.0], ORIGIN, [0, 0, 0])
    for point, normal in (([0.0, 0.0], UP), (ORIGIN, UP[1:]), (ORIGIN, [0.0, np.nan, 1.0])):
        with pytest.raises(ScenarioError, match="point and normal must be three finite numbers each"):
            ForceLaw.table([0, 1e-3], [0, 1.0], point, normal)


def slider(push: str = "1 N", **arm: str) -> dict[str, Any]:
    """Return an impedance display pressed against the object along -x, from 1 mm before it."""
    operator = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "100 N/m"}
    return {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**operator, **arm, "force": [f"-{push}", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "run": {"duration": "2 s"},
    }


def law_of(stiffest: float) -> ForceLaw:
    """Return a law along -x from the start on: 500 N/m, then the largest slope beyond 1 mm."""
    return ForceLaw.table([0.0, 1e-3, 2e-3], [0.0, 0.5, 0.5 + 1e-3 * stiffest], ORIGIN, [1.0, 0.0, 0.0])


def test_a_law_below_the_exact_limit_is_stable_and_comes_to_rest() -> None:
    law = law_of(2000.0)
    found = certify_force_law(slider(), law)
    assert found.state is State.STABLE
    assert found.multiplier[0] + found.multiplier[1] < 1.0
    assert found.slopes == (0.0, 2000.0)
    assert "also through a loss of contact" in found.sentence
    trace = palpate.simulate(slider(), object=law)
    assert np.ptp(trace["tip"][-500:, 0]) < 1e-7
    depth = -float(trace["tip"][-1, 0])
    # the motors' force, the arm's spring and its push balance
    assert law.at(depth) == pytest.approx(1.0 - 100.0 * depth, rel=1e-3)


def test_a_law_beyond_the_exact_limit_is_unstable_at_the_steep_depths_only() -> None:
    device = LinearDevice.of_mass(0.06, 0.05, HumanArm(0.15, 4.5, 100.0))
    limit = critical_stiffness(device, period=1e-3)
    steep = certify_force_law(slider(), law_of(1.05 * limit))
    assert steep.state is State.UNDECIDED
    assert steep.unstable_depths == pytest.approx(np.array([[1e-3, np.inf]]))
    gentle = certify_force_law(slider(), law_of(0.95 * limit))
    assert gentle.unstable_depths.size == 0
    everywhere = ForceLaw.table([0.0, 1e-3], [0.0, 1.05e-3 * limit], ORIGIN, [1.0, 0.0, 0.0])
    found = certify_force_law(slider(), everywhere)
    assert found.state is State.UNSTABLE
    assert found.unstable_depths == pytest.approx(np.array([[0.0, np.inf]]))


def test_a_controller_that_divides_by_the_stiffness_is_not_judged() -> None:
    tables = slider()
    tables["servo"]["topology"] = "force_tracking"
    tables["operator"] = {"kind": "none"}
    tables["reference"] = {"force": ["-0.1 N", "0 N", "0 N"]}
    tables["controller"] = {"kind": "lqg", "normalize": True}
    with pytest.raises(StabilityError, match="divides by the stiffness"):
        certify_force_law(tables, law_of(1000.0))


def loop_on(stiffness: float) -> Any:
    wall = {"kind": "wall", "stiffness": f"{stiffness} N/m", "normal": [1.0, 0.0, 0.0]}
    return scenario_loop(Scenario.from_dict({**slider(), "object": wall})).path


def test_no_multiplier_proves_a_loop_that_is_unstable_at_the_least_slope() -> None:
    """The condition on the circle says nothing of a loop x <- (a + k b) x with its pole on or outside of it."""
    for pole, proven in ((0.95, True), (1.0, False), (1.05, False), (-1.5, False)):
        path = control.StateSpace([[pole]], [[-1e-6]], [[1.0]], [[0.0]], 1e-3)
        assert (_multiplier(path, 0.0, 1000.0) is not None) == proven
    held = control.StateSpace([[1.05]], [[-1e-4]], [[1.0]], [[0.0]], 1e-3)
    assert _multiplier(held, 400.0, 500.0) is None  # 1.01 at 400 N/m
    assert _multiplier(held, 600.0, 800.0) is not None  # 0.99
    assert _multiplier(held, 600.0, 600.0) == (0.0, 0.0)
    assert _multiplier(held, 400.0, 400.0) is None
    edge = control.StateSpace([[1.5]], [[-1.0 / 1024.0]], [[1.0]], [[0.0]], 1e-3)
    assert _multiplier(edge, 512.0, 512.0) is None  # exactly 1


def test_the_exact_test_of_the_multiplier_agrees_with_a_dense_grid() -> None:
    path = loop_on(2000.0)
    a, b, c = (np.asarray(m) for m in (path.A, path.B, path.C))
    z = np.exp(1j * np.concatenate([np.geomspace(1e-6, 0.1, 4000), np.linspace(0.1, np.pi, 4000)]))
    response = np.array([(c @ np.linalg.solve(one * np.eye(len(a)) - a, b))[0, 0] for one in z])
    seen = set()
    for high in (50.0, 2000.0, 8000.0):
        for x, y in ((0.0, 0.0), (0.95, 0.0), (0.999, 0.0), (0.0, 0.9), (0.5, 0.4)):
            least = ((1.0 - x / z - y * z) * (1.0 / high - response)).real.min()
            assert _positive(a, b, c, 1.0 / high, x, y) == (least > 0.0)
            seen.add(bool(least > 0.0))
    assert seen == {True, False}


def test_a_multiplier_proves_nearly_the_exact_range_and_never_more() -> None:
    limit = critical_stiffness(LinearDevice.of_mass(0.06, 0.05, HumanArm(0.15, 4.5, 100.0)), period=1e-3)
    path = loop_on(2000.0)
    assert _multiplier(path, 0.0, 0.98 * limit) is not None
    assert _multiplier(path, 0.0, 1.001 * limit) is None
    assert _multiplier(path, 500.0, 1.001 * limit) is None


def test_random_laws_within_proven_slopes_decay_from_a_hard_start() -> None:
    """Slopes up to 95 % of the limit, entries every 20 um to 1 mm: the samples of the loop decay to rest."""
    path = loop_on(2000.0)
    a, b, c = (np.asarray(m) for m in (path.A, path.B, path.C))
    limit = critical_stiffness(LinearDevice.of_mass(0.06, 0.05, HumanArm(0.15, 4.5, 100.0)), period=1e-3)
    assert _multiplier(path, 0.0, 0.95 * limit) is not None
    generator = np.random.default_rng(5)
    for _ in range(10):
        steps = generator.uniform(2e-5, 1e-3, 12)
        slopes = generator.choice([0.01, 0.2, 0.95], 12) * limit
        x, y = np.cumsum(np.r_[0.0, steps]), np.cumsum(np.r_[0.0, steps * slopes])
        x, y = x - 0.5 * x[-1], y - np.interp(0.5 * x[-1], x, y)  # about a rest in the middle
        state, sizes = 0.02 * generator.standard_normal(len(a)), []
        for _ in range(6000):
            at = float((c @ state)[0])
            beyond = slopes[-1] * max(at - x[-1], 0.0) + slopes[0] * min(at - x[0], 0.0)
            state = a @ state + b[:, 0] * (np.interp(at, x, y) + beyond)
            sizes.append(np.linalg.norm(state))
        assert max(sizes[-50:]) < 5e-3 * max(sizes)
