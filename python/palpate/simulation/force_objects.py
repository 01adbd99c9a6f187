"""Force laws, force fields and textured walls of a scenario, as the core and a resolved loop describe them."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from palpate import _core
from palpate.arrays import Array
from palpate.contact.force_law import ForceLaw
from palpate.errors import ScenarioError
from palpate.scenario import Scenario
from palpate.scenario.objects import Object
from palpate.units import write

__all__ = ["CHANNELS_OF", "core_object", "force_object", "law_of", "with_law"]

# Channels that the core adds to a row, with their numbers of columns, by the kind of force_object().
CHANNELS_OF: Final = {
    "force_law": {"depth": 1, "slope": 1, "stored_energy": 1},
    "gravity_well": {"stored_energy": 1},
    "virtual_mass": {"mass_position": 3, "stored_energy": 1},
    "textured_wall": {"depth": 1, "stored_energy": 1},
}


def force_object(scenario: Scenario, place: Array) -> dict[str, Any] | None:
    """Return kind and parameters, in SI, of a scenario's force law, field or textured wall; None for other objects.

    A viscous field is none of them: it is a spring without stiffness.

    Args:
        scenario: with the object as its [object].
        place: position of the object (3,), m.

    Raises:
        ScenarioError: a virtual mass that diverges on its coupling, or a vibration above the Nyquist frequency.
    """
    touched = scenario.object
    plane = {"point": place, "normal": np.array(touched.normal or (0.0, 0.0, 1.0))}
    if touched.law is not None:
        depth, force = touched.law.table()
        return {"kind": "force_law", "depth": depth, "force": force, **plane}
    if touched.texture is not None:
        texture, stiffness = touched.texture, touched.stiffness
        assert stiffness is not None  # checked
        assert touched.normal is not None
        return {
            "kind": "textured_wall",
            **plane,
            "across": texture.direction(touched.normal),
            "stiffness": stiffness[0],
            "damping": touched.damping[0],
            "wavelength": texture.wavelength,
            "height": texture.height,
            "lateral_force": texture.lateral_force,
        }
    return None if touched.field is None else _field(scenario, place, plane)


def _field(scenario: Scenario, place: Array, plane: dict[str, Any]) -> dict[str, Any] | None:
    f, period = scenario.object.field, scenario.period
    assert f is not None  # the caller checks
    if f.kind == "constant":
        return {"kind": "constant_field", "force": np.array(f.force)}
    if f.kind == "gravity_well":
        return {"kind": f.kind, "center": place, "stiffness": f.stiffness, "radius": f.radius, "cap": f.cap}
    if f.kind == "vibration":
        assert f.frequency is not None
        if f.frequency * period >= 0.5:
            raise scenario.mistake(
                "object.field.frequency",
                f"{f.frequency:g} Hz; it must be below half the servo rate, {0.5 / period:g} Hz",
            )
        decay = math.inf if f.decay is None else f.decay
        own = {"force": np.array(f.force), "frequency": f.frequency, "decay": decay, "at_contact": f.at_contact}
        return {"kind": f.kind, **own, **plane}
    if f.kind == "virtual_mass":
        own = {"mass": f.mass, "stiffness": f.stiffness, "damping": f.coupling_damping}
        return {"kind": f.kind, **own, "period": period}
    return None


def core_object(scenario: Scenario, parameters: dict[str, Any]) -> Any:
    """Return the core's object of the parameters from `force_object`."""
    make = getattr(_core, parameters["kind"])
    try:
        return make(**{key: value for key, value in parameters.items() if key != "kind"})
    except ValueError as problem:
        raise scenario.mistake(f"object.{_table(scenario.object)}", str(problem)) from None


def _table(touched: Object) -> str:
    return "law" if touched.law is not None else "texture" if touched.texture is not None else "field"


def law_of(scenario: Scenario) -> ForceLaw:
    """Return the force law of a scenario, about a plane through the origin of its object.

    Raises:
        ScenarioError: its object is none.
    """
    law = scenario.object.law
    if law is None:
        raise ScenarioError(f'object.kind: "{scenario.object.kind}" is no force law')
    return ForceLaw(*law.table(), np.zeros(3), np.array(scenario.object.normal))


def with_law(scenario: Scenario, law: ForceLaw, tip: Array) -> Scenario:
    """Return a scenario with a force law in place of its object.

    Args:
        scenario: any.
        law: the force law, its point in the device's frame.
        tip: position of the tip at the start (3,), m.
    """
    table = {"depth": [write(x, "m") for x in law.depth], "force": [write(x, "N") for x in law.force]}
    position = [write(x, "m") for x in law.point - tip]
    chosen = {"kind": "force_law", "position": position, "normal": law.normal.tolist(), "law": table}
    return scenario.model_copy(update={"object": Object.model_validate(chosen), "objects": None})
