"""Recording of an experiment: joint angles and torques, uniformly sampled and checked.

The encoder read `angle[k]` at `time[k]`. The command `torque[k]` was held from `time[k]` to `time[k + 1]` (zero-order
hold). Units are rad and N*m, or m and N for a sliding device.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import signal

from palpate.arrays import Array
from palpate.errors import OutputError, RecordingError
from palpate.files import HDF5_SIGNATURE, as_path, atomic_write, begins_with, check_readable
from palpate.identification.csv_file import read_csv, write_csv
from palpate.identification.hdf5_file import read_hdf5, write_hdf5
from palpate.identification.samples import JITTER, MINIMUM_SAMPLES, Columns, as_columns, check_samples, uniform_period

FEW_VALUES = 10  # different angles, up to which a jump over half of the range may be one count
JUMP = 10  # times the 90 % quantile of the steps, above which a step is no noise
STANDS = 3  # samples in a row at the end of a channel's range, above which the channel may be clipped


@dataclass(frozen=True)
class Recording(Columns):
    """Angles and torques of one experiment.

    Attributes:
        time: (n,), s, uniform.
        angle: (n, dof), rad or m, as the encoder read it at `time[k]`.
        torque: (n, dof), N*m or N, the command held over [time[k], time[k+1]).
        period: s; 0 or less selects the period of `time`.
        metadata: anything that JSON can hold: device, seed, servo, source.
        excitation: (n, dof), known part of the torque that does not depend on the measurement, or None.
        units: unit of the angle and unit of the torque.

    Raises:
        RecordingError: wrong shape, fewer than 50 samples, a sample that is not finite, a repeated or decreasing time
            stamp, a gap, or sampling that is not uniform.
    """

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=float)
        angle = as_columns(self.angle, "angle")
        torque = as_columns(self.torque, "torque")
        if time.ndim != 1 or len(angle) != len(time) or len(torque) != len(time):
            raise RecordingError(
                f"time, angle and torque must have one row per sample; they have shapes "
                f"{time.shape}, {angle.shape}, {torque.shape}"
            )
        if angle.shape[1] != torque.shape[1]:
            raise RecordingError(
                f"angle has {angle.shape[1]} columns and torque {torque.shape[1]}; each joint needs one of both"
            )
        excitation = None if self.excitation is None else as_columns(self.excitation, "excitation")
        if excitation is not None and excitation.shape != torque.shape:
            raise RecordingError(f"excitation has shape {excitation.shape}; it must be that of torque, {torque.shape}")
        check_samples(time, {"angle": angle, "torque": torque, "excitation": excitation}, "sample {}".format)
        median = float(np.median(np.diff(time)))
        for name, values in (("time", time), ("angle", angle), ("torque", torque), ("excitation", excitation)):
            object.__setattr__(self, name, values)
        if not np.isfinite(self.period):
            raise RecordingError(f"the period is {self.period} s; it must be a positive number of seconds")
        if self.period <= 0:
            object.__setattr__(self, "period", uniform_period(time))
        elif abs(self.period - median) > JITTER * self.period:
            raise RecordingError(
                f"the period is said to be {self.period:g} s but the time stamps are {median:g} s apart"
            )

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.angle.shape[1])

    @property
    def duration(self) -> float:
        """Length in s, last hold included."""
        return len(self.time) * self.period

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Recording:
        """Read a recording from CSV or HDF5.

        CSV has a header with units, `time [s], theta1 [rad], ..., tau1 [N*m]`. HDF5 has `time`, `angle` and `torque`
        with a `unit` attribute each, at the root or under `channels`.

        Raises:
            RecordingError: the message names the file and the line, sample or channel.
        """
        file = check_readable(path, RecordingError, kind="the recording's file")
        if begins_with(file, HDF5_SIGNATURE):
            columns = read_hdf5(file)
            try:
                return cls(**vars(columns))
            except RecordingError as error:
                raise RecordingError(f"{file}: {error}") from None
        if file.suffix.lower() in {".h5", ".hdf5"}:
            raise RecordingError(f"{file}: this is not an HDF5 file, though its name says so")
        return cls(**vars(read_csv(file)))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a `.csv` or `.h5` file atomically; return the path."""
        file = as_path(path, OutputError)
        suffix = file.suffix.lower()
        if suffix not in {".csv", ".h5", ".hdf5"}:
            raise RecordingError(f"{file}: a recording is saved as .csv or .h5, not as '{file.suffix}'")
        if suffix == ".csv":
            return atomic_write(file, lambda part: write_csv(self, part))
        return write_hdf5(self, file)

    def split(self, fraction: float = 0.7) -> tuple[Recording, Recording]:
        """Return the first `fraction` of the samples, to estimate from, and the rest, to validate on."""
        cut = round(len(self) * fraction)
        if not 0.0 < fraction < 1.0 or min(cut, len(self) - cut) < MINIMUM_SAMPLES:
            raise RecordingError(
                f"a split at {fraction:g} of {len(self)} samples leaves a part with fewer than {MINIMUM_SAMPLES}"
            )
        return self.slice(0, cut), self.slice(cut, len(self))

    def slice(self, start: int, stop: int) -> Recording:
        """Return the samples `start` to `stop` - 1 as a recording with the same time axis."""
        part = slice(start, stop)
        return replace(
            self,
            time=self.time[part],
            angle=self.angle[part],
            torque=self.torque[part],
            metadata=dict(self.metadata),
            excitation=None if self.excitation is None else self.excitation[part],
        )

    def decimate(self, factor: int) -> Recording:
        """Return every `factor`-th sample, after the same zero-phase low-pass on angle and torque.

        Equal filters leave a linear relation between angle and torque unchanged. The torque is filtered as the mean
        of the holds at each sample, so the half period of the hold does not become a delay.
        """
        if factor < 1:
            raise RecordingError(f"a recording is decimated by 1 or more, not by {factor}")
        if factor == 1:
            return self
        taps = signal.firwin(20 * factor + 1, 0.8 / factor, window="hamming")
        half = 10 * factor
        if len(self) <= 2 * half + MINIMUM_SAMPLES * factor:
            raise RecordingError(f"{len(self)} samples are too short to decimate by {factor}")
        keep = slice(half, len(self) - half, factor)

        def lowpass(values: Array) -> Array:
            trend = values.mean(axis=0)
            smooth = signal.oaconvolve(values - trend, taps[:, None], mode="same", axes=0) + trend
            return np.asarray(smooth[keep], dtype=float)

        def held(values: Array) -> Array:  # mean of the two holds at a sample
            return np.vstack([values[:1], 0.5 * (values[1:] + values[:-1])])

        return replace(
            self,
            time=self.time[keep],
            angle=lowpass(self.angle),
            torque=lowpass(held(self.torque)),
            period=self.period * factor,
            metadata={**self.metadata, "decimated_by": factor},
            excitation=None if self.excitation is None else lowpass(held(self.excitation)),
        )

    def at_end(self, values: Array) -> Array:
        """Return where a channel (n, dof) stands at its largest or smallest value, for `STANDS` samples or more."""
        marked = np.zeros(values.shape, dtype=bool)
        for joint, column in enumerate(values.T):
            for end in (column.min(), column.max()):
                edges = np.flatnonzero(np.diff(np.r_[False, column == end, False].astype(int)))
                for start, stop in zip(edges[::2], edges[1::2], strict=True):
                    marked[start:stop, joint] = stop - start >= STANDS
        return marked

    def require_excitation(self) -> None:
        """Raise RecordingError if a torque or an angle is constant, or an angle jumps by most of its range."""
        for name, values in (("torque", self.torque), ("angle", self.angle)):
            for joint in range(self.dof):
                if np.ptp(values[:, joint]) == 0.0:
                    raise RecordingError(
                        f"too little excitation: {name} {joint + 1} is {values[0, joint]:g} in all {len(self)} samples"
                        "; excite every joint"
                    )
        for joint, angle in enumerate(self.angle.T):
            steps = np.abs(np.diff(angle))
            row = int(np.argmax(steps))
            rare = steps[row] > JUMP * np.quantile(steps, 0.9)
            if rare and steps[row] > 0.5 * np.ptp(angle) and np.unique(angle).size > FEW_VALUES:
                raise RecordingError(
                    f"sample {row + 1}: angle {joint + 1} jumps from {angle[row]:.6g} to {angle[row + 1]:.6g} "
                    f"{self.units[0]}, over half of its range: the encoder wraps, or a sample is wrong; unwrap the "
                    "angle before identifying"
                )
