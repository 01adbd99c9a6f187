"""Servo loop as a learning environment with the interface of Gymnasium, which is not required."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import ScenarioError
from palpate.scenario import Scenario
from palpate.simulation.loop import Loop, Sample, as_force


class _Held:
    """Controller that holds the force of the last action."""

    def __init__(self) -> None:
        self.reset()

    def command(self, _tick: Any) -> Array:
        return self.force

    def reset(self) -> None:
        self.force = np.zeros(3)


class Environment:
    """Loop of a scenario with the methods `reset` and `step` of Gymnasium. SI units, device frame.

    The observation is that of `palpate.Loop` (12,): tip position (m), tip velocity (m/s), object force (N), reference
    force (N). An episode is terminated when the loop diverges, and truncated at the end of the scenario's run.

    Attributes:
        loop: the loop that is stepped.
        action_low, action_high: (3,), N.
        observation_low, observation_high: (12,).
    """

    def __init__(
        self,
        scenario: Scenario | Mapping[str, Any] | str | Path,
        *,
        acts: Literal["controller", "operator", "reference"] = "controller",
        reward: Callable[[Sample], float] | None = None,
        largest_force: float = 10.0,
        periods: int = 1,
        controller: Any = None,
        object: Any = None,
    ) -> None:
        """Make the environment.

        Args:
            scenario: a Scenario, its tables, or the path of its TOML file.
            acts: who applies the action: "controller" (its commanded tip force), "operator" (the force on the tip) or
                "reference" (the reference force).
            reward: of a sample; None: minus |reference - object force|, N.
            largest_force: bound of the action on each axis, N; actions beyond it are clipped.
            periods: servo periods for which an action is held.
            controller: as for `palpate.simulate`; not with acts = "controller".
            object: as for `palpate.simulate`.

        Raises:
            ScenarioError: an argument is out of range, or as `palpate.simulate`.
        """
        if acts not in ("controller", "operator", "reference"):
            raise ScenarioError(f'acts must be "controller", "operator" or "reference", not {acts!r}')
        if not 0.0 < largest_force < np.inf:
            raise ScenarioError(f"largest_force must be positive and finite in N, not {largest_force}")
        if periods < 1:
            raise ScenarioError(f"periods must be at least 1, not {periods}")
        if acts == "controller" and controller is not None:
            raise ScenarioError('controller: with acts = "controller" the action is the command; leave it out')
        self._acts, self._periods = acts, periods
        self._reward = reward if reward is not None else _force_error
        self._held = _Held()
        self.loop = Loop(scenario, self._held if acts == "controller" else controller, object)
        self.action_high = np.full(3, float(largest_force))
        self.action_low = -self.action_high
        self.observation_high = np.full(12, np.inf)
        self.observation_low = -self.observation_high

    def reset(self, *, seed: int | None = None) -> tuple[Array, dict[str, Any]]:
        """Return to the first sample; return the observation and an information table."""
        self.loop.reset(seed)
        return self.loop.observation, {"time": self.loop.time}

    def step(self, action: ArrayLike) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply a force (3,), N; return observation, reward, terminated, truncated, information.

        The reward is the sum over the servo periods of the action; the information has the last `sample`.

        Raises:
            ScenarioError: the action is not three finite numbers, or the episode is over.
        """
        force = as_force(action, "action")
        if self.loop.done:
            raise ScenarioError("the episode is over; call reset() first")
        force = np.clip(force, self.action_low, self.action_high)
        self._held.force = force
        reward = 0.0
        for _ in range(self._periods):
            sample = self.loop.step(
                force=force if self._acts == "operator" else None,
                reference=force if self._acts == "reference" else None,
            )
            reward += float(self._reward(sample))
            if self.loop.done:
                break
        terminated = self.loop.diverged
        information = {"time": self.loop.time, "sample": sample}
        return self.loop.observation, reward, terminated, self.loop.done and not terminated, information


def _force_error(sample: Sample) -> float:
    return -float(np.linalg.norm(sample.reference - sample.object_force))
