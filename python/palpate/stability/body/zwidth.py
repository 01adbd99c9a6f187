"""Z-width of a loop on a deformable body: how stiff the body may be, over the damping of a damper beside it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import control
import numpy as np

from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.verdict import State
from palpate.stability.body.body_loop import BodyLoop
from palpate.stability.body.certificate import contact_of
from palpate.stability.body.multirate_loop import MultirateLoop
from palpate.stability.contact_loop import device_loop
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.zwidth_map import ZWidth, operator_name, other_operators

__all__ = ["body_boundaries", "body_zwidth"]

_SCALES = np.geomspace(1e-3, 1e4, 71)  # factors on the body's force
_POINTS = 24  # of a curve
_DOUBLINGS = 40
_ACROSS = "unstable: a motion across the contact grows, while the curves are for motions along its normal"
_UNKNOWN = "undecided: the response of the body is not known well enough"
_MOVES = "undecided: small motions decay, but the run of the scenario does not rest"
_NOT_SIMULATED = (
    "the body is scaled at a fixed tip position, and a run with a stiffer body rests elsewhere, with other nodes in "
    "contact; palpate certify tests other depths too, whose limits may be lower, and compares the loop with the run "
    "of the scenario"
)


@dataclass(frozen=True)
class _HeldLoop:
    """Loop along the normal of a contact without friction, where an arm holds the tip against slides.

    A stiffer body pushes the tip aside more: both loops limit its stiffness.

    Attributes:
        along: motions along the normal.
        across: motions in all directions.
    """

    along: BodyLoop | MultirateLoop
    across: BodyLoop | MultirateLoop

    @property
    def period(self) -> float:
        """Servo period, s."""
        return self.along.period

    def root(self, scale: float = 1.0, damping: float = 0.0) -> complex:
        """Return the eigenvalue with the largest modulus of both loops, or of an unstable one along the normal."""
        along = self.along.root(scale, damping)
        return along if abs(along) >= 1.0 else max(along, self.across.root(scale, damping), key=abs)


_Loop = BodyLoop | MultirateLoop | _HeldLoop


def body_boundaries(
    s: Scenario, own: str, others: list[tuple[str, HumanArm | None]], progress: Callable[[float], None]
) -> tuple[dict[str, Boundary], list[str], float, float, str]:
    """Return boundaries by operator, operators without a stable body, K, least stable stiffness, N/m, and a doubt.

    A boundary gives the largest static stiffness of the body along the contact's normal, over the damping of a damper
    beside the body, along the normal and by backward difference. The whole response of the body is scaled, at the tip
    position where the scenario's run rests. Motions are along the normal. They are in all directions with friction, or
    if an arm keeps the tip from sliding at the scenario's stiffness (the slide margin of `ContactStability`). The doubt
    is why the scenario's own loop is not known to be stable: small motions in all directions about its contact do not
    decay, or its run does not rest. It is empty if the loop is stable.

    Args:
        s: its object is a body.
        own: name of the scenario's operator.
        others: other operators, by name.
        progress: called with the fraction done.

    Raises:
        StabilityError: the contact is unknown, or no stiffness is stable with the scenario's operator.
    """
    contact, run, row = contact_of(s)
    stiffness, full = contact.static_stiffness, contact.loop
    choice = s.object.body
    assert choice is not None
    holds_across = choice.options.get("static_friction", 0.0) > 0.0 or len(choice.contact_points) > 1
    across = len(full.normal) > 1 and holds_across

    def loop_with(arm: HumanArm | None = None) -> _Loop:
        def path(in_all_directions: bool) -> control.StateSpace:
            return device_loop(s, run.trace, row, contact.normal, in_all_directions, arm=arm).path

        if across or len(full.normal) == 1:
            return full if arm is None else replace(full, path=path(across))
        along, whole = full.along_normal(path(False)), full if arm is None else replace(full, path=path(True))
        return _HeldLoop(along, whole) if whole.radius() < 1.0 else along

    if not stiffness > 0.0:
        raise StabilityError("the body has no stiffness along its force where the run leaves the tip")
    loop = loop_with()
    curves, never = {own: _boundary(loop, stiffness)}, []
    for index, (name, arm) in enumerate(others):
        progress((index + 1) / (len(others) + 1))
        try:
            curves[name] = _boundary(loop_with(arm), stiffness)
        except StabilityError:
            never.append(name)
    least = _interval(loop, curves[own].inside[0])[0]
    doubt = {State.STABLE: "" if run.rests else _MOVES, State.UNSTABLE: _ACROSS}.get(contact.state, _UNKNOWN)
    return curves, never, stiffness, 0.0 if least <= _SCALES[0] else least * stiffness, doubt


def body_zwidth(s: Scenario, _simulated: bool, report: Callable[[str, float], None]) -> ZWidth:
    """Return the Z-width of a scenario whose object is a deformable body; see ``palpate.stability.zwidth``."""
    report("the body's response", 0.05)
    curves, never, stiffness, least, doubt = body_boundaries(
        s, operator_name(s), other_operators(s), lambda done: report("exact boundary", 0.2 + 0.7 * done)
    )
    reason = "the passivity condition holds for springs and dampers, and a deformable body has states of its own"
    edge = next(iter(curves.values()))
    along = least < stiffness < float(edge.stiffness[np.argmin(edge.damping)])
    return ZWidth(
        title=s.title,
        curves=curves,
        passive=None,
        not_passive=reason,
        simulated=None,
        here=(0.0, stiffness),
        stable_here=along and not doubt,
        never=tuple(never),
        min_stable_stiffness=least,
        not_simulated=_NOT_SIMULATED,
        unstable_by=doubt if along else "",
    )


def _boundary(loop: _Loop, stiffness: float) -> Boundary:
    """Return the boundary of a loop; `stiffness` is that of the body along the normal, N/m."""
    undamped = _interval(loop, 0.0)[1]
    largest = _largest_damping(loop, stiffness, undamped)
    damping = largest * (1.0 - np.cos(np.linspace(0.0, 0.5 * math.pi, _POINTS))) if largest > 0.0 else np.zeros(1)
    found = [(b, *_interval(loop, float(b))) for b in damping]
    kept = [(b, low, high) for b, low, high in found if high > 0.0]
    if not kept:
        raise StabilityError("no body of any stiffness is stable in this loop")
    roots = [loop.root(high, float(b)) for b, _, high in kept]
    b, low, high = kept[len(kept) // 3]
    return Boundary(
        np.array([one[0] for one in kept]),
        stiffness * np.array([one[2] for one in kept]),
        np.abs(np.angle(roots)),
        (float(b), stiffness * math.sqrt(low * high)),
        math.inf,
    )


def _largest_damping(loop: _Loop, stiffness: float, undamped: float) -> float:
    """Return the largest damping with which some stiffness is stable, N s/m; 0: none."""
    good, bad = 0.0, stiffness * max(undamped, 1.0) * loop.period
    for _ in range(_DOUBLINGS):
        if _interval(loop, bad)[1] == 0.0:
            break
        good, bad = bad, 2.0 * bad
    for _ in range(12):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if _interval(loop, middle)[1] > 0.0 else (good, middle)
    return good


def _interval(loop: _Loop, damping: float) -> tuple[float, float]:
    """Return the first interval of factors on the body's force, from soft to stiff, that is stable; (0, 0): none."""

    def stable(scale: float) -> bool:
        return abs(loop.root(scale, damping)) < 1.0

    low = next((k for k, scale in enumerate(_SCALES) if stable(scale)), None)
    if low is None:
        return 0.0, 0.0
    high = next((k for k in range(low + 1, len(_SCALES)) if not stable(_SCALES[k])), None)
    top = _SCALES[-1] if high is None else _edge(stable, _SCALES[high - 1], _SCALES[high])
    bottom = _SCALES[0] if low == 0 else _edge(stable, _SCALES[low], _SCALES[low - 1])
    return float(bottom), float(top)


def _edge(stable: Callable[[float], bool], inside: float, outside: float) -> float:
    for _ in range(30):
        middle = math.sqrt(inside * outside)
        inside, outside = (middle, outside) if stable(middle) else (inside, middle)
    return inside
