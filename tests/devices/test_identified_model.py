"""Files of identified models: read as they are written, and refused with the key that is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate.devices.catalog import _identified, identified_model, load
from palpate.errors import DeviceError

MODEL: dict[str, Any] = {
    "name": '"mine"',
    "description": '"two states"',
    "source": '"measured"',
    "period": '"0.5 ms"',
    "a": "[[0.9, 0.1], [0.0, 0.8]]",
    "b": "[[0.0], [1.0]]",
    "c": "[[2.0, 0.0]]",
}


def written(tmp_path: Path, **changes: str | None) -> str:
    lines = [f"{key} = {value}" for key, value in {**MODEL, **changes}.items() if value is not None]
    path = tmp_path / f"model-{len(list(tmp_path.iterdir()))}.toml"
    path.write_text("\n".join(lines), "utf-8")
    return str(path)


def test_an_identified_model_is_read_from_its_file(tmp_path: Path) -> None:
    found = _identified(written(tmp_path), 1)
    assert (found.name, found.description, found.source, found.period) == ("mine", "two states", "measured", 5e-4)
    assert np.array_equal(found.a, [[0.9, 0.1], [0.0, 0.8]])
    assert np.array_equal(found.b, [[0.0], [1.0]])
    assert np.array_equal(found.c, [[2.0, 0.0]])


@pytest.mark.parametrize("key", list(MODEL))
def test_a_key_that_is_missing_is_named(key: str, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=rf"model-0\.toml: {key} is missing$"):
        _identified(written(tmp_path, **{key: None}), 1)


@pytest.mark.parametrize(
    ("changes", "dof", "says"),
    [
        ({"period": '"0 s"'}, 1, r"period is 0 s; it must be positive"),
        ({"a": "3"}, 1, r"a must be 0 x 0, not of shape \(\)"),
        ({"a": "[[0.9, 0.1]]"}, 1, r"a must be 1 x 1, not of shape \(1, 2\)"),
        ({}, 2, r"b must be 2 x 2, not of shape \(2, 1\)"),
        ({"b": "[[0.0, 1.0], [1.0, 0.0]]"}, 2, r"c must be 2 x 2, not of shape \(1, 2\)"),
        ({"c": '[["one", 0.0]]'}, 1, r"c must be a matrix: a list of rows of numbers"),
        ({"c": "[[inf, 0.0]]"}, 1, r"c has a number that is not finite"),
    ],
)
def test_matrices_and_the_period_that_fit_no_model_are_refused(
    changes: dict[str, str], dof: int, says: str, tmp_path: Path
) -> None:
    with pytest.raises(DeviceError, match=rf"model-0\.toml: {says}$"):
        _identified(written(tmp_path, **changes), dof)


def test_a_device_without_an_identified_model_says_so() -> None:
    with pytest.raises(DeviceError, match="slider has no identified model; give one as identified_model in its file"):
        identified_model(load("slider"))
