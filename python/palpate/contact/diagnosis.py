"""What is wrong with a mesh, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Diagnosis", "lengths"]


@dataclass(frozen=True)
class Diagnosis:
    """Counts of faults, and of what was mended when the mesh was made. `str()` tells it in sentences."""

    triangles: int
    vertices: int
    parts: int
    """Pieces that share no edge."""
    size: tuple[float, float, float]
    """Edges of the box around it along x, y and z, m."""
    volume: float
    """Enclosed, m^3; of no meaning if the mesh is open."""
    open_edges: int
    non_manifold_edges: int
    mixed_winding_edges: int
    degenerate: int
    duplicate: int
    self_intersections: int
    """Edges that pierce a triangle; -1 if the mesh is too broken to look."""
    pinched_vertices: int = 0
    """Vertices at which parts of the surface meet in that one point only."""
    mended: tuple[str, ...] = ()
    """What was changed, one sentence each."""

    @property
    def closed(self) -> bool:
        """Whether there is an inside."""
        return self.open_edges == 0

    @property
    def clean(self) -> bool:
        """Closed, manifold, wound one way, without pieces that cut each other."""
        faults = (self.open_edges, self.non_manifold_edges, self.mixed_winding_edges, self.degenerate, self.duplicate)
        return not any(faults) and self.self_intersections == 0 and self.pinched_vertices == 0

    def __str__(self) -> str:
        lines = [f"{self.triangles} triangles, {self.vertices} vertices, {self.parts} part{'s'[: self.parts != 1]}"]
        lines.append(f"{lengths(self.size)} along x, y and z")
        named = (
            (self.open_edges, "open edges (a border)"),
            (self.non_manifold_edges, "edges with more than two triangles"),
            (self.mixed_winding_edges, "edges whose triangles turn opposite ways round"),
            (self.degenerate, "triangles without area"),
            (self.duplicate, "repeated triangles"),
            (self.self_intersections, "edges that pierce a triangle"),
            (self.pinched_vertices, "vertices at which parts meet in a point only"),
        )
        lines += [f"{count} {what}" for count, what in named if count > 0]
        if self.closed:
            lines.append(f"closed, {self.volume:.6g} m^3")
        lines += [f"mended: {what}" for what in self.mended]
        return "\n".join(lines)


def lengths(size: tuple[float, float, float]) -> str:
    """Return lengths, m, as people write them: in mm, those of large things in m."""
    scale, unit = (1.0, "m") if max(size) >= 1.0 else (1e3, "mm")
    return " × ".join(f"{length * scale:.4g}" for length in size) + f" {unit}"
