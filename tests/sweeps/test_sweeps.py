"""Sweeps: cells are what `simulate` finds, the file is the same whoever fills it, and nothing done is lost."""

from __future__ import annotations

import re
import resource
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import palpate
import pytest
from nightly import nightly
from palpate.cli.main import app
from palpate.errors import OutputError, ScenarioError
from palpate.report.sweep import sweep_page
from palpate.sweeps import State, SweepError, merge, open_sweep, sweep
from palpate.sweeps.axes import Axis, _spread, _value, axes_of, limits_of, stored_axis, with_value
from palpate.sweeps.run import _run, dask_executor, plan_of
from palpate.sweeps.store import FileStore
from palpate.sweeps.sweep_plot import plot_sweep
from resealed import changed
from typer.testing import CliRunner

SLIDER: dict[str, Any] = {
    "title": "a wall in the hand",
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display"},
    "operator": {
        "kind": "arm",
        "mass": "0.1 kg",
        "damping": "1 N*s/m",
        "stiffness": "200 N/m",
        "shape": "step",
        "force": ["-0.5 N", "0 N", "0 N"],
        "stop": "20 ms",
    },
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "run": {"duration": "0.25 s"},
}
OVER: dict[str, Any] = {"object.damping": [0.0, 1.0], "object.stiffness": "100 N/m..20 N/mm:150 log"}


def test_a_cell_is_what_simulate_finds() -> None:
    found = sweep(
        SLIDER, {"device.delay": [0, 2], "operator.mass": ["0.1 kg", "0.2 kg"], "object.stiffness": "1 N/mm..9 N/mm:5"}
    )
    assert found.shape == (2, 2, 5)
    assert found.done == 1.0
    for index in np.ndindex(found.shape):
        trace = found.simulate(*index)
        if trace.unstable_from is not None:
            assert found["unstable_from"][index] == trace.unstable_from
            assert found["verdict"][index] == State.UNSTABLE
            continue
        assert np.isnan(found["unstable_from"][index])
        bend = np.linalg.norm(np.diff(trace["tip"], n=2, axis=0), axis=1)  # entry k - 2 belongs to sample k
        first, last = found.excitation.first, len(trace) - 1
        fifth = (last - first) // 5
        early, prior, late = (
            bend[begin - 1 : begin - 1 + fifth].max() for begin in (first + fifth, last - 2 * fifth, last - fifth)
        )
        assert found["oscillation_2"][index] == pytest.approx(early, rel=1e-6)
        assert found["oscillation_4"][index] == pytest.approx(prior, rel=1e-6)
        assert found["oscillation_5"][index] == pytest.approx(late, rel=1e-6)
        assert (found.outcomes.growth[index] > 1) == (late > min(early, prior))
        assert found["ripple"][index] == pytest.approx(np.ptp(trace["tip"][-50:], axis=0).max() / 2, rel=1e-9)
        assert found["peak_object_force"][index] == pytest.approx(
            np.linalg.norm(trace["object_force"], axis=1).max(), rel=1e-9
        )
    assert found.unstable.any()
    assert not found.unstable.all()


def test_a_tip_that_still_slides_along_a_wall_is_not_settled() -> None:
    """It ends far from where it is in a run twenty times as long; the wall's own loop at the start has no slide."""
    scenario: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "reference": {"force": ["-1.2 N", "0 N", "0 N"]},
        "object": {"kind": "wall", "normal": [1, 0, 0], "stiffness": "46 N/m", "damping": "1 N*s/m"},
    }
    over = {"object.stiffness": ["46 N/m"]}
    short, long = (sweep({**scenario, "run": {"duration": t}}, over) for t in ("0.24 s", "4.8 s"))
    way = np.linalg.norm(long["steady_tip"] - short["steady_tip"])
    assert way > 0.1 * np.linalg.norm(long["steady_tip"])
    assert not short.settled.any()


