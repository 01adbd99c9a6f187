"""The spring or wall that acts as another object does about a rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.equivalent_spring import as_spring, linear_radius

TABLES: dict[str, Any] = {
    "device": {"name": "slider"}, "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
}  # fmt: skip
WELL = {"kind": "gravity_well", "radius": "10 mm", "stiffness": "200 N/m"}


def scenario(**touched: Any) -> Scenario:
    return Scenario.from_dict({**TABLES, "object": {"position": ["1 mm", "0 mm", "0 mm"], **touched}})


def trace(touching: Any = 1.0, deflection: Any = 0.0, slope: float = 0.0) -> Any:
    n = 4
    far = np.zeros((n, 3))
    far[2, :2] = 0.6 * np.array([deflection, 0.0]) + 0.8 * np.array([0.0, deflection])
    return {"touching": np.broadcast_to(np.reshape(touching, (-1, 1)), (n, 1)), "deflection": far,
            "slope": np.array([[1.0], [1.0], [1.0], [slope]])}  # fmt: skip


def test_a_force_law_is_a_wall_with_its_slope_at_the_end() -> None:
    law = {"depth": ["0 mm", "1 mm", "3 mm"], "force": ["0 N", "1 N", "5 N"]}
    one = scenario(kind="force_law", normal=[1, 0, 0], law=law)
    found, reason = as_spring(one, trace(slope=2345.6))
    assert found is not None
    assert (found.object.kind, found.object.stiffness, reason) == ("wall", pytest.approx((2345.6,) * 3), "")
    assert (found.object.normal, found.object.position) == (one.object.normal, one.object.position)
    assert as_spring(one, trace(touching=[1.0, 1.0, 1.0, 0.0])) == (None, "the tip is off the force law")


@pytest.mark.parametrize(
    ("cap", "radius"), [(None, 0.01), ("4 N", 0.01), ("1 N", 0.005)]
)  # the force is linear up to its largest
def test_a_gravity_well_is_a_spring_while_the_tip_stays_where_its_force_is_linear(
    cap: str | None, radius: float
) -> None:
    field = WELL if cap is None else {**WELL, "largest_force": cap}
    one = scenario(kind="field", field=field)
    assert one.object.field is not None
    assert linear_radius(one.object.field) == pytest.approx(radius)
    found, reason = as_spring(one, trace(deflection=0.999 * radius))
    assert found is not None
    assert (found.object.kind, found.object.stiffness, reason) == ("spring", (200.0,) * 3, "")
    assert found.object.damping == (0.0, 0.0, 0.0)
    assert found.object.position == one.object.position
    left = "the tip leaves the distance within which the force of the gravity well is linear"
    assert as_spring(one, trace(deflection=1.001 * radius)) == (None, left)
    assert as_spring(one, trace(touching=[1.0, 0.0, 1.0, 1.0])) == (None, left)


def test_a_viscous_field_is_a_spring_without_stiffness_and_other_objects_have_none() -> None:
    found, reason = as_spring(scenario(kind="field", field={"kind": "viscous", "damping": "3 N*s/m"}), trace())
    assert found is not None
    assert (found.object.stiffness, found.object.damping, reason) == ((0.0,) * 3, (3.0,) * 3, "")
    assert as_spring(scenario(kind="spring", stiffness="50 N/m"), trace()) == (None, "")
    constant = scenario(kind="field", field={"kind": "constant", "force": ["1 N", "0 N", "0 N"]})
    assert as_spring(constant, trace()) == (None, "")
