"""Certificates of textured walls and virtual masses: the exact sampled loop at the place where the run rests."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.contact_law import ContactLaw, closed_matrix
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.simulator import build_simulation
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.stability.assumptions import assumptions
from palpate.stability.certificate import Certificate
from palpate.stability.counter_example import CounterExample

__all__ = ["certify_mass", "certify_texture", "mass_law", "texture_law"]

SLOW = 4.0 * np.pi  # rad/s: slower motions of modulus 1 or more are drifts
MARGINAL = 1e-6  # distance of a modulus from 1 that is rounding; a double root at 1 loses half the digits


def certify_texture(s: Scenario) -> Certificate:
    """Return the certificate of a scenario on a textured wall, for small motions about the place where its run rests.

    Raises:
        StabilityError: the controller divides by the stiffness, or the tip is fixed.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    simulation = build_simulation(s)
    trace = simulation.simulate()
    if not trace["touching"][-1, 0]:
        return _undecided(s, trace, "the tip is off the textured wall at the end of the run")
    parameters = simulation.objects[""].parameters
    assert parameters is not None  # a textured wall has them
    return _certificate(s, trace, texture_law(parameters, trace["tip"][-1], s.period), "the slope of the texture there")


def certify_mass(s: Scenario) -> Certificate:
    """Return the certificate of a scenario in which the tip carries a virtual mass.

    Raises:
        StabilityError: the controller divides by the stiffness, or the tip is fixed.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    simulation = build_simulation(s)
    parameters = simulation.objects[""].parameters
    assert parameters is not None  # a virtual mass has them
    return _certificate(s, simulation.simulate(), mass_law(parameters, s.period), "the mass as its own sampled motion")


def texture_law(parameters: dict[str, Any], tip: Array, period: float) -> ContactLaw:
    """Return the law of a textured wall for small motions about a tip position (3,), m, at rest.

    With the depth d = a sin(k s) - h and its gradient g = a k cos(k s) t - n, the force K d g + A sin(k s) t has the
    derivative K g g^T + (A k cos(k s) - K d a k^2 sin(k s)) t t^T.
    """
    p, offset = parameters, np.asarray(tip, dtype=float) - parameters["point"]
    n, t, number = np.asarray(p["normal"]), np.asarray(p["across"]), 2.0 * np.pi / p["wavelength"]
    sine, cosine = np.sin(number * t @ offset), np.cos(number * t @ offset)
    depth = p["height"] * sine - n @ offset
    gradient = p["height"] * number * cosine * t - n
    bend = p["lateral_force"] * number * cosine - p["stiffness"] * depth * p["height"] * number**2 * sine
    law = ContactLaw.stiffness(p["stiffness"] * np.outer(gradient, gradient) + bend * np.outer(t, t))
    size = float(np.linalg.norm(gradient))
    return law.damped(p["damping"] * size**2, gradient / size, period)


def mass_law(parameters: dict[str, Any], period: float) -> ContactLaw:
    """Return the law of a virtual mass; states: the tip at the last sample, place and velocity of the mass."""
    m, k, b = (parameters[key] for key in ("mass", "stiffness", "damping"))
    eye, none = np.eye(3), np.zeros((3, 3))
    out = np.hstack([-b / period * eye, -k * eye, -b * eye])  # force of the states
    direct = (k + b / period) * eye
    push = period / m
    a = np.vstack(
        [
            np.zeros((3, 9)),
            np.hstack([none, eye, period * eye]) + period * push * out,
            np.hstack([none, none, eye]) + push * out,
        ]
    )
    return ContactLaw(a, np.vstack([eye, period * push * direct, push * direct]), out, direct)


def _certificate(s: Scenario, trace: Trace, law: ContactLaw, detail: str) -> Certificate:
    """Return the certificate of the loop of a law where the run ends."""
    if s.controller.normalizes:
        raise StabilityError(
            "controller.normalize: it divides by the object's stiffness, which this object does not have alone; "
            "judge its run"
        )
    spring = {"kind": "spring", "stiffness": "1 N/m"}
    loop = scenario_loop(
        Scenario.from_dict({**s.to_dict(), "object": spring}),
        pose=trace["angle"][-1],
        tip_force=trace["command_force"][-1],
        operator_force=trace["operator_force"][-1],
    )
    values = np.linalg.eigvals(closed_matrix(loop.path, law, loop.directions))
    rates = np.abs(np.log(np.maximum(np.abs(values), 1e-300)) + 1j * np.angle(values)) / s.period
    drifts = (np.abs(values) >= 1.0 - MARGINAL) & (rates < SLOW)
    radius = float(np.abs(values[~drifts]).max(initial=0.0))
    run = trace.verdict
    state, reason, example = State.STABLE, f"every small motion decays (spectral radius {radius:.6g})", None
    if radius >= 1.0:
        state, reason = State.UNDECIDED, f"a small motion grows (spectral radius {radius:.6g}), and the run is {run}"
        if run.state in FAILED and run.since is not None:
            state = State.UNSTABLE
            example = CounterExample(s.to_dict(), float("inf"), f"the scenario itself {run.reason}.")
    elif run.state in FAILED:
        state, reason = State.UNDECIDED, f"small motions decay, but the verdict of the run is {run}"
    elif drifts.any():
        state = State.UNDECIDED
        reason = f"nothing holds the tip or the mass in some direction; other motions decay (radius {radius:.6g})"
    holds = (*assumptions(s), f"Small motions about the place at which the run ends, with {detail}.")
    steps = (
        "The loop is one matrix, exact for forces held over a servo period.",
        f"The scenario was simulated with the object itself: {run}.",
    )
    margin = {"spectral_radius_at_rest": radius}
    return Certificate(s.title, Verdict(state, reason), holds, margin, steps, {}, None, example, s.to_dict())


def _undecided(s: Scenario, trace: Trace, reason: str) -> Certificate:
    state = Verdict(State.UNDECIDED, f"{reason}; the verdict of the run is {trace.verdict}")
    return Certificate(s.title, state, assumptions(s), {}, (), {}, scenario=s.to_dict())
