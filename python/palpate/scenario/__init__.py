"""Scenario files: reading and validation."""

from palpate.scenario.model import Controller as ControllerChoice
from palpate.scenario.model import Scenario
from palpate.scenario.objects import Object

__all__ = ["ControllerChoice", "Object", "Scenario"]
