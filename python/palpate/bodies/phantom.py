"""The palpation phantom: a block with a skin and a hidden nodule."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from palpate.bodies.body import Body
from palpate.bodies.build import build
from palpate.bodies.errors import BodyError
from palpate.bodies.material import Region, Skin
from palpate.bodies.places import ball, beyond
from palpate.bodies.volume import block

__all__ = ["phantom"]

_SIDE, _HEIGHT = 0.1, 0.05  # m


def phantom(
    *,
    young: float = 10e3,
    contrast: float = 5.0,
    depth: float = 10e-3,
    diameter: float = 15e-3,
    skin: float = 2e-3,
    skin_young: float = 50e3,
    poisson: float = 0.45,
    spacing: float = 5e-3,
    modes: int = 0,
    output: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Body:
    """Build a block of 100 x 100 x 50 mm, bonded below, touched on its top (z = 50 mm).

    Args:
        young: of the block, Pa; 5 to 15 kPa is like soft tissue.
        contrast: of the nodule's modulus over the block's; 2 to 10 for lesions of the breast; 1 for none.
        depth: of the nodule's top under the block's, m; 5 to 20 mm.
        diameter: of the nodule in the middle of the block, m.
        skin: thickness, m; 0 for none.
        skin_young: of the skin, Pa; of the breast 56 +- 16 kPa.
        poisson: Poisson's ratio.
        spacing: of the cells, m.
        modes: vibration modes to find too.
        output: file to write to.
        progress: told what is done, and the fraction of it.

    Raises:
        BodyError: the nodule does not fit into the block, or a number is impossible.
    """
    if not (diameter > 0 and skin <= depth and depth + diameter <= _HEIGHT):
        raise BodyError(
            f"the nodule lies between the skin and the block's bottom: {skin:g} m <= depth, "
            f"depth + diameter <= {_HEIGHT} m; here {depth:g} and {diameter:g} m"
        )
    centre = (_SIDE / 2, _SIDE / 2, _HEIGHT - depth - diameter / 2)
    nodule = [] if contrast == 1.0 else [Region(ball(centre, diameter / 2), contrast * young)]
    return build(
        block((_SIDE, _SIDE, _HEIGHT), spacing, layers=(skin,) if skin > 0 else ()),
        young=young,
        poisson=poisson,
        regions=nodule,
        skin=Skin(skin, skin_young) if skin > 0 else None,
        fixed=beyond("z", "<", 1e-6),
        touch=beyond("z", ">", _HEIGHT - 1e-6),
        modes=modes,
        output=output,
        progress=progress,
    )
