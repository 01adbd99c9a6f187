"""What `sweep` and `body` print of a result, and which of their options are refused."""

from __future__ import annotations

from contextlib import ExitStack, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.cli.body import _rows
from palpate.cli.sweep import _executor, _pairs, _print_result, _shard
from palpate.simulation.verdict import State
from palpate.sweeps import SweepError

LONG = Path("/tmp") / ("folder[1]" * 12) / "s.h5"


def plan(**changes: Any) -> Any:
    values = {"count": 12345, "chunks": 7, "chunk": 2000, "tables": {"title": "A [title]"}}
    return SimpleNamespace(**{**values, **changes})


@pytest.mark.parametrize(
    ("done", "idle", "one", "first"),
    [
        (1.0, False, {}, "A [title]: 12,345 cells"),
        (0.12345, False, {}, "A [title]: 12.3% of 12,345 cells are done"),
        (1.0, False, {"tables": {}}, "s: 12,345 cells"),
        (1.0, True, {}, "A [title]: nothing for shard 9/9 to run: the 12,345 cells are 7 chunks of up to 2,000, and "
         "shard 1 to 7 run them all"),
        (1.0, True, {"chunks": 1}, "A [title]: nothing for shard 9/9 to run: the 12,345 cells are 1 chunk of up to "
         "2,000, and shard 1 runs it all"),
    ],
)  # fmt: skip
def test_a_sweep_says_how_many_cells_are_done_and_their_verdicts(
    done: float, idle: bool, one: dict[str, Any], first: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    counts = [0] * len(State)
    counts[State.SETTLED], counts[State.UNDECIDED] = 12000, 345
    monkeypatch.setattr("palpate.sweeps.store.tally", lambda _: counts)
    found: Any = SimpleNamespace(plan=plan(**one), done=done, excitation="a [push] of 1 N " * 8)
    _print_result(found, LONG, "9/9", idle)
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    rest = [] if idle else ["12,000 settled, 345 undecided", ("a [push] of 1 N " * 8).strip()]
    assert lines == [first, *rest, str(LONG)]


def test_keys_have_values_and_come_once() -> None:
    assert _pairs([" a.b = 1 N..2 N:3", "c=x=y"]) == {"a.b": " 1 N..2 N:3", "c": "x=y"}
    assert _pairs([]) == {}
    for text in ("a", "a=", "a=  "):
        with pytest.raises(SweepError, match=f'"{text}" is no key with values; write for example'):
            _pairs([text])
    with pytest.raises(SweepError, match="a is given twice"):
        _pairs(["a=1", " a =2"])


def test_a_shard_is_two_numbers() -> None:
    assert (_shard(None), _shard("2/8"), _shard("123456/999999")) == (None, (2, 8), (123456, 999999))
    for wrong in ("2", "2/", "a/8", "2/8/9", "-1/8", "1234567/8"):
        with pytest.raises(SweepError, match="write it as 2/8, the second of eight"):
            _shard(wrong)


def test_an_engine_and_its_scheduler_belong_together(monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as stack:
        assert _executor(stack, "threads", None, 3) == (None, 3)
        for engine, scheduler, said in (
            ("dask", None, "--engine dask needs the scheduler's address"),
            ("other", None, "--engine other: choose threads, or dask with --scheduler ADDRESS"),
            ("threads", "tcp://a", "--scheduler is for --engine dask: add that, or leave the address out"),
        ):
            with pytest.raises(SweepError, match=said):
                _executor(stack, engine, scheduler, 3)
        monkeypatch.setattr("palpate.sweeps.run.dask_executor", lambda address: nullcontext((address, 8)))
        assert _executor(stack, "dask", "tcp://a", 3) == ("tcp://a", 8)


def test_the_rows_of_a_body_state_its_numbers_in_their_units() -> None:
    record = {
        "volume_m3": 4e-6, "young_Pa": 2e3, "poisson": 0.45, "density_kg_per_m3": 1050.0, "regions": ["a nodule"],
        "surface_layer": "a skin", "fixed": ["z < 1 mm", "x < 1 mm"], "held": ["y < 1 mm", "y > 2 mm"],
        "touch": "z > 9 mm", "order": 2, "nodes": 1234, "unknowns": 3702,
        "seconds": {"meshing": 1.234, "solving": 5.678},
        "memory_bytes": 2.5e9, "operations": 1.2e10, "versions": {"palpate": "1.0", "numpy": "2"},
    }  # fmt: skip
    contents = SimpleNamespace(young=np.array([1e3, 5e3]), frequencies=2.0 * np.pi * np.array([20.0, 345.6]))
    body: Any = SimpleNamespace(record=record, points=np.array([[0.0, 0, 0], [0.01, 0.02, 0.03]]), contents=contents)
    assert dict(_rows(body)) == {
        "size": "10 × 20 × 30 mm, 4 cm³",
        "material": "Young's modulus 1 to 5 kPa, Poisson's ratio 0.45, 1050 kg/m³",
        "region": "a nodule", "layer": "a skin", "fixed": "z < 1 mm, x < 1 mm", "held": "y < 1 mm, y > 2 mm",
        "contact": "z > 9 mm", "elements": "quadratic, 1,234 nodes, 3,702 unknowns", "modes": "2, 20 to 346 Hz",
        "build": "2.5 GB, 12 Gflop; meshing 1.23 s, solving 5.68 s", "versions": "palpate 1.0, numpy 2",
    }  # fmt: skip
    body.record = {"young_Pa": 2e3, "order": 1, "method": "boundary elements"}
    body.contents = SimpleNamespace(young=np.empty(0), frequencies=np.empty(0))
    assert dict(_rows(body)) == {
        "size": "10 × 20 × 30 mm, 0 cm³", "material": "Young's modulus 2 kPa, Poisson's ratio None, 0 kg/m³",
        "fixed": "?", "contact": "whole surface that is not fixed",
        "elements": "boundary elements, linear, 0 nodes, 0 unknowns", "modes": "none", "build": "0 GB, 0 Gflop; ",
        "versions": "",
    }  # fmt: skip
    for values, spread in (([1e3, 1e3 * (1 + 0.9e-6)], "1"), ([1e3, 1.00001e3], "1 to 1")):
        body.contents.young = np.array(values)
        assert dict(_rows(body))["material"].startswith(f"Young's modulus {spread} kPa")
