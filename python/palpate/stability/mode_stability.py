"""Stability of every contact mode of a loop, of the switching between them, and the margin of the worst."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.linear.sampled_loop import reachable_space
from palpate.simulation.contact_law import closed_matrix
from palpate.stability.mesh_modes import ContactMode, SurfacePoint, friction_law
from palpate.stability.mesh_sites import Site
from palpate.stability.switching import Sector, common_lyapunov, dwell_time

__all__ = ["ModeStability", "Switching", "contact_matrix", "gain_margin", "mode_stability", "site_switching"]

CORNERS = 16  # of the polygon about the disk of friction
UNFELT = 1e-6  # force on the object relative to stiffness times motion, below which a motion is not felt
ALONG = 0.35  # motion out of the surface relative to the whole, of a slow motion along it
SLOW = 4.0 * math.pi  # rad/s (2 Hz): slower motions along the surface of a tip that slides are the operator's
MARGINAL = 1e-9  # distance of an eigenvalue from the unit circle that is rounding
LARGEST = 1e4  # gain margin at which the search stops; the margin is then unbounded


@dataclass(frozen=True, eq=False)
class ModeStability:
    """Stability of one contact mode at one site.

    Attributes:
        site: where.
        mode: the mode.
        radius: largest modulus of the eigenvalues that the contact takes part in.
        angle: angle of that eigenvalue, rad per sample.
        drift: modulus of the fastest drift along the surface, in which the contact takes no part; 0 if there is none.
    """

    site: Site
    mode: ContactMode
    radius: float
    angle: float
    drift: float

    @property
    def stable(self) -> bool:
        """Whether small motions decay, drift along the surface aside."""
        return self.radius < 1.0

    @property
    def slides_away(self) -> bool:
        """Whether an unstable slide speeds up without oscillation."""
        return not self.stable and self.mode.kind in ("sliding", "edge") and self.angle < MARGINAL


@dataclass(frozen=True, eq=False)
class Switching:
    """What is proven about switching between the modes at one site.

    Attributes:
        site: where.
        proof: "common" (a common Lyapunov function: any order of modes), "dwell" (modes that last long enough) or
            "undecided".
        decrease: least relative decrease of the common Lyapunov function in a sample.
        dwell: dwell time, samples; inf without a proof.
        separates: whether the proof covers the loss of contact.
        pair: names of the pair of modes that requires the dwell time, or of the mode that has no Lyapunov function.
    """

    site: Site
    proof: Literal["common", "dwell", "undecided"]
    decrease: float
    dwell: float
    separates: bool
    pair: tuple[str, str]


def mode_stability(site: Site, modes: Iterable[ContactMode], scale: float = 1.0) -> list[ModeStability]:
    """Return the stability of contact modes at a site, the contact's force times ``scale``."""
    modes = list(modes)
    directions = site.loop.directions
    matrices = [closed_matrix(site.path, mode.law, directions, scale) for mode in modes]
    values: list[NDArray[np.complex128]] = [np.zeros(0, complex)] * len(modes)
    for size in {len(m) for m in matrices}:
        chosen = [i for i, m in enumerate(matrices) if len(m) == size]
        for i, found in zip(chosen, np.linalg.eigvals(np.array([matrices[i] for i in chosen])), strict=True):
            values[i] = found
    return [_judge(site, mode, m, v) for mode, m, v in zip(modes, matrices, values, strict=True)]


def _judge(site: Site, mode: ContactMode, matrix: Array, values: NDArray[np.complex128]) -> ModeStability:
    drift = 0.0
    near = np.abs(np.log(np.maximum(np.abs(values), 1e-300)) + 1j * np.angle(values)) / site.loop.period
    slow = (np.abs(values) >= 1.0 - MARGINAL) & (near < SLOW)
    if slow.any():
        drifting = np.zeros(len(values), dtype=bool)
        for i in np.flatnonzero(slow):
            drifting[i] = _drifts(site, mode, matrix, complex(values[i]))
        drift = float(np.abs(values[drifting]).max(initial=0.0))
        values = values[~drifting]
    worst = int(np.argmax(np.abs(values)))
    return ModeStability(site, mode, float(np.abs(values[worst])), float(abs(np.angle(values[worst]))), drift)


def _drifts(site: Site, mode: ContactMode, matrix: Array, value: complex) -> bool:
    """Return whether a slow eigenvalue is a motion along the surface in which the contact takes no part.

    Its force on the object is zero to rounding, or the tip does not stick and hardly moves out of the surface.
    """
    law, directions, n = mode.law, site.loop.directions, site.path.nstates
    vector = np.linalg.svd(matrix - value * np.eye(len(matrix)))[2][-1].conj()
    motion = directions @ (site.path.C @ vector[:n])
    force = law.D @ motion + law.C @ vector[n:]
    size = float(np.linalg.norm(motion))
    felt = float(np.linalg.norm(directions.T @ force)) / max(float(np.linalg.norm(law.D)) * size, 1e-300)
    if abs(value - 1.0) < 1e-5 and felt < UNFELT:
        return True
    return mode.kind in ("sliding", "edge", "face") and float(abs(mode.normal @ motion)) < ALONG * size


def contact_matrix(site: Site, mode: ContactMode) -> Array:
    """Return the matrix of the loop in a mode, without the states that the force on the object does not show."""
    directions = site.loop.directions
    matrix = closed_matrix(site.path, mode.law, directions)
    force = np.hstack([directions.T @ mode.law.D @ directions @ site.path.C, directions.T @ mode.law.C])
    basis, inverse = reachable_space(matrix.T, force.T, force.T)
    return np.asarray(basis.T @ matrix @ inverse.T, dtype=float)


