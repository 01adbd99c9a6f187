"""Base parameters: combinations of inertia and gravity in which the dynamics of a device are linear.

    M(q) qdd + C(q, qd) qd + N(q) = sum over j of value_j * (torque of a fictitious device with that one parameter at 1)

The fictitious devices are the device itself with other masses and inertias, so the core computes the physics. Their
masses may be negative.

premium:  M11 = A + P cos 2θ2 - Q cos 2θ3 + h cos θ2 sin θ3,  M22, M33,  M23 = -h/2 sin(θ2 - θ3),
          N = (0, n2 cos θ2, n3 sin θ3);  P and Q are an eighth of the P and Q of the usual closed form.
slider:   the mass m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import RecordingError

_ZERO: dict[str, Any] = {f"mass__{s}": 0.0 for s in ("a", "c", "be", "df")} | {
    f"inertia__{s}": [0.0, 0.0, 0.0] for s in ("a", "c", "be", "df")
}
_ZERO |= {"inertia__base": 0.0, "drive__rotor_inertia": [0.0] * 3, "environment__gravity": 0.0}

_PREMIUM: dict[str, tuple[str, str, dict[str, Any]]] = {
    "A": ("kg*m^2", "constant part of M11", {"inertia__base": 1.0}),
    "P": ("kg*m^2", "part of M11 with cos 2θ2", {"inertia__be": [0.0, 1.0, -1.0]}),
    "Q": ("kg*m^2", "part of M11 with -cos 2θ3", {"inertia__df": [0.0, -1.0, 1.0]}),
    # The squares of these two masses' terms cancel; the product l1 (l2 ma + l3 mc) remains.
    "h": (
        "kg*m^2",
        "coupling l1 (l2 ma + l3 mc)",
        {"geometry__l1": 1.0, "geometry__l2": 4.0, "geometry__l3": -1.0, "mass__a": 0.125, "mass__c": -0.5},
    ),
    "M22": ("kg*m^2", "inertia of joint 2", {"inertia__be": [1.0, 0.0, 0.0]}),
    "M33": ("kg*m^2", "inertia of joint 3", {"inertia__df": [1.0, 0.0, 0.0]}),
    "n2": (
        "N*m",
        "gravity of joint 2, with cos θ2",
        {"environment__gravity": 1.0, "geometry__l5": 1.0, "mass__be": 1.0},
    ),
    "n3": (
        "N*m",
        "gravity of joint 3, with sin θ3",
        {"environment__gravity": 1.0, "geometry__l6": -1.0, "mass__df": 1.0},
    ),
}

_SLIDER: dict[str, tuple[str, str, dict[str, Any]]] = {"m": ("kg", "moving mass", {"mass__tip": 1.0})}

_BASE = {"premium": _PREMIUM, "slider": _SLIDER}  # base parameters by mechanism: unit, meaning, the fictitious device


def _table(device: Device) -> dict[str, tuple[str, str, dict[str, Any]]]:
    if device.mechanism not in _BASE:
        known = " and ".join(_BASE)
        raise RecordingError(
            f"no base parameters are known for the mechanism {device.mechanism} of {device.name}; they are for {known}"
        )
    return _BASE[device.mechanism]


@dataclass(frozen=True)
class Parameter:
    """One unknown of the dynamics.

    Attributes:
        name: short, as in the formulas above; k1 and c1 are viscous and Coulomb friction of joint 1.
        unit: SI.
        meaning: in words.
        joint: 0-based joint whose friction it is, or -1.
    """

    name: str
    unit: str
    meaning: str
    joint: int = -1


def base_parameters(device: Device) -> list[Parameter]:
    """Return the parameters of inertia and gravity of a device's mechanism, in order."""
    return [Parameter(name, unit, meaning) for name, (unit, meaning, _) in _table(device).items()]


def friction_parameters(device: Device, coulomb: bool = True) -> list[Parameter]:
    """Return the parameters of viscous friction, and of Coulomb friction if requested, of each joint."""
    torque, speed = device.torque_unit, device.model.fields["friction.viscous"].unit
    joints = range(device.dof)
    out = [Parameter(f"k{j + 1}", speed, f"viscous friction of joint {j + 1}", j) for j in joints]
    if coulomb:
        out += [Parameter(f"c{j + 1}", torque, f"Coulomb friction of joint {j + 1}", j) for j in joints]
    return out


