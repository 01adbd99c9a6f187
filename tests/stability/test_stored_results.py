"""Whole results of every analysis are as stored: each number, state and sentence."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from fingerprint import fingerprint
from palpate import fem, stability
from palpate.devices import load
from palpate.linear import HumanArm, LinearDevice
from palpate.scenario import Scenario
from palpate.stability import MeasuredResponse, criteria
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.switching import dwell_time
from stored import check_stored

STORED = Path(__file__).with_name("stored")
SCENARIOS = Path(__file__).parents[2] / "scenarios"
POSE = [0.1, 2.2, 3.2]


def summary(value: Any) -> Any:
    """Return a result as plain values; an array with more than 12 numbers as its shape and fingerprint."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: summary(getattr(value, one.name)) for one in fields(value) if one.name != "scenario"}
    if isinstance(value, dict):
        return {str(key): summary(entry) for key, entry in value.items() if key != "scenario"}
    if isinstance(value, list | tuple):
        return [summary(entry) for entry in value]
    if isinstance(value, np.ndarray):
        if value.size <= 12 or value.dtype.kind not in "fc":
            return summary(value.tolist()) if value.size <= 12 else [*value.shape, float(np.sum(value))]
        bad = ~np.isfinite(value)
        return [*value.shape, int(bad.sum()), fingerprint(np.where(bad, 0.0, value))]
    if isinstance(value, complex):
        return [value.real, value.imag]
    return value


def loop(seed: int, device: str = "phantom-premium-1.5a", **tables: Any) -> dict[str, Any]:
    """Return a press on a wall by a random hand, at a random pose, rate and delay."""
    rng = np.random.default_rng(seed)
    hand: dict[str, Any] = {
        "kind": "arm",
        "mass": f"{rng.uniform(0.05, 0.4):.4f} kg",
        "damping": f"{rng.uniform(1.0, 8.0):.4f} N*s/m",
        "stiffness": f"{rng.uniform(20.0, 500.0):.4f} N/m",
        "force": ["0 N", "0.1 N", f"{-rng.uniform(0.2, 1.0):.4f} N"],
    }
    if rng.random() < 0.5:
        hand |= {"tissue_stiffness": "800 N/m", "tissue_damping": "2 N*s/m"}
    start = {"pose": [f"{q:.4f} rad" for q in np.array([0.0, 2.2305, 3.2776]) + rng.uniform(-0.25, 0.25, 3)]}
    wall = {"kind": "wall", "normal": [0.0, 0.6, 0.8], "stiffness": f"{np.exp(rng.uniform(4.0, 8.5)):.4f} N/m"}
    if rng.random() < 0.5:
        wall["damping"] = f"{rng.uniform(0.2, 3.0):.4f} N*s/m"
    if device == "slider":
        start, wall["normal"], hand["force"] = {"pose": ["0 mm"]}, [-1.0, 0.0, 0.0], ["0.4 N", "0 N", "0 N"]
    return {
        "device": {"name": device, "delay": int(rng.integers(0, 3)), "encoder": bool(rng.random() < 0.3)},
        "start": start,
        "servo": {"period": f"{rng.uniform(0.3, 1.5):.4f} ms", "topology": "impedance_display"},
        "operator": hand,
        "object": wall,
        "run": {"duration": "0.3 s"},
        **tables,
    }


def certificate(tables: Any) -> Any:
    return stability.certify(Scenario.from_dict(tables) if isinstance(tables, dict) else tables).to_dict()


def zwidth(tables: Any) -> Any:
    found = stability.zwidth(tables, simulated=False)
    return {**summary(found), "verdict": found.verdict, "remarks": found.gap_remarks}


def workspace(tables: Any) -> Any:
    found = stability.workspace(tables, poses=60)
    plain = {key: entry for key, entry in summary(found).items() if key != "directions"}  # eigenvectors of any sign
    return {**plain, "text": str(found), "stable": found.stable}


