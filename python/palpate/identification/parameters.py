"""Regression of inertia, gravity and friction of a device from one recording, with confidence intervals.

The weak form (weak_form.py) is linear in the base parameters (base.py) and the friction. It is solved with instrumental
variables computed from the excitation if the recording contains it, otherwise by least squares. Neighboring test
functions overlap and the noise is colored, so the covariance is that of correlated moments.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import stats

from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import DeviceError, RecordingError
from palpate.identification.base import Parameter, base_parameters, friction_parameters, with_base_values
from palpate.identification.device_file import write_fit
from palpate.identification.instruments import expected_angles
from palpate.identification.recording import Recording
from palpate.identification.weak_form import (
    TestFunctions,
    WeakRows,
    clear_rows,
    delay_column,
    slowest_speed,
    weak_rows,
)

Method = Literal["auto", "instruments", "least_squares"]

SINGULAR = 1e-6  # ratio of singular values of the scaled columns at rounding level
DELAY = Parameter("delay", "s", "delay of the torque", 0)
SIGNIFICANT = 4.0  # standard deviations above which a delay or a negative friction is not noise
BETTER = 2 / 3  # torque error without the rows at an end of a channel's range, below which the channel is clipped
EXACT = 0.5  # percent of the torque; a fit that leaves less needs no explanation
UNEXPLAINED = 10.0  # percent of a joint's torque; a fit that leaves more has much noise, or the wrong model
MAX_RELATIVE_STD = 0.1  # standard deviation over the joint torque above which a parameter is undetermined


@dataclass(frozen=True)
class ParameterFit:
    """Estimated parameters.

    Attributes:
        parameters: description of the parameters.
        value: (p,) SI.
        covariance: (p, p).
        level: confidence of `low` and `high`.
        method: "instruments" or "least_squares".
        condition: of the scaled columns; 1 is perfect, above some 100 the excitation is poor.
        undetermined: names of parameters whose uncertainty affects the torque.
        torque_error: (dof,) residual of the torque, rms, in percent.
        rows: number of test functions.
        freedom: degrees of freedom of Student's t for the intervals, the number of test functions without overlap, of
            the joint that has the fewest with a known direction of motion.
        template: device with the known lengths, and with the values to compare.
        file: of the recording, or "a recording".
        doubts: reasons why the intervals may not hold the true values, each a sentence; empty if there is none.
    """

    parameters: list[Parameter]
    value: Array
    covariance: Array
    level: float
    method: str
    condition: float
    undetermined: list[str]
    torque_error: Array
    rows: int
    freedom: float
    template: Device
    file: str
    doubts: tuple[str, ...] = ()

    @property
    def std(self) -> Array:
        """Standard deviations (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @property
    def half_width(self) -> Array:
        """Half the width of the confidence intervals (p,)."""
        return float(stats.t.ppf(0.5 + 0.5 * self.level, self.freedom)) * self.std

    @property
    def low(self) -> Array:
        """Lower ends of the confidence intervals (p,)."""
        return self.value - self.half_width

    @property
    def high(self) -> Array:
        """Upper ends of the confidence intervals (p,)."""
        return self.value + self.half_width

    def __getitem__(self, name: str) -> float:
        """Value of the parameter called `name`."""
        return float(self.value[[p.name for p in self.parameters].index(name)])

    def friction(self, letter: str, dof: int) -> Array:
        """Return viscous ("k") or Coulomb ("c") friction (dof,), 0 where it was not estimated."""
        names = [p.name for p in self.parameters]
        return np.array([self[f"{letter}{j + 1}"] if f"{letter}{j + 1}" in names else 0.0 for j in range(dof)])

    @property
    def device(self) -> Device:
        """Device with the estimated parameters; Coulomb friction whose interval includes 0 is 0.

        Raises:
            DeviceError: the parameters are those of no physical device.
        """
        dof = self.template.dof
        names = [p.name for p in self.parameters]
        low = np.array([self.low[names.index(f"c{j + 1}")] if "c1" in names else 0.0 for j in range(dof)])
        coulomb = np.where(low > 0, self.friction("c", dof), 0.0)
        base = self.value[: len(base_parameters(self.template))]
        return with_base_values(self.template, base, self.friction("k", dof), coulomb)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the device as a device file that a scenario can name, with the intervals as comments.

        Raises:
            DeviceError: the parameters are those of no physical device.
            OutputError: the file cannot be written.
        """
        lines = [
            f"Estimates with {100 * self.level:g} % intervals. The masses and inertias below are one choice that has",
            "these base parameters; no other choice moves differently.",
        ]
        for i, p in enumerate(self.parameters):
            interval = f"{self.low[i]:.4g} to {self.high[i]:.4g}"
            mark = "; not determined by this recording" if p.name in self.undetermined else ""
            lines.append(f"  {p.name:4}{self.value[i]:>12.4g}  {interval:>26}  {p.unit}, {p.meaning}{mark}")
        return write_fit(path, self.device, self.template, self.file, lines)


def estimate_parameters(
    recording: Recording,
    device: Device,
    *,
    coulomb: bool = True,
    method: Method = "auto",
    level: float = 0.95,
    tests: TestFunctions | None = None,
) -> ParameterFit:
    """Estimate base parameters and friction of a device from a recording.

    Args:
        recording: any trajectory that moves every joint.
        device: mechanism with known lengths; its masses, inertias, gravity and friction are not used.
        coulomb: estimate Coulomb friction too.
        method: "instruments" needs a recording with its excitation and a stable loop; "auto" uses them if possible,
            and least squares otherwise.
        level: confidence of the intervals.
        tests: test functions; None for the default ones.

    Raises:
        RecordingError: the recording belongs to another device, is too short, or has too little excitation.
    """
    if recording.dof != device.dof:
        raise RecordingError(f"the recording has {recording.dof} joints, {device.name} has {device.dof}")
    if not 0 < level < 1:
        raise RecordingError(f"the confidence level must lie between 0 and 1, not {level}")
    recording.require_excitation()
    functions = TestFunctions() if tests is None else tests
    parameters = base_parameters(device) + friction_parameters(device, coulomb)
    slowest = slowest_speed(recording, functions)
    rows = weak_rows(device, recording, functions, slowest=slowest)
    if len(rows.torque) * device.dof < 4 * len(parameters):
        raise RecordingError(
            f"{recording.duration:g} s are too short for {len(parameters)} parameters; record at least 5 s"
        )
    keep = _usable(rows, coulomb)
    for axis, count in enumerate(keep.sum(axis=0)):
        if count < 20:
            raise RecordingError(
                f"too little excitation: joint {axis + 1} moves in one direction faster than {slowest[axis]:.2g} "
                f"{recording.units[0]}/s for {functions.width:g} s only {count:.0f} times; move it more, or leave "
                "Coulomb friction out"
            )
    weight = _balance(rows.torque)
    columns, target = _stack(rows, weight, keep, len(parameters))
    condition = _check_excitation(columns, parameters)
    expected = None if method == "least_squares" else expected_angles(recording)
    z, known = columns, recording.torque
    if expected is not None and recording.excitation is not None:
        known = recording.excitation
        instrument_rows = weak_rows(device, recording, functions, angle=expected, slowest=slowest)
        z = _stack(instrument_rows, weight, keep, len(parameters))[0]
    elif method == "instruments":
        raise RecordingError("instruments need a recording that holds its excitation and a stable loop")
    chosen = "least_squares" if expected is None else "instruments"
    file = str(recording.metadata.get("file", "a recording"))
    fit = _solve(parameters, columns, z, target, functions, level, chosen, condition, device, file)
    doubts = _nonphysical(fit)
    late = [
        _append(c, delay_column(tau, recording.period, functions) * weight * keep)
        for c, tau in ((columns, recording.torque), (z, known))
    ]
    if _distinguished(late[0]):
        delayed = _solve(
            [*parameters, DELAY], late[0], late[1], target, functions, level, chosen, condition, device, file
        )
        doubts += _late_torque(fit, delayed)
    if expected is None:
        doubts += _loop_bias(fit, columns, target)
    trials = []
    for name, values in (("angle", recording.angle), ("torque", recording.torque)):
        marked = recording.at_end(values)
        clear = clear_rows(marked, recording.period, functions)
        kept = clear if name == "torque" else np.broadcast_to(clear.min(axis=1, keepdims=True), clear.shape)
        rest = None
        if np.all((keep * kept).sum(axis=0) >= 2 * len(parameters)):
            parts = columns * kept[:, :, None], z * kept[:, :, None], target * kept
            rest = _solve(parameters, *parts, functions, level, chosen, condition, device, file)
        if np.any(keep * kept < keep):
            trials.append((name, marked, rest))
    doubts += _clipped(fit, trials)
    return replace(fit, doubts=tuple(doubts or _unexplained(fit)))


def _append(columns: Array, column: Array) -> Array:
    return np.concatenate([columns, column[:, :, None]], axis=2)


def _nonphysical(fit: ParameterFit) -> list[str]:
    """Return the doubt about estimates that no device has: friction or inertia below zero."""
    friction = [p.name[0] in "kc" and p.name[1:].isdigit() for p in fit.parameters]
    negative = friction & (fit.value < -SIGNIFICANT * fit.std)
    below = [p.name for p, one in zip(fit.parameters, negative, strict=True) if one]
    said = f"the friction {', '.join(below)} is negative" if below else ""
    try:
        _ = fit.device
    except DeviceError:
        said = "the inertia matrix is not positive definite" + (f" and {said}" if said else "")
    except RecordingError:  # a device without gravity, whose masses are not of interest here
        pass
    if not said:
        return []
    return [f"No device has these parameters: {said}. Check the signs of angles and torques, and the time stamps."]


def _unexplained(fit: ParameterFit) -> list[str]:
    """Return the doubt about joints whose torque the model does not explain; noise alone is part of the intervals."""
    much = [(j + 1, left) for j, left in enumerate(fit.torque_error) if left > UNEXPLAINED]
    if not much:
        return []
    shares = ", ".join(f"{left:.0f} % of the torque of joint {joint}" for joint, left in much)
    return [
        f"The fit leaves {shares} unexplained. The intervals hold if that is noise. They do not if an angle or a "
        "torque has another unit or zero than stated, or the device moves otherwise than its model."
    ]


def _late_torque(fit: ParameterFit, delayed: ParameterFit) -> list[str]:
    """Return the doubt about a torque that acts before or after its sample, if that moves a parameter noticeably."""
    delay, half = float(delayed.value[-1]), float(delayed.half_width[-1])
    moved = np.abs(delayed.value[:-1] - fit.value) > 0.5 * fit.half_width
    if abs(delay) < SIGNIFICANT * float(delayed.std[-1]) or not moved.any():
        return []
    names = ", ".join(p.name for p, off in zip(fit.parameters, moved, strict=True) if off)
    when = "after" if delay > 0 else "before"
    return [
        f"The torque acts {1e3 * abs(delay):.3g} ± {1e3 * half:.2g} ms {when} its time stamp, as far as the motion "
        f"shows. Shift the recorded torque by that time; until then the intervals of {names} do not hold."
    ]


def _clipped(fit: ParameterFit, trials: list[tuple[str, Array, ParameterFit | None]]) -> list[str]:
    """Return the doubt about a channel that stands at an end of its range, if the fit is better without those rows.

    A drive that saturates as recorded leaves the fit as it is.

    Args:
        fit: of all rows.
        trials: name of a channel, its samples at an end (n, dof), and the fit without them; None: too few rows remain.
    """

    def stands(name: str, marked: Array) -> str:
        joints = ", ".join(str(j + 1) for j in np.flatnonzero(marked.any(axis=0)))
        return f"The recorded {name} of joint {joints} stands at an end of its range in {100 * marked.mean():.2g} %"

    better = [
        (rest.torque_error / fit.torque_error, name, marked, rest) for name, marked, rest in trials if rest is not None
    ]
    if better:
        share, name, marked, rest = min(better, key=lambda one: float(one[0].min()))
        j = int(np.argmin(share))
        if share[j] < BETTER and fit.torque_error[j] > EXACT:
            return [
                f"{stands(name, marked)} of the samples. Without them the fit leaves {rest.torque_error[j]:.2g} % of "
                f"the torque of joint {j + 1} in place of {fit.torque_error[j]:.2g} %: the recording is clipped, or "
                "the joint was at a stop. The intervals may not hold; record a larger range."
            ]
    return [
        f"{stands(name, marked)} of the samples, and too few others remain to show whether it is clipped there; record "
        "a larger range."
        for name, marked, rest in trials
        if rest is None
    ]


def _loop_bias(fit: ParameterFit, columns: Array, target: Array) -> list[str]:
    """Return the doubt about least squares in a closed loop, whose bias is no part of the intervals.

    The torque that the fit does not explain bounds the noise. The bias is at most the noise's share of the power.
    """
    bias = (fit.torque_error / 100) ** 2
    reach = fit.half_width * np.sqrt(np.mean(columns**2, axis=0)) / _size(target)[:, None]
    used = np.any(columns != 0, axis=0)
    hidden = np.any(used & (reach < bias[:, None]), axis=0)
    if not hidden.any():
        return []
    names = ", ".join(p.name for p, small in zip(fit.parameters, hidden, strict=True) if small)
    return [
        f"The recording holds no excitation, and the fit leaves {fit.torque_error.max():.0f} % of a joint's torque. "
        f"If a servo closed the loop, the estimates of {names} may be biased by more than their intervals; record the "
        "excitation."
    ]


def _distinguished(columns: Array) -> bool:
    """Return whether no column depends on the others."""
    singular, _ = _singular(columns)
    return bool(singular[-1] > SINGULAR * singular[0])


def _singular(columns: Array) -> tuple[Array, Array]:
    """Return the singular values of the scaled columns, and their directions by row."""
    flat = columns.reshape(-1, columns.shape[2])
    _, singular, directions = np.linalg.svd(np.linalg.qr(flat / np.linalg.norm(flat, axis=0), mode="r"))
    return singular, directions


def _solve(
    parameters: list[Parameter],
    columns: Array,
    z: Array,
    target: Array,
    tests: TestFunctions,
    level: float,
    method: str,
    condition: float,
    device: Device,
    file: str,
) -> ParameterFit:
    """Return the parameters p with target (rows, dof) = columns (rows, dof, p) p, for the instruments z."""
    size = np.sqrt(np.sum(columns**2, axis=(0, 1)))
    columns, z = columns / size, z / size
    value = np.zeros(len(parameters))
    for _ in range(2):  # the second pass weights joints by the residuals of the first
        error = target - columns @ value
        joint = np.sqrt(np.mean(error**2, axis=0))
        joint = np.where(joint > 0, joint, 1.0)
        cross = np.einsum("rip,riq,i->pq", z, columns, joint**-2)
        value = np.linalg.solve(cross, np.einsum("rip,ri,i->p", z, target, joint**-2))
    error = target - columns @ value
    moments = np.einsum("rip,ri,i->rp", z, error, joint**-2)
    used = float(np.any(columns != 0, axis=2).sum(axis=0).min())  # test functions of the joint with the fewest
    spread = long_run_covariance(moments, tests) * used / max(used - len(value) / len(joint), 1.0)
    inverse = np.linalg.inv(cross)
    covariance = inverse @ spread @ inverse.T
    relative_std = np.sqrt(np.diag(covariance))[None] * np.sqrt(np.mean(columns**2, axis=0)) / _size(target)[:, None]
    undetermined = [
        p.name for p, most in zip(parameters, relative_std.max(axis=0), strict=True) if most > MAX_RELATIVE_STD
    ]
    return ParameterFit(
        parameters,
        value / size,
        covariance / np.outer(size, size),
        level,
        method,
        condition,
        undetermined,
        100 * np.sqrt(np.mean(error**2, axis=0)) / _size(target),
        len(error),
        used / (2 * _overlap(tests)),
        device,
        file,
    )


def _size(target: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((target - target.mean(axis=0)) ** 2, axis=0)), dtype=float)


def _balance(torque: Array) -> Array:
    """Return weights (dof,) that make the joints' torques equally large."""
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.asarray(1.0 / np.where(size > 0, size, 1.0), dtype=float)


def _usable(rows: WeakRows, coulomb: bool) -> Array:
    """Return (rows, dof) 1 or 0: with dry friction, only test functions with one direction of motion.

    A sticking joint balances any torque and carries no information; at a reversal the speed is smoothed.
    """
    return rows.moving if coulomb else np.ones_like(rows.moving)


def _stack(rows: WeakRows, weight: Array, keep: Array, count: int) -> tuple[Array, Array]:
    scale = weight * keep
    return rows.columns[:, :, :count] * scale[:, :, None], rows.torque * scale


def _check_excitation(columns: Array, parameters: list[Parameter]) -> float:
    """Return the condition of the scaled columns. Raise RecordingError, naming dependent parameters."""
    flat = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(flat, axis=0)
    still = [p.name for p, s in zip(parameters, size, strict=True) if s <= 1e-12 * size.max()]
    if still:
        raise RecordingError(
            f"too little excitation: no motion depends on {', '.join(still)}; move every joint by some tenths of a "
            "radian"
        )
    singular, directions = _singular(columns)
    if singular[-1] < SINGULAR * singular[0]:
        mixed = [p.name for p, share in zip(parameters, np.abs(directions[-1]), strict=True) if share > 0.2]
        raise RecordingError(
            f"too little excitation: the recording does not distinguish {', '.join(mixed)}; change the pose more, with "
            "all joints at once and out of phase"
        )
    return float(singular[0] / singular[-1])


def long_run_covariance(moments: Array, tests: TestFunctions) -> Array:
    """Return the covariance of the sum of correlated `moments` (rows, p).

    Lags with overlapping test functions have full weight, which falls to zero at three times that lag (Politis & Romano
    1995). If the result is not positive definite, triangular weights (Newey & West 1987) are used.
    """
    overlap = min(_overlap(tests), len(moments) // 12)
    flat, falling = (np.zeros((moments.shape[1], moments.shape[1])) for _ in range(2))
    for lag in range(3 * overlap):
        part = moments[lag:].T @ moments[: len(moments) - lag]
        part = part if lag == 0 else part + part.T
        flat += min(1.0, 1.5 - lag / (2 * overlap)) * part
        falling += (1 - lag / (3 * overlap)) * part
    scale = np.sqrt(np.diag(falling))
    return flat if np.linalg.eigvalsh(flat / np.outer(scale, scale)).min() > 0.01 else falling


def _overlap(tests: TestFunctions) -> int:
    """Return the number of test functions that overlap with one, on one side."""
    return max(1, round(tests.width / tests.spacing))


def summary_rows(fit: ParameterFit, catalog: Array | None = None) -> list[dict[str, Any]]:
    """Return one row per parameter: name, meaning, unit, value, interval, and the catalog's value if given."""
    rows = []
    for i, p in enumerate(fit.parameters):
        row: dict[str, Any] = {
            "name": p.name,
            "meaning": p.meaning,
            "unit": p.unit,
            "value": float(fit.value[i]),
            "low": float(fit.low[i]),
            "high": float(fit.high[i]),
            "determined": p.name not in fit.undetermined,
        }
        if catalog is not None:
            row["catalog"] = float(catalog[i])
            row["inside"] = bool(fit.low[i] <= catalog[i] <= fit.high[i])
            row["error_percent"] = float(100 * (fit.value[i] / catalog[i] - 1)) if catalog[i] else None
        rows.append(row)
    return rows
