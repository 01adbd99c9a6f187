"""A proxy sticks under every disturbance of its contact's force up to the bound, and slides under larger ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.stability.mesh_contact import MeshContact, mesh_contact
from palpate.stability.sticking import largest_disturbance

TABLES: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {
        "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m",
        "shape": "ramp", "rise": "0.2 s", "force": ["0.05 N", "0.02 N", "-1.5 N"],
    },
    "object": {
        "kind": "mesh",
        "position": ["0.5 mm", "0.3 mm", "-0.5 mm"],
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 4},
        "surface": {"stiffness": "800 N/m", "static_friction": 0.3},
    },
    "run": {"duration": "1 s"},
}  # fmt: skip


def slide(contact: MeshContact, disturbance: np.ndarray) -> float:
    """Return how far the proxy moves under a disturbance (n, 3), N, from where the run rests, m."""
    simulation: Simulation = build_simulation(contact.scenario)
    rest, count = contact.observed.rest, len(disturbance)
    reference, operator = (
        np.vstack([table, np.tile(table[-1], (rest + count + 1 - len(table), 1))])
        for table in (simulation.reference, simulation.operator)
    )
    operator[rest + 1 :] += disturbance[: len(operator) - rest - 1]
    longer = replace(simulation, reference=reference, operator=np.ascontiguousarray(operator))
    proxy = longer.trace(*longer.run())["proxy"][rest:]
    return float(np.linalg.norm(proxy - proxy[0], axis=1).max())


@pytest.mark.parametrize("seed", range(3))
def test_a_proxy_sticks_under_every_disturbance_up_to_the_bound(seed: int) -> None:
    contact = mesh_contact(Scenario.from_dict(TABLES))
    largest = largest_disturbance(contact.sites[-1], contact.observed.trace)
    assert 0.01 < largest < 0.5
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    hertz = rng.uniform(5.0, 60.0)
    square = np.sign(np.sin(2.0 * np.pi * hertz * 1e-3 * np.arange(1500)))
    assert slide(contact, largest * square[:, None] * direction) < 1e-9


def test_a_proxy_slides_under_a_larger_disturbance_along_the_surface() -> None:
    contact = mesh_contact(Scenario.from_dict(TABLES))
    largest = largest_disturbance(contact.sites[-1], contact.observed.trace)
    push = np.tile([12.0 * largest, 0.0, 0.0], (600, 1))
    assert slide(contact, push) > 1e-5


def test_a_contact_without_friction_does_not_stick() -> None:
    tables = {**TABLES, "object": {**TABLES["object"], "surface": {"stiffness": "800 N/m"}}}
    contact = mesh_contact(Scenario.from_dict(tables))
    assert largest_disturbance(contact.sites[-1], contact.observed.trace) == 0.0
