"""Loops of one scenario at many poses, judged together: the critical stiffness of each against a wall, exactly.

The same matrices as ``scenario_loop``, stacked. A device's response falls apart into modes, so that a wall's crossings
are found on all angles and poses at once; each limit is then confirmed by eigenvalues, and where they do not confirm it
the one-by-one search of ``critical`` decides.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.linear.linear_device import HumanArm, SampledDevice
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import assemble_loop, observable_reduction, sampled_plants
from palpate.linear.wall import wall_loop
from palpate.stability.boundaries import stability_interval

__all__ = ["PoseLoops"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ANGLES = np.unique(np.concatenate([np.geomspace(1e-4, np.pi, 220), np.linspace(0.02, np.pi, 180)]))[:-1]
CHUNK = 128  # poses at a time
STABLE = 1 + 1e-10  # a mode at 1 that the wall does not see may stay


@dataclass(frozen=True)
class PoseLoops:
    """Loops at n poses, each from the object's force (3, N) to the tip (3, m).

    Attributes:
        plant: sampled (A, B, C), stacked: from torques to joint angles.
        jacobian: (n, 3, dof), m/rad.
        geometric_stiffness: (n, dof, dof), N m/rad: how the torque of the motors' hold turns with the pose.
        law: the controller, the same everywhere.
        late: delay, samples.
        period: T, s.
    """

    plant: tuple[Array, Array, Array]
    jacobian: Array
    geometric_stiffness: Array
    law: Controller
    late: int
    period: float

    @classmethod
    def of(
        cls,
        device: Device,
        poses: Array,
        law: Controller,
        period: float,
        late: int = 0,
        arm: HumanArm | None = None,
        pull: Array | None = None,
        gravity_compensation: bool = True,
    ) -> PoseLoops:
        """Return the loops of ``device`` at rest in ``poses`` (n, dof), each with the hold's force of that pose.

        Args:
            device: the arm.
            poses: off its singularities.
            law: the controller, sampled every ``period`` (s).
            period: s.
            late: delay, samples.
            arm: holds the tip.
            pull: of the hand at rest, (3,), N.
            gravity_compensation: whether the motors carry the weight.
        """
        plant = sampled_plants(device, poses, arm, np.zeros(3) if pull is None else pull, period)
        jacobian = device.jacobian(poses)
        geometric_stiffness = np.zeros((len(poses), device.dof, device.dof))
        if gravity_compensation:
            forces = np.array([static_tip_force(j, t) for j, t in zip(jacobian, device.gravity(poses), strict=True)])
            geometric_stiffness = np.einsum("nk,nkij->nij", forces, device.tip_hessian(poses))
        return cls(plant, jacobian, geometric_stiffness, law, late, period)

    def __len__(self) -> int:
        return len(self.jacobian)

    def part(self, window: slice) -> PoseLoops:
        """Return the loops of some of the poses."""
        a, b, c = (m[window] for m in self.plant)
        return PoseLoops(
            (a, b, c), self.jacobian[window], self.geometric_stiffness[window], self.law, self.late, self.period
        )

    def critical_stiffness(self, directions: Array, damping: Array) -> tuple[Array, Array]:
        """Return (stiffness, frequency), each (n, d): the least wall at which each loop loses stability, and there.

        Args:
            directions: (n, d, 3), unit vectors along which the wall pushes at each pose.
            damping: B of the wall along each, (n, d), N s/m.

        Returns:
            N/m, 0 where no wall is stable and inf where none is too stiff; Hz, nan where there is no such limit.
        """
        starts = range(0, len(self), CHUNK)

        def job(start: int) -> tuple[Array, Array]:
            window = slice(start, start + CHUNK)
            return self.part(window)._critical(directions[window], damping[window])

        with ThreadPoolExecutor(min(os.cpu_count() or 1, max(len(starts), 1))) as pool:
            parts = list(pool.map(job, starts))
        empty = np.zeros((0, directions.shape[1]))
        return np.concatenate([empty, *(k for k, _ in parts)]), np.concatenate([empty, *(f for _, f in parts)])

    def _critical(self, directions: Array, damping: Array) -> tuple[Array, Array]:
        modes = _Modes(self)
        count, wide = directions.shape[:2]
        pose, along, rate = np.repeat(np.arange(count), wide), directions.reshape(-1, 3), damping.ravel() / self.period

        rows = np.arange(count * wide)
        response = modes.everywhere(ANGLES, directions).reshape(count * wide, -1)
        wanted = 1 / response - rate[:, None] * (1 - np.exp(-1j * ANGLES))
        off, at = wanted.imag, wanted.real

        def over(theta: Array, row: NDArray[np.int64]) -> tuple[Array, Array]:
            """Return (Im W - B Im V, Re W - B Re V): where the first is zero, the second is a stiffness that fits."""
            there = 1 / modes.along(theta, pose[row], along[row]) - rate[row] * (1 - np.exp(-1j * theta))
            return there.imag, there.real

        row, k = np.nonzero(off[:, :-1] * off[:, 1:] < 0)
        brackets = [(row, ANGLES[k], ANGLES[k + 1], off[row, k], off[row, k + 1])]
        # between three angles of one sign the curve may dip through zero and come back: look closer where it turns
        size = np.abs(off)
        turns = (size[:, 1:-1] <= size[:, 2:]) & (size[:, 1:-1] <= size[:, :-2]) & (at[:, 1:-1] > 0)
        turns &= (off[:, 1:-1] * off[:, 2:] > 0) & (off[:, 1:-1] * off[:, :-2] > 0)
        row, k = np.nonzero(turns)
        fine = ANGLES[k][:, None] + (ANGLES[k + 2] - ANGLES[k])[:, None] * np.linspace(0, 1, 17)
        closer = over(fine.ravel(), np.repeat(row, 17))[0].reshape(-1, 17)
        i, k = np.nonzero(closer[:, :-1] * closer[:, 1:] < 0)
        brackets.append((row[i], fine[i, k], fine[i, k + 1], closer[i, k], closer[i, k + 1]))
        row, low, high, at_low, at_high = (np.concatenate(parts) for parts in zip(*brackets, strict=True))
        crossing = row
        angle, value = _roots(lambda theta, i: over(theta, crossing[i]), low, high, at_low, at_high)
        # roots at -1 and at 1 are real for every wall
        for theta in (np.pi, 1e-7):
            ends = np.full(len(rows), theta)
            row, angle = np.concatenate([row, rows]), np.concatenate([angle, ends])
            value = np.concatenate([value, over(ends, rows)[1]])
        good = np.isfinite(value) & (value > 0) & (value < 1e15)
        order = np.lexsort((value[good], row[good]))
        row, angle, value = row[good][order], angle[good][order], value[good][order]
        place = np.arange(len(row)) - np.searchsorted(row, row)  # of a stiffness among its loop's
        shape = (len(rows), int(place.max(initial=-1)) + 1)
        limits, angles = np.full(shape, np.inf), np.full(shape, np.nan)
        limits[row, place], angles[row, place] = value, angle
        first, where = self._first(limits, angles, rate, pose, along)
        frequency = where / (2 * np.pi * self.period)
        sure = np.isfinite(first) & (first > 0) & modes.whole[pose]
        for part, below in ((0.3, True), (0.999, True), (1.001, False)):
            which = np.flatnonzero(sure)
            radius = self._radii(part * first[which], rate[which], pose[which], along[which])
            sure[which] = (radius < STABLE) == below
        sure |= (first == 0) & modes.whole[pose]  # every interval was judged
        for left in np.flatnonzero(~sure):
            damped = float(rate[left] * self.period)
            first[left], frequency[left] = self._alone(int(pose[left]), along[left], damped)
        return first.reshape(count, wide), frequency.reshape(count, wide)

    def _first(
        self, limits: Array, angles: Array, rate: Array, pose: NDArray[np.int64], along: Array
    ) -> tuple[Array, Array]:
        """Return where the first stable interval of stiffness ends, and at which angle; 0 if there is none, or inf.

        Args:
            limits: stiffnesses with a root on the circle, rising, (k, m), N/m, inf where there are fewer.
            angles: of these roots, (k, m), rad per sample.
            rate: B/T, (k,).
            pose: index (k,).
            along: (k, 3).
        """
        count = len(limits)
        result, where = np.zeros(count), np.full(count, np.nan)
        lower, inside, open_rows = np.zeros(count), np.zeros(count, dtype=bool), np.arange(count)
        for k in range(limits.shape[1] + 1):
            upper = limits[open_rows, k] if k < limits.shape[1] else np.full(len(open_rows), np.inf)
            middle = np.where(np.isfinite(upper), 0.5 * (lower[open_rows] + upper), 2 * lower[open_rows] + 1.0)
            stable = self._radii(middle, rate[open_rows], pose[open_rows], along[open_rows]) < STABLE
            ended = inside[open_rows] & ~stable
            inside[open_rows] = stable
            result[open_rows[ended]] = lower[open_rows[ended]]
            if k:
                where[open_rows[ended]] = angles[open_rows[ended], k - 1]
            never = np.isinf(upper) & stable
            result[open_rows[never]] = np.inf
            lower[open_rows] = upper
            open_rows = open_rows[~ended & np.isfinite(upper)]
        return result, where

    def _radii(self, stiffness: Array, rate: Array, pose: NDArray[np.int64], along: Array) -> Array:
        """Return the spectral radius against k walls: K (k,), N/m; B/T (k,); index of the pose (k,); normal (k, 3)."""
        a, entry, out = assemble_loop(self.plant, self.jacobian, self.geometric_stiffness, self.law, self.late)
        n = a.shape[-1]
        b, c = np.einsum("kij,kj->ki", entry[pose], along), np.einsum("kij,ki->kj", out[pose], along)
        closed = np.zeros((len(pose), n + 1, n + 1))
        force = np.concatenate([(stiffness + rate)[:, None] * c, -rate[:, None]], axis=1)
        closed[:, :n, :n] = a[pose]
        closed[:, :n, :] += b[:, :, None] * force[:, None, :]
        closed[:, n, :n] = c
        return np.asarray(np.abs(np.linalg.eigvals(closed)).max(axis=-1), dtype=float)

    def _alone(self, pose: int, direction: Array, damping: float) -> tuple[float, float]:
        """Return (stiffness, frequency) of one loop by the search over every crossing, hidden modes left out."""
        one = self.part(slice(pose, pose + 1))
        a, entry, out = (
            m[0] for m in assemble_loop(one.plant, one.jacobian, one.geometric_stiffness, one.law, one.late)
        )
        a, b, c = observable_reduction(a, entry, out, direction[:, None])
        n = len(a)
        limit = stability_interval(
            wall_loop(SampledDevice(a - np.eye(n), -b[:, 0], np.zeros(n), c[0], 0, self.period)), damping
        )
        return limit.stiffness, limit.frequency


class _Response:
    """A sampled system's response from its modes: C (z - A)^-1 B + D at many angles, of one system or a stack."""

    def __init__(self, a: Array, b: Array, c: Array, d: Array | None = None) -> None:
        if a.shape[-1]:
            self.values, vectors = (np.asarray(m, dtype=complex) for m in np.linalg.eig(a))
            self.whole = np.linalg.cond(vectors) < 1e9  # else the modes do not add up to the system
            left = np.linalg.solve(np.where(self.whole[..., None, None], vectors, np.eye(a.shape[-1])), b)
            residues = np.swapaxes(c @ vectors, -1, -2)[..., :, :, None] * left[..., :, None, :]
        else:
            self.values, self.whole = np.zeros(a.shape[:-1], dtype=complex), np.array(True)
            residues = np.zeros((*a.shape[:-1], c.shape[-2], b.shape[-1]), dtype=complex)
        self.shape = residues.shape[-2:]
        self.residues = residues.reshape(*residues.shape[:-2], b.shape[-1] * c.shape[-2])
        self.direct = 0.0 if d is None else d

    def grid(self, z: Complex) -> Complex:
        """Return the response (..., k, outputs, inputs) of every system at each z (k,)."""
        poles = 1 / (z[:, None] - self.values[..., None, :])
        flat = poles @ self.residues
        return np.asarray(flat.reshape(*flat.shape[:-1], *self.shape) + self.direct, dtype=complex)

    def pairs(self, z: Complex, which: NDArray[np.int64]) -> Complex:
        """Return the response (k, outputs, inputs) of system which[i] of the stack at z[i]."""
        poles = 1 / (z[:, None] - self.values[which])
        flat = (poles[:, None, :] @ self.residues[which])[:, 0, :]
        return np.asarray(flat.reshape(len(z), *self.shape) + self.direct, dtype=complex)


