"""A proxy keeps its contact mode under every disturbance of its contact's force up to the bound."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.contact_law import ContactLaw
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.stability.mesh_contact import MeshContact, mesh_contact
from palpate.stability.sticking import _edges, _peak_gain, largest_disturbance

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


def disturbed(contact: MeshContact, disturbance: np.ndarray) -> dict[str, np.ndarray]:
    """Return channels of the run from its rest on, under a disturbance (n, 3), N."""
    simulation: Simulation = build_simulation(contact.scenario)
    rest, count = contact.observed.rest, len(disturbance)
    reference, operator = (
        np.vstack([table, np.tile(table[-1], (rest + count + 1 - len(table), 1))])
        for table in (simulation.reference, simulation.operator)
    )
    operator[rest + 1 :] += disturbance[: len(operator) - rest - 1]
    longer = replace(simulation, reference=reference, operator=np.ascontiguousarray(operator))
    trace = longer.trace(*longer.run())
    return {name: trace[name][rest:] for name in ("proxy", "touching", "triangle")}


def slide(contact: MeshContact, disturbance: np.ndarray) -> float:
    """Return how far the proxy moves under a disturbance (n, 3), N, from where the run rests, m."""
    proxy = disturbed(contact, disturbance)["proxy"]
    return float(np.linalg.norm(proxy - proxy[0], axis=1).max())


def square_wave(seed: int) -> np.ndarray:
    """Return a square wave of unit size, of random direction and frequency (1500, 3)."""
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    hertz = rng.uniform(5.0, 60.0)
    return np.sign(np.sin(2.0 * np.pi * hertz * 1e-3 * np.arange(1500)))[:, None] * direction


@pytest.mark.parametrize("seed", range(3))
def test_a_proxy_sticks_under_every_disturbance_up_to_the_bound(seed: int) -> None:
    contact = mesh_contact(Scenario.from_dict(TABLES))
    largest = largest_disturbance(contact.sites[-1], contact.observed.trace)
    assert 0.01 < largest < 0.5
    assert slide(contact, largest * square_wave(seed)) < 1e-9


def test_a_proxy_slides_under_a_larger_disturbance_along_the_surface() -> None:
    contact = mesh_contact(Scenario.from_dict(TABLES))
    largest = largest_disturbance(contact.sites[-1], contact.observed.trace)
    push = np.tile([12.0 * largest, 0.0, 0.0], (600, 1))
    assert slide(contact, push) > 1e-5


def without_friction(stiffness: str = "800 N/m", **surface: Any) -> MeshContact:
    tables = {**TABLES, "object": {**TABLES["object"], "surface": {"stiffness": stiffness, **surface}}}
    return mesh_contact(Scenario.from_dict(tables))


@pytest.mark.parametrize("viscous", ["0 N*s/m", "1 N*s/m"])
def test_without_friction_a_proxy_stays_on_its_face_under_every_disturbance_up_to_the_bound(viscous: str) -> None:
    contact = without_friction(viscous=viscous)
    largest = largest_disturbance(contact.sites[-1], contact.observed.trace)
    assert 0.001 < largest < 5.0
    for seed in range(3):
        trace = disturbed(contact, largest * square_wave(seed))
        assert trace["touching"].all()
        assert np.ptp(trace["triangle"]) == 0


def test_a_face_whose_law_depends_on_the_place_has_no_bound() -> None:
    contact = without_friction(shading="40 deg")
    assert largest_disturbance(contact.sites[-1], contact.observed.trace) == 0.0


def test_the_bound_counts_the_transient_of_the_run() -> None:
    contact = mesh_contact(Scenario.from_dict(TABLES))
    site, trace = contact.sites[-1], contact.observed.trace
    early = replace(site, row=150)  # during the ramp of the force
    assert largest_disturbance(early, trace) < 0.8 * largest_disturbance(site, trace)


@pytest.mark.parametrize("k_t", [500.0, 0.0])
def test_the_distances_of_a_proxy_from_the_edges_of_its_face_follow_tip_and_force(k_t: float) -> None:
    """The proxy is the tip less the tangential force over its spring; without one it is under the tip."""
    rng = np.random.default_rng(0)
    corners = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.01, 0.02, 0.0]])
    c, d = 100.0 * rng.normal(size=(3, 2)), 100.0 * rng.normal(size=(3, 3))
    law = ContactLaw(np.zeros((2, 2)), np.zeros((2, 3)), c, d)
    out = rng.normal(size=(3, 4))
    site: Any = SimpleNamespace(
        face=corners, row=3, path=SimpleNamespace(C=out), loop=SimpleNamespace(directions=np.eye(3)),
        point=SimpleNamespace(tangential=k_t, normal=np.array([0.0, 0.0, 1.0])), resting=SimpleNamespace(law=law),
    )  # fmt: skip
    weights = rng.dirichlet(np.ones(3), 8)
    depth = rng.uniform(0.0, 1e-3, (8, 1))
    trace: Any = {"triangle": np.array([9.0] * 3 + [7.0] * 5), "proxy": weights @ corners, "depth": depth}
    rows, left = _edges(site, trace)  # type: ignore[misc]
    states = rng.normal(size=6)  # four of the path, two of the law
    tip = out @ states[:4]
    force = law.C @ states[4:] + law.D @ tip
    proxy = tip - (force / k_t if k_t else 0.0)
    proxy[2] = 0.0
    place = weights[3:] @ corners
    for number, (start, end) in enumerate(((0, 1), (1, 2), (2, 0))):
        along = (corners[end] - corners[start]) / np.linalg.norm(corners[end] - corners[start])
        inward = np.array([-along[1], along[0], 0.0])
        np.testing.assert_allclose(left[:, number], (place - corners[start]) @ inward, atol=1e-15)
        assert rows[number] @ states == pytest.approx(inward @ proxy)
    np.testing.assert_array_equal(left[:, 3], depth[3:, 0])
    assert rows[3] @ states == pytest.approx(-tip[2])
    trace["triangle"][-1] = 8.0
    assert _edges(site, trace) is None
    site.face, trace["triangle"][-1] = None, 7.0
    assert _edges(site, trace) is None


@pytest.mark.parametrize("pole", [0.0, 0.5, -0.9, 0.999, 0.99999, -0.99999])
def test_the_peak_gain_of_one_state_is_the_sum_of_its_powers(pole: float) -> None:
    """|c b| / (1 - |a|): the tail of one state is that of its Lyapunov matrix exactly."""
    found = _peak_gain(np.array([[pole]]), np.array([[3.0, 4.0]]), np.array([[2.0], [-0.5]]))
    np.testing.assert_allclose(found, np.array([10.0, 2.5]) / (1.0 - abs(pole)), rtol=1e-6)


def test_a_peak_gain_is_no_less_than_the_sum_of_powers_of_several_states() -> None:
    rng = np.random.default_rng(0)
    for radius in (0.9, 0.998):
        a = rng.normal(size=(4, 4))
        a *= radius / np.abs(np.linalg.eigvals(a)).max()
        b, c = rng.normal(size=(4, 2)), rng.normal(size=(3, 4))
        exact, state = np.zeros(3), b
        for _ in range(8_000):
            exact += np.linalg.norm(c @ state, axis=1)
            state = a @ state
        found = _peak_gain(a, b, c)
        assert (found >= exact * (1.0 - 1e-9)).all()
        assert (found <= 1.3 * exact).all()
