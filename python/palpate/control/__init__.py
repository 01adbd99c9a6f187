"""The controller that the servo loop runs."""

from palpate.control.controller import Controller

__all__ = ["Controller"]
