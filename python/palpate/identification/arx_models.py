"""Multivariable ARX models with structure matrices: A(q) y(t) = B(q) u(t) + e(t) (Hosseini-Zadeh 2004, 3.17 to 3.23).

    y_k(t) = - sum over j, l = 1..na_kj of a_kj^l y_j(t - l)
             + sum over j, l = 1..nb_kj of b_kj^l u_j(t - nk_kj - l + 1) + e_k(t)

y are the joint angles and u the torques of a recording, both counted from their means. Each output is one linear least
squares problem, solved by QR.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from palpate.arrays import Array, Indices
from palpate.errors import RecordingError
from palpate.identification.recording import Recording

Orders = Indices


@dataclass(frozen=True)
class Fit:
    """Fit of a model to a recording, NRMSE in percent per output: 100 (1 - |y - yhat| / |y - mean y|).

    Attributes:
        one_step: each sample predicted from all measured before it.
        free_run: outputs from the inputs alone, the initial state chosen by least squares.
        free: (n, outputs) the free run itself, in the recording's units.
    """

    one_step: Array
    free_run: Array
    free: Array


@dataclass(frozen=True)
class ArxModel:
    """ARX model with its uncertainty.

    Attributes:
        na: (ny, ny) number of coefficients of each a_kj; nb: (ny, nu) of each b_kj; nk: (ny, nu) delays, samples.
        period: s.
        a: (ny, ny, 1 + max na) coefficients of q^0, q^-1, …; b: (ny, nu, max(nk + nb)) likewise.
        a_std: standard deviations of `a`, 0 where a coefficient is fixed by the structure; b_std likewise.
        covariance: per output, of its coefficients, a first, in the order of the structure.
        noise: (ny, ny) covariance of e, in the outputs' units squared.
        output_mean: (ny,) and input_mean: (nu,) working point.
        samples: number of equations per output.
    """

    na: Orders
    nb: Orders
    nk: Orders
    period: float
    a: Array
    b: Array
    a_std: Array
    b_std: Array
    covariance: tuple[Array, ...]
    noise: Array
    output_mean: Array
    input_mean: Array
    samples: int

    @property
    def count(self) -> int:
        """Number of estimated coefficients."""
        return int(self.na.sum() + self.nb.sum())

    @property
    def reach(self) -> int:
        """Samples of the past that a prediction needs."""
        return _reach(self.na, self.nb, self.nk)

    def to_statespace(self) -> control.StateSpace:
        """Return the model from u - input_mean to y - output_mean in observer form, sampled with `period`.

        Output k owns a chain of max(na_kj, nk_kj + nb_kj - 1) states; its first state is the output itself (before
        a coefficient without delay).
        """
        ny, nu = self.nb.shape
        past = np.maximum(self.na.max(axis=1), (self.nk + self.nb - 1).max(axis=1, where=self.nb > 0, initial=1))
        starts = np.concatenate([[0], np.cumsum(past)])
        n = int(starts[-1])
        c = np.zeros((ny, n))
        c[np.arange(ny), starts[:-1]] = 1.0
        d = self.b[:, :, 0]
        a, b = np.zeros((n, n)), np.zeros((n, nu))
        for k in range(ny):
            for lag in range(1, int(past[k]) + 1):
                row = starts[k] + lag - 1
                if lag < past[k]:
                    a[row, row + 1] = 1.0
                back = self.a[k, :, lag] if lag < self.a.shape[2] else np.zeros(ny)
                push = self.b[k, :, lag] if lag < self.b.shape[2] else np.zeros(nu)
                a[row] -= back @ c
                b[row] = push - back @ d
        return control.StateSpace(
            a,
            b,
            c,
            d,
            self.period,
            inputs=[f"torque[{j + 1}]" for j in range(nu)],
            outputs=[f"angle[{k + 1}]" for k in range(ny)],
        )

    def residuals(self, recording: Recording) -> Array:
        """Return the one-step prediction errors (n - reach, ny), rad. Raise RecordingError if the sampling differs."""
        y, u = self._deviations(recording)
        out = np.zeros((len(y) - self.reach, len(self.na)))
        for k in range(len(self.na)):
            columns = _columns(y, u, self.na[k], self.nb[k], self.nk[k], self.reach)
            out[:, k] = y[self.reach :, k] - columns @ self._row(k)
        return out

    def simulate(self, torque: Array, angle: Array | None = None) -> Array:
        """Return the free run (n, ny) from `torque` (n, nu); the initial state best fits `angle`, or is at rest."""
        system = self.to_statespace()
        a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
        n = a.shape[0]
        largest = float(np.abs(linalg.eigvals(a)).max())
        if largest > 1 and len(torque) * np.log(largest) > np.log(1e6):
            raise RecordingError(f"the model's free run diverges: its largest pole is {largest:.4g}")
        u = np.asarray(torque) - self.input_mean
        # One column is driven by the input from rest; the others are the free responses of the states.
        state = np.hstack([np.zeros((n, 1)), np.eye(n)])
        driven = u @ b.T
        out = np.empty((len(u), c.shape[0], n + 1))
        for t in range(len(u)):
            out[t] = c @ state
            state = a @ state
            state[:, 0] += driven[t]
        forced = out[:, :, 0] + u @ d.T
        if angle is None:
            return np.asarray(forced + self.output_mean, dtype=float)
        wanted = np.asarray(angle) - self.output_mean - forced
        first = np.linalg.lstsq(out[:, :, 1:].reshape(-1, n), wanted.ravel(), rcond=1e-10)[0]
        return np.asarray(forced + out[:, :, 1:] @ first + self.output_mean, dtype=float)

    def fit(self, recording: Recording) -> Fit:
        """Return the fit on a recording, if possible one not used for the estimate. Raise as `residuals`."""
        error = self.residuals(recording)
        spread = np.linalg.norm(recording.angle - recording.angle.mean(axis=0), axis=0)
        rest = np.linalg.norm((recording.angle - recording.angle.mean(axis=0))[self.reach :], axis=0)
        free = self.simulate(recording.torque, recording.angle)
        missed = np.linalg.norm(recording.angle - free, axis=0)
        one_step = 100 * (1 - np.linalg.norm(error, axis=0) / rest)
        return Fit(one_step, 100 * (1 - missed / spread), free)

    def coefficients(self) -> list[dict[str, Any]]:
        """Return every estimated coefficient: name, value, standard deviation."""
        rows = []
        for polynomial, values, spread, orders in (
            ("a", self.a, self.a_std, self.na),
            ("b", self.b, self.b_std, self.nb),
        ):
            for k, j in np.ndindex(*orders.shape):
                first = 1 if polynomial == "a" else int(self.nk[k, j])
                for place in range(first, first + int(orders[k, j])):
                    name = f"{polynomial}{k + 1}{j + 1}[{place}]"
                    rows.append({"name": name, "value": float(values[k, j, place]), "std": float(spread[k, j, place])})
        return rows

    def _deviations(self, recording: Recording) -> tuple[Array, Array]:
        if abs(recording.period - self.period) > 1e-6 * self.period:
            raise RecordingError(
                f"the model is sampled every {self.period:g} s but the recording every {recording.period:g} s; "
                "decimate both alike"
            )
        if recording.dof != len(self.na):
            raise RecordingError(f"the model has {len(self.na)} outputs but the recording {recording.dof} joints")
        return recording.angle - self.output_mean, recording.torque - self.input_mean

    def _row(self, k: int) -> Array:
        parts = [self.a[k, j, 1 : 1 + n] for j, n in enumerate(self.na[k])]
        parts += [self.b[k, j, d : d + n] for j, (n, d) in enumerate(zip(self.nb[k], self.nk[k], strict=True))]
        return np.concatenate(parts)


def arx(
    recording: Recording, na: ArrayLike, nb: ArrayLike, nk: ArrayLike, *, instruments: Recording | None = None
) -> ArxModel:
    """Return the ARX model from torques to angles.

    Args:
        recording: angles (outputs) and torques (inputs).
        na: (dof, dof) orders, or one number for a diagonal of it.
        nb: (dof, dof) orders, or one number for all.
        nk: (dof, dof) delays in samples, or one number for all.
        instruments: a recording of the same length whose regressors are free of this one's noise; without it the
            estimate is plain least squares, which noise on the angles biases. The standard deviations allow for errors
            that are not white; of slow, oversampled modes they are up to twice too large.

    Raises:
        RecordingError: orders of the wrong shape, too few samples, or too little excitation, naming the coefficient.
    """
    return _estimate(recording, recording.torque, _orders(na, nb, nk, recording.dof), instruments)


def arx_from_excitation(recording: Recording, na: int, nb: int) -> ArxModel:
    """Return the closed loop's model from the excitation to the angles, every output from every input.

    To first order, its free run is the measurement without noise, which is the source of instruments.

    Raises:
        RecordingError: the recording does not hold its excitation.
    """
    if recording.excitation is None:
        raise RecordingError("the recording does not hold its excitation")
    return _estimate(recording, recording.excitation, _orders(na, nb, 1, recording.dof), None)


def _estimate(
    recording: Recording, inputs: Array, orders: tuple[Orders, Orders, Orders], instruments: Recording | None
) -> ArxModel:
    """Return the model from `inputs` (n, dof) to the angles."""
    na, nb, nk = orders
    means = recording.angle.mean(axis=0), inputs.mean(axis=0)
    y, u = recording.angle - means[0], inputs - means[1]
    ny, nu = nb.shape
    reach = _reach(na, nb, nk)
    rows = len(y) - reach
    most = int((na.sum(axis=1) + nb.sum(axis=1)).max())
    if rows < 2 * most:
        raise RecordingError(
            f"{len(y)} samples are too few for {most} coefficients per output; {2 * most + reach} are needed"
        )
    a, b = np.zeros((ny, ny, 1 + na.max())), np.zeros((ny, nu, max(int((nk + nb).max()), 1)))
    a_std, b_std = np.zeros_like(a), np.zeros_like(b)
    a[:, :, 0] = np.eye(ny)
    errors = np.empty((rows, ny))
    covariance = []
    for k in range(ny):
        columns = _columns(y, u, na[k], nb[k], nk[k], reach)
        target = y[reach:, k]
        if instruments is None:
            value, inverse = _least_squares(columns, target, lambda i, k=k: _name(na[k], nb[k], nk[k], k, i))
            errors[:, k] = target - columns @ value
            covariance.append(float(errors[:, k] @ errors[:, k]) / (rows - len(value)) * inverse)
        else:
            z = _columns(
                instruments.angle - instruments.angle.mean(axis=0),
                instruments.torque - instruments.torque.mean(axis=0),
                na[k],
                nb[k],
                nk[k],
                reach,
            )
            value, spread = _instrumental(columns, target, z, lags=10 * int(na[k].max()))
            errors[:, k] = target - columns @ value
            covariance.append(spread)
        deviation = np.sqrt(np.diag(covariance[-1]))
        at = 0
        for j in range(ny):
            part = slice(at, at + na[k, j])
            a[k, j, 1 : 1 + na[k, j]], a_std[k, j, 1 : 1 + na[k, j]] = value[part], deviation[part]
            at += na[k, j]
        for j in range(nu):
            part = slice(at, at + nb[k, j])
            place = slice(nk[k, j], nk[k, j] + nb[k, j])
            b[k, j, place], b_std[k, j, place] = value[part], deviation[part]
            at += nb[k, j]
    freedom = rows - (na.sum(axis=1) + nb.sum(axis=1))
    noise = errors.T @ errors / np.sqrt(np.outer(freedom, freedom))
    return ArxModel(na, nb, nk, recording.period, a, b, a_std, b_std, tuple(covariance), noise, *means, rows)


def _orders(na: ArrayLike, nb: ArrayLike, nk: ArrayLike, dof: int) -> tuple[Orders, Orders, Orders]:
    out = []
    for name, given in (("na", na), ("nb", nb), ("nk", nk)):
        values = np.asarray(given)
        if values.ndim == 0:
            values = np.diag(np.full(dof, values)) if name == "na" else np.full((dof, dof), values)
        if values.shape != (dof, dof) or not np.issubdtype(values.dtype, np.integer) or values.min() < 0:
            raise RecordingError(f"{name} must be a {dof} x {dof} matrix of whole numbers, 0 or more, or one of them")
        out.append(values.astype(np.int64))
    if np.any(out[0].sum(axis=1) + out[1].sum(axis=1) == 0):
        raise RecordingError("an output without any coefficient cannot be modeled; raise na or nb in its row")
    return out[0], out[1], out[2]


def _reach(na: Orders, nb: Orders, nk: Orders) -> int:
    return int(max(na.max(), (nk + nb - 1).max(where=nb > 0, initial=1), 1))


def _columns(y: Array, u: Array, na: Orders, nb: Orders, nk: Orders, reach: int) -> Array:
    """Return the regressors of one output, (n - reach, coefficients)."""
    n = len(y)
    parts = [-y[reach - lag : n - lag, j] for j in range(len(na)) for lag in range(1, na[j] + 1)]
    parts += [u[reach - lag : n - lag, j] for j in range(len(nb)) for lag in range(nk[j], nk[j] + nb[j])]
    return np.column_stack(parts)


def _name(na: Orders, nb: Orders, nk: Orders, k: int, index: int) -> str:
    names = [f"a{k + 1}{j + 1}[{lag}]" for j in range(len(na)) for lag in range(1, na[j] + 1)]
    names += [f"b{k + 1}{j + 1}[{lag}]" for j in range(len(nb)) for lag in range(nk[j], nk[j] + nb[j])]
    return names[index]


def _least_squares(columns: Array, target: Array, name: Any) -> tuple[Array, Array]:
    """Return the solution and (X^T X)^-1, by QR of the scaled columns."""
    scale = np.linalg.norm(columns, axis=0)
    if np.any(scale == 0):
        raise RecordingError(f"too little excitation: nothing in the recording acts on {name(int(np.argmin(scale)))}")
    whole = np.asarray(np.linalg.qr(np.column_stack([columns / scale, target]), mode="r"), dtype=float)
    r, rest = whole[: len(scale), : len(scale)], whole[: len(scale), -1]
    diagonal = np.abs(np.diag(r))
    if diagonal.min() < 1e-10 * diagonal.max():
        raise RecordingError(
            f"too little excitation: {name(int(np.argmin(diagonal)))} cannot be distinguished from the others; "
            "excite more frequencies or lower the orders"
        )
    inverse = linalg.solve_triangular(r, np.eye(len(scale)))
    return inverse @ rest / scale, inverse @ inverse.T / np.outer(scale, scale)


def _instrumental(columns: Array, target: Array, z: Array, lags: int) -> tuple[Array, Array]:
    """Return the instrumental-variable solution and its covariance.

    Noise on the angles passes through A(q), so the equation's errors are not white: the covariance contains their
    autocorrelation up to `lags` samples, with the weights of Newey & West (1987), which keep it positive.
    """
    scale, size = np.linalg.norm(columns, axis=0), np.linalg.norm(z, axis=0)
    if np.any(scale == 0) or np.any(size == 0):
        raise RecordingError("too little excitation: a regressor of the model is zero throughout")
    cross = (z / size).T @ (columns / scale)
    if np.linalg.cond(cross) > 1e12:
        raise RecordingError("too little excitation: the instruments do not distinguish the coefficients")
    gain = np.linalg.solve(cross, (z / size).T) / scale[:, None]
    value = gain @ target
    error = target - columns @ value
    rows = len(error) - len(value)
    covariance = float(error @ error) / rows * gain @ gain.T
    for lag in range(1, min(lags, rows - 1) + 1):
        shifted = gain[:, lag:] @ gain[:, :-lag].T
        covariance += (1.0 - lag / (lags + 1.0)) * float(error[lag:] @ error[:-lag]) / rows * (shifted + shifted.T)
    return value, covariance
