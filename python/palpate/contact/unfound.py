"""Sentences about a contact force on a body that was not found."""

from __future__ import annotations

from typing import Final

__all__ = ["MOST_NODES", "MOST_PLACES", "UNFOUND", "crowded", "unfound"]

MOST_NODES: Final = 128  # in contact along the normals, and of a local model
MOST_PLACES: Final = 256  # near the tips, in contact by signed distance
UNFOUND: Final = "the contact force was not found"


def crowded(most: int = MOST_NODES) -> str:
    """Return the sentence about more nodes in contact than a kind of contact holds, with the remedy."""
    return f"more than {most} nodes lie under the tip: use a smaller tip or a coarser mesh"


def unfound(samples: str, cause: str | None = None) -> str:
    """Return the sentence that the force was not found in `samples`; None: of all causes of any body."""
    causes = (
        "too many nodes lie near the tip, it inverts tetrahedra of the body or moves too far between the updates of "
        "its model, or the contact has not converged: use a smaller force, depth or tip, a coarser mesh, smaller "
        "steps, or a shorter interval between updates"
    )
    return f"{UNFOUND} in {samples}: {cause or causes}"