def test_a_cell_that_rests_off_force_over_stiffness_is_not_settled() -> None:
    """An arm of 100 N/m takes its share of the force: 25, 9.1 and 3.8 % of F/K; up to 5 % count as settled."""
    arm = {"kind": "arm", "mass": "0.05 kg", "damping": "8 N*s/m", "stiffness": "100 N/m"}
    tables = {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["1 N", "0 N", "0 N"]},
        "controller": {"kind": "gain", "gain": [1.0, 1.0, 1.0]},
        "operator": arm,
        "object": {"kind": "spring", "stiffness": "1 N/mm", "damping": "0.5 N*s/m"},
        "run": {"duration": "1 s"},
    }
    found = sweep(tables, {"object.stiffness": ["300 N/m", "1 N/mm", "2.5 N/mm"]})
    assert [found.verdict(cell) for cell in range(3)] == [State.UNDECIDED, State.UNDECIDED, State.SETTLED]
    np.testing.assert_allclose(found["steady_tip"][:, 0], 1.0 / (np.array([300.0, 1000.0, 2500.0]) + 100.0), rtol=1e-3)
    assert [found.simulate(cell).verdict.state for cell in range(3)] == [found.verdict(cell) for cell in range(3)]


def test_keys_without_a_lane_of_their_own_are_made_ready_anew() -> None:
    """The servo period and a word change the whole setup; a designed controller follows its object."""
    over = {
        "object.stiffness": [500.0, 900.0],
        "servo.period": ["0.5 ms", "1 ms"],
        "object.coupling": "backward,bilinear",
    }
    found = sweep({**SLIDER, "object": {"stiffness": "1 N/mm", "damping": "2 N*s/m"}}, over)
    assert found.shape == (2, 2, 2)
    assert len({round(float(f), 12) for f in found["peak_object_force"].ravel()}) == 8
    tracking = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "reference": {"force": "2 N"},
        "object": {"stiffness": "1 N/mm"},
        "controller": {"kind": "lead_lag"},
        "run": {"duration": "20 ms"},
    }
    designed = sweep(tracking, {"object.stiffness": ["1 N/mm", "2 N/mm"]})
    alone = palpate.simulate({**tracking, "object": {"stiffness": "2 N/mm"}})
    assert designed["peak_object_force"][1] == pytest.approx(np.linalg.norm(alone["object_force"], axis=1).max())


def test_the_file_does_not_depend_on_who_fills_it(tmp_path: Path) -> None:
    """The core's threads, an executor, shards put together: the same bytes; draws have a generator for each cell."""
    slider = {**SLIDER, "run": {"duration": "1 s"}}
    random = {"operator.mass": "0.05 kg..0.3 kg", "operator.damping": "0.5 N*s/m..4 N*s/m"}
    options: dict[str, Any] = {"random": random, "draws": 20, "seed": 7}
    sweep(slider, OVER, out=tmp_path / "one.h5", workers=1, **options)
    whole = (tmp_path / "one.h5").read_bytes()
    with ThreadPoolExecutor(2) as pool:
        sweep(slider, OVER, out=tmp_path / "two.h5", executor=pool, workers=2, **options)
    assert (tmp_path / "two.h5").read_bytes() == whole
    for part in (1, 2):
        sweep(slider, OVER, out=tmp_path / f"part{part}.h5", shard=(part, 2), **options)
    assert 0.0 < open_sweep(tmp_path / "part1.h5").done < 1.0
    with pytest.raises(SweepError, match="done in none"):
        merge([tmp_path / "part1.h5"], tmp_path / "merged.h5")
    merge([tmp_path / "part1.h5", tmp_path / "part2.h5"], tmp_path / "merged.h5")
    assert (tmp_path / "merged.h5").read_bytes() == whole
    found = open_sweep(tmp_path / "one.h5")
    assert found.shape == (2, 150, 20)
    assert len(np.unique(found["peak_object_force"])) > 5900
    other = sweep(slider, OVER, **{**options, "seed": 8})
    assert not np.array_equal(other["peak_object_force"], found["peak_object_force"])


@pytest.mark.parametrize("workers", [None, 2])
@pytest.mark.parametrize(("todo", "cells"), [([0, 1, 2], [4, 8, 10]), ([1], [4])])
def test_each_chunk_is_run_once_and_progress_counts_the_cells_that_are_done(
    todo: list[int], cells: list[int], workers: int | None
) -> None:
    """Here or by an executor: ten cells in chunks of four, the last of two; a shard counts its own chunks alone."""
    ran: list[tuple[int, int]] = []
    kept: dict[int, Any] = {}
    said: list[tuple[str, float]] = []

    def run(first: int, last: int, threads: int = 1) -> dict[str, Any]:
        ran.append((first, last))
        return {"first": first}

    plan, store = SimpleNamespace(chunk=4, count=10, run=run), SimpleNamespace(put=kept.__setitem__)
    with ThreadPoolExecutor(1) as pool:
        _run(plan, todo, store, pool if workers else None, workers, lambda *one: said.append(one))  # type: ignore
    assert sorted(ran) == [(4 * chunk, min(4 * chunk + 4, 10)) for chunk in todo]
    assert kept == {chunk: {"first": 4 * chunk} for chunk in todo}
    assert said == [(f"{n} of {cells[-1]} cells", (i + 1) / len(todo)) for i, n in enumerate(cells)]


