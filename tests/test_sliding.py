"""A slide's numbers against closed forms, and the sliding experiment's demands on a few pairs of stiffnesses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate import Mesh, Proxy, Surface
from palpate.loop.sliding import slide
from palpate.loop.touched import box
from palpate.loop.trace import Trace

PERIOD = 5e-4


def dragged(surface: Surface, depth: float = 2e-3, ticks: int = 2000) -> Trace:
    """A tip led by nobody's loop: down onto a cube, 30 mm along x at constant depth, and up again."""
    mesh = Mesh(*box(0.08, 16))
    s = np.linspace(0.0, 1.0, ticks)
    height = np.interp(s, [0.0, 0.2, 0.8, 1.0], [1e-3, -depth, -depth, 1e-3])
    path = np.stack([np.interp(s, [0.2, 0.8], [-0.015, 0.015]), np.full(ticks, 1e-3), height], axis=1)
    c = Proxy(mesh, surface).follow(path)
    values = {
        "tip": path, "proxy": c.position, "normal": c.normal, "depth": c.depth, "surface_stiffness": c.stiffness,
        "triangle": c.triangle, "touching": c.touching, "object_force": -c.force,
        "reference_force": np.tile([0.0, 0.0, -2.0], (ticks, 1)),
    }  # fmt: skip
    return Trace.of(PERIOD * np.arange(ticks), values)


def halves(**kw: Any) -> Surface:
    """1 N/mm for x < 0, 3 N/mm for x > 0."""
    vertices, triangles = box(0.08, 16)
    stiff = np.where(vertices[triangles].mean(axis=1)[:, 0] < 0.0, 1000.0, 3000.0)
    return Surface(stiffness=stiff, **kw)


def test_a_step_and_the_energy_it_makes() -> None:
    """From k1 to k2 at constant depth d the force steps by (k2 - k1) d, and the field makes (k2 - k1) d^2 / 2."""
    found = slide(dragged(halves(tangential=0.0)))
    assert found is not None
    assert found.step_at_crossing == pytest.approx(2000.0 * 2e-3, rel=1e-9)
    assert found.energy_generated == pytest.approx(0.5 * 2000.0 * 4e-6, rel=2e-3)
    assert found.energy_dissipated == pytest.approx(0.0, abs=1e-12)
    assert found.path == pytest.approx(0.03, rel=1e-9)


def test_the_continuous_field_makes_none() -> None:
    """Where the force is the slope of a potential, in and out by another way gives back what was put in."""
    found = slide(dragged(halves(tangential=0.0, field="continuous")))
    assert found is not None
    assert abs(found.energy_generated) < 1e-3 * 0.5 * 2000.0 * 4e-6
    discrete = slide(dragged(halves(tangential=0.0)))
    assert discrete is not None
    assert discrete.step_at_crossing is not None
    assert found.step_at_crossing is not None
    assert found.step_at_crossing < 0.01 * discrete.step_at_crossing
    assert found.buzz < 0.05 * discrete.buzz


def test_friction_takes_force_times_way() -> None:
    """A proxy that slides with mu takes mu k d over its way."""
    found = slide(dragged(Surface(stiffness=1000.0, tangential=1000.0, static_friction=0.2), ticks=20_000))
    assert found is not None
    held = 0.2 * 1000.0 * 2e-3
    assert found.energy_dissipated == pytest.approx(held * (0.03 - 0.2 * 2e-3), rel=0.01)
    assert found.energy_generated == pytest.approx(0.0, abs=1e-6)


def test_buzz_is_the_power_between_20_and_500_hz() -> None:
    """A sine of amplitude a in the band has power a^2/2; below it, none."""
    base = dragged(Surface(stiffness=1000.0, tangential=0.0), ticks=8000)
    for frequency, share in ((100.0, 1.0), (400.0, 1.0), (5.0, 0.0), (800.0, 0.0)):
        wave = 0.3 * np.sin(2 * np.pi * frequency * base.time)
        force = np.stack([wave, 0 * wave, 0 * wave], axis=1)
        found = slide(Trace.of(base.time, {n: base[n] for n in base.channels} | {"object_force": force}))
        assert found is not None
        assert found.buzz == pytest.approx(share * 0.045, rel=0.02, abs=2e-4)


def test_lost_contact_is_counted() -> None:
    """Ticks apart after the first touch; a trace that never touches has no slide."""
    trace = dragged(Surface(stiffness=1000.0, tangential=0.0))
    apart = int(np.sum(trace["touching"][:, 0] == 0.0))
    found = slide(trace)
    assert found is not None
    assert found.lost_ticks == apart - int(np.argmax(trace["touching"][:, 0]))
    assert not found.touching_at_end
    assert not found.settled
    away = {name: trace[name] for name in trace.channels} | {"touching": np.zeros(len(trace))}
    assert slide(Trace.of(trace.time, away)) is None