def fictitious(device: Device) -> list[Device]:
    """Return one device per base parameter: that parameter is 1; all others and the friction are 0."""
    has = device.model.parameters
    zero = device.parameters.with_values(**{k: v for k, v in _ZERO.items() if k.replace("__", ".") in has})
    return [replace(device, parameters=zero.with_values(**only)) for _, _, only in _table(device).values()]


def base_values(device: Device) -> Array:
    """Return the base parameters of a device (base parameters,), SI.

    They are fitted to M(q) qd and N(q) at random states, by those of the fictitious devices; exact to rounding.
    """
    draw = np.random.default_rng(0)
    q, qd = draw.uniform(-np.pi, np.pi, (2, 40, device.dof))

    def effects(one: Device) -> Array:
        momentum = np.einsum("nij,nj->ni", one.mass_matrix(q), qd)
        return np.concatenate([momentum.ravel(), one.gravity(q).ravel()])

    columns = np.column_stack([effects(one) for one in fictitious(device)])
    return np.asarray(np.linalg.lstsq(columns, effects(device), rcond=None)[0], dtype=float)


def true_values(device: Device, parameters: list[Parameter]) -> Array:
    """Return the catalog's value of each parameter (p,), SI."""
    values = dict(zip((p.name for p in base_parameters(device)), base_values(device), strict=True))
    values |= {f"k{j + 1}": device.viscous[j] for j in range(device.dof)}
    values |= {f"c{j + 1}": device.coulomb[j] for j in range(device.dof)}
    return np.array([values[p.name] for p in parameters])


def with_base_values(
    device: Device, values: Array, viscous: Array | None = None, coulomb: Array | None = None
) -> Device:
    """Return a device with the same lengths, the base parameters `values` and the given friction.

    Infinitely many segments have the same base parameters, hence the same motion. The result is one choice, without
    negative masses and inertias if the values allow one; l5 or l6 changes its sign for a gravity of the other sign.

    Raises:
        RecordingError: the device's gravity, l5 or l6 is zero, so its gravity cannot be fitted.
        DeviceError: the values make no physical device (an inertia matrix that is not positive definite).
    """
    names = [p.name for p in base_parameters(device)]
    want = dict(zip(names, np.asarray(values, dtype=float).tolist(), strict=True))
    if names == list(_SLIDER):
        out = replace(device, parameters=device.parameters.with_values(mass__tip=want["m"]))
    else:
        given = device.parameters
        gravity = given.one("environment.gravity", 9.81)
        here = dict(zip(names, base_values(device), strict=True))
        scale = want["h"] / here["h"] if here["h"] else 0.0
        levers = {"l5": given.one("geometry.l5"), "l6": given.one("geometry.l6")}
        if 0.0 in levers.values() or gravity == 0.0:
            raise RecordingError(f"{device.name} has no gravity to fit: its g, l5 or l6 is zero")
        bare = {k: v for k, v in _ZERO.items() if k != "environment__gravity"}
        bare |= {"mass__a": scale * given.one("mass.a"), "mass__c": scale * given.one("mass.c")}
        start = replace(device, parameters=given.with_values(**bare))
        rest = {name: want[name] - v for name, v in zip(names, base_values(start), strict=True)}
        p, q = rest["P"], rest["Q"]  # an equal share of both inertias adds to A, and makes both positive
        mass_be, mass_df = rest["n2"] / (gravity * levers["l5"]), -rest["n3"] / (gravity * levers["l6"])
        filled = start.parameters.with_values(
            inertia__base=rest["A"] - abs(p) - abs(q),
            inertia__be=[rest["M22"], abs(p) + p, abs(p) - p],
            inertia__df=[rest["M33"], abs(q) - q, abs(q) + q],
            mass__be=abs(mass_be),
            mass__df=abs(mass_df),
            geometry__l5=np.copysign(1.0, mass_be) * levers["l5"],
            geometry__l6=np.copysign(1.0, mass_df) * levers["l6"],
        )
        out = replace(device, parameters=filled)
    return out.with_friction(
        viscous=device.viscous if viscous is None else np.maximum(viscous, 0.0),
        coulomb=device.coulomb if coulomb is None else np.maximum(coulomb, 0.0),
    )