@nightly
def test_two_dask_workers_give_the_same_file_as_none(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    slider = {**SLIDER, "run": {"duration": "1 s"}}
    over = {"object.damping": "0 N*s/m..2 N*s/m:10", "object.stiffness": "100 N/m..20 N/mm:1000 log"}
    sweep(slider, over, out=tmp_path / "none.h5")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        arguments = [f"--over={key}={text}" for key, text in over.items()]
        (tmp_path / "s.toml").write_text(palpate.stability.counter_example.to_toml(slider), "utf-8")
        done = CliRunner().invoke(
            app,
            [
                *("sweep", str(tmp_path / "s.toml"), *arguments, "--out", str(tmp_path / "dask.h5")),
                *("--engine", "dask", "--scheduler", cluster.scheduler_address),
            ],
        )
        assert done.exit_code == 0, done.output
    assert "10,000 cells" in done.output
    assert (tmp_path / "dask.h5").read_bytes() == (tmp_path / "none.h5").read_bytes()


def test_a_scheduler_that_is_not_there_is_said(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(SweepError, match="no Dask scheduler answers at"),
        dask_executor("tcp://127.0.0.1:9", timeout=1.0),
    ):
        pass


KILLED = """
import sys
from palpate.sweeps import sweep
from tests_sweeps_plan import SLIDER, OVER
sweep(SLIDER, OVER, out=sys.argv[1], workers=1, progress=lambda text, share: print(text, flush=True))
"""


def test_killed_it_goes_on_where_it_was(tmp_path: Path) -> None:
    """Killed after its first chunks: they are kept, not run again, and the end is as if never killed."""
    over = {"object.damping": "0 N*s/m..2 N*s/m:40", "object.stiffness": "100 N/m..20 N/mm:1500 log"}
    (tmp_path / "tests_sweeps_plan.py").write_text(f"SLIDER = {SLIDER!r}\nOVER = {over!r}\n", "utf-8")
    file = tmp_path / "killed.h5"
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n" + KILLED
    run = subprocess.Popen([sys.executable, "-c", code, str(file)], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    run.stdout.readline()
    run.send_signal(signal.SIGKILL)
    run.wait()
    run.stdout.close()
    begun = open_sweep(file)
    assert 0.0 < begun.done < 1.0
    ran: list[tuple[int, int]] = []
    plan = type(begun.plan)
    original = plan.run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "run", lambda self, a, b, threads=1: ran.append((a, b)) or original(self, a, b, threads))
        ended = sweep(SLIDER, over, out=file)
    assert ended.done == 1.0
    assert len(ran) == round((1 - begun.done) * -(-begun.plan.count // begun.plan.chunk))
    sweep(SLIDER, over, out=tmp_path / "whole.h5")
    assert file.read_bytes() == (tmp_path / "whole.h5").read_bytes()


def test_a_disk_that_is_too_small_is_told_before_anything_is_run(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(palpate.stability.counter_example.to_toml(SLIDER), "utf-8")
    arguments = ["sweep", str(path), "--over=object.stiffness=100 N/m..9 N/mm:5000", "--out", str(tmp_path / "out.h5")]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20000, before[1]))
    try:
        done = CliRunner().invoke(app, arguments)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert done.exit_code == 2
    assert "cannot be written" in done.output
    assert list(tmp_path.iterdir()) == [path]


def test_mistakes_are_told_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="is no key of a scenario"):
        sweep(SLIDER, {"stiffness": [1.0]})
    with pytest.raises(ScenarioError, match="stifness"):
        sweep(SLIDER, {"object.stifness": ["1 N/mm"]})
    with pytest.raises(ScenarioError, match="must not be negative"):
        sweep(SLIDER, {"object.damping": [1.0, -1.0]})
    for text in ("50 N/m..150 N/m", "50 N/m...150 N/m:3", "50 N/m..150 N/m:-3", "50 N/m..150 N/m:2.5"):
        with pytest.raises(SweepError, match="is no range; write both ends"):
            sweep(SLIDER, {"object.stiffness": text})
    with pytest.raises(SweepError, match="a key takes at most"):
        sweep(SLIDER, {"object.stiffness": "1 N/m..2 N/m:99999999999"})
    with pytest.raises(ScenarioError, match='surface belongs to kind = "mesh"'):
        sweep(SLIDER, {"object.surface.stiffness": ["1 N/mm"]})
    with pytest.raises(SweepError, match="no range to draw from"):
        sweep(SLIDER, OVER, random={"operator.mass": "0.1 kg..0.2 kg:5"})
    with pytest.raises(SweepError, match="the first number goes from 1"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, out=tmp_path / "shard.h5", shard=(3, 2))
    assert not (tmp_path / "shard.h5").exists()
    for wrong in (3, (1, 2, 3), (1.0, 2.0), ("1", "2")):
        with pytest.raises(SweepError, match=r"shard: .* it is two whole numbers"):
            sweep(SLIDER, {"object.stiffness": [1.0]}, shard=wrong)  # type: ignore[arg-type]
    with pytest.raises(OutputError, match="a file is named by text or a Path, not by 3"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, out=3)  # type: ignore[arg-type]
    with pytest.raises(SweepError, match="a file is named by text or a Path, not by 3"):
        open_sweep(3)  # type: ignore[arg-type]
    with pytest.raises(SweepError, match="nothing to vary: give for example over="):
        sweep(SLIDER, [1.0])  # type: ignore[arg-type]
    for name in ("draws", "seed"):
        with pytest.raises(SweepError, match=f"{name}: '3' is not a whole number"):
            sweep(SLIDER, OVER, **{name: "3"})  # type: ignore[arg-type]
    with pytest.raises(SweepError, match="a list of files is put together"):
        merge("a.h5", tmp_path / "all.h5")
    with pytest.raises(OutputError, match="is a folder"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, out=tmp_path)
    with pytest.raises(SweepError, match=r"none\.h5: there is no such file"):
        merge([tmp_path / "none.h5"], tmp_path / "all.h5")
    for wrong in (np.nan, np.inf, None, {}):
        with pytest.raises(SweepError, match=f"object.stiffness: {wrong!r} is not a finite number"):
            sweep(SLIDER, {"object.stiffness": [wrong]})
    with pytest.raises(SweepError, match="a stiffness is needed"):
        sweep(SLIDER, {"object.stiffness": ["3 kg"]})
    with pytest.raises(SweepError, match="cannot be drawn at random"):
        sweep(SLIDER, OVER, random={"servo.period": "1 ms..2 ms"})
    with pytest.raises(SweepError, match="free to move"):
        sweep({**SLIDER, "operator": {"kind": "fixed"}}, {"object.stiffness": [1.0]})
    with pytest.raises(SweepError, match="the most is"):
        sweep(SLIDER, {"object.stiffness": "1 N/m..2 N/m:100000", "object.damping": "1 N*s/m..2 N*s/m:100000"})
    sweep(SLIDER, {"object.stiffness": [1.0]}, out=tmp_path / "a.h5")
    with pytest.raises(SweepError, match="another sweep"):
        sweep(SLIDER, {"object.stiffness": [2.0]}, out=tmp_path / "a.h5")
    with FileStore(tmp_path / "a.h5", plan_of(SLIDER, {"object.stiffness": [1.0]})):
        assert open_sweep(tmp_path / "a.h5").done == 1.0  # reading does not wait
        with pytest.raises(SweepError, match="is being written by another sweep"):
            sweep(SLIDER, {"object.stiffness": [1.0]}, out=tmp_path / "a.h5")
    with changed(tmp_path / "a.h5") as file:
        del file["oscillation_4"]
    with pytest.raises(SweepError, match="has no oscillation_4: another version wrote it"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, out=tmp_path / "a.h5")
    (tmp_path / "b.h5").write_text("no HDF5", "utf-8")
    with pytest.raises(SweepError, match="not an HDF5 file, so not a sweep; give another file, or delete it"):
        sweep(SLIDER, {"object.stiffness": [2.0]}, out=tmp_path / "b.h5")
    with pytest.raises(OutputError):
        sweep(SLIDER, {"object.stiffness": [2.0]}, out=tmp_path / "b.h5" / "c.h5")


def test_the_command_line_says_what_it_needs(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(palpate.stability.counter_example.to_toml(SLIDER), "utf-8")
    asked = ["sweep", str(path), "--over=object.stiffness=1 N/m,2 N/m", "--out", str(tmp_path / "out.h5")]
    for more, says in (
        (["--over=object.stiffness=3 N/m"], "object.stiffness is given twice"),
        (["--scheduler=tcp://127.0.0.1:9"], "--scheduler is for --engine dask"),
        (["--engine=dask"], "needs the scheduler's address"),
        (["--engine=spark"], "choose threads, or dask"),
        (["--shard=second"], "write it as 2/8"),
    ):
        done = CliRunner().invoke(app, [*asked, *more])
        assert done.exit_code == 2
        assert says in " ".join(done.output.split())
    assert list(tmp_path.iterdir()) == [path]


def test_a_sweep_is_shown_in_a_line(tmp_path: Path) -> None:
    """What varied, how many cells, and where they are; not the arrays."""
    over = {"object.stiffness": [50.0, 60.0, 70.0], "object.damping": [0.0, 0.1]}
    kept = "object.stiffness (3) × object.damping (2)"
    assert repr(sweep(SLIDER, over)) == f"<Sweep: {kept}; 100% of 6 cells run>"
    path = tmp_path / "part.h5"
    assert repr(sweep(SLIDER, over, draws=4, out=path, shard=(2, 2))) == (
        f"<Sweep: {kept}, 4 draws each; 0% of 24 cells run, in {path}>"
    )


def test_a_shard_without_cells_says_so_and_is_merged(tmp_path: Path) -> None:
    """Cells go in chunks: of 2 cells all are the first shard's, and the second's file adds nothing."""
    path = tmp_path / "s.toml"
    path.write_text(palpate.stability.counter_example.to_toml(SLIDER), "utf-8")
    said = []
    for shard in ("1/2", "2/2"):
        part = tmp_path / f"{shard[0]}.h5"
        asked = ["sweep", str(path), "--over=object.stiffness=1 N/m,2 N/m", f"--shard={shard}", f"--out={part}"]
        said.append(" ".join(CliRunner().invoke(app, asked).output.split()))
    assert "2 undecided" in said[0]
    assert "nothing for shard 2/2 to run: the 2 cells are 1 chunk of up to" in said[1]
    assert "shard 1 runs it all" in said[1]
    assert "settled" not in said[1]
    merge([tmp_path / "1.h5", tmp_path / "2.h5"], tmp_path / "all.h5")
    assert open_sweep(tmp_path / "all.h5").done == 1.0


def test_ranges_and_lists() -> None:
    (axis,) = axes_of({"object.stiffness": "100 N/m..5 N/mm:3 log"})
    np.testing.assert_allclose(axis.values, [100.0, np.sqrt(100.0 * 5000.0), 5000.0])
    (axis,) = axes_of({"servo.period": "0.5 ms..2 ms:4"})
    assert axis.text(1) == "0.001 s"
    (axis,) = axes_of({"operator.force.z": ["1 N", "-2 N"]})
    assert with_value(SLIDER, axis, 1)["operator"]["force"] == ["-0.5 N", "0 N", "-2.0 N"]
    (axis,) = axes_of({"object.stiffness.y": ["2 N/m"]})  # the other axes keep their common value
    assert with_value(SLIDER, axis, 0)["object"]["stiffness"] == ["1 N/mm", "2.0 N/m", "1 N/mm"]
    assert limits_of("operator.mass", "0.1 kg..0.1 kg") == (0.1, 0.1)
    with pytest.raises(SweepError, match=r"from the smaller to the larger, not from 0\.2 kg to 0\.1 kg"):
        limits_of("operator.mass", "0.2 kg..0.1 kg")


def test_one_component_of_a_stiffness_is_varied_as_the_whole_key() -> None:
    """The slider moves along x alone: the stiffness along x is its stiffness, and that along y is not felt."""
    stiffness = ["1 N/mm", "2 N/mm"]
    whole, x, y = (
        sweep(SLIDER, {f"object.stiffness{axis}": stiffness})["peak_object_force"] for axis in ("", ".x", ".y")
    )
    np.testing.assert_array_equal(x, whole)
    assert y[0] == y[1] == whole[0] != whole[1]


def test_equal_plans_have_equal_text_whatever_the_order_of_their_keys() -> None:
    random = {"operator.mass": "0.05 kg..0.3 kg", "operator.damping": "0.5 N*s/m..4 N*s/m"}
    one, other = (plan_of(SLIDER, OVER, random=dict(pairs)) for pairs in (random.items(), reversed(random.items())))
    assert one == other
    assert one.text() == other.text()


@pytest.mark.parametrize("keys", [("operator.mass", "operator.damping"), ("operator.damping", "operator.mass")])
def test_draws_do_not_depend_on_the_order_of_their_keys(keys: tuple[str, str], tmp_path: Path) -> None:
    """A file sorts the keys; its scenarios are those whose outcomes it holds."""
    ranges = {"operator.mass": "0.05 kg..0.3 kg", "operator.damping": "0.5 N*s/m..4 N*s/m"}
    random = {key: ranges[key] for key in keys}
    path = tmp_path / "draws.h5"
    found = sweep(SLIDER, {"object.stiffness": [500.0]}, random=random, draws=2, seed=7, out=path)
    for one in (found, open_sweep(path)):
        peak = np.linalg.norm(one.simulate(0, 1)["object_force"], axis=1).max()
        assert one["peak_object_force"][0, 1] == pytest.approx(peak, rel=1e-9)


def test_memory_does_not_grow_with_the_count(tmp_path: Path) -> None:
    """Ten times the cells, stored in a file: what is held at once is a chunk."""
    import tracemalloc

    peaks = []
    for count in (40, 400):
        over = {"object.damping": f"0 N*s/m..2 N*s/m:{count}", "object.stiffness": "100 N/m..20 N/mm:500 log"}
        plan = plan_of({**SLIDER, "run": {"duration": "5 ms"}}, over)
        with FileStore(tmp_path / f"{count}.h5", plan) as store:
            chunks = store.missing()
            tracemalloc.start()
            _run(plan, chunks, store, None, 1, lambda _text, _share: None)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        assert store.path.stat().st_size > 90 * plan.count
    assert peaks[1] < 1.3 * peaks[0]


@pytest.mark.parametrize(
    ("path", "unit", "values", "says"),
    [
        (3, "N/m", [1.0], "3 is no key"),
        ("object.", "N/m", [1.0], "is no key"),
        ("object.stiffness", "N/m", [], "cannot be varied"),
        ("object.stiffness", "N/m", [1.0, [2.0]], "cannot be varied"),
        ("object.stiffness", "parsec", [1.0], "cannot be varied"),
        ("object.stiffness", "kg", [1.0], "of another kind"),
        ("object.stiffness", "N/m", [1.0, "stiff"], "of another kind"),
        ("object.mesh.radius", "m", [True], "of another kind"),
    ],
)
def test_an_axis_of_a_file_is_one_that_a_sweep_could_have(path: Any, unit: Any, values: Any, says: str) -> None:
    assert stored_axis("object.stiffness", "N/m", [1.0, 2.0]) == Axis("object.stiffness", "N/m", (1.0, 2.0))
    with pytest.raises(ValueError, match=says):
        stored_axis(path, unit, values)


def test_a_key_is_varied_or_drawn_and_not_both() -> None:
    drawn = {"object.stiffness": "1 N/m..2 N/m"}
    with pytest.raises(SweepError, match=r"object\.stiffness is varied and drawn at random"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, random=drawn)
    assert sweep(SLIDER, {"object.damping": [0.0]}, random=drawn).plan.count == 1


def test_cells_that_diverged_are_drawn_above_all_others() -> None:
    """Their ripple is not known, but it is larger than that of every cell that came to an end."""
    figure = pytest.importorskip("matplotlib.figure").Figure()
    plan = SimpleNamespace(axes=[Axis("object.stiffness", "N/m", (1e3, 2e3, 3e3, 4e3))], draws=1, tables={})
    states = np.array([State.SETTLED, State.SETTLED, State.UNSTABLE, State.UNSTABLE], dtype=float)
    result: Any = SimpleNamespace(plan=plan, outcomes={"ripple": [1e-6, 2e-3, np.inf, np.nan], "verdict": states})
    ax = plot_sweep(result, figure.subplots())
    drawn = {x: y for line in ax.lines for x, y in zip(*line.get_data(), strict=True)}
    assert (drawn[1.0], drawn[2.0]) == pytest.approx((1e-3, 2.0))  # mm over N/mm
    assert min(drawn[3.0], drawn[4.0]) > 2.0


@pytest.mark.parametrize(("top", "unit", "shown"), [(150.0, "N/m", 150.0), (4e3, "N/mm", 4.0)])
def test_soft_walls_are_drawn_in_n_per_m(top: float, unit: str, shown: float) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    plan = SimpleNamespace(axes=[Axis("object.stiffness", "N/m", (50.0, top))], draws=1, tables={})
    settled = np.full(2, State.SETTLED, dtype=float)
    ax = plot_sweep(
        SimpleNamespace(plan=plan, outcomes={"ripple": [1e-6, 1e-6], "verdict": settled}), figure.subplots()
    )
    assert ax.get_xlabel() == f"object stiffness [{unit}]"
    assert max(float(x) for line in ax.lines for x in line.get_xdata()) == pytest.approx(shown)


def test_the_page_of_one_cell_gives_it_a_share_of_one() -> None:
    page = sweep_page(sweep({**SLIDER, "title": "Slider"}, {"object.stiffness": [1.0]}))
    assert (page.title, page.lead) == ("Sweep: Slider", "object.stiffness (1)")
    text = page.html()
    assert re.search(r'<td class="number">1</td><td class="number">100</td>', text)


@pytest.mark.parametrize(
    ("kind", "design", "says"),
    [
        ("lead_lag", "cell", "for each cell"),
        ("lead_lag", "once", "once, for the scenario as it stands"),
        ("gain", "once", ""),
        ("", "cell", ""),
    ],
)
def test_the_page_says_for_what_a_controller_is_designed(kind: str, design: Any, says: str) -> None:
    """A given gain is not designed, nor is there one without a controller."""
    tracking: dict[str, Any] = {
        "device": {"name": "slider"},
        "reference": {"force": ["1 N", "0 N", "0 N"]},
        "object": {"stiffness": "1 N/mm"},
        "run": {"duration": "20 ms"},
    }
    if kind:
        tracking["controller"] = {"kind": kind, **({"gain": 0.5} if kind == "gain" else {})}
    text = sweep_page(sweep(tracking, {"object.stiffness": [1000.0]}, draws=2, design=design)).html()
    assert text.count("The controller is designed") == bool(says)
    assert not says or f"The controller is designed {says}." in text


@pytest.mark.parametrize(
    ("given", "unit", "expected"),
    [
        (" true ", None, (True, "")), ("false", None, (False, "")), (" step", None, ("step", "")),
        ("2 N/mm", "N/m", (2000.0, "N/m")), ("3 ms", None, (0.003, "s")), (2, None, (2, "")), (2, "N", (2.0, "N")),
        (np.float64(0.5), None, (0.5, "")), (np.bool_(True), None, (True, "")), (True, None, (True, "")),
    ],
)  # fmt: skip
def test_a_value_of_an_axis_is_a_quantity_a_word_or_a_truth(given: Any, unit: str | None, expected: Any) -> None:
    found = _value(given, unit)
    assert found == pytest.approx(expected) if isinstance(expected[0], float) else found == expected
    assert type(found[0]) is type(expected[0])


@pytest.mark.parametrize(("given", "unit"), [("1 N", "N/m"), ("2 blargs", None), (np.inf, None), (None, None)])
def test_a_value_that_is_none_is_refused(given: Any, unit: str | None) -> None:
    with pytest.raises(ValueError, match=r"."):
        _value(given, unit)


def test_a_range_is_even_in_its_values_or_in_their_ratios() -> None:
    assert _spread(1.0, 3.0, 5, False) == (1.0, 1.5, 2.0, 2.5, 3.0)
    assert _spread(1.0, 16.0, 5, True) == pytest.approx((1.0, 2.0, 4.0, 8.0, 16.0))
    assert _spread(1.0, 16.0, 1, True) == (1.0,)
    for low, high, count, logarithmic, said in (
        (0.0, 1.0, 0, False, "a range needs a count of at least 1"),
        (0.0, 1.0, 3, True, "a logarithmic range needs ends above zero"),
        (1.0, 0.0, 3, True, "a logarithmic range needs ends above zero"),
    ):
        with pytest.raises(ValueError, match=said):
            _spread(low, high, count, logarithmic)
