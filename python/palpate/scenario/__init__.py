"""What people run: a scenario file, read and checked before anything moves."""

from palpate.scenario.model import Scenario

__all__ = ["Scenario"]
