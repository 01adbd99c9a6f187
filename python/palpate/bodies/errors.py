"""What building or loading a body raises, and what it warns of."""

from palpate.errors import PalpateError

__all__ = ["BodyError", "BodyWarning"]


class BodyError(PalpateError):
    """A body cannot be built or loaded: a mesh without volume, nothing fixed, an impossible material, a broken file."""


class BodyWarning(UserWarning):
    """A body can be built, but a number in it is probably not what was meant."""
