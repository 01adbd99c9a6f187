"""Figures of traces, meshes and bodies, drawn with matplotlib."""

from palpate.plotting.figures import angles, deflection, energy, forces, torques

__all__ = ["angles", "deflection", "energy", "forces", "torques"]
