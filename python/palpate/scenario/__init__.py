"""Scenario files: reading and validation."""

from palpate.scenario.model import Controller as ControllerChoice
from palpate.scenario.model import Object, Scenario

__all__ = ["ControllerChoice", "Object", "Scenario"]
