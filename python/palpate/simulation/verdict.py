"""Verdict of a servo loop: its final state and the reason."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, Literal

__all__ = ["FAILED", "OSCILLATES", "State", "Verdict"]


class State(IntEnum):
    """Final state of a servo loop.

    A run settles. STABLE is the state of a certificate alone: small motions about the equilibrium decay, and the run
    does not contradict it.
    """

    SETTLED = 0
    BOUNDED_OSCILLATION = 1
    UNSTABLE = 2
    CONTACT_LOST = 3
    OUT_OF_REACH = 4
    DRIVE_LIMIT = 5
    UNDECIDED = 6
    STABLE = 7

    @property
    def label(self) -> str:
        """The state in words."""
        return _LABELS[self]

    @property
    def tone(self) -> Literal["good", "note", "bad"]:
        """Tone in which pages and the command line show the state: a green tick for "settled" and "stable" alone."""
        if self in (State.SETTLED, State.STABLE):
            return "good"
        return "note" if self is State.UNDECIDED else "bad"


_LABELS = {
    State.SETTLED: "settled",
    State.BOUNDED_OSCILLATION: "bounded oscillation",
    State.UNSTABLE: "unstable",
    State.CONTACT_LOST: "contact lost",
    State.OUT_OF_REACH: "out of reach",
    State.DRIVE_LIMIT: "drive limit exceeded",
    State.UNDECIDED: "undecided",
    State.STABLE: "stable",
}
# States of a run in which its loop failed; a certificate beside such a run is never "stable".
FAILED = frozenset(
    (State.BOUNDED_OSCILLATION, State.UNSTABLE, State.CONTACT_LOST, State.OUT_OF_REACH, State.DRIVE_LIMIT)
)
OSCILLATES = frozenset((State.UNSTABLE, State.BOUNDED_OSCILLATION))  # states in which a run shows no stable loop


@dataclass(frozen=True)
class Verdict:
    """State of a loop and the reason for it.

    Attributes:
        state: final state.
        reason: one sentence without the state; a certificate's may have more.
        since: when an instability, a loss of contact or a limit began, s; None if it did not or is not known.
        axis: "x", "y" or "z", along which the loop oscillates most; None if it does not oscillate.
        amplitude: of the oscillation along `axis`, m; None likewise.
        frequency: of the oscillation, Hz; None likewise.
        linear: what the linear loop says, with its spectral radius; None if the run has no linear loop.
    """

    state: State
    reason: str
    since: float | None = None
    axis: str | None = None
    amplitude: float | None = None
    frequency: float | None = None
    linear: str | None = None

    @property
    def settled(self) -> bool:
        """Whether the loop settled: the only state that deserves a green tick."""
        return self.state is State.SETTLED

    def __str__(self) -> str:
        return f"{self.state.label}: {self.reason}" if self.reason else self.state.label

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict for JSON; the state as its label."""
        return {**{f.name: getattr(self, f.name) for f in fields(self)}, "state": self.state.label}

    @classmethod
    def from_dict(cls, stored: Any) -> Verdict | None:
        """Return the verdict of `to_dict`; None for anything else."""
        try:
            state = next(state for state in State if state.label == stored["state"])
            return cls(**{**stored, "state": state})
        except (LookupError, TypeError, StopIteration):
            return None
