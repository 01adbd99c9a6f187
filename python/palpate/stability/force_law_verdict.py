"""Stability of a scenario's loop with a force law in place of its object, by the range of its slope.

About a rest, a strictly rising law is a monotone function with slopes in [low, high]. For x+ = A x + B f, y = C x with
A + low B C stable, the rest is stable for every such function if for some a, b >= 0 with a + b < 1

    Re [ (1 - a/z - b z) (1/(high - low) - C (z - A - low B C)^-1 B) ] > 0    on the unit circle

(O'Shea 1967; discrete: Willems & Brockett 1968). With a = b = 0 it is the circle criterion. Since Re z = Re 1/z, the
left side is the real part of a causal system H, and it is positive if (H - 1)/(H + 1) is stable with a norm below 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import control
import numpy as np

from palpate.arrays import Array
from palpate.contact.force_law import ForceLaw
from palpate.control.stability_margins import peak_gain
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario, written_out
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.verdict import State
from palpate.units import write

__all__ = ["ForceLawVerdict", "certify_force_law"]

SHARES: Final = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999, 0.9999)  # of a and b that are tried
MARGIN: Final = 1e-9  # of the norm below 1


@dataclass(frozen=True, eq=False)
class ForceLawVerdict:
    """Stability of a loop with a force law, about the pose of its start.

    Attributes:
        state: STABLE, UNSTABLE or UNDECIDED.
        sentence: the verdict in words.
        slopes: (least, largest) slope that was judged, N/m; the least is 0 if a loss of contact is covered.
        multiplier: (a, b) of the proof; nan without one.
        unstable_depths: (k, 2), m: ranges of depth where a rest is unstable by itself; the last may end at inf.
    """

    state: State
    sentence: str
    slopes: tuple[float, float]
    multiplier: tuple[float, float]
    unstable_depths: Array


def certify_force_law(
    scenario: Scenario | Mapping[str, Any] | str | Path, law: ForceLaw, controller: Any = None
) -> ForceLawVerdict:
    """Return the stability of a scenario's loop with a force law in place of its object.

    Every motion decays to the rest for any law with these slopes, as long as the device is linear about its start.
    Slopes from 0 on include a loss of contact. A loop that is stable with each slope alone is not proven by that, and
    stays undecided without a multiplier.

    Args:
        scenario: its object is replaced.
        law: the force law.
        controller: in place of the scenario's, linear.

    Raises:
        StabilityError: the controller divides by the stiffness, or the device cannot be pushed along the normal.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    s = written_out(read_scenario(scenario, controller))
    wall = {"kind": "wall", "stiffness": write(law.stiffest, "N/m"), "normal": law.normal.tolist()}
    loop = scenario_loop(Scenario.from_dict({**s.to_dict(), "object": wall}))
    if loop.normalized:
        raise StabilityError(
            "controller.normalize: it divides by the stiffness, so its reference depends on the depth; "
            "judge it on a spring, and run it on the law with palpate.simulate"
        )
    unstable = np.array([loop.spectral_radius(float(k)) >= 1.0 for k in law.slopes])
    depths, none = _ranges(law, unstable), (float("nan"), float("nan"))
    slopes = f"{law.softest:.5g} to {law.stiffest:.5g} N/m"
    if unstable.any():
        where = ", ".join(
            f"{1e3 * first:.4g} mm or more" if np.isinf(last) else f"{1e3 * first:.4g} to {1e3 * last:.4g} mm"
            for first, last in depths
        )
        state = State.UNSTABLE if unstable.all() else State.UNDECIDED
        sentence = f"{state.label}: with slopes from {slopes}, a rest at a depth of {where} is unstable"
        return ForceLawVerdict(state, sentence, (law.softest, law.stiffest), none, depths)
    for least in (0.0, law.softest):
        found = _multiplier(loop.path, least, law.stiffest)
        if found is not None:
            scope = "also through a loss of contact" if least == 0.0 else "as long as the tip stays in contact"
            sentence = f"stable: every motion decays, {scope}, for any law with slopes from {least:.5g} to "
            sentence += f"{law.stiffest:.5g} N/m"
            return ForceLawVerdict(State.STABLE, sentence, (least, law.stiffest), found, depths)
    sentence = f"undecided: a rest at each depth is stable, but no multiplier for slopes from {slopes} was found"
    return ForceLawVerdict(State.UNDECIDED, sentence, (law.softest, law.stiffest), none, depths)


def _multiplier(path: control.StateSpace, low: float, high: float) -> tuple[float, float] | None:
    """Return (a, b) that prove stability for every slope from low to high; None: none was found."""
    b, c = np.asarray(path.B), np.asarray(path.C)
    a = np.asarray(path.A) + low * b @ c
    if np.abs(np.linalg.eigvals(a)).max() >= 1.0:
        return None
    if high == low:
        return 0.0, 0.0
    theta = np.concatenate([np.geomspace(1e-5, 0.1, 200), np.linspace(0.1, np.pi, 300)])
    z = np.exp(1j * theta)
    response = np.array([(c @ np.linalg.solve(one * np.eye(len(a)) - a, b))[0, 0] for one in z])
    plain = 1.0 / (high - low) - response
    pairs = [(x, y) for x in SHARES for y in SHARES if x + y < 1.0]
    least = {(x, y): float(((1.0 - x / z - y * z) * plain).real.min()) for x, y in pairs}
    for pair in sorted(least, key=lambda one: -least[one])[:5]:
        if least[pair] > 0.0 and _positive(a, b, c, 1.0 / (high - low), *pair):
            return pair
    return None


def _positive(a: Array, b: Array, c: Array, constant: float, causal: float, ahead: float) -> bool:
    """Return whether the real part of the condition is positive on the whole circle, by an exact norm."""
    n = len(a)
    # states: those of the loop, and its output with the constant one sample before
    big = np.block([[a, np.zeros((n, 2))], [-c, np.zeros((1, 2))], [np.zeros((1, n + 2))]])
    entry = np.vstack([b, [[0.0]], [[constant]]])
    # H = constant - C x - causal (late output + late constant) - ahead (-(C A x + C B u) + late constant)
    out = np.hstack([-c + ahead * c @ a, [[-causal]], [[-(causal + ahead)]]])
    direct = np.array([[constant]]) + ahead * c @ b
    scale = 1.0 / constant  # of H, which changes no sign
    out, direct = scale * out, scale * direct
    inverse = 1.0 / float(direct[0, 0] + 1.0)
    closed = big - entry @ out * inverse
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
        return False
    reflected = control.StateSpace(
        closed, entry * inverse, 2.0 * out * inverse, np.array([[(float(direct[0, 0]) - 1.0) * inverse]]), 1.0
    )
    return peak_gain(reflected)[0] < 1.0 - MARGIN


def _ranges(law: ForceLaw, flags: Array) -> Array:
    """Return the ranges of depth (k, 2), m, of the segments with a flag; the last segment goes on without end."""
    out: list[list[float]] = []
    for i in np.flatnonzero(flags):
        end = float(law.depth[i + 1]) if i + 1 < len(flags) else float("inf")
        if out and out[-1][1] == law.depth[i]:
            out[-1][1] = end
        else:
            out.append([float(law.depth[i]), end])
    return np.array(out).reshape(-1, 2)
