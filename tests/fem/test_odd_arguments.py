"""Whatever a caller passes to a body, it is accepted or refused by an error of the package, in one sentence."""

from __future__ import annotations

import inspect
import warnings
from typing import Any

import numpy as np
import pytest
from palpate import fem
from palpate.errors import PalpateError

ODD: list[Any] = [None, "x", "5 kg", "", [], {}, [1, 2], float("nan"), -1, 0, 1e9, True, object(), 3 + 2j]
GIVEN: dict[str, Any] = {
    "point": [0.02, 0.02, 0.02],
    "radius": "5 mm",
    "depth": "1 mm",
    "path": np.linspace([0.02, 0.02, 0.03], [0.02, 0.02, 0.024], 5),
    "paths": np.full((5, 2, 3), 0.04),
    "radii": ["5 mm", "5 mm"],
    "regions": "x < 5 mm",
    "period": "1 ms",
    "instantaneous_ratio": 2,
    "retardation_time": "0.1 s",
    "values": np.zeros(25),
    "factor": 2,
    "static_friction": 0.3,
    "points": [[0.0, 0.0, 0.0], [0.0, 5e-3, 0.0]],
    "changes": [{"at": "10 ms", "held": "x < 5 mm"}],
}
METHODS = [
    "contains", "held", "hyperelastic", "indent", "mass_spring", "modal", "on_surface", "scaled_stiffness",
    "signed_distance", "simulate_path", "simulate_tips", "viscoelastic", "with_contact_points", "with_friction",
    "with_support_changes",
]  # fmt: skip
BY_DISTANCE = ("simulate_tips", "with_contact_points")


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> fem.Body:
    """40 x 40 x 20 mm of 10 kPa, bonded below, touched on its top, with vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.04, 0.04, 0.02), 0.01)
    return fem.build(shape, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=4, output=path)


@pytest.mark.parametrize("name", METHODS)
def test_an_odd_argument_raises_no_error_of_python(body: fem.Body, name: str) -> None:
    method = getattr(body.signed_distance() if name in BY_DISTANCE else body, name)
    parameters = [p for p in inspect.signature(method).parameters.values() if p.kind is not p.VAR_KEYWORD]
    usual = {p.name: GIVEN.get(p.name, "5 mm") for p in parameters if p.default is p.empty}
    said = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        method(**usual)
        for parameter in parameters:
            for value in ODD:
                try:
                    method(**{**usual, parameter.name: value})
                except PalpateError as problem:
                    said.append(str(problem))
                except Exception as problem:
                    pytest.fail(f"{name}({parameter.name}={value!r}): {type(problem).__name__}: {problem}")
    assert len(said) > len(parameters)
    assert all(said)


def test_where_a_tip_is_not_is_said(body: fem.Body) -> None:
    """A point beside the body, a tip that starts inside it, and two tips in one place."""
    with pytest.warns(
        fem.BodyWarning, match=r"point: it lies 15 mm from the surface; .* nearest point \(40, 20, 20\) mm"
    ):
        body.signed_distance().indent(["55 mm", "20 mm", "20 mm"], "8 mm", "1 mm")
    by_distance = body.signed_distance()
    with pytest.warns(fem.BodyWarning, match="path: a tip starts inside the body"):
        by_distance.simulate_path([[0.02, 0.02, 0.012]] * 3, "8 mm")
    with pytest.warns(fem.BodyWarning, match="path: a tip starts inside the body"):
        by_distance.simulate_tips(np.array([[[0.02, 0.02, 0.03], [0.02, 0.02, 0.012]]] * 3), ["4 mm", "4 mm"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        body.signed_distance().simulate_path([[0.02, 0.02, 0.028]] * 3, "8 mm")
    volume = fem.block((0.02, 0.02, 0.02), 0.01)
    solver = fem.QuasiStaticSolver(fem.HyperelasticModel(volume, fem.Material("5 kPa"), "z < 0.001 mm"))
    with pytest.raises(fem.BodyError, match="in row 1 both tips are in the same place"):
        solver.simulate_path(
            [[[0.01, 0.01, 0.03], [0.0, 0.01, 0.03]], [[0.01, 0.01, 0.03]] * 2], "4 mm", outward=(0, 0, 1)
        )
