"""Critical stiffness of one scenario's loop at many poses at once.

The matrices are those of ``scenario_loop``, stacked. The response of a device is evaluated from its modes, so that the
crossings of a wall are found for all angles and poses at once. Each limit is confirmed by eigenvalues. Where they do
not confirm it, ``stability_interval`` decides.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Complex
from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.linear.linear_device import HumanArm, SampledDevice
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import assemble_loop, observable_reduction, sampled_plants
from palpate.linear.wall import wall_loop
from palpate.stability.maps.modal_response import ModalResponse
from palpate.stability.maps.wall_interval import stability_interval

__all__ = ["PoseLoops"]

ANGLES = np.unique(np.concatenate([np.geomspace(1e-4, np.pi, 220), np.linspace(0.02, np.pi, 180)]))[:-1]
CHUNK = 128  # poses per chunk
STABLE = 1 + 1e-10  # an unobservable mode at 1 is accepted


@dataclass(frozen=True)
class PoseLoops:
    """Loops at n poses, each from the object's force (3, N) to the tip (3, m).

    Attributes:
        plant: sampled (A, B, C), stacked: from torques to joint angles.
        jacobian: (n, 3, dof), m/rad.
        geometric_stiffness: (n, dof, dof), N m/rad: derivative of the gravity compensation torque by the pose.
        controller: the same at every pose.
        delay: samples.
        period: T, s.
    """

    plant: tuple[Array, Array, Array]
    jacobian: Array
    geometric_stiffness: Array
    controller: Controller
    delay: int
    period: float

    @classmethod
    def of(
        cls,
        device: Device,
        poses: Array,
        controller: Controller,
        period: float,
        delay: int = 0,
        arm: HumanArm | None = None,
        rest_force: Array | None = None,
        gravity_compensation: bool = True,
    ) -> PoseLoops:
        """Return the loops of ``device`` at rest in ``poses``, each with the gravity compensation of that pose.

        Args:
            device: the arm.
            poses: (n, dof), rad, not singular.
            controller: sampled every ``period``.
            period: s.
            delay: samples.
            arm: operator at the tip; None: no operator.
            rest_force: force of the operator at rest, (3,), N.
            gravity_compensation: whether the motors carry the weight.
        """
        plant = sampled_plants(device, poses, arm, np.zeros(3) if rest_force is None else rest_force, period)
        jacobian = device.jacobian(poses)
        geometric_stiffness = np.zeros((len(poses), device.dof, device.dof))
        if gravity_compensation:
            forces = np.array([static_tip_force(j, t) for j, t in zip(jacobian, device.gravity(poses), strict=True)])
            geometric_stiffness = np.einsum("nk,nkij->nij", forces, device.tip_hessian(poses))
        return cls(plant, jacobian, geometric_stiffness, controller, delay, period)

    def __len__(self) -> int:
        return len(self.jacobian)

    def subset(self, window: slice) -> PoseLoops:
        """Return the loops of the poses in ``window``."""
        a, b, c = (m[window] for m in self.plant)
        return PoseLoops(
            (a, b, c), self.jacobian[window], self.geometric_stiffness[window], self.controller, self.delay, self.period
        )

    def critical_stiffness(self, directions: Array, damping: Array) -> tuple[Array, Array, Array]:
        """Return the first stable interval of stiffness of each loop and direction, each (n, d).

        Args:
            directions: (n, d, 3), unit normals of the walls at each pose.
            damping: B of the wall along each, (n, d), N s/m.

        Returns:
            Upper end, the critical stiffness, N/m: 0 where no wall is stable and inf where every stiff wall is.
            Frequency of the oscillation there, Hz; nan where there is no limit.
            Lower end, N/m: above 0 where the device is unstable without a wall.
        """
        starts = range(0, len(self), CHUNK)

        def job(start: int) -> tuple[Array, Array, Array]:
            window = slice(start, start + CHUNK)
            return self.subset(window)._critical(directions[window], damping[window])

        with ThreadPoolExecutor(min(os.cpu_count() or 1, max(len(starts), 1))) as pool:
            parts = list(pool.map(job, starts))
        empty = np.zeros((0, directions.shape[1]))
        critical, frequency, lower = (np.concatenate([empty, *(part[i] for part in parts)]) for i in range(3))
        return critical, frequency, lower

    def _critical(self, directions: Array, damping: Array) -> tuple[Array, Array, Array]:
        modes = _TipResponse(self)
        count, d = directions.shape[:2]
        pose, normal = np.repeat(np.arange(count), d), directions.reshape(-1, 3)
        rate = damping.ravel() / self.period
        row, angle, value = self._crossings(modes, directions, pose, normal, rate)
        good = np.isfinite(value) & (value > 0) & (value < 1e15)
        order = np.lexsort((value[good], row[good]))
        row, angle, value = row[good][order], angle[good][order], value[good][order]
        place = np.arange(len(row)) - np.searchsorted(row, row)  # rank of a stiffness within its loop
        shape = (count * d, int(place.max(initial=-1)) + 1)
        limits, angles = np.full(shape, np.inf), np.full(shape, np.nan)
        limits[row, place], angles[row, place] = value, angle
        critical, where, lower = self._first(limits, angles, rate, pose, normal)
        frequency = where / (2 * np.pi * self.period)
        confirmed = np.isfinite(critical) & (critical > 0) & modes.complete[pose]
        for share, below in ((0.3, True), (0.999, True), (1.001, False)):
            which = np.flatnonzero(confirmed)
            inside = lower[which] + share * (critical[which] - lower[which])
            radius = self._radii(inside, rate[which], pose[which], normal[which])
            confirmed[which] = (radius < STABLE) == below
        confirmed |= (critical == 0) & modes.complete[pose]  # every interval was tested
        for i in np.flatnonzero(~confirmed):
            b = float(rate[i] * self.period)
            critical[i], frequency[i], lower[i] = self._single_loop(int(pose[i]), normal[i], b)
        return critical.reshape(count, d), frequency.reshape(count, d), lower.reshape(count, d)

    def _crossings(
        self, modes: _TipResponse, directions: Array, pose: NDArray[np.int64], normal: Array, rate: Array
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """Return (row, angle, stiffness), each (k,), of the roots on the unit circle of every loop and direction.

        Args:
            modes: response of the loops.
            directions: (n, d, 3).
            pose: index (n d,); normal: (n d, 3); rate: B/T (n d,).
        """
        count = len(pose)
        rows = np.arange(count)
        response = modes.everywhere(ANGLES, directions).reshape(count, -1)
        wall = 1 / response - rate[:, None] * (1 - np.exp(-1j * ANGLES))
        mismatch, stiffness = wall.imag, wall.real

        def evaluate(theta: Array, row: NDArray[np.int64]) -> tuple[Array, Array]:
            """Return (Im W - B Im V, Re W - B Re V): where the first is zero, the second is a stiffness."""
            value = 1 / modes.along(theta, pose[row], normal[row]) - rate[row] * (1 - np.exp(-1j * theta))
            return value.imag, value.real

        row, k = np.nonzero(mismatch[:, :-1] * mismatch[:, 1:] < 0)
        brackets = [(row, ANGLES[k], ANGLES[k + 1], mismatch[row, k], mismatch[row, k + 1])]
        # Between three angles with one sign the curve may cross zero twice: refine about local minima of its modulus.
        size = np.abs(mismatch)
        turns = (size[:, 1:-1] <= size[:, 2:]) & (size[:, 1:-1] <= size[:, :-2]) & (stiffness[:, 1:-1] > 0)
        turns &= (mismatch[:, 1:-1] * mismatch[:, 2:] > 0) & (mismatch[:, 1:-1] * mismatch[:, :-2] > 0)
        row, k = np.nonzero(turns)
        fine = ANGLES[k][:, None] + (ANGLES[k + 2] - ANGLES[k])[:, None] * np.linspace(0, 1, 17)
        refined = evaluate(fine.ravel(), np.repeat(row, 17))[0].reshape(-1, 17)
        i, k = np.nonzero(refined[:, :-1] * refined[:, 1:] < 0)
        brackets.append((row[i], fine[i, k], fine[i, k + 1], refined[i, k], refined[i, k + 1]))
        row, low, high, at_low, at_high = (np.concatenate(parts) for parts in zip(*brackets, strict=True))
        crossing = row
        angle, value = _roots(lambda theta, i: evaluate(theta, crossing[i]), low, high, at_low, at_high)
        for theta in (np.pi, 1e-7):  # roots at -1 and at 1 are real for every wall
            ends = np.full(count, theta)
            row, angle = np.concatenate([row, rows]), np.concatenate([angle, ends])
            value = np.concatenate([value, evaluate(ends, rows)[1]])
        return row, angle, value

    def _first(
        self, limits: Array, angles: Array, rate: Array, pose: NDArray[np.int64], normal: Array
    ) -> tuple[Array, Array, Array]:
        """Return the first stable interval of stiffness: upper end, its angle and lower end, each (k,).

        Stiffness in N/m, angle in rad per sample.

        Args:
            limits: stiffnesses with a root on the circle, (k, m), N/m, ascending, padded with inf.
            angles: angles of these roots, (k, m), rad per sample.
            rate: B/T, (k,).
            pose: index (k,).
            normal: (k, 3).
        """
        count = len(limits)
        result, where, start = np.zeros(count), np.full(count, np.nan), np.zeros(count)
        lower, inside, open_rows = np.zeros(count), np.zeros(count, dtype=bool), np.arange(count)
        for k in range(limits.shape[1] + 1):
            upper = limits[open_rows, k] if k < limits.shape[1] else np.full(len(open_rows), np.inf)
            middle = np.where(np.isfinite(upper), 0.5 * (lower[open_rows] + upper), 2 * lower[open_rows] + 1.0)
            stable = self._radii(middle, rate[open_rows], pose[open_rows], normal[open_rows]) < STABLE
            ended = inside[open_rows] & ~stable
            begun = open_rows[stable & ~inside[open_rows]]
            start[begun] = lower[begun]
            inside[open_rows] = stable
            result[open_rows[ended]] = lower[open_rows[ended]]
            if k:
                where[open_rows[ended]] = angles[open_rows[ended], k - 1]
            never = np.isinf(upper) & stable
            result[open_rows[never]] = np.inf
            lower[open_rows] = upper
            open_rows = open_rows[~ended & np.isfinite(upper)]
        return result, where, start

    def _radii(self, stiffness: Array, rate: Array, pose: NDArray[np.int64], normal: Array) -> Array:
        """Return the spectral radius (k,) against walls of K (k,), N/m, B/T (k,) and normal (k, 3) at poses (k,)."""
        a, entry, out = assemble_loop(self.plant, self.jacobian, self.geometric_stiffness, self.controller, self.delay)
        n = a.shape[-1]
        b, c = np.einsum("kij,kj->ki", entry[pose], normal), np.einsum("kij,ki->kj", out[pose], normal)
        closed = np.zeros((len(pose), n + 1, n + 1))
        force = np.concatenate([(stiffness + rate)[:, None] * c, -rate[:, None]], axis=1)
        closed[:, :n, :n] = a[pose]
        closed[:, :n, :] += b[:, :, None] * force[:, None, :]
        closed[:, n, :n] = c
        return np.asarray(np.abs(np.linalg.eigvals(closed)).max(axis=-1), dtype=float)

    def _single_loop(self, pose: int, direction: Array, damping: float) -> tuple[float, float, float]:
        """Return the critical stiffness, its frequency and the lower end for the observable part of one loop."""
        loop = self.subset(slice(pose, pose + 1))
        a, entry, out = (
            m[0]
            for m in assemble_loop(loop.plant, loop.jacobian, loop.geometric_stiffness, loop.controller, loop.delay)
        )
        a, b, c = observable_reduction(a, entry, out, direction[:, None])
        n = len(a)
        limit = stability_interval(
            wall_loop(SampledDevice(a - np.eye(n), -b[:, 0], np.zeros(n), c[0], 0, self.period)), damping
        )
        return limit.stiffness, limit.frequency, limit.min_stable_stiffness


class _TipResponse:
    """Response of the tips of the loops to the object's force at any angle."""

    def __init__(self, loops: PoseLoops) -> None:
        self.loops = loops
        self.plants = ModalResponse(*loops.plant)
        feedback = loops.controller.feedback
        self.controller = ModalResponse(feedback.A, feedback.B, feedback.C, feedback.D)
        self.complete = self.plants.complete & self.controller.complete

    def everywhere(self, theta: Array, directions: Array) -> Complex:
        """Return tip motion per object force along each direction, (n, d, k), m/N, at angles (k,), rad per sample."""
        z = np.exp(1j * theta)
        jacobian = self.loops.jacobian[:, None]
        compliance = self._closed(self.plants.grid(z), self.loops.geometric_stiffness[:, None], z[None, :])
        tip = jacobian @ compliance @ np.swapaxes(jacobian, -1, -2) @ self.controller.grid(z)
        count, d = directions.shape[:2]
        both = np.einsum("ndi,ndj->nijd", directions, directions).reshape(count, 9, d)
        return np.asarray(np.swapaxes(tip.reshape(*tip.shape[:2], 9) @ both, 1, 2), dtype=complex)

    def along(self, theta: Array, pose: NDArray[np.int64], direction: Array) -> Complex:
        """Return tip motion per force, (k,), m/N, for angles (k,), poses (k,) and directions (k, 3)."""
        z = np.exp(1j * theta)
        jacobian = self.loops.jacobian[pose]
        torque = np.swapaxes(jacobian, -1, -2) @ (self.controller.grid(z) @ direction[:, :, None])
        compliance = self._closed(self.plants.pairs(z, pose), self.loops.geometric_stiffness[pose], z) @ torque
        return np.asarray((direction[:, None, :] @ (jacobian @ compliance))[:, 0, 0], dtype=complex)

    def _closed(self, plant: Complex, geometric_stiffness: Array, z: Complex) -> Complex:
        """Return delayed joint angles per torque, with the geometric stiffness fed back."""
        delayed = (z**-self.loops.delay)[..., None, None] * plant
        return np.asarray(
            np.linalg.solve(np.eye(plant.shape[-1]) - delayed @ geometric_stiffness, delayed), dtype=complex
        )


