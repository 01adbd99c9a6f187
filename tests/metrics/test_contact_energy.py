"""Paths and energies of a contact: those of the relative motion of the touching point and its object."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.metrics.body_contact import palpation_metrics
from palpate.metrics.mesh_contact import sliding_metrics

ARM: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "run": {"duration": "1 s"},
}
HELD = {**ARM, "servo": {"period": "1 ms", "topology": "impedance_display"}, "operator": {"kind": "fixed"}}
BOX = {"shape": "box", "edge": "80 mm", "divisions": 4}


def moved_mesh(**surface: Any) -> dict[str, Any]:
    """Return a mesh that moves by 20 mm under a held tip and back, 0.5 mm above it at the ends and 1.5 mm between."""
    rows = [["0 s", "0 mm", "0 mm", "0 mm"], ["0.4 s", "20 mm", "0 mm", "1 mm"], ["0.8 s", "0 mm", "0 mm", "0 mm"]]
    return {
        "kind": "mesh",
        "position": ["0 mm", "0 mm", "0.5 mm"],
        "mesh": BOX,
        "surface": {"stiffness": "1 N/mm", **surface},
        "frame": {"displacement": rows},
    }


def test_a_mesh_that_moves_under_a_held_tip_is_slid_over_by_its_own_way() -> None:
    found = sliding_metrics(simulate({**HELD, "object": moved_mesh(tangential="0 N/mm")}))
    assert found is not None
    assert found.path == pytest.approx(40e-3, rel=1e-9)
    assert found.energy_generated == pytest.approx(0.0, abs=1e-12)


def test_friction_under_a_moving_mesh_dissipates_its_force_times_the_slip() -> None:
    """The force is that of the mean depth of 1 mm; the proxy sticks for 2 µ d / k of the way, once."""
    found = sliding_metrics(simulate({**HELD, "object": moved_mesh(static_friction=0.3)}))
    assert found is not None
    assert found.energy_dissipated == pytest.approx(0.3 * 1.0 * 40e-3, rel=0.05)
    assert found.energy_generated == pytest.approx(0.0, abs=1e-12)


def test_a_turning_mesh_does_no_net_work_on_a_held_tip_without_friction() -> None:
    turned = moved_mesh(tangential="0 N/mm")
    turned["frame"] = {"rotation": [["0 s", "0 deg", "0 deg", "0 deg"], ["0.9 s", "0 deg", "10 deg", "30 deg"]]}
    turned["position"] = ["-10 mm", "0 mm", "0.5 mm"]
    trace = simulate({**HELD, "object": turned})
    found = sliding_metrics(trace)
    assert found is not None
    stored = 0.5 * 1000.0 * trace["depth"][:, 0] ** 2
    assert np.ptp(stored) > 1e-4
    assert abs(found.energy_generated) < 1e-3 * np.ptp(stored)


def test_an_admittance_display_does_the_work_of_its_tool_on_a_mesh() -> None:
    """The tip moves beside the tool, so its own way gives the field a work that it does not do."""
    display = {
        **ARM,
        "servo": {
            "period": "0.5 ms",
            "topology": "admittance_display",
            "tool": {"mass": "0.1 kg", "damping": "2 N*s/m"},
        },
        "controller": {"kind": "workspace"},
        "operator": {
            "kind": "arm",
            "mass": "0.15 kg",
            "damping": "4.5 N*s/m",
            "stiffness": "100 N/m",
            "force": ["0.5 N", "0 N", "-1.2 N"],
        },
        "object": {
            "kind": "mesh",
            "position": ["0 mm", "0 mm", "-2 mm"],
            "mesh": BOX,
            "surface": {"stiffness": "20 N/mm", "static_friction": 0.1},
        },
    }
    trace = simulate(display)
    found = sliding_metrics(trace)
    assert found is not None
    move, force = np.diff(trace["tool"], axis=0), trace["object_force"]
    work = float(np.sum(0.5 * (force[1:] + force[:-1]) * move))
    assert found.energy_dissipated > 0.0
    assert abs(found.energy_generated) < 1e-3 * work


def test_the_work_of_a_body_that_moves_against_a_held_tip_is_stored_in_it() -> None:
    body = {
        "shape": "block",
        "size": ["40 mm", "40 mm", "20 mm"],
        "young": "20 kPa",
        "spacing": "10 mm",
        "radius": "8 mm",
    }
    body["kind"] = "compliance"
    rows = [["0 s", "0 mm", "0 mm", "0 mm"], ["0.5 s", "0 mm", "0 mm", "3 mm"]]
    pressed = {"kind": "body", "position": ["0 mm", "0 mm", "-8.1 mm"], "body": body, "frame": {"displacement": rows}}
    found = palpation_metrics(simulate({**HELD, "object": pressed}))
    assert found is not None
    assert found.stored > 1e-4
    assert found.work == pytest.approx(found.stored, rel=1e-3)
    assert abs(found.lost) < 1e-3 * found.stored
