"""Errors and warnings about bodies."""

from palpate.errors import PalpateError, PalpateWarning

__all__ = ["BodyError", "BodyWarning"]


class BodyError(PalpateError):
    """A body cannot be built, loaded or indented: bad mesh or material, nothing fixed, broken file, no equilibrium."""


class BodyWarning(PalpateWarning):
    """A body can be built or indented, but a number is probably not as intended."""
