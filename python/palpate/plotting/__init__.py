"""Matplotlib figures of traces, meshes and bodies."""

from palpate.plotting.figures import angles, deflection, energy, forces, torques

__all__ = ["angles", "deflection", "energy", "forces", "torques"]
