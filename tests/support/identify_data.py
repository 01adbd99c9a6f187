"""Simulated experiments that several tests look at, each run once."""

from functools import lru_cache

from palpate import devices
from palpate import identification as identify


@lru_cache
def premium_recording(seed: int = 3) -> identify.Recording:
    """20 s on the nonlinear arm, encoder counts, noise on angles and torques."""
    return identify.simulate_experiment(devices.load("phantom-premium-1.5a"), duration=20.0, seed=seed)


@lru_cache
def short_recording(seed: int, torque_noise: float = 1e-3) -> identify.Recording:
    """12 s at 500 Hz: cheap enough for many seeds."""
    arm = devices.load("phantom-premium-1.5a")
    noise = identify.Noise(angle=2e-5, torque=torque_noise)
    return identify.simulate_experiment(arm, duration=12.0, period=2e-3, seed=seed, noise=noise)