class _Modes:
    """How the tips of the loops answer the object's force at any angle."""

    def __init__(self, loops: PoseLoops) -> None:
        self.loops = loops
        self.plants = _Response(*loops.plant)
        feedback = loops.law.feedback
        self.law = _Response(feedback.A, feedback.B, feedback.C, feedback.D)
        self.whole = self.plants.whole & self.law.whole

    def everywhere(self, theta: Array, directions: Array) -> Complex:
        """Return the tip's motion along each direction per force of the object along it, (n, d, k) at angles (k,)."""
        z = np.exp(1j * theta)
        jacobian = self.loops.jacobian[:, None]
        moved = self._closed(self.plants.grid(z), self.loops.geometric_stiffness[:, None], z[None, :])
        tip = jacobian @ moved @ np.swapaxes(jacobian, -1, -2) @ self.law.grid(z)
        count, wide = directions.shape[:2]
        both = np.einsum("ndi,ndj->nijd", directions, directions).reshape(count, 9, wide)
        return np.asarray(np.swapaxes(tip.reshape(*tip.shape[:2], 9) @ both, 1, 2), dtype=complex)

    def along(self, theta: Array, pose: NDArray[np.int64], direction: Array) -> Complex:
        """Return the same for pairs of an angle (k,), a pose (k,) and a direction (k, 3)."""
        z = np.exp(1j * theta)
        jacobian = self.loops.jacobian[pose]
        pushed = np.swapaxes(jacobian, -1, -2) @ (self.law.grid(z) @ direction[:, :, None])
        moved = self._closed(self.plants.pairs(z, pose), self.loops.geometric_stiffness[pose], z) @ pushed
        return np.asarray((direction[:, None, :] @ (jacobian @ moved))[:, 0, 0], dtype=complex)

    def _closed(self, plant: Complex, geometric_stiffness: Array, z: Complex) -> Complex:
        """Return joint angles per torque, late, with the turning of the hold's torque fed back."""
        late = (z**-self.loops.late)[..., None, None] * plant
        return np.asarray(np.linalg.solve(np.eye(plant.shape[-1]) - late @ geometric_stiffness, late), dtype=complex)


