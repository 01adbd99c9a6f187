"""Sweeps that are too large are refused before anything is expanded, and large files are read in parts."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from palpate.simulation.verdict import State
from palpate.sweeps import SweepError, open_sweep, store, sweep, sweep_plot
from palpate.sweeps.axes import LONGEST, axes_of
from palpate.sweeps.run import IN_MEMORY, plan_of

SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["0.1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "50 N/m"},
    "run": {"duration": "50 ms"},
}
TEN_THOUSAND = {"object.stiffness": "10 N/m..20 N/m:10000", "object.damping": "0 N*s/m..1 N*s/m:10000"}


@pytest.mark.parametrize(
    ("over", "more", "says"),
    [
        (
            {"object.stiffness": "1 N/m..2 N/m:100000000"},
            {},
            "object.stiffness: 100,000,000 values; a key takes at most",
        ),
        (
            {"object.stiffness": np.ones(LONGEST + 1)},
            {},
            "object.stiffness: 100,001 values; a key takes at most 100,000",
        ),
        (
            dict.fromkeys(TEN_THOUSAND, "1 N/m..2 N/m:100000"),
            {},
            "10,000,000,000 cells (100,000 × 100,000); the most is",
        ),
        (TEN_THOUSAND, {"draws": 2}, "200,000,000 cells (10,000 × 10,000 × 2); the most is 100,000,000"),
        (TEN_THOUSAND, {}, "out: 100,000,000 cells take 14 GB, and a sweep in memory has at most 10,000,000 cells"),
    ],
)
def test_a_sweep_that_is_too_large_is_refused_at_once(over: Any, more: dict[str, Any], says: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(SweepError) as caught:
            sweep(SLIDER, over, **more)
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith(says)


def test_the_largest_plan_of_a_file_is_accepted() -> None:
    assert plan_of(SLIDER, TEN_THOUSAND).count == 100_000_000 > IN_MEMORY
    assert len(axes_of({"object.stiffness": f"1 N/m..2 N/m:{LONGEST}"})[0]) == LONGEST


def test_states_of_a_file_are_counted_in_parts_and_maps_drawn_in_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    over = {"object.stiffness": "20 N/m..3 N/mm:7", "object.damping": "0 N*s/m..1 N*s/m:5"}
    found = sweep(SLIDER, over, out=tmp_path / "a.h5")
    verdict = found["verdict"]
    counts = [int(np.count_nonzero(verdict == state)) for state in State]
    assert sum(counts) == 35
    assert found.outcomes.tally() == sweep(SLIDER, over).outcomes.tally() == counts
    monkeypatch.setattr(store, "_PART", 4)
    assert open_sweep(tmp_path / "a.h5").outcomes.tally() == store.tally(tmp_path / "a.h5") == counts
    monkeypatch.setattr(sweep_plot, "MOST", 3)
    axes = Figure().subplots()
    sweep_plot.plot_sweep(found, axes)
    shown = axes.collections[0].get_array()
    assert shown is not None
    np.testing.assert_array_equal(shown.reshape(3, 3), verdict[::3, ::2])
