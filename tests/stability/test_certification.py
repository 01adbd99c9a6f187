"""Numbers and sentences of a certificate of a spring or wall, against closed forms and the loop itself."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.control.stability_margins import loop_margins
from palpate.devices import Device
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.simulation.verdict import State, Verdict
from palpate.stability import certification, certify, destabilizing_operator
from palpate.stability.assumptions import assumptions
from palpate.stability.certification import (
    _dominant_angle,
    _longest_interval,
    _passivity_condition,
    _range,
    _stable_factors,
    _stiffness_factor,
)
from palpate.stability.passivity import field_damping
from slider_press import resonant
from slider_press import slider as leant_on


def slider(stiffness: str = "90 N/m", **tables: Any) -> dict[str, Any]:
    return leant_on(stiffness, **{"run": {"duration": "0.1 s"}, **tables})


def press(**tables: Any) -> Scenario:
    return Scenario.from_dict(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": {"pose": ["0.2 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "0.5 ms", "topology": "impedance_display"},
            "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"},
            "object": {"kind": "spring", "stiffness": ["1 N/mm", "2 N/mm", "3 N/mm"], "damping": "1 N*s/m"},
            "run": {"duration": "0.1 s"},
            **tables,
        }
    )


def loop_of(stiffness: list[float], damping: list[float], normalized: bool = False) -> Any:
    return SimpleNamespace(stiffness=np.diag(stiffness), damping=np.diag(damping), normalized=normalized)


@pytest.mark.parametrize(
    ("model", "kinematics", "design", "said"),
    [
        ("nonlinear", "nonlinear", {}, (False, False, True)),
        ("nonlinear", "linear", {"stiffness": "1 N/mm"}, (False, True, False)),
        ("linear", "nonlinear", {}, (True, False, True)),
        ("linear", "linear", {"stiffness": "1 N/mm"}, (True, True, False)),
    ],
)
def test_the_assumptions_name_a_simplified_device_and_a_controller_designed_for_the_object(
    model: str, kinematics: str, design: dict[str, str], said: tuple[bool, bool, bool]
) -> None:
    scenario = press(
        device={"name": "phantom-premium-1.5a", "model": model, "kinematics": kinematics},
        operator={"kind": "force", "force": ["0 N", "0 N", "-1 N"]},
        controller={"kind": "lqg", **design},
    )
    words = " ".join(assumptions(scenario))
    parts = ("its linearization at the start", "kinematics are those of the start", "another controller")
    assert tuple(part in words for part in parts) == said
    assert ("linearized exactly there" in words) is (model == "nonlinear")


@pytest.mark.parametrize(
    ("stiffness", "damping", "factor", "said"),
    [
        ([1000.0, 3000.0], [0.0, 0.0], 2.5, "2.5 times as stiff (7.5 N/mm)"),
        ([1000.0, 3000.0], [5.0, 4.0], 2.5, "2.5 times as stiff and as damped (7.5 N/mm with 12.5 N s/m)"),
        ([0.0, 0.0], [5.0, 4.0], 2.5, "2.5 times as damped (12.5 N s/m)"),
        ([1000.0, 3000.0], [5.0, 4.0], math.inf, "of any stiffness"),
    ],
)
def test_a_claim_names_the_stiffest_and_most_damped_direction_times_the_margin(
    stiffness: list[float], damping: list[float], factor: float, said: str
) -> None:
    loop = loop_of(stiffness, damping)
    assert _stiffness_factor(factor, loop) == said
    margins: Any = SimpleNamespace(gain_up=factor, gain_down=0.25)
    assert _range(margins, loop) == f"the object may be {said} before the loop oscillates"
    up = "any factor" if math.isinf(factor) else "2.5 times"
    relative = _range(margins, loop_of(stiffness, damping, normalized=True))
    assert relative.endswith(f"the object may be 0.25 to {up} as stiff as the servo takes it to be")


@pytest.mark.parametrize("edge", [0.9, 0.5, 0.03, 2e-6])
def test_the_largest_stable_factor_is_where_the_radius_falls_to_one(edge: float) -> None:
    """|z| = 0.5 + 0.5 f / f0 at the angle 0.3 rad; below another range of factors the loop is unstable again."""

    def matrix(factor: float = 1.0) -> np.ndarray:
        radius = 0.5 + 0.5 * factor / edge if factor > 0.2 * edge else 2.0
        return radius * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])

    least, most = _stable_factors(SimpleNamespace(matrix=matrix))  # type: ignore[arg-type]
    assert most == pytest.approx(edge, rel=1e-9)
    assert least == pytest.approx(0.2 * edge if edge > 5e-6 else 0.0, rel=1e-9)
    assert _dominant_angle(SimpleNamespace(matrix=matrix)) == pytest.approx(0.3)  # type: ignore[arg-type]
    with pytest.raises(StabilityError, match="no factor on the stiffness makes the loop stable"):
        _stable_factors(SimpleNamespace(matrix=lambda factor: np.eye(2) * 1.1))  # type: ignore[arg-type]


def test_the_dominant_angle_is_that_of_the_largest_eigenvalue() -> None:
    values = np.array([0.99, 0.5, -1.2, 0.3])
    loop: Any = SimpleNamespace(matrix=lambda: np.diag(values))
    assert _dominant_angle(loop) == pytest.approx(np.pi)


def test_an_unstable_loop_doubles_in_its_doubling_time_at_its_frequency() -> None:
    """400 N/m on 60 g oscillate at sqrt(K/m) nearly; the counter-example lasts until a thousandfold growth."""
    certificate = certify(slider("400 N/m"))
    margin = certificate.margin
    radius, doubling = margin["spectral_radius"], margin["doubling_time_s"]
    assert radius == pytest.approx(scenario_loop(Scenario.from_dict(slider("400 N/m"))).spectral_radius(), rel=1e-12)
    assert radius ** (doubling / 1e-3) == pytest.approx(2.0, rel=1e-9)
    assert margin["frequency_Hz"] == pytest.approx(math.sqrt(400.0 / 0.06) / (2.0 * math.pi), rel=2e-3)
    assert certificate.claim.startswith(
        f"Unstable: about the start an oscillation at {margin['frequency_Hz']:.4g} Hz doubles every {doubling:.3g} s; "
        f"the loop is stable below {margin['critical_gain']:.4g} times the object's stiffness and damping."
    )
    example = certificate.counter_example
    assert example is not None
    shown = Scenario.from_dict(example.scenario).run
    assert radius ** (shown.duration / 1e-3) == pytest.approx(1e3, rel=1e-3)
    assert shown.record_every == 1


def test_a_loop_that_softer_objects_destabilize_as_well_is_stable_between_two_factors() -> None:
    """Every object below the upper factor was called stable."""
    scenario = Scenario.from_dict(resonant("100 N/mm"))
    found = certify(scenario)
    least, most = found.margin["least_stable_gain"], found.margin["critical_gain"]
    assert f"the loop is stable from {least:.4g} to {most:.4g} times the object's stiffness" in found.claim
    loop = scenario_loop(scenario)
    for factor, stable in ((0.99 * least, False), (1.01 * least, True), (0.99 * most, True), (1.01 * most, False)):
        assert (loop.spectral_radius(1e5 * factor, 0.0) < 1.0) is stable


@pytest.mark.parametrize("damping", [[0.0, 0.0, 0.0], [0.0, 0.2, 0.0], [0.1, 0.2, 0.3]])
def test_a_bilinear_coupling_has_a_pole_at_minus_one_where_it_damps_alone(damping: list[float]) -> None:
    """Without a damper it is the spring itself, whose loop is not at its limit."""
    spring = {"kind": "spring", "stiffness": "50 N/m", "damping": [f"{b} N*s/m" for b in damping]}
    loops = [scenario_loop(press(object=spring | {"coupling": rule})) for rule in ("bilinear", "backward")]
    sizes = [len(loop.matrix()) for loop in loops]
    assert sizes == [loops[0].path.nstates + np.count_nonzero(damping)] * 2
    radii = [loop.spectral_radius() for loop in loops]
    if not any(damping):
        assert radii[0] == radii[1] < 1.0


def test_a_stable_certificate_lists_the_margins_of_its_loop() -> None:
    scenario = Scenario.from_dict(slider())
    found = certify(scenario)
    m = loop_margins(scenario_loop(scenario).gain())
    expected = {
        "gain_margin": m.gain_up,
        "gain_reduction_margin": m.gain_down,
        "phase_margin_deg": m.phase,
        "delay_margin_s": m.delay,
        "disk_margin": m.disk,
        "device_damping_N_s_per_m": 0.05,
        "max_passive_interval_s": 0.05 / 45.0,  # b over K / 2
    }
    assert {name: found.margin[name] for name in expected} == pytest.approx(expected, rel=1e-9)
    late = "It stays passive if a tick is late, up to 1.111 ms after the one before."
    assert any(step.endswith(late) for step in found.method)
    assert any(step.startswith("The full scenario was run for 0.1 s; its verdict is") for step in found.method)


@pytest.mark.parametrize(
    ("delay", "damping", "gain"), [(0, 0.0, 1.0), (2, 0.0, 1.0), (1, 0.01, 1.0), (0, 0.02, 0.4), (0, 0.0, 0.5)]
)
def test_up_to_the_longest_interval_the_damping_of_the_device_suffices(delay: int, damping: float, gain: float) -> None:
    """The servo divides by the nominal period, so that virtual damping grows with the interval."""
    spring = {"kind": "spring", "stiffness": "20 N/m", "damping": f"{damping} N*s/m"}
    tables = slider(object=spring, device={"name": "slider", "delay": delay}, controller={"kind": "gain", "gain": gain})
    scenario = Scenario.from_dict(tables)
    longest = _longest_interval(scenario, scenario_loop(scenario))
    needed = field_damping(
        lipschitz=20.0 * gain, longest_period=longest, delay=delay, virtual_damping=gain * damping * longest / 1e-3
    )
    assert needed == pytest.approx(0.05, rel=1e-9)
    passive, required, remark = _passivity_condition(scenario, scenario_loop(scenario))
    assert passive is (required <= 0.05) is (longest >= 1e-3)
    if delay == 0 or damping == 0.0:
        assert required == pytest.approx(gain * (20.0 * 1e-3 * (0.5 + delay) + damping), rel=1e-9)
    assert remark == (
        f"Passivity, exactly: the object requires {required:.4g} N s/m of the device's own damping at the tip "
        "and there is 0.05 N s/m."
    )


def test_late_ticks_require_the_damping_of_their_longest_interval() -> None:
    spring = {"kind": "spring", "stiffness": "20 N/m", "damping": "0.01 N*s/m"}
    servo = {"period": "1 ms", "topology": "impedance_display", "jitter": "0.5 ms"}
    scenario = Scenario.from_dict(slider(object=spring, servo=servo))
    passive, required, remark = _passivity_condition(scenario, scenario_loop(scenario))
    assert required == pytest.approx(field_damping(lipschitz=20.0, longest_period=1.5e-3, virtual_damping=0.015))
    assert passive is True
    assert remark.startswith("Passivity with ticks up to 0.5 ms late: the object requires at most")
    stiff = Scenario.from_dict(slider("90 N/m", servo=servo))
    assert _passivity_condition(stiff, scenario_loop(stiff))[0] is None  # the condition is sufficient only


def test_of_several_directions_the_condition_of_the_stiffest_is_sufficient_only() -> None:
    scenario = press()
    loop = scenario_loop(scenario)
    passive, required, remark = _passivity_condition(scenario, loop)
    assert required == pytest.approx(3000.0 * 0.5e-3 * 0.5 + 1.0)
    assert passive is None
    assert remark == (
        f"Passivity: the object requires at most {required:.4g} N s/m of the device's own damping at the tip "
        f"and there is at least {loop.device_damping:.4g} N s/m. That is what the torque that balances the weight "
        "leaves: the servo turns it with the pose at ticks."
    )


def weighed(stiffness: float, delay: int = 0) -> Scenario:
    """Return the arm on a wall in a pose where the turning of the balancing torque takes 5 % of the friction."""
    return press(
        device={"name": "phantom-premium-1.5a", "delay": delay},
        start={"pose": ["0 rad", "2.9 rad", "3.7 rad"]},
        servo={"period": "2 ms", "topology": "impedance_display"},
        operator={"kind": "force", "force": ["0 N", "-0.01 N", "0 N"]},
        object={"kind": "wall", "normal": [0, 1, 0], "stiffness": f"{stiffness!r} N/m"},
    )


def test_a_wall_up_to_the_friction_that_the_turning_of_the_weight_leaves_is_passive() -> None:
    """Held between ticks, the torque that balances the weight generates energy as a sampled spring does."""
    scenario = weighed(10.0)
    device, pose = scenario.load_device(), np.array(scenario.start.pose)
    lever = device.jacobian(pose)[1]
    friction = 1.0 / float(lever**2 @ (1.0 / device.viscous))
    left = scenario_loop(scenario).device_damping
    assert 0.9 * friction < left < 0.96 * friction
    hand = HumanArm(0.1, 0.0, 5.0)
    for stiffness, passive in ((0.5 * (friction + left) / 1e-3, None), (0.999 * left / 1e-3, True)):
        held = weighed(stiffness)
        assert _passivity_condition(held, scenario_loop(held))[0] is passive
        radius = scenario_loop(held, arm=hand, operator_force=(0.0, 0.0, 0.0)).spectral_radius()
        assert (radius < 1.0) is bool(passive)
    drawn = np.random.default_rng(3)
    for mass, spring in 10.0 ** drawn.uniform([-3.0, -1.0], [1.0, 4.0], (20, 2)):
        assert scenario_loop(held, arm=HumanArm(mass, 0.0, spring), operator_force=(0, 0, 0)).spectral_radius() < 1.0


@pytest.mark.parametrize("delay", [0, 1])
def test_the_turning_of_the_weight_takes_friction_in_proportion_to_the_interval(delay: int) -> None:
    """Both ends of the range of intervals, and the largest of them with a wall."""
    scenario = weighed(2.0, delay)
    own, loop = scenario_loop(scenario).own, scenario_loop(scenario)
    whole = own.felt(0.0)
    assert loop.device_damping == own.felt(2e-3) < whole
    most = own.longest_interval(0.0)
    assert own.felt(0.999 * most) > 0.0 == own.felt(1.001 * most)
    longest = _longest_interval(scenario, loop)
    assert own.felt(longest) == pytest.approx(2.0 * (0.5 + delay) * longest, rel=1e-9)


def test_no_hand_is_searched_for_an_identified_model() -> None:
    """Its response includes whatever held it."""
    scenario = press(
        device={"name": "phantom-premium-1.5a", "model": "experimental"}, operator={"kind": "none"},
        servo={"period": "0.5 ms"}, reference={"force": ["0 N", "0 N", "1 N"]},
        object={"kind": "spring", "stiffness": "1 N/mm"},
    )  # fmt: skip
    assert destabilizing_operator(scenario) is None


def test_a_run_that_diverges_from_a_stable_start_is_its_own_counter_example(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = Verdict(State.UNSTABLE, "diverges at t = 0.07 s", 0.07)
    monkeypatch.setattr(certification, "_simulate_to_rest", lambda _: (None, failed, "It was run."))
    found = certify(slider())
    assert found.verdict.state is State.UNSTABLE
    assert found.claim == "Unstable: small motions about the start decay, but the run itself diverges at t = 0.07 s."
    example = found.counter_example
    assert example is not None
    assert (example.growth, example.sentence) == (math.inf, "the scenario itself diverges at t = 0.07 s.")
    assert example.scenario == Scenario.from_dict(slider()).to_dict()
    for state, expected in ((State.CONTACT_LOST, State.UNDECIDED), (State.UNDECIDED, State.STABLE)):
        run = Verdict(state, "its reason")
        monkeypatch.setattr(certification, "_simulate_to_rest", lambda _, run=run: (None, run, "It was run."))
        assert certify(slider()).verdict.state is expected


def test_a_run_that_comes_to_rest_is_tested_there_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rest is that of another stiffness: stable at 50 N/m, beyond the limit of 100 N/m at 130 N/m."""
    settled = Verdict(State.SETTLED, "the tip rests")
    rests = {stiffness: scenario_loop(Scenario.from_dict(slider(f"{stiffness} N/m"))) for stiffness in (50, 130)}
    found = {}
    for stiffness, rest in rests.items():
        monkeypatch.setattr(certification, "_simulate_to_rest", lambda _, rest=rest: (rest, settled, "It was run."))
        found[stiffness] = certify(slider())
        radius = found[stiffness].margin["spectral_radius_at_rest"]
        assert radius == pytest.approx(rest.spectral_radius(), rel=1e-9)
    assert found[50].verdict.state is State.STABLE
    assert found[50].margin["gain_margin_at_rest"] == pytest.approx(loop_margins(rests[50].gain()).gain_up, rel=1e-9)
    assert found[130].verdict.state is State.UNDECIDED
    assert "stable at the start, but not where the run comes to rest (spectral radius 1.0" in found[130].claim
    assert "gain_margin_at_rest" not in found[130].margin
    mixed = {"eigenvalues": True, "Jury": False, "Routh": True, "Lyapunov": True}
    whole = certification.check_stability
    monkeypatch.setattr(
        certification, "check_stability", lambda m: (0.99, mixed) if np.shape(m) == (9, 9) else whole(m)
    )
    rest_of_nine: Any = SimpleNamespace(matrix=lambda: np.zeros((9, 9)))
    monkeypatch.setattr(certification, "_simulate_to_rest", lambda _: (rest_of_nine, settled, "It was run."))
    assert certify(slider()).verdict.state is State.UNDECIDED