def gain_margin(
    found: Sequence[ModeStability], candidates: int = 12, start: float = 1.0
) -> tuple[float, ModeStability]:
    """Return the least factor on the contact's force, above ``start``, at which a mode becomes unstable, and the mode.

    The factor is found for the modes nearest their limit, and then confirmed for all of them.

    Args:
        found: modes, stable with the factor ``start``.
        candidates: number of modes for which the factor is found at first.
        start: factor at which the search begins.
    """
    chosen = sorted(found, key=lambda one: -one.radius)[:candidates]
    for _ in range(3):
        low, high = start, 1.5 * start
        while high < LARGEST and not _unstable(chosen, high):
            low, high = high, 1.5 * high
        if high >= LARGEST:
            low = high = math.inf
        while high - low > 1e-3 * high and math.isfinite(high):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if _unstable(chosen, middle) else (middle, high)
        missed = _unstable(found, 0.99 * min(high, LARGEST))
        if not missed:
            break
        chosen = [*chosen, *(one for one in missed[:candidates] if one not in chosen)]
    worst = (_unstable(chosen, high) or chosen)[0] if math.isfinite(high) else chosen[0]
    return high, worst


def _unstable(found: Iterable[ModeStability], scale: float) -> list[ModeStability]:
    """Return those modes that are unstable with the contact's force times ``scale``, the worst first."""
    at: dict[int, list[ModeStability]] = {}
    for one in found:
        at.setdefault(id(one.site), []).append(one)
    bad = []
    for group in at.values():
        scaled = mode_stability(group[0].site, [one.mode for one in group], scale)
        bad += [(now.radius, one) for one, now in zip(group, scaled, strict=True) if now.radius >= 1.0]
    return [one for _, one in sorted(bad, key=lambda pair: -pair[0])]


def site_switching(site: Site) -> Switching:
    """Return what is proven about switching between the contact modes at a site.

    The proof holds for every force of friction that Coulomb's law admits, whether the proxy sticks or slides, and for
    every stiffness between the extremes.
    """
    sectors = _observable(site, [_sector(site, group) for group in _groups(site.points)])
    apart = [replace(sector, low=0.0) for sector in sectors]
    for chosen, separates in ((apart, True), (sectors, False)):
        found = common_lyapunov(chosen, CORNERS)
        if found is not None:
            return Switching(site, "common", found.decrease, 0.0, separates, ("", ""))
    matrices = [sector.matrices(4) for sector in sectors]
    names = [sector.name for sector, group in zip(sectors, matrices, strict=True) for _ in group]
    every = np.concatenate(matrices)
    waits = dwell_time(every)
    if waits is None:
        worst = names[int(np.argmax(np.abs(np.linalg.eigvals(every)).max(axis=1)))]
        return Switching(site, "undecided", 0.0, math.inf, False, (worst, worst))
    i, j = waits.pair
    return Switching(site, "dwell", 0.0, waits.samples, False, (names[i], names[j]))


def _groups(points: Sequence[SurfacePoint]) -> list[list[SurfacePoint]]:
    """Return the points in groups that differ in their stiffness only, and whose laws are affine in it."""
    groups: list[list[SurfacePoint]] = []
    for point in points:
        last = groups[-1][-1] if groups else None
        if last is not None and np.array_equal(last.normal, point.normal) and last.drag == point.drag:
            groups[-1].append(point)
        else:
            groups.append([point])
    return groups


def _sector(site: Site, group: Sequence[SurfacePoint]) -> Sector:
    """Return the sector of the points of one normal, whose stiffness has every value between theirs."""
    directions, point = site.loop.directions, group[0]

    def matrix(stiffness: float, along: Array) -> Array:
        law = friction_law(replace(point, stiffness=stiffness), along)
        return closed_matrix(site.path, law, directions)

    zero, unit = np.zeros(2), 1.0 if point.rubs and 0.0 < point.friction < math.inf else 0.0
    base, whole = matrix(0.0, zero), matrix(1.0, zero)
    row = np.zeros(len(base))
    row[: site.path.nstates] = point.normal @ directions @ site.path.C
    inverse = row / max(float(row @ row), 1e-300)
    tangent = np.stack([(matrix(1.0, unit * axis) - whole) @ inverse for axis in np.eye(2)], axis=1)
    friction = point.friction if unit else 0.0
    name = f"a face of normal ({', '.join(f'{x:.2f}' for x in point.normal)})"
    low, high = (extreme(one.stiffness for one in group) for extreme in (min, max))
    return Sector(name, base, (whole - base) @ inverse, tangent / (friction or 1.0), row, low, high, friction)


def _observable(site: Site, sectors: Sequence[Sector]) -> list[Sector]:
    """Return the sectors without the states that no force of any of them shows."""
    directions = site.loop.directions
    points = [group[0] for group in _groups(site.points)]
    laws = [friction_law(point, np.zeros(2)) for point in points]
    force = np.vstack(
        [np.hstack([directions.T @ law.D @ directions @ site.path.C, directions.T @ law.C]) for law in laws]
    )
    still = closed_matrix(site.path, laws[0], directions, 0.0)
    basis, inverse = reachable_space(still.T, force.T, force.T)
    return [sector.transformed(basis.T, inverse.T) for sector in sectors]
