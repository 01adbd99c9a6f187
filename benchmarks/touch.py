"""Time of the proxy's step on spheres of 980 to a million triangles, on the path of CHAI3D's measurement."""

from __future__ import annotations

from typing import Any

from palpate.contact import Mesh

from benchmarks.ball import ball
from benchmarks.proxy_steps import orbit, time_steps
from benchmarks.section import Effort, Progress, Rows, Section, figures

__all__ = ["SECTION"]

PIECES = (7, 22, 71)  # parts of an edge of the icosahedron: 980, 9,680 and 100,820 triangles
MILLION = 224
SHAPES = {"smooth": 0.0, "bumpy": 0.04}  # height of the bumps over the radius
TICKS = 60_000


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return times of a step, us: "median_us" and "p99.9_us", by "shape", "radius_m" and "triangles"."""
    sizes = (*PIECES, MILLION) if effort.large else PIECES
    path = {name: orbit(effort.runs(TICKS), bump) for name, bump in SHAPES.items()}
    rows = []
    for number, pieces in enumerate(sizes):
        for shape, bump in SHAPES.items():
            tell(f"{20 * pieces**2:,} triangles, {shape}", number / len(sizes))
            mesh = Mesh(*ball(pieces, bump=bump))
            for radius in (0.0, 0.01):
                times = time_steps(mesh, path[shape], radius)
                rows.append(
                    {
                        "proxy": f"{'point' if radius == 0 else 'sphere of 10 mm'} on a {shape} ball",
                        "shape": shape,
                        "radius_m": radius,
                        "triangles": len(mesh.triangles),
                        "median_us": times["median"],
                        "p99.9_us": times["p99.9"],
                        "lost_ticks": times["lost"],
                        "unfinished_ticks": times["unfinished"],
                    }
                )
    return Rows(rows)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return row["proxy"], f"{row['triangles']:,}", figures(row["median_us"], 2), figures(row["p99.9_us"], 2)


SECTION = Section(
    "one step of the proxy, friction 0.6 / 0.4, with the tip below the surface of a ball of 0.5 m (minimum of three "
    "passes)",
    ("proxy", "triangles", "median [µs]", "p99.9 [µs]"),
    _cells,
    _measure,
)