@pytest.mark.parametrize(("shown", "run", "expected"), [
    (False, State.UNDECIDED, State.UNDECIDED), (False, State.SETTLED, State.UNSTABLE),
    (True, State.UNDECIDED, State.UNSTABLE),
])  # fmt: skip
def test_an_unstable_linear_loop_is_undecided_only_if_no_run_shows_it(
    shown: bool, run: State, expected: State, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = certification.CounterExample({}, 2.0, "it grows.") if shown else None
    monkeypatch.setattr(certification, "divergence_example", lambda *_: example)
    for since in (None, 0.07):
        verdict = Verdict(run, "its reason", since)
        monkeypatch.setattr(certification, "_simulate_to_rest", lambda _, verdict=verdict: (None, verdict, "Run."))
        found = certify(slider("400 N/m"))
        assert found.verdict.state is expected
        assert found.counter_example is example
        assert (f"The verdict of the run is {run.label}: its reason." in found.claim) is (since is None)
        assert found.passive is None


def test_passivity_is_a_matter_of_impedance_displays_with_a_gain() -> None:
    tracking = Scenario.from_dict(
        slider(servo={"period": "1 ms"}, operator={"kind": "none"}, reference={"force": ["0.5 N", "0 N", "0 N"]})
    )
    with_lead = Scenario.from_dict(slider("20 N/m", controller={"kind": "lead_lag"}))
    for scenario in (tracking, with_lead):
        passive, required, remark = _passivity_condition(scenario, scenario_loop(scenario))
        assert passive is None
        assert math.isnan(required)
        assert remark == "Passivity is not defined for this topology and controller."
    found = certify(tracking)
    assert found.claim.endswith("before the loop oscillates.")
    assert "passive_damping_required_N_s_per_m" not in found.margin


def test_the_stiffest_axis_is_that_with_the_largest_gain() -> None:
    scenario = press(controller={"kind": "gain", "gain": [0.5, 2.0, 1.0]})
    loop = scenario_loop(scenario)
    required = _passivity_condition(scenario, loop)[1]
    assert required == pytest.approx(2.0 * (3000.0 * 0.5e-3 * 0.5 + 1.0))
    longest = _longest_interval(scenario, loop)
    assert longest == pytest.approx(loop.own.felt(longest) / required * 0.5e-3)


@pytest.mark.parametrize("found", [False, True])
def test_a_search_for_a_destabilizing_hand_is_reported(found: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    example = certification.CounterExample({}, 2.0, "in a hand of 1 kg it grows.") if found else None
    monkeypatch.setattr(certification, "destabilizing_operator", lambda _: example)
    spring = {"kind": "spring", "stiffness": "90 N/m", "damping": "1 N*s/m"}
    certificate = certify(slider(object=spring))
    assert certificate.verdict.state is State.STABLE
    assert certificate.passive is False
    assert certificate.counter_example is example
    said = any("No mass and spring that destabilizes the loop was found" in step for step in certificate.method)
    assert said is not found
    assert "it is not passive, so another operator can destabilize it" in certificate.claim


@pytest.mark.parametrize("stiffness", [10.0, 90.0])
def test_encoder_counts_need_friction_up_to_the_stiffness_that_it_suffices_for(
    stiffness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = Scenario.from_dict(slider(f"{stiffness} N/m", device={"name": "slider", "encoder": True}))
    monkeypatch.setattr(Device, "coulomb", np.array([50.0 * 23e-6 / 2.0]))
    passive, _, remark = _passivity_condition(scenario, scenario_loop(scenario))
    assert passive is (stiffness < 50.0)
    assert ("Encoder counts of 23 µm at the tip require 0.001035 N of dry friction" in remark) is (stiffness > 50.0)
    damped = {"kind": "spring", "stiffness": f"{stiffness} N/m", "damping": "1 N*s/m"}
    lossy = Scenario.from_dict(slider(object=damped, device={"name": "slider", "encoder": True}))
    assert "Encoder counts" not in _passivity_condition(lossy, scenario_loop(lossy))[2]  # not passive without them


def test_a_loop_that_diverges_says_when_and_one_that_ends_what_its_verdict_is() -> None:
    said = certify(slider("20 N/mm", run={"duration": "1 s"})).method[-1]
    assert said.startswith("The full scenario was run for 1 s and diverged at ")
    two = Scenario.from_dict(slider(device={"name": "haply-2diy"}, start={"tip": ["20 mm", "100 mm", "0 mm"]},
        operator={"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}))  # fmt: skip
    loop = scenario_loop(two)
    assert loop.directions.shape == (3, 2)
    assert _passivity_condition(two, loop)[2].startswith("Passivity: the object requires at most")
