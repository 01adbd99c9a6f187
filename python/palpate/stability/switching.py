"""Stability of a loop whose contact switches or varies at will: x_{k+1} = A(k) x_k, with A in a set of matrices.

A common quadratic Lyapunov function, A^T P A < P for every A of the set, proves that x^T P x decays in whatever order
they act. It then also decays for every matrix in their convex hull. A bounded input, such as the step of a force at a
change of mode, leaves the state bounded. Without P, each matrix's own Lyapunov matrix gives a dwell time: the state
decays if the matrix changes no more often (Liberzon, Switching in Systems and Control, 2003).

The set is a union of sectors. In each, a normal force w = kappa y answers the motion y = c x of the tip, with any
stiffness kappa in [low, high]. A force along the surface of at most mu |w| acts in any direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky, solve_discrete_lyapunov, solve_triangular

from palpate.arrays import Array

__all__ = [
    "CommonLyapunov",
    "DwellTime",
    "Sector",
    "common_lyapunov",
    "decrease",
    "dwell_time",
    "has_solver",
    "strongest_lyapunov",
]

MARGIN = 1e-7  # least decrease of x^T P x in a step, relative to x^T P x, that counts as verified
ROUNDS = 3  # of the solver, each with the sectors that the last P violates
ADDED = 2  # sectors added in a round
LARGEST = 20  # states above which the solver takes too long
PAIRS = 5e8  # multiplications above which a dwell time uses the Frobenius norm, which exceeds the spectral norm


@dataclass(frozen=True, eq=False)
class Sector:
    """Loops A(kappa, u) = base + (normal kappa + tangent mu kappa u) row, with low <= kappa <= high and |u| <= 1.

    Attributes:
        name: the contact, in words.
        base: loop without this force (n, n).
        normal: input of the normal force (n,).
        tangent: inputs of the force along the surface (n, m).
        row: motion of the tip along the normal (n,).
        low: least stiffness, N/m; high: largest.
        friction: mu.
    """

    name: str
    base: Array
    normal: Array
    tangent: Array
    row: Array
    low: float
    high: float
    friction: float

    def matrices(self, corners: int) -> Array:
        """Return matrices whose convex hull contains the sector: a polygon about the disk of u, (., n, n)."""
        disk = np.zeros((1, self.tangent.shape[1]))
        if self.friction > 0.0 and disk.shape[1] == 2:
            angle = 2.0 * np.pi * np.arange(corners) / corners
            disk = np.stack([np.cos(angle), np.sin(angle)], axis=1) / np.cos(np.pi / corners)
        inputs = self.normal + self.friction * disk @ self.tangent.T
        stiffness = np.array(sorted({self.low, self.high}))
        return np.asarray(self.base + (stiffness[:, None, None] * inputs)[..., None] * self.row).reshape(
            -1, *self.base.shape
        )

    def transformed(self, into: Array, back: Array) -> Sector:
        """Return the sector in other coordinates: x' = into x, x = back x'."""
        return Sector(
            self.name, into @ self.base @ back, into @ self.normal, into @ self.tangent, self.row @ back,
            self.low, self.high, self.friction,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class CommonLyapunov:
    """Common quadratic Lyapunov function of several sectors.

    Attributes:
        matrix: P (n, n), positive definite.
        decrease: least relative decrease of x^T P x in one step, over all sectors.
        solved: whether an optimizer found P; otherwise it is a sum of single Lyapunov matrices.
    """

    matrix: Array
    decrease: float
    solved: bool


@dataclass(frozen=True)
class DwellTime:
    """Shortest mean time between changes of the matrix for which the state is proven to decay.

    Attributes:
        samples: the dwell time, in samples.
        pair: indices of the two matrices that require it.
    """

    samples: float
    pair: tuple[int, int]


def has_solver() -> bool:
    """Return whether the optional solver of linear matrix inequalities, Clarabel, is installed."""
    try:
        import clarabel  # noqa: F401
    except ImportError:
        return False
    return True


def decrease(matrices: ArrayLike, p: Array) -> Array:
    """Return the least relative decrease of x^T P x under each of the matrices (m, n, n), (m,).

    It is computed in coordinates in which P is the identity: 1 - sigma_max(R A R^-1)^2 with P = R^T R. A value is -inf
    if P is not positive definite.
    """
    a = np.asarray(matrices, dtype=float)
    try:
        r = cholesky(0.5 * (p + p.T))
    except np.linalg.LinAlgError:
        return np.full(len(a), -np.inf)
    inverse = solve_triangular(r, np.eye(len(r)))
    return np.asarray(1.0 - np.linalg.norm(r @ a @ inverse, 2, axis=(1, 2)) ** 2, dtype=float)


def common_lyapunov(sectors: Sequence[Sector], corners: int) -> CommonLyapunov | None:
    """Return a common quadratic Lyapunov function of sectors, verified at their matrices; None: not found.

    Sums of single Lyapunov matrices are tried first, then linear matrix inequalities if Clarabel is installed.
    """
    groups = [sector.matrices(corners) for sector in sectors]
    every = np.concatenate(groups)
    if np.abs(np.linalg.eigvals(every)).max() >= 1.0:
        return None
    p = _summed(groups)
    if p is None:
        return None
    worst = float(decrease(every, p).min())
    if worst > MARGIN:
        return CommonLyapunov(p, worst, False)
    if not has_solver() or len(p) > LARGEST:
        return None
    found = _solve(sectors, groups, p, corners)
    return None if found is None else CommonLyapunov(found, float(decrease(every, found).min()), True)


def strongest_lyapunov(matrices: ArrayLike) -> Array | None:
    """Return P whose x^T P x decreases most, relative to |x|^2, under each of the matrices (m, n, n); None: not found.

    It needs Clarabel, and is to be verified with `decrease`.
    """
    a = np.asarray(matrices, dtype=float)
    n = a.shape[-1]
    none = np.zeros(n)
    return _inequalities([Sector("", one, none, np.zeros((n, 0)), none, 0.0, 0.0, 0.0) for one in a], 4, 1e-4)


def dwell_time(matrices: ArrayLike) -> DwellTime | None:
    """Return the dwell time of the matrices (m, n, n) from their own Lyapunov matrices; None if one is unstable.

    Each V_i = x^T P_i x decays by q_i in a step, and V_j <= mu_ij V_i at a change from i to j. The state decays if each
    matrix i acts longer than log(max_j mu_ij) / -log(q_i) samples on average.
    """
    a = np.asarray(matrices, dtype=float)
    count, n = len(a), a.shape[-1]
    roots, inverses, rates = np.zeros_like(a), np.zeros_like(a), np.zeros(count)
    for i, one in enumerate(a):
        p = _own_lyapunov(one)
        if p is None or not (shrinks := float(decrease(one[None], p)[0])) > 0.0:
            return None
        roots[i] = cholesky(p)
        inverses[i] = solve_triangular(roots[i], np.eye(n))
        rates[i] = -np.log1p(-min(shrinks, 1.0 - 1e-16))
    worst = DwellTime(0.0, (0, 0))
    spectral = count**2 * n**3 < PAIRS
    for i in range(count):
        change = roots @ inverses[i]
        size = np.linalg.norm(change, 2 if spectral else "fro", axis=(1, 2))
        growth = 2.0 * np.log(np.maximum(size, 1.0))
        growth[i] = 0.0
        j = int(np.argmax(growth))
        if growth[j] / rates[i] > worst.samples:
            worst = DwellTime(float(growth[j] / rates[i]), (i, j))
    return worst


def _own_lyapunov(matrix: Array) -> Array | None:
    """Return P > 0 whose x^T P x decays at nearly the rate of the slowest eigenvalue; None if that grows."""
    radius = float(np.abs(np.linalg.eigvals(matrix)).max())
    if radius >= 1.0:
        return None
    bound = 0.5 * (1.0 + radius)  # of the decay that P shows
    p = np.asarray(solve_discrete_lyapunov(matrix.T / bound, np.eye(len(matrix)), method="bilinear"), dtype=float)
    p = 0.5 * (p + p.T)
    return p if np.all(np.isfinite(p)) and np.linalg.eigvalsh(p)[0] > 0.0 else None


def _summed(groups: Sequence[Array], passes: int = 12) -> Array | None:
    """Return a sum of Lyapunov matrices of the mean matrix of each group, with weights raised where it decays least."""
    own = [_own_lyapunov(group.mean(axis=0)) for group in groups]
    known = [one / np.trace(one) for one in own if one is not None]
    if len(known) < len(own):
        return None
    p = np.asarray(sum(known), dtype=float)
    best, value = p, -np.inf
    for turn in range(passes):
        shrinks = [float(decrease(group, p).min()) for group in groups]
        i = int(np.argmin(shrinks))
        if shrinks[i] > value:
            best, value = p, shrinks[i]
        if value > MARGIN:
            break
        p = p / np.trace(p) + known[i] / (turn + 2.0)
    return best


def _solve(sectors: Sequence[Sector], groups: Sequence[Array], start: Array, corners: int) -> Array | None:
    """Return P from linear matrix inequalities on the violated sectors, in coordinates in which ``start`` is I."""
    try:
        r = cholesky(start)
    except np.linalg.LinAlgError:  # states of too different size
        return None
    inverse = solve_triangular(r, np.eye(len(r)))
    scaled = [sector.transformed(r, inverse) for sector in sectors]
    used: list[int] = []
    p = np.eye(len(r))
    for _ in range(ROUNDS):
        shrinks = np.array([decrease(group, r.T @ p @ r).min() for group in groups])
        if shrinks.min() > MARGIN:
            return np.asarray(r.T @ p @ r, dtype=float)
        fresh = [int(i) for i in np.argsort(shrinks) if int(i) not in used and shrinks[i] <= MARGIN][:ADDED]
        if not fresh:
            return None
        used += fresh
        found = _inequalities([scaled[i] for i in used], corners)
        if found is None:
            return None
        p = found
    return None


def _inequalities(sectors: Sequence[Sector], corners: int, gap: float = 1e-2) -> Array | None:
    """Return P <= I that maximizes t, with x^T P x decreasing by t |x|^2 in every sector; None if t is not positive.

    With the forces w (normal) and v (tangential) of a sector, the S-procedure requires for some a, b >= 0

        V(A x + B [w, v]) - V(x) + a (w - low y)(high y - w) + b (mu^2 w^2 - |v|^2) <= -t |x|^2.

    The disk of friction is that about the polygon of ``corners`` corners. ``gap`` is the solver's tolerance.
    """
    import clarabel
    from scipy import sparse

    n = len(sectors[0].base)
    basis, count = _symmetric_basis(n)
    blocks, right, cones = [], [], []
    width = count + 1 + 2 * len(sectors)  # P, t, and the multipliers a, b
    for index, sector in enumerate(sectors):
        joint, signs = _quadratics(replace(sector, friction=sector.friction / np.cos(np.pi / corners)))
        m = joint.shape[1]
        change = np.zeros((count, m, m))
        change[:, :n, :n] = basis
        change -= joint.T @ basis @ joint
        block = np.zeros((m * (m + 1) // 2, width))
        block[:, :count] = -_packed(change).T
        eye = np.zeros((m, m))
        eye[:n, :n] = np.eye(n)
        block[:, count] = _packed(eye)
        for i, sign in enumerate(signs):
            block[:, count + 1 + 2 * index + i] = _packed(sign)
        blocks.append(block)
        right.append(np.zeros(len(block)))
        cones.append(clarabel.PSDTriangleConeT(m))
    bound = np.zeros((n * (n + 1) // 2, width))
    bound[:, :count] = _packed(basis).T
    positive = np.zeros((2 * len(sectors), width))
    positive[:, count + 1 :] = -np.eye(2 * len(sectors))
    blocks += [bound, positive]
    right += [_packed(np.eye(n)), np.zeros(len(positive))]
    cones += [clarabel.PSDTriangleConeT(n), clarabel.NonnegativeConeT(len(positive))]
    cost = np.zeros(width)
    cost[count] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = gap  # P is verified without the solver
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((width, width)), cost, sparse.csc_matrix(np.vstack(blocks)), np.concatenate(right), cones,
        settings,
    )  # fmt: skip
    x = np.asarray(solver.solve().x)
    if not np.all(np.isfinite(x)) or x[count] <= 0.0:
        return None
    return np.asarray(np.tensordot(x[:count], basis, 1), dtype=float)


def _quadratics(sector: Sector) -> tuple[Array, list[Array]]:
    """Return [A, B] (n, n + m) from state and forces to the next state, and the forms a and b of the S-procedure.

    The forces are in units of the force that a state of size 1 meets. Without a range of stiffness or without friction,
    the force and its multiplier are left out.
    """
    s, n = sector, len(sector.base)
    unit = s.high * float(np.linalg.norm(s.row)) or 1.0
    ranged, rubs = s.high > s.low, s.friction > 0.0 and s.tangent.shape[1] > 0
    base = s.base if ranged else s.base + s.high * np.outer(s.normal, s.row)
    joint = np.hstack([base, unit * s.normal[:, None] * ranged, unit * s.tangent * rubs])
    joint = joint[:, [*range(n), *([n] if ranged else []), *(range(n + 1, joint.shape[1]) if rubs else [])]]
    m = joint.shape[1]
    motion, force = np.zeros(m), np.zeros(m)
    motion[:n] = s.row / unit
    if ranged:
        force[n] = 1.0
    else:
        force = s.high * motion
    first, second = np.zeros((m, m)), np.zeros((m, m))
    if ranged:
        outer = np.outer(force - s.low * motion, s.high * motion - force)
        first = 0.5 * (outer + outer.T)
    if rubs:
        second = s.friction**2 * np.outer(force, force)
        tail = np.arange(n + ranged, m)
        second[tail, tail] -= 1.0
    return joint, [first, second]


def _symmetric_basis(n: int) -> tuple[Array, int]:
    """Return a basis of the symmetric matrices (k, n, n), and k."""
    rows, columns = np.triu_indices(n)
    basis = np.zeros((len(rows), n, n))
    basis[np.arange(len(rows)), rows, columns] = basis[np.arange(len(rows)), columns, rows] = 1.0
    return basis, len(rows)


def _packed(matrix: Array) -> Array:
    """Return the upper triangle of symmetric matrices (..., n, n), column by column, as the solver packs it."""
    rows, columns = np.triu_indices(matrix.shape[-1])
    order = np.lexsort((rows, columns))
    rows, columns = rows[order], columns[order]
    return np.asarray(matrix[..., rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0)), dtype=float)
