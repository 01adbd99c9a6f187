"""Validation of deformable bodies against converged finite elements, Hertz, and conservation of energy."""
