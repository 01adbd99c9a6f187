"""Diagnosis of a mesh: counts of defects."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Diagnosis:
    """Counts of the defects of a mesh, and the repairs made when it was created. `str()` describes them."""

    triangles: int
    vertices: int
    components: int
    """Components that share no edge."""
    size: tuple[float, float, float]
    """Edges of the bounding box along x, y and z, m."""
    volume: float
    """Enclosed volume, m^3; meaningless if the mesh is open."""
    open_edges: int
    non_manifold_edges: int
    mixed_winding_edges: int
    degenerate: int
    duplicate: int
    self_intersections: int
    """Edges that intersect a triangle; -1 if the mesh is too defective for the check."""
    pinched_vertices: int = 0
    """Vertices at which parts of the surface meet in one point only."""
    repairs: tuple[str, ...] = ()
    """Repairs, one phrase each."""

    @property
    def closed(self) -> bool:
        """Whether the mesh encloses a volume."""
        return self.open_edges == 0

    @property
    def clean(self) -> bool:
        """Whether the mesh is closed, manifold, consistently oriented and free of self-intersections."""
        faults = (self.open_edges, self.non_manifold_edges, self.mixed_winding_edges, self.degenerate, self.duplicate)
        return not any(faults) and self.self_intersections == 0 and self.pinched_vertices == 0

    def __str__(self) -> str:
        lines = [
            f"{self.triangles} triangles, {self.vertices} vertices, {self.components} part{'s'[: self.components != 1]}"
        ]
        lines.append(f"{format_size(self.size)} along x, y and z")
        named = (
            (self.open_edges, "open edges (a border)"),
            (self.non_manifold_edges, "edges with more than two triangles"),
            (self.mixed_winding_edges, "edges between triangles of opposite orientation"),
            (self.degenerate, "triangles without area"),
            (self.duplicate, "repeated triangles"),
            (self.self_intersections, "edges that intersect a triangle"),
            (self.pinched_vertices, "vertices at which parts meet in a point only"),
        )
        lines += [f"{count} {defect}" for count, defect in named if count > 0]
        if self.closed:
            lines.append(f"closed, {self.volume:.6g} m^3")
        lines += [f"repaired: {repair}" for repair in self.repairs]
        return "\n".join(lines)


def format_size(size: tuple[float, float, float]) -> str:
    """Return the edges of a box, m, as text in mm, or in m if one is 1 m or longer."""
    scale, unit = (1.0, "m") if max(size) >= 1.0 else (1e3, "mm")
    return " × ".join(f"{length * scale:.4g}" for length in size) + f" {unit}"
