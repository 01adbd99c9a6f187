"""Deformable bodies condensed from finite elements, fast enough for the servo loop."""

from palpate.fem.body import Body
from palpate.fem.boundary_build import build_boundary
from palpate.fem.builder import build
from palpate.fem.contact_accuracy import force_error, softening, spacing_for
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.hyperelastic import HyperelasticModel, Strain
from palpate.fem.indentation import ContactHistory, Indentation
from palpate.fem.material import Material, Region, SurfaceLayer
from palpate.fem.model_spec import Law
from palpate.fem.palpation_phantom import phantom
from palpate.fem.quasi_static import MultiTipHistory, QuasiStaticSolver, RealtimeRun
from palpate.fem.selectors import Selector, box, half_space, on_surface, parse_selector, sphere
from palpate.fem.spring_build import build_springs
from palpate.fem.support_changes import SupportChange
from palpate.fem.volume import Volume, block, fill, grid, read_volume

__all__ = [
    "Body",
    "BodyError",
    "BodyWarning",
    "ContactHistory",
    "HyperelasticModel",
    "Indentation",
    "Law",
    "Material",
    "MultiTipHistory",
    "QuasiStaticSolver",
    "RealtimeRun",
    "Region",
    "Selector",
    "Strain",
    "SupportChange",
    "SurfaceLayer",
    "Volume",
    "block",
    "box",
    "build",
    "build_boundary",
    "build_springs",
    "fill",
    "force_error",
    "grid",
    "half_space",
    "load",
    "on_surface",
    "parse_selector",
    "phantom",
    "read_volume",
    "softening",
    "spacing_for",
    "sphere",
]

load = Body.load
