"""What building or loading a body raises, and what it warns of."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError, PalpateWarning

__all__ = ["BodyError", "BodyWarning", "lost", "press_to_rest"]

_PATIENCE = 10  # depths in turn at which a body does not rest, each hundreds of slow steps


class BodyError(PalpateError):
    """A body cannot be built or loaded: a mesh without volume, nothing fixed, an impossible material, a broken file."""


class BodyWarning(PalpateWarning):
    """A body can be built, but a number in it is probably not what was meant."""


def press_to_rest(depths: NDArray[np.float64], settle: Callable[[int], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Press in by `depths` (m,), m, from one place of rest to the next; return the row of the last.

    `settle` goes on to the depth of a number and returns a row: the nodes pressed at its place 7, whether the body came
    to rest at its end. Where it buckles it may take some depths until it rests again.

    Raises:
        BodyError: the body does not come to rest at the last depth, or at several in turn, or the tip has lost it at
            the last; and until where it was felt.
    """
    held, touched, restless = 0.0, False, 0
    for number, depth in enumerate(depths):
        row = settle(number)
        pressed, rests, last = row[7] > 0, row[-1] > 0, number + 1 == len(depths)
        touched, restless = touched or pressed, 0 if rests else restless + 1
        if pressed and rests:
            held = 1e3 * depth
        if (last and (not rests or (touched and not pressed))) or restless >= _PATIENCE:
            until = f"it was felt at rest until {held:.3g} mm" if held > 0 else "nor did it before"
            wrong = (
                "the body gives way, and the tip loses it"
                if touched and not pressed
                else "the body does not come to rest"
            )
            raise BodyError(
                f"pressed {1e3 * depth:.3g} mm deep {wrong}; {until}: press less deep, or with a larger tip"
            )
    return row


def lost(deep: float, held: float) -> str:
    """Return what is wrong with a press `deep`, mm, that was felt until `held`, mm."""
    return (
        f"pressed {deep:.3g} mm deep the body gives way, and the tip loses it; it was felt until {held:.3g} mm: press "
        "less deep, or with a larger tip"
    )