def _roots(
    both: Callable[[Array, NDArray[np.int64]], tuple[Array, Array]],
    low: Array,
    high: Array,
    at_low: Array,
    at_high: Array,
) -> tuple[Array, Array]:
    """Return (angle, value) where the first of ``both`` changes sign between low and high, all at once (Illinois)."""
    low, high, at_low, at_high = low.copy(), high.copy(), at_low.copy(), at_high.copy()
    angle, value = 0.5 * (low + high), np.full(low.shape, np.nan)
    live = np.arange(len(low))
    for turn in range(80):
        if live.size == 0:
            break
        a, b, fa, fb = low[live], high[live], at_low[live], at_high[live]
        guess = (a * fb - b * fa) / (fb - fa)
        guess = np.where((guess > a) & (guess < b) & (turn % 6 < 5), guess, 0.5 * (a + b))
        f, value[live] = both(guess, live)
        angle[live] = guess
        left = f * fa > 0
        low[live], at_low[live] = np.where(left, guess, a), np.where(left, f, 0.5 * fa)
        high[live], at_high[live] = np.where(left, b, guess), np.where(left, 0.5 * fb, f)
        done = (np.abs(f) <= 1e-11 * np.abs(value[live])) | (high[live] - low[live] <= 4e-16 * high[live])
        live = live[~done]
    return angle, value