def _roots(
    evaluate: Callable[[Array, NDArray[np.int64]], tuple[Array, Array]],
    low: Array,
    high: Array,
    at_low: Array,
    at_high: Array,
) -> tuple[Array, Array]:
    """Return (angle, value) at the sign changes of the first output of ``evaluate`` between low and high.

    All brackets are iterated at once by the Illinois method.
    """
    low, high, at_low, at_high = low.copy(), high.copy(), at_low.copy(), at_high.copy()
    angle, value = 0.5 * (low + high), np.full(low.shape, np.nan)
    live = np.arange(len(low))
    for iteration in range(80):
        if live.size == 0:
            break
        a, b, fa, fb = low[live], high[live], at_low[live], at_high[live]
        guess = (a * fb - b * fa) / (fb - fa)
        guess = np.where((guess > a) & (guess < b) & (iteration % 6 < 5), guess, 0.5 * (a + b))
        f, value[live] = evaluate(guess, live)
        angle[live] = guess
        left = f * fa > 0
        low[live], at_low[live] = np.where(left, guess, a), np.where(left, f, 0.5 * fa)
        high[live], at_high[live] = np.where(left, b, guess), np.where(left, 0.5 * fb, f)
        done = (np.abs(f) <= 1e-11 * np.abs(value[live])) | (high[live] - low[live] <= 4e-16 * high[live])
        live = live[~done]
    return angle, value
