"""A verdict on a scenario: the claim, what it assumes, its margin and method, or a counter-example that runs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.control.stability_margins import critical_gain, loop_margins
from palpate.errors import PalpateError
from palpate.files import atomic_write, check_suffix
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.simulator import simulate
from palpate.stability.counter_example import CounterExample, destabilizing_operator, divergence_example
from palpate.stability.criteria import lyapunov, precise_tables
from palpate.stability.passivity import field_damping, passive_damping, quantized_stiffness

__all__ = ["Certificate", "certify", "check_stability"]

Array = NDArray[np.float64]
Verdict = Literal["stable", "unstable", "cannot tell"]


@dataclass(frozen=True)
class Certificate:
    """What is claimed of a scenario's loop, and on what grounds.

    Attributes:
        title: the scenario's.
        verdict: "stable", "unstable" or "cannot tell".
        claim: one sentence.
        assumptions: what the claim holds for, each a sentence.
        margin: numbers with their unit in the name; empty if nothing is claimed.
        method: how it was found and checked, each a sentence.
        criteria: verdict of each road ("eigenvalues", "Jury", "Routh", "Lyapunov") on its own.
        passive: whether the display is passive, so stable in every passive hand; None: not asked, or not shown.
        counter_example: a scenario that runs and shows an instability; None if there is none to show.
    """

    title: str
    verdict: Verdict
    claim: str
    assumptions: tuple[str, ...]
    margin: Mapping[str, float]
    method: tuple[str, ...]
    criteria: Mapping[str, bool]
    passive: bool | None = None
    counter_example: CounterExample | None = None
    scenario: Mapping[str, Any] = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether stability is claimed."""
        return self.verdict == "stable"

    def __str__(self) -> str:
        lines = [self.claim, "", "Holds for:", *(f"  - {one}" for one in self.assumptions)]
        if self.margin:
            lines += [
                "",
                "Margins:",
                *(f"  {_named(name)}: {value:.{_digits(name)}g}{_unit(name)}" for name, value in self.margin.items()),
            ]
        lines += ["", "Method:", *(f"  - {one}" for one in self.method)]
        if self.counter_example is not None:
            lines += ["", f"Counter-example: {self.counter_example.sentence}"]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as JSON can hold it; infinities become text."""
        plain: dict[str, Any] = _plain(asdict(self))
        return plain

    def save(self, path: str | Path) -> Path:
        """Write the certificate as `.json`, whole or not at all; return the path.

        Raises:
            OutputError: the suffix is another one, or the file cannot be written.
        """
        text = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        file = check_suffix(path, (".json",), "a certificate")
        return atomic_write(file, lambda part: part.write_text(text, encoding="utf-8"))


def certify(scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None) -> Certificate:
    """Return the certificate of a scenario's servo loop.

    The loop is linearised where it rests (at the start, and where the run comes to rest), sampled exactly, and judged
    by four independent criteria; if they disagree nothing is claimed. An unstable loop comes with a scenario that
    grows;
    one that is stable but not passive with the passive hand, found by search, that makes it unstable. Each
    counter-example has been run.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: in place of the scenario's: a Controller or a python-control system, as for `palpate.simulate`. It
            is written into the scenario of the certificate. A Python function has no linear model and is refused.

    Raises:
        ScenarioError, DesignError, PoseError: the scenario has a mistake, or the controller is not linear or does not
            fit.
        StabilityError: it has no loop to judge (nothing is touched, or the tip is held still).
    """
    s = read_scenario(scenario, controller)
    loop = scenario_loop(s)
    radius, criteria = check_stability(loop)
    if len(set(criteria.values())) > 1 or abs(radius - 1) < 1e-12:
        return _cannot_tell(s, radius, criteria)
    if radius >= 1:
        return _unstable(s, loop, radius, criteria)
    return _stable(s, loop, radius, criteria)


def check_stability(loop: ScenarioLoop) -> tuple[float, dict[str, bool]]:
    """Return the spectral radius, and whether each road finds the loop stable."""
    a = loop.matrix()
    radius = float(np.abs(np.linalg.eigvals(a)).max())
    by_jury, by_routh = precise_tables(a)
    return radius, {
        "eigenvalues": radius < 1,
        "Jury": by_jury,
        "Routh": by_routh,
        "Lyapunov": bool(lyapunov(a).stable),
    }


def _cannot_tell(s: Scenario, radius: float, criteria: Mapping[str, bool]) -> Certificate:
    says = ", ".join(f"{name}: {'stable' if stable else 'unstable'}" for name, stable in criteria.items())
    return Certificate(
        s.title,
        "cannot tell",
        f"Cannot tell: the loop is so near its limit (spectral radius 1 {radius - 1:+.1e}) that the methods disagree "
        f"within rounding ({says}).",
        _assumptions(s),
        {},
        _method(s),
        dict(criteria),
        scenario=s.to_dict(),
    )


def _unstable(s: Scenario, loop: ScenarioLoop, radius: float, criteria: Mapping[str, bool]) -> Certificate:
    doubling = math.log(2) / math.log(radius) * loop.period
    margin = {"spectral_radius": radius, "doubling_time_s": doubling}
    bears = ""
    try:
        share = critical_gain(loop.gain())
        margin["stable_share_of_the_object"] = share
        bears = f"; it would bear {share:.4g} of the object's stiffness and damping"
    except PalpateError:
        pass
    angle = _angle(loop)
    margin["frequency_Hz"] = angle / (2 * math.pi * loop.period)
    motion = f"a swing at {margin['frequency_Hz']:.4g} Hz" if angle > 0 else "a motion without swing"
    example = divergence_example(s, radius)
    return Certificate(
        s.title,
        "unstable",
        f"Unstable: {motion} doubles every {doubling:.3g} s{bears}.",
        _assumptions(s),
        margin,
        _method(s),
        dict(criteria),
        None,
        example,
        s.to_dict(),
    )


def _angle(loop: ScenarioLoop) -> float:
    """Return the angle of the largest eigenvalue, rad per sample."""
    values = np.linalg.eigvals(loop.matrix())
    return float(abs(np.angle(values[np.argmax(np.abs(values))])))


def _stable(s: Scenario, loop: ScenarioLoop, radius: float, criteria: Mapping[str, bool]) -> Certificate:
    m = loop_margins(loop.gain())
    margin = {
        "spectral_radius": radius,
        "object_stiffer_by_factor": m.gain_up,
        "object_softer_by_factor": m.gain_down,
        "phase_deg": m.phase,
        "further_delay_s": m.delay,
        "disk_alpha": m.disk,
    }
    method = list(_method(s))
    claim = f"Stable: the object may be {_factor(m.gain_up, loop)} before the loop oscillates"
    rests, diverged, sentence = _at_rest(s)
    method.append(sentence)
    if diverged is not None:
        return Certificate(
            s.title,
            "unstable",
            f"Unstable: small motions about the start die out, but the run itself diverges at {diverged:g} s.",
            _assumptions(s),
            margin,
            tuple(method),
            dict(criteria),
            None,
            CounterExample(s.to_dict(), float("inf"), f"as it stands, the run diverges after {diverged:.3g} s."),
            s.to_dict(),
        )
    if rests is not None:
        there, roads_there = check_stability(rests)
        margin["spectral_radius_where_it_rests"] = there
        if not all(roads_there.values()):
            return Certificate(
                s.title,
                "cannot tell",
                "Cannot tell: stable at the start, but not where the run comes to rest (spectral radius "
                f"{there:.6g}); the loop may swing between the two without end.",
                _assumptions(s),
                margin,
                tuple(method),
                dict(criteria),
                scenario=s.to_dict(),
            )
        margin["object_stiffer_by_factor_where_it_rests"] = loop_margins(rests.gain()).gain_up
    passive, needed, why = _passive(s, loop)
    example = None
    if not math.isnan(needed):
        margin["passive_damping_needed_N_s_per_m"] = needed
        margin["device_damping_N_s_per_m"] = loop.device_damping
    if passive:
        claim += ", and passive: stable in every passive hand"
        late = _longest_period(s, loop)
        if late > s.period:
            margin["longest_time_between_ticks_s"] = late
            why += f" It stays passive if ticks come late, up to {1e3 * late:.4g} ms after the one before."
    elif not math.isnan(needed):
        example = destabilizing_operator(s)
        if example is not None:
            passive = False
        if passive is False:
            claim += ", with the operator described; it is not passive, so another hand can make it unstable"
        if example is None:
            method.append(
                "No unstable mass and spring was found for a hand; more general passive hands were not searched."
            )
    if why:
        method.append(why)
    return Certificate(
        s.title,
        "stable",
        claim + ".",
        _assumptions(s),
        margin,
        tuple(method),
        dict(criteria),
        passive,
        example,
        s.to_dict(),
    )


def _factor(up: float, loop: ScenarioLoop) -> str:
    if math.isinf(up):
        return "as stiff as you like"
    stiffest = up * float(np.linalg.eigvalsh(loop.stiffness).max())
    damped = " and as damped" if np.any(loop.damping) else ""
    return f"{up:.4g} times as stiff{damped} ({stiffest / 1e3:.4g} N/mm)"


def _at_rest(s: Scenario) -> tuple[ScenarioLoop | None, float | None, str]:
    """Run the scenario; return its loop where it came to rest, when it diverged (s), and what was seen."""
    trace = simulate(s)
    ran = f"The full scenario was run for {s.run.duration:g} s"
    if not trace.stable:
        return None, trace.unstable_from, f"{ran} and diverged at {trace.unstable_from:g} s."
    if s.device.model != "nonlinear":
        return None, None, f"{ran} and stayed bounded."
    if s.object.kind == "wall" and not trace["touching"][-1, 0]:
        return None, None, f"{ran} and stayed bounded; at its end the tip is off the wall."
    speed = np.abs(np.diff(trace["tip"][-20:], axis=0)).max() / (s.period * s.run.record_every)
    if speed > 5e-3:
        at = f"the tip still moves at {speed:.2g} m/s"
        return None, None, f"{ran} and stayed bounded; it has not come to rest ({at})."
    force = trace["command_force"][-1]
    there = scenario_loop(s, pose=trace["angle"][-1], tip_force=force, operator_force=trace["operator_force"][-1])
    return there, None, f"{ran}, stayed bounded, and was judged again where it came to rest."


def _passive(s: Scenario, loop: ScenarioLoop) -> tuple[bool | None, float, str]:
    """Return whether the display is passive (None: not asked), the damping it needs, and a remark."""
    if s.servo.topology != "impedance_display" or s.controller.kind not in ("none", "gain"):
        return None, float("nan"), "Passivity is not asked of a loop with this topology and controller."
    if s.object.coupling != "backward" or math.isnan(loop.device_damping):
        return None, float("nan"), ""
    if not loop.rests:
        return (
            None,
            float("nan"),
            "No passivity is claimed: with the constant force of its motors alone the device tips over from this pose.",
        )
    share = max(s.controller.gain or (1.0,))
    k = float(np.linalg.eigvalsh(loop.stiffness).max()) * share
    b = float(np.linalg.eigvalsh(loop.damping).max()) * share
    needed = passive_damping(stiffness=k, virtual_damping=b, period=s.period, delay=s.device.delay)
    if late := s.servo.jitter:
        longest = s.period + late  # and a difference over it, divided by the period, damps so much the more
        needed = field_damping(
            lipschitz=k, longest_period=longest, delay=s.device.delay, virtual_damping=b * longest / s.period
        )
    passive: bool | None = loop.device_damping >= needed
    several = loop.directions.shape[1] > 1  # the stiffest direction against the least damped one: enough, not exact
    exactly, most, least = ("", " at most", " at least") if several else (", exactly", "", "")
    if late:
        exactly, most = f" with ticks up to {1e3 * late:.4g} ms late", " at most"
    remark = (
        f"Passivity{exactly}: the object needs{most} {needed:.4g} N s/m of the device's own damping at the tip and "
        f"there is{least} {loop.device_damping:.4g} N s/m."
    )
    if (several or late) and not passive:
        passive = None
    if s.device.encoder:
        device = s.load_device()
        levers = np.abs(loop.directions.T @ device.jacobian(_start(s))).max(axis=0)
        quantum = float((levers * device.encoder_step).max())
        friction = float(np.where(levers > 1e-9, device.coulomb / np.maximum(levers, 1e-9), np.inf).min())
        bound = quantized_stiffness(damping=loop.device_damping, coulomb=friction, period=s.period, quantum=quantum)
        if passive and k > bound:
            passive = False
            remark += (
                f" Encoder counts of {quantum * 1e6:.3g} um at the tip need friction for {k:.4g} N/m, and it covers "
                f"{bound:.4g} N/m (Abbott & Okamura 2005)."
            )
    return passive, needed, remark


def _longest_period(s: Scenario, loop: ScenarioLoop) -> float:
    """Return the T_max (s) up to which ``field_damping`` is covered by the damping that is felt."""
    share = max(s.controller.gain or (1.0,))
    k, b = (share * float(np.linalg.eigvalsh(m).max()) for m in (loop.stiffness, loop.damping))
    # The servo divides its differences by the period, however long they took: b grows with T_max.
    needed = k * (0.5 + s.device.delay) + b / s.period
    return loop.device_damping / needed if needed > 0 else float("inf")


def _start(s: Scenario) -> Array:
    if s.start.tip is not None:
        return s.load_device().inverse(s.start.tip)
    return np.array(s.start.pose, dtype=float)


def _assumptions(s: Scenario) -> tuple[str, ...]:
    device = s.load_device()
    rate, delay = 1 / s.period, s.device.delay
    said = [
        f"{device.name} at {rate:g} Hz, {delay or 'no'} sample{'' if delay == 1 else 's'} of delay, every tick on time."
    ]
    if s.servo.jitter > 0.0:
        late = f"up to {1e3 * s.servo.jitter:.4g} ms"
        said.append(f"Only the run, and what is said of passivity, has the scenario's late ticks ({late}).")
    o = s.operator
    if o.kind == "arm":
        grip = "rigidly" if o.tissue_stiffness is None else f"through fingertip tissue of {o.tissue_stiffness:g} N/m"
        said.append(
            f"This operator: an arm of {o.mass:g} kg, {o.damping:g} N s/m, {o.stiffness:g} N/m that grips {grip}."
        )
    elif s.servo.topology == "impedance_display":
        said.append("Nobody's mass or damping at the tip: a hand that only pushes.")
    else:
        said.append("A reference force that does not depend on the motion.")
    if s.device.model == "nonlinear":
        said.append("Small motions about the pose: the device is linearised exactly there.")
    if s.object.kind == "wall":
        said.append("The tip stays in the wall; motions along the surface are left to the hand.")
    ignored = []
    if np.any(device.coulomb > 0):
        ignored.append("dry friction, which only takes energy away")
    if s.device.encoder:
        count = float((np.abs(device.jacobian(_start(s))).max(axis=0) * device.encoder_step).max())
        ignored.append(
            f"encoder counts (up to {count * 1e6:.2g} um at the tip), which can leave a swing of a few counts"
        )
    if s.device.saturation:
        ignored.append("the drive's limits, which a large swing meets")
    if ignored:
        said.append(f"Left out: {'; '.join(ignored)}.")
    wild = _unstable_pole(s)
    if wild is not None:
        said.append(
            f"The controller by itself is unstable (a pole of modulus {wild:.6g}): the verdict ends where the loop is "
            "open, off a wall or at a limit of the drive."
        )
    return tuple(said)


def _unstable_pole(s: Scenario) -> float | None:
    """Return the modulus of the controller's largest pole if it is outside the unit circle."""
    if s.controller.kind != "state_space" or not s.controller.A:
        return None
    largest = float(np.abs(np.linalg.eigvals(np.array(s.controller.A, dtype=float))).max())
    return largest if largest > 1 + 1e-9 else None


def _method(s: Scenario) -> tuple[str, ...]:
    return (
        f"The loop is one matrix, exact for forces held over {s.period * 1e3:g} ms; no hold or delay is approximated.",
        "Eigenvalues, Jury's table, Routh's array through the bilinear map and a Lyapunov matrix were computed apart, "
        "and a verdict is given only if all four agree.",
    )


UNITS = {"_N_s_per_m": " N s/m", "_Hz": " Hz", "_deg": " deg", "_s": " s"}  # at the end of a margin's name


def _unit(name: str) -> str:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def _digits(name: str) -> int:
    return 9 if name.startswith("spectral_radius") else 5  # of a radius, what is left to 1 counts


def _named(name: str) -> str:
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " ")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
