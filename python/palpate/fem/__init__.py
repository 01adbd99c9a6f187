"""Deformable bodies condensed from finite elements, fast enough for the servo."""

from palpate.fem.body import Body, Press, Presses
from palpate.fem.builder import build
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.hyperelastic import Law, Solid, Strain
from palpate.fem.material import Material, Region, Skin
from palpate.fem.palpation_phantom import phantom
from palpate.fem.quasi_static import Live, PressedSolid, Touches
from palpate.fem.selectors import Place, ball, beyond, box, on_surface, place
from palpate.fem.volume import Volume, block, fill, grid, read_volume

__all__ = [
    "Body",
    "BodyError",
    "BodyWarning",
    "Law",
    "Live",
    "Material",
    "Place",
    "Press",
    "PressedSolid",
    "Presses",
    "Region",
    "Skin",
    "Solid",
    "Strain",
    "Touches",
    "Volume",
    "ball",
    "beyond",
    "block",
    "box",
    "build",
    "fill",
    "grid",
    "load",
    "on_surface",
    "phantom",
    "place",
    "read_volume",
]

load = Body.load