def walls(seed: int) -> Any:
    """Return limits of random walls of a device with one axis."""
    rng = np.random.default_rng(seed)
    arm = HumanArm(0.1, 3.0, 200.0) if seed % 2 else None
    mass, damping = rng.uniform(0.03, 0.3), rng.uniform(0.01, 1.0)
    device = LinearDevice.of_mass(mass, damping, arm)
    options: dict[str, Any] = {"period": rng.uniform(2e-4, 2e-3), "delay": [0.0, 1.0, 0.4, 2.0][seed % 4]}
    options["velocity_filter"] = [0.0, 0.6][seed % 2]
    given = {"mass": mass, "damping": damping, **options}
    curve: Boundary = stability.stability_boundary(device, points=80, **options)
    b = 0.3 * float(curve.damping.max())
    period = options["period"]
    passive = {"period": period, "delay": int(options["delay"])}
    return summary(
        [
            stability.wall_limit(**given, virtual_damping=b, arm=arm),
            curve, curve.stiffest, curve.pieces, curve.stiffest_at(b), curve.up_to(b),
            stability.critical_stiffness(device, virtual_damping=b, **options),
            stability.passive_damping(stiffness=500.0, virtual_damping=b, **passive),
            stability.sufficient_damping(stiffness=500.0, virtual_damping=b, **passive),
            stability.passive_stiffness(damping=1.0, virtual_damping=np.array([0.0, 0.2, 0.5]), **passive),
            stability.field_damping(lipschitz=800.0, longest_period=period, delay=1, virtual_damping=b),
            stability.quantized_stiffness(damping=1.0, coulomb=0.05, period=period, quantum=2e-5, virtual_damping=0.1),
            stability.coulomb_amplitude(mass=0.1, stiffness=4000.0, damping=0.1, coulomb=0.05, period=period),
            stability.certify_coupling(damping=1.0, coupling_stiffness=600.0, coupling_damping=0.2, period=period),
            stability.two_port_margin(damping=1.0, coupling_stiffness=600.0, coupling_damping=0.2, period=period),
        ]
    )  # fmt: skip


def tables_of(seed: int) -> Any:
    """Return the criteria of a random matrix."""
    matrix = np.random.default_rng(seed).normal(size=(4, 4)) / (1.5 + 0.5 * (seed % 3))
    polynomial = stability.characteristic_polynomial(matrix)
    return summary(
        [polynomial, stability.jury(polynomial), stability.routh(polynomial), stability.lyapunov(matrix),
         stability.precise_tables(matrix), criteria.check_stability(matrix)]
    )  # fmt: skip


def measured(seed: int) -> Any:
    """Return the critical stiffness of a noisy response of a mass with a hold and a delay."""
    rng = np.random.default_rng(seed)
    period = 1e-3
    f = np.geomspace(2.0, 480.0, 220)
    z, s = np.exp(2j * np.pi * f * period), 2j * np.pi * f
    response = (1.0 - 1.0 / z) / (s * period) / (0.08 * s**2 + 2.0 * s + 20.0) / z ** (seed % 3)
    noisy = response * (1.0 + 2e-3 * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f))))
    whole = MeasuredResponse(f, noisy, period)
    low = MeasuredResponse(f[:60], noisy[:60], period, deviation=1e-3 * np.abs(noisy[:60]))
    return summary([whole.critical_stiffness(b, delay=0.5) for b in (0.0, 1.0)] + [low.critical_stiffness()])


