"""[guard]: time-domain guard of an impedance display."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import BeforeValidator, model_validator

from palpate.devices import Device
from palpate.scenario.fields import Number, Rate, Section, must

_KEYS: Final[Mapping[str, frozenset[str]]] = {
    "none": frozenset(),
    "energy_bound": frozenset({"viscous", "coulomb"}),
    "passivity_controller": frozenset({"cap"}),
    "half_sample": frozenset({"velocity", "horizon", "observer", "deadbeat"}),
    "sample_estimate_hold": frozenset({"correction"}),
}
_ONE: Final = 'a loop has one guard, and several are given: keep one, for example kind = "energy_bound"'


def _one(value: object) -> object:
    if isinstance(value, (list, tuple)):
        raise ValueError(_ONE)
    return value


_PART: Final = must(lambda share: 0.0 < share <= 1.0, "{:g}; it must be above 0 and at most 1")
_SHARE: Final = must(lambda share: share <= 1.0, "{:g}; it must be between 0 and 1")
_HORIZON: Final = must(lambda periods: periods <= 100.0, "{:g} servo periods; it must be between 0 and 100")


class Guard(Section):
    """[guard]: time-domain guard of an impedance display, behind any object and controller.

    Attributes:
        kind: "none", "energy_bound", "passivity_controller", "half_sample" or "sample_estimate_hold".
        viscous: of the device's viscous friction, the part that an energy bound relies on, above 0 and at most 1.
        coulomb: of the device's dry friction, the part that an energy bound relies on, 0 to 1.
        cap: largest damping of a passivity controller, times the tip's inertia over the servo period.
        velocity: of a half-sample prediction, "backward", "adaptive_window" or "observer".
        horizon: of a half-sample prediction, servo periods.
        observer: rate of the observer of a half-sample prediction, rad/s.
        deadbeat: whether a half-sample prediction leaves a wall by two forces that end in the state in which the
            continuous wall leaves it.
        correction: of a sample-estimate-hold, share of the last estimate's error that the next force makes good.
    """

    kind: Annotated[
        Literal["none", "energy_bound", "passivity_controller", "half_sample", "sample_estimate_hold"],
        BeforeValidator(_one),
    ] = "none"
    viscous: Annotated[Number, _PART] = 0.8
    coulomb: Annotated[Number, _SHARE] = 0.8
    cap: Annotated[Number, _PART] = 0.5
    velocity: Literal["backward", "adaptive_window", "observer"] = "backward"
    horizon: Annotated[Number, _HORIZON] = 0.5
    observer: Rate = 1000.0
    deadbeat: bool = False
    correction: Annotated[Number, _SHARE] = 1.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        stray = sorted(self.model_fields_set - {"kind"} - _KEYS[self.kind])
        if stray:
            raise ValueError(f'{stray[0]} has no meaning for kind = "{self.kind}"')
        if "observer" in self.model_fields_set and self.velocity != "observer":
            raise ValueError('observer belongs to velocity = "observer"')
        return self

    def check(self, topology: str, model: str, delay: int, device: Device) -> None:
        """Raise ValueError if the guard does not fit the loop.

        Args:
            topology: of the loop.
            model: of the device, `device.model`.
            delay: of the device, servo periods.
            device: of the loop.
        """
        if self.kind == "none":
            return
        if topology == "admittance_display":
            raise ValueError(
                "guard.kind: a guard bounds the force that the motors hold on an object, and the motors of an "
                "admittance_display position the tip; remove [guard]"
            )
        if topology != "impedance_display":
            raise ValueError(
                "guard.kind: in force_tracking the motors supply energy by design, so there is nothing to guard; "
                'remove [guard], or write servo.topology = "impedance_display"'
            )
        if model == "experimental":
            raise ValueError(
                'guard.kind: inertia and friction of the "experimental" model are not known; write '
                'device.model = "nonlinear"'
            )
        if self.deadbeat and delay > 0:
            raise ValueError(
                "guard.deadbeat: the two forces must act at once, and the device has a delay of "
                f"{delay} servo period(s); leave deadbeat out, or write device.delay = 0"
            )
        if self.kind != "energy_bound":
            return
        if model != "nonlinear":
            raise ValueError(
                'guard.kind: an energy bound relies on dry friction, which the "linear" model does not have; write '
                'device.model = "nonlinear"'
            )
        bare = [joint + 1 for joint, viscous in enumerate(device.viscous) if not viscous > 0.0]
        if bare:
            raise ValueError(
                f"guard.kind: an energy bound relies on viscous friction of each joint, and joint {bare[0]} of "
                f"{device.name} has none; give its file friction.viscous, or take another guard"
            )


OneGuard = Annotated[Guard, BeforeValidator(_one)]
