"""Linear loop of a scenario's admittance display about a pose of rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import matrix_balance

from palpate.arrays import Array
from palpate.control.workspace_controller import workspace
from palpate.errors import StabilityError
from palpate.linear.admittance_loop import admittance_loop, sensed_plant, tip_feedback
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import pull_at_start, require_spring, scenario_arm, touched_directions

__all__ = ["display_matrix"]

NEUTRAL = 1e-10  # singular value of A - I, over the largest, of a fixed point


def display_matrix(
    scenario: Scenario, *, pose: ArrayLike | None = None, operator_force: ArrayLike | None = None
) -> Array:
    """Return the matrix (n, n) of one tick of an admittance display on a spring or wall, about rest.

    All directions in which the tip can move count, because the operator's force closes a loop in each. A translation
    that neither the object nor the operator resists is left out.

    Args:
        scenario: with a [servo.tool].
        pose: (dof,), rad; the start's if not given.
        operator_force: of the hand at rest there (3,), N; the arm's spring at the start if not given.

    Raises:
        StabilityError: nothing is touched, the directions cannot be pushed, or nothing brakes a free tool.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`; or the pose is near a singular one.
    """
    tool = scenario.servo.tool
    assert tool is not None
    require_spring(scenario, display=True)
    device, arm = scenario.load_device(), scenario_arm(scenario)
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    at = start if pose is None else np.asarray(pose, dtype=float)
    force = pull_at_start(scenario, arm) if operator_force is None else np.asarray(operator_force, dtype=float)
    controller = workspace(device, scenario.period, **scenario.controller.options)
    feedback = tip_feedback(controller, at, force)
    plant = sensed_plant(device, at, arm, force, scenario.period, feedback.axes)
    directions = touched_directions(scenario, device.jacobian(at))
    across = directions @ directions.T
    k, b = (
        across @ np.diag(np.asarray(one, dtype=float)) @ across
        for one in (scenario.object.stiffness, scenario.object.damping)
    )
    loop = admittance_loop(plant, feedback, tool.mass, tool.damping, k, b, scenario.device.delay)[0]
    free = 0 if arm is not None and arm.stiffness > 0.0 else feedback.axes.shape[1] - directions.shape[1]
    if free and tool.damping == 0.0 and (arm is None or arm.damping == 0.0):
        raise StabilityError(
            "servo.tool.damping: along the surface nothing brakes a tool without damper, so its velocity is neutral "
            "there; give it a damper, or judge the loop by its run"
        )
    return _without_translations(loop, free)


def _without_translations(a: Array, count: int) -> Array:
    """Return A (n, n) on the complement of its at most `count` fixed points, the translations that nothing resists."""
    balanced = matrix_balance(a, permute=False)[0]
    _, sizes, basis = np.linalg.svd(balanced - np.eye(len(a)))
    fixed = min(count, int(np.count_nonzero(sizes < NEUTRAL * sizes[0])))
    rest = basis[: len(a) - fixed].T
    return np.asarray(rest.T @ balanced @ rest, dtype=float)
