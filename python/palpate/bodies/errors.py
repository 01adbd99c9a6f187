"""What building or loading a body raises, and what it warns of."""

import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError, PalpateWarning

__all__ = ["BodyError", "BodyWarning", "check_rest", "lost"]


class BodyError(PalpateError):
    """A body cannot be built or loaded: a mesh without volume, nothing fixed, an impossible material, a broken file."""


class BodyWarning(PalpateWarning):
    """A body can be built, but a number in it is probably not what was meant."""


def check_rest(depths: NDArray[np.float64], nodes: NDArray[np.float64], rests: NDArray[np.float64]) -> None:
    """Refuse a press that went in by `depths` (m,), m, if the body does not rest at the last, or the tip lost it there.

    `nodes` (m,) were pressed at each, and `rests` (m,) tells at which ones the body came to rest.

    Raises:
        BodyError: it does not, and how deep it did.
    """
    deep = 1e3 * depths[-1]
    held = 1e3 * depths[(nodes > 0) & (rests > 0)]
    until = f"it was felt at rest until {held[-1]:.3g} mm" if len(held) > 0 else "nor did it before"
    if nodes[-1] == 0 and (nodes > 0).any():
        wrong = "the body gives way, and the tip loses it"
    elif not rests[-1] > 0:
        wrong = "the body does not come to rest"
    else:
        return
    raise BodyError(f"pressed {deep:.3g} mm deep {wrong}; {until}: press less deep, or with a larger tip")


def lost(deep: float, held: float) -> str:
    """Return what is wrong with a press `deep`, mm, that was felt until `held`, mm."""
    return (
        f"pressed {deep:.3g} mm deep the body gives way, and the tip loses it; it was felt until {held:.3g} mm: press "
        "less deep, or with a larger tip"
    )
