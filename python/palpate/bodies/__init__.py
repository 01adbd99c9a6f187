"""What yields: bodies condensed from finite elements, fast enough for the servo."""

from palpate.bodies.body import Body, Press, Presses
from palpate.bodies.build import build
from palpate.bodies.errors import BodyError, BodyWarning
from palpate.bodies.material import Material, Region, Skin
from palpate.bodies.phantom import phantom
from palpate.bodies.places import Place, ball, beyond, box, on_surface, place
from palpate.bodies.pressed import Live, PressedSolid, Touches
from palpate.bodies.solid import Law, Solid, Strain
from palpate.bodies.volume import Volume, block, fill, grid, read_volume

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
