"""What people run: a scenario file, read and checked before anything moves."""

from palpate.scenario.model import Controller as ControllerChoice
from palpate.scenario.model import Object, Scenario

__all__ = ["ControllerChoice", "Object", "Scenario"]
