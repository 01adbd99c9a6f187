"""The palpation phantom: what it hands to the builder, and the nodules that fit into its block."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.fem import BodyError, palpation_phantom
from palpate.fem.palpation_phantom import phantom


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, dict[str, Any]]]:
    calls: list[tuple[Any, dict[str, Any]]] = []
    monkeypatch.setattr(palpation_phantom, "build", lambda volume, **options: calls.append((volume, options)))
    return calls


def test_the_default_phantom_has_a_skin_of_2_mm_and_a_nodule_of_15_mm_at_10_mm(built: Any) -> None:
    phantom()
    (volume, options) = built[0]
    assert volume.source == "block of 100 x 100 x 50 mm"
    np.testing.assert_allclose(np.unique(volume.points[:, 0]), np.arange(21) * 5e-3, atol=1e-12)
    planes = np.append(np.linspace(0.0, 0.048, 11), 0.05)
    np.testing.assert_allclose(np.unique(volume.points[:, 2].round(12)), planes, atol=1e-12)
    assert (options["young"], options["poisson"], options["modes"]) == (10e3, 0.45, 0)
    assert options["output"] is None
    assert options["progress"] is None
    assert (options["surface_layer"].thickness, options["surface_layer"].young) == (2e-3, 50e3)
    probes = np.array([[0.0, 0.0, -9e-7], [0.0, 0.0, 1.1e-6], [0.0, 0.0, 0.05 - 9e-7], [0.0, 0.0, 0.05 - 1.1e-6]])
    assert options["fixed"].inside(probes).tolist() == [True, False, False, False]
    assert options["touch"].inside(probes).tolist() == [False, False, True, False]
    (nodule,) = options["regions"]
    assert nodule.young == pytest.approx(50e3)
    middle = np.array([0.05, 0.05, 0.0325])
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        assert nodule.where.inside(middle + np.outer([7.4e-3, 7.6e-3], axis)).tolist() == [True, False]


def test_a_contrast_of_1_is_no_nodule_and_a_thickness_of_0_is_no_skin(built: Any) -> None:
    given: dict[str, Any] = {"young": "8 kPa", "poisson": 0.3, "spacing": "20 mm", "modes": 3}
    given |= {"output": "file.h5", "progress": print}
    phantom(contrast=1.0, layer_thickness=0.0, **given)
    (volume, options) = built[0]
    assert options["regions"] == []
    assert options["surface_layer"] is None
    np.testing.assert_allclose(np.unique(volume.points[:, 2]), [0.0, 0.025, 0.05], atol=1e-12)
    assert (options["young"], options["poisson"], options["modes"]) == (8e3, 0.3, 3)
    assert (options["output"], options["progress"]) == ("file.h5", print)


@pytest.mark.parametrize(
    ("layer", "depth", "diameter", "said"),
    [
        (0.05, 0.05, 0.01, "layer_thickness: 50 mm"),
        (0.03, 0.03, 0.0201, "diameter: 20.1 mm"),
        (0.01, 0.009, 0.02, "depth: 9 mm"),
        (0.01, 0.0301, 0.02, "depth: 30.1 mm"),
        (0.01, 0.01, 0.02, ""),
        (0.0, 0.03125, 0.01875, ""),
        (0.03125, 0.03125, 0.01875, ""),
    ],
)
def test_a_nodule_lies_between_the_skin_and_the_bottom(
    layer: float, depth: float, diameter: float, said: str, built: Any
) -> None:
    given: dict[str, Any] = {"layer_thickness": layer, "depth": depth, "diameter": diameter, "spacing": 0.025}
    if said:
        with pytest.raises(BodyError, match=said):
            phantom(**given)
    else:
        phantom(**given)
    assert len(built) == (not said)
