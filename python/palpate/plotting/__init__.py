"""Matplotlib figures of traces, meshes and bodies."""

from palpate.plotting.body_contact import deformed_surface
from palpate.plotting.figures import angles, deflection, energy, forces, torques

__all__ = ["angles", "deflection", "deformed_surface", "energy", "forces", "torques"]
