"""Certification of a scenario's servo loop by four criteria, its margins, its passivity and a full simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from palpate.control.stability_margins import Margins, loop_margins
from palpate.devices.reach import near_limits
from palpate.errors import PalpateError, StabilityError
from palpate.scenario import Scenario
from palpate.simulation.drive_hold import drive_hold
from palpate.simulation.linear_evidence import loop_at_rest
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.simulator import simulate
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.stability.assumptions import assumptions, method, redesigned
from palpate.stability.certificate import Certificate
from palpate.stability.counter_example import CounterExample, destabilizing_operator, divergence_example
from palpate.stability.criteria import check_stability
from palpate.stability.encoder_counts import count_at_tip, friction_for_counts
from palpate.stability.passivity import field_damping, passive_damping

__all__ = ["certify_spring"]

DOUBLE_ROOT = 1e-7  # modulus over 1 that is rounding: a free device has a double root at 1


def certify_spring(s: Scenario) -> Certificate:
    """Return the certificate of a scenario whose object is a spring or a wall; see ``palpate.stability.certify``.

    Raises:
        StabilityError, ScenarioError, DesignError, PoseError: as ``certify``.
    """
    loop = scenario_loop(s)
    radius, criteria = check_stability(loop.matrix())
    if len(set(criteria.values())) > 1 or abs(radius - 1) < 1e-12:
        verdicts = ", ".join(f"{name}: {'stable' if stable else 'unstable'}" for name, stable in criteria.items())
        reason = (
            f"the loop is so near its limit (spectral radius 1 {radius - 1:+.1e}) that the criteria "
            f"disagree within rounding ({verdicts})."
        )
        return _certificate(s, criteria, State.UNDECIDED, reason, {}, method(s))
    if radius >= 1:
        return _unstable(s, loop, radius, criteria)
    return _stable(s, loop, radius, criteria)


def _certificate(
    s: Scenario,
    criteria: Mapping[str, bool],
    state: State,
    reason: str,
    margin: Mapping[str, float],
    steps: tuple[str, ...],
    passive: bool | None = None,
    example: CounterExample | None = None,
) -> Certificate:
    return Certificate(
        s.title, Verdict(state, reason), assumptions(s), margin, steps, dict(criteria), passive, example, s.to_dict()
    )


def _unstable(s: Scenario, loop: ScenarioLoop, radius: float, criteria: Mapping[str, bool]) -> Certificate:
    doubling = math.log(2) / math.log(radius) * loop.period
    margin = {"spectral_radius": radius, "doubling_time_s": doubling}
    limit = ""
    try:
        least, gain = _stable_factors(loop)
        margin["critical_gain"] = gain
        whose = "its design stiffness" if loop.normalized else "the object's stiffness and damping"
        limit = f"; the loop is stable below {gain:.4g} times {whose}"
        if least > 0.0:
            margin["least_stable_gain"] = least
            limit = f"; the loop is stable from {least:.4g} to {gain:.4g} times {whose}"
        limit += _own_controller(s)
    except PalpateError:
        pass
    angle = _dominant_angle(loop)
    margin["frequency_Hz"] = angle / (2 * math.pi * loop.period)
    motion = f"an oscillation at {margin['frequency_Hz']:.4g} Hz" if angle > 0 else "a motion without oscillation"
    example = divergence_example(s, radius)
    rest, run, sentence = _simulate_to_rest(s)
    reason = f"about the start {motion} doubles every {doubling:.3g} s{limit}."
    if rest is not None:
        margin["spectral_radius_at_rest"] = rest.spectral_radius()
    if run.since is None:
        reason += f" The verdict of the run is {run}."
    # without a counter-example, friction, encoder counts or drive limits may bound all motions
    hidden = example is None and run.state is State.UNDECIDED
    state = State.UNDECIDED if hidden else State.UNSTABLE
    return _certificate(s, criteria, state, reason, margin, (*method(s), sentence), None, example)


def _stable_factors(loop: ScenarioLoop) -> tuple[float, float]:
    """Return the uppermost interval of factors below 1 on stiffness and damping that makes an unstable loop stable.

    Its lower end is 0 if the loop is stable down to a factor of 1e-6.

    Raises:
        StabilityError: no factor down to 1e-6 makes it stable.
    """

    def excess(factor: float) -> float:
        return float(np.abs(np.linalg.eigvals(loop.matrix(factor))).max()) - 1.0

    factors = np.geomspace(1.0, 1e-6, 300)
    found = np.array([excess(factor) for factor in factors])
    stable = np.flatnonzero(found < 0.0)
    if not len(stable):
        raise StabilityError("no factor on the stiffness makes the loop stable")
    first = int(stable[0])
    below = np.flatnonzero(found[first:] > DOUBLE_ROOT)
    least = 0.0
    if len(below):
        end = first + int(below[0])
        inside = int(stable[stable < end][-1])
        least = float(brentq(excess, factors[end], factors[inside]))
    return least, float(brentq(excess, factors[first], factors[first - 1]))


def _dominant_angle(loop: ScenarioLoop) -> float:
    """Return the angle of the largest eigenvalue, rad per sample."""
    values = np.linalg.eigvals(loop.matrix())
    return float(abs(np.angle(values[np.argmax(np.abs(values))])))


def _stable(s: Scenario, loop: ScenarioLoop, radius: float, criteria: Mapping[str, bool]) -> Certificate:
    m = loop_margins(loop.gain())
    margin = {
        "spectral_radius": radius,
        "gain_margin": m.gain_up,
        "gain_reduction_margin": m.gain_down,
        "phase_margin_deg": m.phase,
        "delay_margin_s": m.delay,
        "disk_margin": m.disk,
    }
    rest, run, sentence = _simulate_to_rest(s)
    steps = [*method(s), sentence]
    if run.state is State.UNSTABLE and run.since is not None:
        reason = f"small motions about the start decay, but the run itself {run.reason}."
        example = CounterExample(s.to_dict(), float("inf"), f"the scenario itself {run.reason}.")
        return _certificate(s, criteria, State.UNSTABLE, reason, margin, tuple(steps), None, example)
    if rest is not None:
        radius_at_rest, criteria_at_rest = check_stability(rest.matrix())
        margin["spectral_radius_at_rest"] = radius_at_rest
        if not all(criteria_at_rest.values()):
            reason = (
                "stable at the start, but not where the run comes to rest (spectral radius "
                f"{radius_at_rest:.6g}); the loop may oscillate between the two."
            )
            return _certificate(s, criteria, State.UNDECIDED, reason, margin, tuple(steps))
        at_rest = loop_margins(rest.gain())
        margin["gain_margin_at_rest"] = at_rest.gain_up
        m = replace(m, gain_up=min(m.gain_up, at_rest.gain_up), gain_down=max(m.gain_down, at_rest.gain_down))
    if run.state in FAILED:
        reason = f"small motions about the start decay, but the verdict of the run is {run}."
        return _certificate(s, criteria, State.UNDECIDED, reason, margin, tuple(steps))
    passive, destabilizing, addition = _passivity(s, loop, margin, steps)
    reason = f"{_range(m, loop)}{_own_controller(s)}{addition}."
    return _certificate(s, criteria, State.STABLE, reason, margin, tuple(steps), passive, destabilizing)


def _passivity(
    s: Scenario, loop: ScenarioLoop, margin: dict[str, float], steps: list[str]
) -> tuple[bool | None, CounterExample | None, str]:
    """Return the passivity of a stable loop, a counter-example, and an addition to the claim.

    The numbers are added to ``margin`` and the remarks to ``steps``.
    """
    passive, required, remark = _passivity_condition(s, loop)
    example = None
    if not math.isnan(required):
        margin["passive_damping_required_N_s_per_m"] = required
        margin["device_damping_N_s_per_m"] = loop.device_damping
    if passive:
        longest = _longest_interval(s, loop)
        if longest > s.period:
            margin["max_passive_interval_s"] = longest
            remark += f" It stays passive if a tick is late, up to {1e3 * longest:.4g} ms after the one before."
    elif not math.isnan(required):
        example = destabilizing_operator(s)
        if example is not None:
            passive = False
        else:
            steps.append(
                "No mass and spring that destabilizes the loop was found; more general passive operators were not "
                "searched."
            )
    if remark:
        steps.append(remark)
    if s.servo.topology != "impedance_display":
        return passive, example, ""
    additions = {
        True: ", and passive: stable with every passive operator",
        False: ", with the operator described; it is not passive, so another operator can destabilize it",
        None: ", with the operator described; whether it is passive is not known",
    }
    return passive, example, additions[passive]


def _own_controller(s: Scenario) -> str:
    """Return an addition to a factor on the object that holds for the controller as it is alone."""
    return " with this controller" if redesigned(s) else ""


def _range(m: Margins, loop: ScenarioLoop) -> str:
    if not loop.normalized:
        return f"the object may be {_stiffness_factor(m.gain_up, loop)} before the loop oscillates"
    up = "any factor" if math.isinf(m.gain_up) else f"{m.gain_up:.4g} times"
    return (
        "the loop is the same for every stiffness of the object, and the object may be "
        f"{m.gain_down:.4g} to {up} as stiff as the servo takes it to be"
    )


def _stiffness_factor(factor: float, loop: ScenarioLoop) -> str:
    if math.isinf(factor):
        return "of any stiffness"
    stiffest = factor * float(np.linalg.eigvalsh(loop.stiffness).max())
    if stiffest == 0.0:
        return f"{factor:.4g} times as damped ({factor * float(np.linalg.eigvalsh(loop.damping).max()):.4g} N s/m)"
    if not np.any(loop.damping):
        return f"{factor:.4g} times as stiff ({stiffest / 1e3:.4g} N/mm)"
    damping = factor * float(np.linalg.eigvalsh(loop.damping).max())
    return f"{factor:.4g} times as stiff and as damped ({stiffest / 1e3:.4g} N/mm with {damping:.4g} N s/m)"


def _simulate_to_rest(s: Scenario) -> tuple[ScenarioLoop | None, Verdict, str]:
    """Run the scenario; return its loop at rest, the verdict of the run, and the observation as a sentence."""
    trace = simulate(s)
    run, verdict = f"The full scenario was run for {s.run.duration:g} s", trace.verdict
    if not trace.completed:
        return None, verdict, f"{run} and diverged at {trace.unstable_from:g} s."
    run = f"{run}; its verdict is {verdict.state.label}"
    hold = drive_hold(trace, s)
    run = "; ".join([run, *([hold] if hold else []), *near_limits(s.load_device(), trace["angle"])])
    rest, reason = loop_at_rest(trace, s)
    told = "; the loop was tested again where it came to rest" if rest is not None else f"; {reason}" if reason else ""
    return rest, verdict, f"{run}{told}."


def _passivity_condition(s: Scenario, loop: ScenarioLoop) -> tuple[bool | None, float, str]:
    """Return whether the display is passive (None: open), the damping it requires (N s/m or nan), and a remark."""
    if s.servo.topology != "impedance_display" or s.controller.kind not in ("none", "gain"):
        return None, float("nan"), "Passivity is not defined for this topology and controller."
    if s.object.coupling != "backward" or math.isnan(loop.device_damping):
        return None, float("nan"), ""
    if not loop.rests:
        return (
            None,
            float("nan"),
            "No passivity is claimed: under the constant force of its motors alone the device tips over at this pose.",
        )
    gain = max(s.controller.gain or (1.0,))
    k = float(np.linalg.eigvalsh(loop.stiffness).max()) * gain
    b = float(np.linalg.eigvalsh(loop.damping).max()) * gain
    required = passive_damping(stiffness=k, virtual_damping=b, period=s.period, delay=s.device.delay)
    if late := s.servo.jitter:
        longest = s.period + late  # the servo divides a difference over it by the period: the damping grows as much
        required = field_damping(
            lipschitz=k, longest_period=longest, delay=s.device.delay, virtual_damping=b * longest / s.period
        )
    passive: bool | None = loop.device_damping >= required
    # Sufficient, not exact: the stiffest direction with the least damped one, a hold that turns with the pose, and a
    # passive mode before the operator.
    turns = bool(np.any(loop.own.turning))
    several = loop.directions.shape[1] > 1 or turns or s.load_device().flexible is not None
    exactly, at_most, at_least = ("", " at most", " at least") if several else (", exactly", "", "")
    if late:
        exactly, at_most = f" with ticks up to {1e3 * late:.4g} ms late", " at most"
    remark = (
        f"Passivity{exactly}: the object requires{at_most} {required:.4g} N s/m of the device's own damping at the tip "
        f"and there is{at_least} {loop.device_damping:.4g} N s/m."
    )
    if turns:
        remark += " That is what the torque that balances the weight leaves: the servo turns it with the pose at ticks."
    if (several or late) and not passive:
        passive = None
    if s.device.encoder and passive:
        needed = friction_for_counts(s, loop, gain * loop.stiffness, gain * loop.damping)
        own = s.load_device().coulomb
        if np.any(lacks := needed > own):
            passive, joint = False, int(np.argmax(np.where(lacks, needed - own, -np.inf)))
            unit = s.load_device().torque_unit.replace("*", " ")
            remark += (
                f" Encoder counts of {count_at_tip(s, loop) * 1e6:.3g} µm at the tip require "
                f"{needed[joint]:.4g} {unit} of dry friction of joint {joint + 1}, and it has {own[joint]:.4g} {unit} "
                "(Abbott & Okamura 2005)."
            )
    return passive, required, remark


def _longest_interval(s: Scenario, loop: ScenarioLoop) -> float:
    """Return the T_max (s) up to which the device's damping covers ``field_damping``."""
    gain = max(s.controller.gain or (1.0,))
    k, b = (gain * float(np.linalg.eigvalsh(m).max()) for m in (loop.stiffness, loop.damping))
    # The servo divides its differences by the period, whatever their interval: b grows with T_max.
    required = k * (0.5 + s.device.delay) + b / s.period
    return loop.own.longest_interval(required)