def switched(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    base = 0.9 * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return summary(dwell_time([base, base @ np.diag([1.0, 0.5, 0.8]), 0.7 * base.T]))


def couplings(name: str) -> Any:
    device = load(name)
    return summary(stability.design_couplings(device, POSE if device.dof == 3 else [0.0]))


def energies() -> Any:
    k = np.arange(60)
    x, f = 1e-3 * np.sin(0.3 * k), np.maximum(2.0 * np.cos(0.3 * k + 0.4), 0.0)
    watch = stability.EnergyObserver()
    seen = []
    for place, force in zip(x, f, strict=True):
        seen.append(watch.update(float(place)))
        watch.set_force(float(force))
    mass = control.tf([1e-3 / 0.2, 0.0], [1.0, -1.0], 1e-3)
    return summary(
        [np.array(seen), stability.zoh_energy(f, x), stability.naive_energy(f, x),
         stability.positive_real_margin(mass, 1e-3), stability.two_port_limit(damping=1.0, period=1e-3)]
    )  # fmt: skip


ADMITTANCE = SCENARIOS / "admittance-display.toml"
CASES: dict[str, Callable[[], Any]] = {
    **{f"certificate-{k}": partial(lambda k: certificate(loop(k)), k) for k in range(8)},
    **{f"certificate-slider-{k}": partial(lambda k: certificate(loop(k, "slider")), k) for k in range(4)},
    "certificate-display": lambda: certificate(str(ADMITTANCE)),
    "certificate-lqg": lambda: certificate(str(SCENARIOS / "press-stiff-cube-lqg.toml")),
    "certificate-lead-lag": lambda: certificate(str(SCENARIOS / "press-soft-cube-lead-lag.toml")),
    "certificate-mesh": lambda: certificate(str(SCENARIOS / "slide-cube-by-forces.toml")),
    **{f"zwidth-{k}": partial(lambda k: zwidth(loop(k)), k) for k in range(3)},
    "zwidth-slider": lambda: zwidth(loop(1, "slider")),
    **{f"workspace-{k}": partial(lambda k: workspace(loop(k)), k) for k in range(2)},
    "workspace-device": lambda: workspace("phantom-premium-1.5a"),
    **{f"walls-{k}": partial(walls, k) for k in range(6)},
    **{f"criteria-{k}": partial(tables_of, k) for k in range(9)},
    **{f"measured-{k}": partial(measured, k) for k in range(3)},
    **{f"switched-{k}": partial(switched, k) for k in range(3)},
    **{f"couplings-{name}": partial(couplings, name) for name in ("phantom-premium-1.5a", "slider")},
    "energies": energies,
}


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_as_stored(name: str) -> None:
    check_stored(STORED / f"{name}.json", summary(CASES[name]()))


BODIES = {
    "compliance": {},
    "signed_distance": {"static_friction": 0.3},
    "viscoelastic": {"instantaneous_ratio": 2.0, "retardation_time": "50 ms"},
    "neo-hookean": {"update_interval": "5 ms"},
}


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("body") / "block.h5"
    fem.build(
        fem.block((0.024, 0.024, 0.012), 0.006), young=20e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1,
        output=path,
    )  # fmt: skip
    return path


@pytest.mark.parametrize("kind", BODIES)
def test_a_result_of_a_body_is_as_stored(block: Path, kind: str) -> None:
    """Compliances have single precision, and a hyperelastic body is solved until its error is small."""
    body = {"file": str(block), "kind": kind, "radius": "8 mm", "origin": ["13 mm", "11 mm", "12 mm"], **BODIES[kind]}
    pressed = loop(3, object={"kind": "body", "position": ["0 mm", "0 mm", "-8.1 mm"], "body": body})
    pressed["operator"]["force"] = ["0 N", "0 N", "-0.4 N"]
    pressed["run"]["duration"] = "0.6 s"
    found = {"certificate": summary(certificate(pressed))}
    found["certificate"]["margin"].pop("response_error_over_tolerable", None)  # of rounding
    if kind == "compliance":
        found["zwidth"] = zwidth(pressed)
    kept = json.loads(json.dumps(found).replace(str(block), "FILE"))
    check_stored(STORED / f"body-{kind}.json", numbers_of(kept), 5e-2 if kind == "neo-hookean" else 5e-3)


def numbers_of(value: Any) -> Any:
    """Return a result without digits in its sentences, which may differ in the last place."""
    if isinstance(value, dict):
        return {key: numbers_of(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [numbers_of(entry) for entry in value]
    return re.sub(r"-?\d[\d.e+-]*", "#", value) if isinstance(value, str) else value
