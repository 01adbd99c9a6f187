"""Excitation signals: PRBS, multisine and sweep. Each has a seed and an exact peak per channel.

Signals are (samples, channels), sampled at the servo period and held between samples.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from palpate.arrays import Array, Indices
from palpate.errors import RecordingError

_KEYS = {"band": "band_hz", "clock": "clock_s"}  # of fields in a description


class Excitation(Protocol):
    """Signal of any duration."""

    @property
    def amplitude(self) -> Array:
        """Peak of each channel, (channels,)."""

    def sample(self, duration: float, period: float) -> Array:
        """Return the values at t = 0, period, … over `duration` seconds, (n, channels)."""

    def describe(self) -> dict[str, Any]:
        """Return kind, parameters and seed, as JSON can hold them."""


def crest_factor(values: ArrayLike) -> Array:
    """Return peak over root mean square of each column: 1 for a binary signal, 1.41 for a sine."""
    x = np.asarray(values, dtype=float)
    rms = np.sqrt(np.mean(x**2, axis=0))
    return np.asarray(np.max(np.abs(x), axis=0) / rms, dtype=float)


def _amplitudes(amplitude: ArrayLike) -> Array:
    values = np.atleast_1d(np.array(amplitude, dtype=float))
    if values.ndim != 1 or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise RecordingError(f"amplitudes must be finite and not negative, one per channel; got {values.tolist()}")
    return values


def _band(band: tuple[float, float], duration: float, period: float) -> tuple[float, float]:
    low, high = float(band[0]), float(band[1])
    if not 0 < low < high < 0.5 / period:
        raise RecordingError(
            f"the band must rise within 0 < f < {0.5 / period:g} Hz (half the sampling rate); "
            f"got {low:g} to {high:g} Hz"
        )
    if low * duration < 1.0:
        raise RecordingError(f"{low:g} Hz does not fit one period into {duration:g} s")
    return low, high


def _count(duration: float, period: float) -> int:
    count = round(duration / period)
    if count < 2:
        raise RecordingError(f"{duration:g} s at a period of {period:g} s are fewer than two samples")
    return count


class _Described:
    """Signal whose fields describe it."""

    kind: ClassVar[str]

    def describe(self) -> dict[str, Any]:
        """Return kind, parameters and seed, as JSON can hold them."""
        parameters = {f.name: np.asarray(getattr(self, f.name)).tolist() for f in fields(self)}  # type: ignore[arg-type]
        return {"kind": self.kind, **{_KEYS.get(name, name): value for name, value in parameters.items()}}


@dataclass(frozen=True)
class Multisine(_Described):
    """Sines on a grid of 1/duration, assigned to the channels in turn, so that the channels are orthogonal.

    Phases start from those of Schroeder (1970), -πk(k-1)/N. Repeated clipping lowers the peak (Van der Ouderaa,
    Schoukens and Renneboog 1988). The seed shifts the signal in time and draws the sign of each channel. Each channel
    has `lines` sines over `band`, evenly spaced or `logarithmic`. Their amplitudes are equal, and scaled to a peak of
    `amplitude`.
    """

    kind = "multisine"

    amplitude: Array
    band: tuple[float, float]
    lines: int = 20
    seed: int = 0
    logarithmic: bool = False

    def sample(self, duration: float, period: float) -> Array:
        """Return the values at t = 0, period, … over `duration` seconds, (n, channels)."""
        n, channels = _count(duration, period), len(self.amplitude)
        low, high = _band(self.band, duration, period)
        first, last = int(np.ceil(low * duration - 1e-9)), int(np.floor(high * duration + 1e-9))
        wanted = min(self.lines * channels, last - first + 1)
        if wanted < channels:
            raise RecordingError(
                f"the band {low:g} to {high:g} Hz has {last - first + 1} lines in {duration:g} s; "
                f"{channels} channels need more"
            )
        spread = np.geomspace(first, last, wanted) if self.logarithmic else np.linspace(first, last, wanted)
        bins = np.unique(np.round(spread).astype(int))
        draw = np.random.default_rng(self.seed)
        out = np.zeros((n, channels))
        for channel in range(channels):
            mine = bins[channel::channels]
            k = np.arange(1, len(mine) + 1)
            phases = -np.pi * k * (k - 1) / len(mine) + mine * draw.uniform(0, 2 * np.pi)
            wave = _compressed(n, mine, phases)
            sign = draw.choice([-1.0, 1.0])
            out[:, channel] = sign * self.amplitude[channel] * wave / np.max(np.abs(wave))
        return out


def _compressed(count: int, bins: Indices, phases: Array, rounds: int = 60) -> Array:
    """Return equal cosines on `bins` of a period of `count` points, with the phases of the lowest peak found."""
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[bins] = np.exp(1j * phases)
    best = wave = np.fft.irfft(spectrum, count)
    for attempt in range(rounds):
        level = np.max(np.abs(wave)) * (0.75 + 0.2 * attempt / rounds)
        clipped = np.fft.rfft(np.clip(wave, -level, level))
        spectrum[bins] = np.exp(1j * np.angle(clipped[bins]))
        wave = np.fft.irfft(spectrum, count)
        if np.max(np.abs(wave)) < np.max(np.abs(best)):
            best = wave
    return np.asarray(best, dtype=float)


@dataclass(frozen=True)
class Prbs(_Described):
    """Pseudo-random binary sequence of maximal length, one shift of the same register per channel.

    `clock` is the time between possible switches, s. The power is flat to about 0.4/clock Hz. The seed draws the state
    of the register.
    """

    kind = "prbs"

    amplitude: Array
    clock: float
    seed: int = 0

    def sample(self, duration: float, period: float) -> Array:
        """Return the values at t = 0, period, … over `duration` seconds, (n, channels)."""
        n, channels = _count(duration, period), len(self.amplitude)
        hold = round(self.clock / period)
        if hold < 1 or abs(hold * period - self.clock) > 1e-6 * self.clock:
            raise RecordingError(f"the clock must be a whole number of periods of {period:g} s; got {self.clock:g} s")
        needed = -(-n // hold)
        bits = min(max(int(np.ceil(np.log2(needed * channels + 1))), 2), 32)
        draw = np.random.default_rng(self.seed)
        state = draw.integers(0, 2, bits)
        state[draw.integers(bits)] = 1
        length = 2**bits - 1
        sequence = signal.max_len_seq(bits, state=state, length=min(length, needed * channels))[0]
        out = np.empty((n, channels))
        for channel in range(channels):
            start = channel * len(sequence) // channels
            chips = np.resize(np.roll(sequence, -start), needed) * 2.0 - 1.0
            out[:, channel] = self.amplitude[channel] * np.repeat(chips, hold)[:n]
        return out


@dataclass(frozen=True)
class Sweep(_Described):
    """Logarithmic chirp through `band`, Hz, by one channel after the other, for equal parts of the duration.

    The seed draws the order of the channels and their start phases.
    """

    kind = "chirp"

    amplitude: Array
    band: tuple[float, float]
    seed: int = 0

    def sample(self, duration: float, period: float) -> Array:
        """Return the values at t = 0, period, … over `duration` seconds, (n, channels)."""
        n, channels = _count(duration, period), len(self.amplitude)
        share = n // channels
        low, high = _band(self.band, share * period, period)
        draw = np.random.default_rng(self.seed)
        order, phases = draw.permutation(channels), draw.uniform(0, 360, channels)
        out = np.zeros((n, channels))
        time = np.arange(share) * period
        for place, channel in enumerate(order):
            wave = signal.chirp(time, low, share * period, high, method="logarithmic", phi=phases[channel])
            out[place * share : (place + 1) * share, channel] = self.amplitude[channel] * wave
        return out


def multisine(
    amplitude: ArrayLike, band: tuple[float, float], *, lines: int = 20, seed: int = 0, logarithmic: bool = False
) -> Multisine:
    """Return a multisine over `band`, Hz, with the peaks `amplitude`, one per channel; see `Multisine`."""
    if lines < 1:
        raise RecordingError(f"a multisine needs at least one line; got {lines}")
    return Multisine(_amplitudes(amplitude), band, lines, seed, logarithmic)


def prbs(amplitude: ArrayLike, clock: float, *, seed: int = 0) -> Prbs:
    """Return a binary sequence of ±`amplitude`, one per channel, that may switch every `clock` s; see `Prbs`."""
    if not (np.isfinite(clock) and clock > 0):
        raise RecordingError(f"the clock must be a positive time; got {clock} s")
    return Prbs(_amplitudes(amplitude), float(clock), seed)


def chirp(amplitude: ArrayLike, band: tuple[float, float], *, seed: int = 0) -> Sweep:
    """Return a logarithmic chirp through `band`, Hz, with the peaks `amplitude`, one per channel; see `Sweep`."""
    return Sweep(_amplitudes(amplitude), band, seed)
