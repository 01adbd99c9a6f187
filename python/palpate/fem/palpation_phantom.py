"""The palpation phantom: a block with a skin and a hidden nodule."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from palpate.fem.body import Body
from palpate.fem.builder import build
from palpate.fem.checks import length, not_negative, positive
from palpate.fem.errors import BodyError
from palpate.fem.material import Region, SurfaceLayer
from palpate.fem.selectors import half_space, sphere
from palpate.fem.volume import block

__all__ = ["phantom"]

_SIDE, _HEIGHT = 0.1, 0.05  # m


def phantom(
    *,
    young: float | str = 10e3,
    contrast: float | str = 5.0,
    depth: float | str = 10e-3,
    diameter: float | str = 15e-3,
    skin: float | str = 2e-3,
    skin_young: float | str = 50e3,
    poisson: float | str = 0.45,
    spacing: float | str = 5e-3,
    modes: int = 0,
    output: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Body:
    """Build a block of 100 x 100 x 50 mm, bonded below, touched on its top (z = 50 mm).

    Args:
        young: of the block, Pa, or text with its unit, as all here; 5 to 15 kPa is like soft tissue.
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
    stiffness, times = positive(young, "Pa", "young"), positive(contrast, "", "contrast")
    layer, deep, wide = not_negative(skin, "m", "skin"), length(depth, "depth"), positive(diameter, "m", "diameter")
    if layer >= _HEIGHT:
        raise BodyError(f"skin: {1e3 * layer:g} mm; it must be thinner than the block of {1e3 * _HEIGHT:g} mm")
    if layer + wide > _HEIGHT:
        raise BodyError(
            f"diameter: {1e3 * wide:g} mm; between a skin of {1e3 * layer:g} mm and the bottom of the block of "
            f"{1e3 * _HEIGHT:g} mm is no room for that"
        )
    if not layer <= deep <= _HEIGHT - wide:
        raise BodyError(
            f"depth: {1e3 * deep:g} mm; the nodule lies between the skin and the bottom of the block of "
            f"{1e3 * _HEIGHT:g} mm: from {1e3 * layer:g} to {1e3 * (_HEIGHT - wide):.4g} mm"
        )
    centre = (_SIDE / 2, _SIDE / 2, _HEIGHT - deep - wide / 2)
    nodule = [] if times == 1.0 else [Region(sphere(centre, wide / 2), times * stiffness)]
    return build(
        block((_SIDE, _SIDE, _HEIGHT), spacing, layers=(layer,) if layer > 0 else ()),
        young=stiffness,
        poisson=poisson,
        regions=nodule,
        skin=SurfaceLayer(layer, skin_young) if layer > 0 else None,
        fixed=half_space("z", "<", 1e-6),
        touch=half_space("z", ">", _HEIGHT - 1e-6),
        modes=modes,
        output=output,
        progress=progress,
    )
