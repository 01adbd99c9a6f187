"""What building or loading a body raises, and what it warns of."""

from palpate.errors import PalpateError

__all__ = ["BodyError", "BodyWarning"]


class BodyError(PalpateError):
    """A body cannot be built or loaded: a mesh without volume, nothing fixed, an impossible material, a broken file."""


class BodyWarning(UserWarning):
    """A body can be built, but a number in it is probably not what was meant."""


def lost(deep: float, held: float) -> str:
    """Return what is wrong with a press `deep`, mm, that was felt until `held`, mm."""
    return (
        f"pressed {deep:.3g} mm deep the body gives way, and the tip loses it; it was felt until {held:.3g} mm: press "
        "less deep, or with a larger tip"
    )
