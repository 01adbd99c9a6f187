"""[servo.tool]: virtual tool of an admittance display."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Protocol

from palpate.scenario.fields import OneDamping, OneMass, Section, must

_FEEDBACK: Final = frozenset({"bandwidth", "damping", "observer", "disturbance"})  # options that position the tip


class Tool(Section):
    """[servo.tool]: virtual tool of an admittance display.

    Attributes:
        mass: kg.
        damping: against the ground, N*s/m.
    """

    mass: Annotated[OneMass, must(lambda mass: mass > 0.0, "{:g} kg; it must be positive")]
    damping: OneDamping


class _Controller(Protocol):
    """[controller], as far as it is checked here."""

    @property
    def kind(self) -> str: ...
    @property
    def options(self) -> Mapping[str, Any]: ...


def check_tool(topology: str, tool: Tool | None, controller: _Controller, operator: str) -> None:
    """Raise ValueError if the tool does not fit the loop, or the loop is no admittance display with all its parts.

    Args:
        topology: of the loop.
        tool: of the loop.
        controller: of the loop.
        operator: kind of the operator.
    """
    if topology != "admittance_display":
        if tool is not None:
            raise ValueError(
                "servo.tool: only an admittance_display has a virtual tool; remove it, or write "
                'servo.topology = "admittance_display"'
            )
        return
    if tool is None:
        raise ValueError(
            'servo.tool is missing: the operator moves a tool; write [servo.tool] with mass = "0.1 kg" and '
            'damping = "1 N*s/m", for example'
        )
    if controller.kind != "workspace":
        raise ValueError(
            'controller.kind: the tip of an admittance_display follows the tool by the "workspace" controller; write '
            f'it in place of "{controller.kind}"'
        )
    if stray := sorted(set(controller.options) - _FEEDBACK):
        raise ValueError(
            f"controller.{stray[0]}: the tool is the reference model of an admittance_display, so it has no meaning; "
            "remove it"
        )
    if operator not in ("force", "arm"):
        raise ValueError(
            'operator.kind: the force of the operator moves the tool of an admittance_display; write kind = "force" or '
            f'"arm", not "{operator}"'
        )
