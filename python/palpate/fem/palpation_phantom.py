"""Palpation phantom: a block with a surface layer and an embedded nodule."""

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

_SIDE, _HEIGHT = 0.1, 0.05  # m


def phantom(
    *,
    young: float | str = 10e3,
    contrast: float | str = 5.0,
    depth: float | str = 10e-3,
    diameter: float | str = 15e-3,
    layer_thickness: float | str = 2e-3,
    layer_young: float | str = 50e3,
    poisson: float | str = 0.45,
    spacing: float | str = 5e-3,
    modes: int = 0,
    output: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Body:
    """Build a block of 100 x 100 x 50 mm, fixed at its bottom, with its top (z = 50 mm) as contact surface.

    Quantities are numbers in SI or text with a unit.

    Args:
        young: Young's modulus of the block, Pa; 5 to 15 kPa is typical of soft tissue.
        contrast: modulus of the nodule over that of the block; 2 to 10 for lesions of the breast, 1 for no nodule.
        depth: of the top of the nodule below the top of the block, m; 5 to 20 mm.
        diameter: of the nodule, which is centered in x and y, m.
        layer_thickness: thickness of the surface layer, m; 0 for none.
        layer_young: Young's modulus of the surface layer, Pa; skin of the breast has 56 +- 16 kPa.
        poisson: Poisson's ratio.
        spacing: of the cells, m.
        modes: number of vibration modes to compute.
        output: file to write to.
        progress: called with a description and the fraction done.

    Raises:
        BodyError: the nodule does not fit into the block, or a number is out of range.
    """
    stiffness, ratio = positive(young, "Pa", "young"), positive(contrast, "", "contrast")
    layer = not_negative(layer_thickness, "m", "layer_thickness")
    deep, width = length(depth, "depth"), positive(diameter, "m", "diameter")
    _check_nodule(layer, deep, width)
    edge = positive(spacing, "m", "spacing")
    if edge > _HEIGHT:
        raise BodyError(f"spacing: {1e3 * edge:g} mm exceeds the height of the block, {1e3 * _HEIGHT:g} mm: use 5 mm")
    center = (_SIDE / 2, _SIDE / 2, _HEIGHT - deep - width / 2)
    nodule = [] if ratio == 1.0 else [Region(sphere(center, width / 2), ratio * stiffness)]
    return build(
        block((_SIDE, _SIDE, _HEIGHT), edge, layers=(layer,) if layer > 0 else ()),
        young=stiffness,
        poisson=poisson,
        regions=nodule,
        surface_layer=SurfaceLayer(layer, layer_young) if layer > 0 else None,
        fixed=half_space("z", "<", 1e-6),
        touch=half_space("z", ">", _HEIGHT - 1e-6),
        modes=modes,
        output=output,
        progress=progress,
    )


def _check_nodule(layer: float, deep: float, width: float) -> None:
    """Raise BodyError unless a nodule at a depth, m, lies between the surface layer and the bottom."""
    if layer >= _HEIGHT:
        raise BodyError(
            f"layer_thickness: {1e3 * layer:g} mm; it must be thinner than the block of {1e3 * _HEIGHT:g} mm"
        )
    if layer + width > _HEIGHT:
        raise BodyError(
            f"diameter: {1e3 * width:g} mm; the nodule does not fit between a layer of {1e3 * layer:g} mm and the "
            f"bottom of the block of {1e3 * _HEIGHT:g} mm"
        )
    if not layer <= deep <= _HEIGHT - width:
        raise BodyError(
            f"depth: {1e3 * deep:g} mm; the nodule lies between the surface layer and the bottom of the block of "
            f"{1e3 * _HEIGHT:g} mm: from {1e3 * layer:g} to {1e3 * (_HEIGHT - width):.4g} mm"
        )
