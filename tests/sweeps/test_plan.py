"""Plan of a sweep: its numbers, its text, its cells, and whom it asks to run them."""

from __future__ import annotations

import json
import logging
import sys
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest
from palpate import fem
from palpate.control.controller import Controller
from palpate.errors import ScenarioError
from palpate.scenario import Scenario
from palpate.simulation.simulator import build_simulation
from palpate.sweeps import State, SweepError, axes, open_sweep, plan, run, sweep
from palpate.sweeps.axes import LARGEST, Axis, _axis, axes_of, key_of, limits_of, stored_limits, with_value
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.plan import Plan, _check_value, _put, _runs_as_batch, _same_controller, _split
from palpate.sweeps.run import _reason, _result, _run, _share, dask_executor, plan_of

SLIDER: dict[str, Any] = {
    "title": "slider",
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "arm", "mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "20 N/m",
                 "shape": "step", "force": ["-0.5 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "50 N/m"},
    "run": {"duration": "20 ms"},
}  # fmt: skip
TRACKING: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms"},
    "reference": {"force": ["1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "run": {"duration": "20 ms"},
}
OVER = {"object.damping": [0.0, 1.0], "object.stiffness": "10 N/m..30 N/m:3"}


def lasting(seconds: float, cells: int = 100, draws: int = 1) -> Plan:
    tables = {**SLIDER, "run": {"duration": f"{seconds} s"}}
    return plan_of(tables, {"object.stiffness": list(np.linspace(1.0, 9.0, cells))}, draws=draws)


@pytest.mark.parametrize(
    ("seconds", "chunk"),
    [(0.02, 16384), (0.3, 16384), (0.4, 16384), (1.0, 4096), (3.0, 2048), (30.0, 128), (60.0, 64), (500.0, 64)],
)
def test_a_chunk_has_the_power_of_two_of_cells_that_is_nearest_to_five_million_ticks(
    seconds: float, chunk: int
) -> None:
    """From 64 to 16384 cells; the last one may be smaller."""
    found = lasting(seconds, 65)
    assert found.chunk == chunk
    assert found.period == 1e-3
    assert found.chunks == (2 if chunk == 64 else 1)
    nearest = 2 ** round(np.log2(5e6 / (seconds / 1e-3)))
    assert chunk == min(max(nearest, 64), 16384)
    assert (found.shape, found.count) == ((65,), 65)
    assert (lasting(seconds, 5, 3).shape, lasting(seconds, 5, 3).count) == ((5, 3), 15)


@pytest.mark.parametrize(("seconds", "chunk"), [(0.02, 64), (0.6, 32), (2.0, 8), (60.0, 1)])
def test_a_chunk_of_cells_that_run_one_at_a_time_takes_seconds(seconds: float, chunk: int) -> None:
    """Else an interrupted sweep of bodies would begin again, and executors would share one chunk."""
    body = {"shape": "block", "size": ["20 mm"] * 2 + ["10 mm"], "spacing": "5 mm", "young": "10 kPa", "radius": "4 mm"}
    tables = {**SLIDER, "object": {"kind": "body", "body": body}, "run": {"duration": f"{seconds} s"}}
    assert plan_of(tables, {"operator.stiffness": list(np.linspace(10.0, 90.0, 65))}).chunk == chunk


def test_a_file_of_an_axis_is_relative_to_the_folder_of_the_scenario(tmp_path: Path) -> None:
    """As in the scenario's file; workers have other working directories."""
    for name, size in (("one", "10 mm"), ("two", "12 mm")):
        fem.build(fem.block(("20 mm", "20 mm", size), "5 mm"), young="10 kPa", fixed="z < 0.1 mm").save(
            tmp_path / f"{name}.h5"
        )
    file = tmp_path / "press.toml"
    file.write_text(
        '[device]\nname = "slider"\n[object]\nkind = "body"\nposition = ["-4.1 mm", "0 mm", "0 mm"]\n'
        '[object.body]\nfile = "one.h5"\nradius = "4 mm"\n'
        '[reference]\nforce = ["-0.1 N", "0 N", "0 N"]\n[run]\nduration = "0.1 s"\n'
    )
    found = plan_of(file, {"object.body.file": ["one.h5", "two.h5"]})
    assert found.axes[0].values == (str(tmp_path / "one.h5"), str(tmp_path / "two.h5"))
    assert [Path(found.scenario(cell).object.body.file).name for cell in (0, 1)] == ["one.h5", "two.h5"]


def test_an_axis_is_checked_with_the_first_values_of_the_others() -> None:
    """The friction coefficients of a body need each other, and so do its kind and the keys of that kind."""
    body = {"shape": "block", "size": ["20 mm"] * 2 + ["10 mm"], "spacing": "5 mm", "young": "10 kPa", "radius": "4 mm"}
    place = {"kind": "body", "position": ["-4.1 mm", "0 mm", "0 mm"], "body": body}
    tables = {**SLIDER, "object": place}
    rough = {"object.body.static_friction": [0.3, 0.5], "object.body.dynamic_friction": [0.1, 0.2]}
    plan_of(tables, rough).check()
    solid = {"object.body.kind": ["viscoelastic"], "object.body.instantaneous_ratio": [2.0, 3.0],
             "object.body.retardation_time": ["0.1 s"]}  # fmt: skip
    assert sweep(tables, solid).shape == (1, 2, 1)
    wrong = {"object.body.static_friction": [0.3, 0.5], "object.body.dynamic_friction": [0.1, 0.4]}
    with pytest.raises(ScenarioError, match="dynamic_friction"):
        plan_of(tables, wrong).check()


def test_the_text_of_a_plan_is_the_plan() -> None:
    found = plan_of(SLIDER, OVER, random={"operator.mass": "0.05 kg..0.3 kg"}, draws=4, seed=7, design="once")
    assert json.loads(found.text()) == {
        "scenario": Scenario.from_dict(SLIDER).to_dict(),
        "over": [["object.damping", "N*s/m", [0.0, 1.0]], ["object.stiffness", "N/m", [10.0, 20.0, 30.0]]],
        "random": {"operator.mass": [0.05, 0.3]},
        "draws": 4,
        "seed": 7,
        "design": "once",
        "files": {},
    }
    assert Plan.of_text(found.text()) == found
    raw = json.loads(found.text())
    for change in (
        {"draws": 0}, {"draws": True}, {"draws": 1.0}, {"draws": -1}, {"seed": -1}, {"seed": 0.5}, {"design": "twice"},
        {"over": []}, {"draws": LARGEST}, {"over": [["object.damping", "N*s/m"]]},
        {"files": [1]}, {"random": {"operator.mass": [0.3, 0.05]}}, {"random": []}, {"scenario": 3}, {"over": None},
    ):  # fmt: skip
        with pytest.raises(SweepError, match=r"^the plan of the sweep cannot be used: "):
            pytest.fail(repr(Plan.of_text(json.dumps({**raw, **change}))))
    most = {**raw, "over": [["object.stiffness", "N/m", [1.0, 2.0]]], "draws": LARGEST // 2}
    assert Plan.of_text(json.dumps(most)).count == LARGEST
    with pytest.raises(SweepError, match="is not that of a sweep"):
        Plan.of_text(json.dumps({**most, "draws": LARGEST // 2 + 1}))
    assert Plan.of_text(json.dumps({**raw, "seed": 0})).seed == 0


def test_the_scenario_of_a_cell_has_its_values_its_draws_and_its_own_seed() -> None:
    """The number of a cell plus 10^8 times the seed; the draws of a cell are those of its own generator."""
    random = {"operator.mass": "0.05 kg..0.3 kg", "operator.damping": "1 N*s/m..2 N*s/m"}
    found = plan_of(SLIDER, OVER, random=random, draws=2, seed=3)
    assert found.shape == (2, 3, 2)
    for cell in (0, 5, 11):
        scenario = found.scenario(cell)
        generator = np.random.default_rng(np.random.SeedSequence(3, spawn_key=(cell,)))
        damping, mass = generator.uniform(1.0, 2.0), generator.uniform(0.05, 0.3)
        assert (scenario.operator.damping, scenario.operator.mass) == (damping, mass)
        assert scenario.run.seed == 3 * LARGEST + cell
        assert scenario.object.damping[0] == [0.0, 1.0][cell // 6]
        assert scenario.object.stiffness[0] == [10.0, 20.0, 30.0][cell // 2 % 3]
    drawn = found._draw(np.array([5, 0]))
    assert drawn["operator.mass"].tolist() == [found.scenario(cell).operator.mass for cell in (5, 0)]
    assert found._seeds(np.array([0, 9])).tolist() == [3 * LARGEST, 3 * LARGEST + 9]
    own = plan_of(SLIDER, {"run.seed": [17, 4]}, seed=3)
    assert [own.scenario(cell).run.seed for cell in (0, 1)] == [17, 4]
    seeded = plan_of(SLIDER, {"object.damping": [0.0]}, random={"run.seed": "1..5"}, seed=3)
    assert 1 <= seeded.scenario(0).run.seed <= 5


def test_whole_numbers_are_drawn_whole_with_both_ends() -> None:
    """A delay of 1.4 periods has no scenario."""
    found = plan_of(SLIDER, {"object.damping": [0.5]}, random={"device.delay": "1..3"}, draws=60)
    drawn = found._draw(np.arange(60))["device.delay"]
    assert set(drawn.tolist()) == {1.0, 2.0, 3.0}
    assert [found.scenario(cell).device.delay for cell in range(4)] == drawn[:4].tolist()
    whole = found.run(0, 4)
    for cell in range(4):
        peak = np.linalg.norm(found.simulate(cell)["object_force"], axis=1).max()
        assert whole["peak_object_force"][cell] == pytest.approx(peak, rel=1e-9)


def test_a_plan_is_checked_at_the_ends_of_its_columns_and_at_every_other_value(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, Any]] = []
    monkeypatch.setattr(
        plan, "_check_value", lambda _tables, axis, index: asked.append((axis.path, axis.values[index]))
    )
    over = {"object.stiffness": [20.0, 30.0, 10.0], "object.coupling": ["backward", "bilinear"]}
    plan_of(SLIDER, over, random={"operator.mass": "0.05 kg..0.3 kg", "device.delay": "0..2"}).check()
    assert asked == [
        ("object.stiffness", 30.0), ("object.stiffness", 10.0), ("object.coupling", "backward"),
        ("object.coupling", "bilinear"), ("operator.mass", 0.05), ("operator.mass", 0.3), ("device.delay", 0.0),
        ("device.delay", 2.0),
    ]  # fmt: skip


def test_a_mistake_of_a_value_begins_with_the_value() -> None:
    with pytest.raises(ScenarioError) as caught:
        _check_value(SLIDER, Axis("object.stiffness", "N/m", (1.0, -2.0)), 1)
    assert str(caught.value).startswith("object.stiffness = -2.0 N/m: object.stiffness")
    for change, says in (
        (
            {"device": {"name": "slider", "model": "linear"}, "operator": {"kind": "force", "force": "1 N"}},
            'a sweep runs the "nonlinear" device, not its "linear" model',
        ),
        ({"operator": {"kind": "fixed"}}, 'a sweep runs a device that is free to move; "fixed" keeps the tip still'),
    ):
        with pytest.raises(SweepError) as refused:
            plan_of({**SLIDER, **change}, OVER).check()
        assert says in str(refused.value)


@pytest.mark.parametrize(
    ("change", "axis", "batch"),
    [
        ({}, "object.stiffness", True),
        ({"guard": {"kind": "half_sample"}}, "object.stiffness", False),
        ({}, "guard.kind", False),
        ({"object": {"kind": "wall", "stiffness": "50 N/m", "normal": [1, 0, 0]}}, "object.stiffness", True),
        ({"object": {"kind": "none"}}, "operator.mass", True),
    ],
)
def test_springs_and_walls_without_a_guard_run_as_a_batch(change: dict[str, Any], axis: str, batch: bool) -> None:
    tables = Scenario.from_dict({**SLIDER, **change}).to_dict()
    assert _runs_as_batch(tables, (Axis(axis, "", (1.0,)),)) is batch


def test_an_axis_that_changes_the_controller_needs_a_new_simulation() -> None:
    """A controller that is given, or designed once, is the same in every cell."""
    (stiffness,) = axes_of({"object.stiffness": [3000.0, 500.0, 1000.0]})
    for kind, design, changes in (
        ("none", "cell", False), ("gain", "cell", False), ("lead_lag", "cell", True), ("lead_lag", "once", False),
    ):  # fmt: skip
        controller = {"kind": kind, **({"gain": 0.5} if kind == "gain" else {})}
        found = plan_of({**TRACKING, "controller": controller}, {"object.stiffness": [500.0, 3000.0]}, design=design)
        assert _same_controller(found, stiffness) is not changes
        assert (
            _same_controller(found, Axis("object.damping", "N*s/m", (0.0, 1e-9))) is (kind != "lead_lag" or not changes)
            or changes
        )
        lane, rebuilt = _split(found.text())
        assert [axis.path for axis in (rebuilt if changes else lane)] == ["object.stiffness"]
        assert not (lane if changes else rebuilt)
    words = plan_of(SLIDER, {"object.coupling": ["backward", "bilinear"], "object.stiffness": [1.0]})
    assert [[axis.path for axis in part] for part in _split(words.text())] == [
        ["object.stiffness"],
        ["object.coupling"],
    ]
    normalized = {**TRACKING, "controller": {"kind": "lqg", "stiffness": "1 N/mm", "normalize": True}}
    assert _same_controller(plan_of(normalized, {"object.stiffness": [500.0, 3000.0]}), stiffness)


def test_a_controller_differs_by_any_of_its_matrices_or_its_design_stiffness(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the values at the least and the largest of the axis."""
    tables = {**TRACKING, "controller": {"kind": "lead_lag"}}
    known = build_simulation(tables).controller
    assert isinstance(known, Controller)
    s = known.system
    matrices = {"A": s.A, "B": s.B, "C": s.C, "D": s.D}
    asked: list[str] = []
    found = plan_of(tables, {"object.stiffness": [500.0, 3000.0]})
    axis = Axis("object.stiffness", "N/m", (700.0, 3000.0, 500.0))

    def same(other: Controller) -> bool:
        both = {"500.0 N/m": known, "3000.0 N/m": other}

        def built(scenario: Any) -> Any:
            asked.append(scenario["object"]["stiffness"])
            return SimpleNamespace(controller=both[asked[-1]])

        monkeypatch.setattr(plan, "build_simulation", built)
        return _same_controller(found, axis)

    assert same(known)
    assert asked == ["500.0 N/m", "3000.0 N/m"]
    for name, matrix in matrices.items():
        changed = {**matrices, name: matrix + 1e-9}
        assert not same(replace(known, system=control.StateSpace(*changed.values(), s.dt)))
    assert not same(replace(known, design_stiffness=np.array([1.0, 2.0, 3.0])[0]))


def test_the_values_of_cells_are_put_into_columns() -> None:
    """A component of a stiffness leaves the other axes as they are, or as another component put them."""
    experiment = build_simulation({**SLIDER, "object": {"kind": "spring", "stiffness": ["10 N/m", "20 N/m", "30 N/m"]}})
    columns: dict[str, Any] = {}
    values = np.array([1.0, 2.0])
    _put(columns, experiment, "operator.mass", values)
    np.testing.assert_array_equal(columns.pop("arm_mass"), [[1.0], [2.0]])
    _put(columns, experiment, "object.stiffness.y", values)
    np.testing.assert_array_equal(columns["stiffness"], [[10.0, 1.0, 30.0], [10.0, 2.0, 30.0]])
    _put(columns, experiment, "object.stiffness.z", 5.0 * values)
    np.testing.assert_array_equal(columns["stiffness"], [[10.0, 1.0, 5.0], [10.0, 2.0, 10.0]])
    _put(columns, experiment, "object.damping", values)
    np.testing.assert_array_equal(columns["damping"], [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])


def test_cells_are_the_same_in_any_order_and_company() -> None:
    """Across axes that need a simulation of their own, draws and late ticks."""
    tables = {**SLIDER, "servo": {**SLIDER["servo"], "jitter": "0.2 ms"}}
    over = {"object.coupling": ["backward", "bilinear"], **OVER, "servo.period": ["1 ms", "2 ms"]}
    found = plan_of(tables, over, random={"operator.mass": "0.05 kg..0.3 kg"}, draws=2, seed=5)
    whole = found.run(0, found.count)
    some = np.array([47, 0, 13, 30, 22])
    few = found.run_cells(some)
    assert set(few) == set(whole)
    for name, values in few.items():
        np.testing.assert_array_equal(values, whole[name][some])
    assert len(np.unique(whole["peak_command_force"])) > 40
    for cell in (13, 30):
        trace = found.simulate(cell)
        assert whole["peak_object_force"][cell] == pytest.approx(np.linalg.norm(trace["object_force"], axis=1).max())


def test_a_sweep_is_read_by_name_index_and_state(tmp_path: Path) -> None:
    found = sweep(SLIDER, OVER, out=tmp_path / "a.h5")
    assert found.values("object.stiffness").tolist() == [10.0, 20.0, 30.0]
    worded = sweep(SLIDER, {"object.coupling": ["backward", "bilinear"]})
    assert worded.values("object.coupling").tolist() == ["backward", "bilinear"]
    with pytest.raises(SweepError, match=r"^servo.period was not varied; object.damping, object.stiffness were$"):
        found.values("servo.period")
    assert found.scenario(1, 2).object.stiffness[0] == 30.0
    assert found.scenario(1, 0).object.damping[0] == 1.0
    assert found.excitation == found.plan.excitation()
    assert found.excitation.first == 0
    again = open_sweep(tmp_path / "a.h5")
    np.testing.assert_array_equal(again["ripple"], found["ripple"])
    states = np.array([[float(state) for state in State]])
    outcomes = Outcomes({"verdict": states})
    assert outcomes.settled.tolist() == [[state is State.SETTLED for state in State]]
    assert outcomes.unstable.tolist() == [[state is State.UNSTABLE for state in State]]
    both = outcomes.where(State.CONTACT_LOST, State.UNDECIDED)
    assert both.tolist() == [[state in (State.CONTACT_LOST, State.UNDECIDED) for state in State]]
    assert (len(outcomes), list(outcomes)) == (1, ["verdict"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"design": "twice"}, 'design: \'twice\'; it is "cell" or "once"'),
        ({"draws": 0}, "draws: 0; at least one cell for each combination is needed"),
        ({"draws": 1.5}, "draws: 1.5 is not a whole number"),
        ({"seed": -1}, "seed: -1; from 0 to 90,071,991"),
        ({"seed": 90_071_992}, "seed: 90071992; from 0 to 90,071,991"),
        ({"seed": "1"}, "seed: '1' is not a whole number"),
    ],
)
def test_a_number_that_no_sweep_has_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(SweepError) as caught:
        plan_of(SLIDER, OVER, **options)
    assert str(caught.value) == says
    assert plan_of(SLIDER, OVER, seed=90_071_991, draws=1, design="cell").seed == 90_071_991
    assert (plan_of(SLIDER, OVER).draws, plan_of(SLIDER, OVER).seed) == (1, 0)


def test_a_share_is_every_nth_chunk() -> None:
    chunks = [0, 1, 2, 4, 5, 9]
    assert _share(chunks, None) is chunks
    assert _share(chunks, (1, 1)) == chunks
    assert _share(chunks, (1, 3)) == [0, 9]
    assert _share(chunks, (3, 3)) == [2, 5]
    assert _share([], [2, 3]) == []  # type: ignore[arg-type]
    for wrong in ((0, 3), (4, 3), (-1, 3)):
        with pytest.raises(SweepError) as caught:
            _share(chunks, wrong)
        assert str(caught.value) == f"shard {wrong[0]}/{wrong[1]}: the first number goes from 1 to the second"
    for other in ((1,), (1, 2, 3), ("1", 2), (1, 2.0), {1, 2}, 3):
        with pytest.raises(SweepError) as caught:
            _share(chunks, other)  # type: ignore[arg-type]
        assert str(caught.value) == f"shard: {other!r}; it is two whole numbers, such as (2, 8), the second of eight"


class Slow:
    """An executor that has a result only for its oldest chunk, when that is waited for."""

    def __init__(self) -> None:
        self.futures: list[Future[Any]] = []
        self.most = 0

    def submit(self, work: Any, *what: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.futures.append(future)
        self.open = [one for one in self.futures if not one.done()]
        self.most = max(self.most, len(self.open))
        if len(self.open) == self.limit or what[1] == 40:
            for one in self.open[:1] if what[1] < 40 else self.open:
                one.set_result({"ended": what[1]})
        return future

    limit = 6


def test_three_chunks_are_kept_ready_for_each_worker() -> None:
    slow, kept, work = Slow(), [], SimpleNamespace(chunk=4, count=40, run=lambda *_: None)
    store = SimpleNamespace(put=lambda chunk, _values: kept.append(chunk))
    said: list[tuple[str, float]] = []
    _run(work, list(range(10)), store, slow, 2, lambda *one: said.append(one))  # type: ignore[arg-type]
    assert slow.most == 6
    assert sorted(kept) == list(range(10))
    assert said[-1] == ("40 of 40 cells", 1.0)


def test_chunks_that_wait_are_cancelled_when_one_fails() -> None:
    failed: Future[Any] = Future()
    failed.set_exception(ValueError("it broke\nhere"))
    waiting: Future[Any] = Future()
    futures = [failed, waiting]
    executor = SimpleNamespace(submit=lambda *_: futures.pop(0))
    work = SimpleNamespace(chunk=4, count=8, run=None)
    with pytest.raises(SweepError) as caught:
        _run(work, [0, 1], SimpleNamespace(), executor, 1, lambda *_: None)  # type: ignore[arg-type]
    end = "; what is done is kept, and the same command continues"
    assert str(caught.value) == f"a worker failed: ValueError: it broke here{end}"
    assert waiting.cancelled()
    own: Future[Any] = Future()
    own.set_exception(ScenarioError("as it is"))
    with pytest.raises(ScenarioError, match=r"^as it is$"):
        _result(own)


def test_a_failure_of_an_executor_is_named_by_its_cause() -> None:
    def of(name: str) -> str:
        return _reason(type(name, (Exception,), {})("x " * 400))

    assert of("KilledWorker").startswith("several workers died while they ran the same cells")
    gone = "the Dask scheduler no longer answers, or it cancelled the work"
    assert of("FutureCancelledError") == of("CommClosedError") == gone
    assert of("BrokenProcessPool") == "a worker process died (killed, or out of memory)"
    assert len(of("OddError")) == len("a worker failed: OddError: ") + 303


def test_an_executor_of_dask_is_asked_for_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[Any] = []
    workers: dict[str, dict[str, int]] = {"a": {"nthreads": 2}, "b": {"nthreads": 3}}

    class Client:
        def __init__(self, *what: Any, **options: Any) -> None:
            if what[0] == "nowhere":
                raise OSError("no answer\nat all")
            events.append((what, options))

        def __enter__(self) -> Client:
            return self

        def __exit__(self, *_: Any) -> None:
            events.append("closed")

        def scheduler_info(self, n_workers: int) -> dict[str, Any]:
            assert n_workers == -1
            return {"workers": workers}

        def get_executor(self, pure: bool) -> Any:
            assert pure is False
            return SimpleNamespace(shutdown=lambda *, wait: events.append(wait))

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Client))
    names = ("distributed", "distributed.client", "distributed.core", "tornado.application")
    for name in names:
        monkeypatch.setattr(logging.getLogger(name), "level", logging.INFO)
    with dask_executor("there") as (_, threads):
        assert threads == 5
        assert [logging.getLogger(name).level for name in names] == [logging.CRITICAL] * 4
    assert events == [(("there",), {"timeout": 10.0, "set_as_default": False}), False, "closed"]
    workers.clear()
    with pytest.raises(SweepError, match="the Dask scheduler at there has no workers"), dask_executor("there"):
        pass
    with pytest.raises(SweepError) as caught, dask_executor("nowhere"):
        pass
    assert str(caught.value) == (
        "no Dask scheduler answers at nowhere (no answer); start one with `dask scheduler`, and workers with "
        "`dask worker ADDRESS`"
    )
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SweepError, match="dask: not installed"), dask_executor("there"):
        pass


def test_axes_are_read_as_a_scenario_file_has_them() -> None:
    for values, unit, read in (
        ("1 N/m, 2 N/mm", "N/m", (1.0, 2000.0)),
        ("1 N/m..3 N/m:3", "N/m", (1.0, 2.0, 3.0)),
        ([1, "2 N/m", np.float64(3.0)], "N/m", (1.0, 2.0, 3.0)),
        (5.0, "N/m", (5.0,)),
        (np.array([1.0, 2.0]), "N/m", (1.0, 2.0)),
    ):
        assert _axis("object.stiffness", values) == Axis("object.stiffness", unit, read)
    assert _axis("object.coupling", "backward, bilinear") == Axis("object.coupling", "", ("backward", "bilinear"))
    assert _axis("device.delay", "0..4:3") == Axis("device.delay", "", (0.0, 2.0, 4.0))
    assert [_axis("device.delay", "0..4:3").text(k) for k in range(3)] == [0, 2, 4]
    assert _axis("servo.period", "1 ms..4 ms:3 log").unit == "s"
    assert (len(_axis("device.delay", [1, 2])), _axis("servo.period", ["1 ms"]).text(0)) == (2, "0.001 s")
    turned = _axis("object.body.rotation.y", "0 deg..90 deg:2")
    assert (turned.unit, turned.values, turned.text(0)) == ("rad", (0.0, np.pi / 2.0), "0.0 rad")
    assert _axis("object.body.rotation.y", ["0.3 rad"]).text(0) == "0.3 rad"
    assert (key_of("object.stiffness.z"), key_of("object.z"), key_of("a.b.c")) == (
        "object.stiffness",
        "object.z",
        "a.b.c",
    )
    assert [Axis(f"operator.force.{axis}", "N", (1.0,)).component for axis in "xyz"] == [0, 1, 2]
    assert Axis("operator.force", "N", (1.0,)).component is None
    for values, says in (
        ([], "object.coupling: no values"),
        (["backward", "1 N"], "object.coupling: values of different kinds: , N"),
        (
            "1 blarg..2 blarg:3",
            'object.coupling: "1 blarg" cannot be read as a number with a unit; write it as "100 N/m"',
        ),
        ("1 N..2 N:0", "object.coupling: a range needs a count of at least 1"),
    ):
        with pytest.raises(SweepError) as caught:
            _axis("object.coupling", values)
        assert str(caught.value) == says
    for several in ([["30 mm", "40 mm", "10 mm"]], [0.02, [0.03, 0.04, 0.01]], np.ones((2, 3))):
        with pytest.raises(SweepError, match=r"several values; .* as in \"object.body.size.x\"$"):
            axes_of({"object.body.size": several})
    with pytest.raises(SweepError, match="a key is varied twice"):
        axes_of(_Twice({"object.stiffness": [1.0]}))
    assert (
        len(axes_of({"object.stiffness": f"1 N/m..2 N/m:{10_000}", "object.damping": f"0 N*s/m..1 N*s/m:{10_000}"}))
        == 2
    )
    with pytest.raises(SweepError, match=r"^100,010,000 cells \(10,001 × 10,000\); the most is 100,000,000: "):
        axes_of({"object.stiffness": "1 N/m..2 N/m:10001", "object.damping": "0 N*s/m..1 N*s/m:10000"})


class _Twice(dict[str, Any]):
    """Mapping that yields its entries twice."""

    def items(self) -> Any:
        return [*super().items(), *super().items()]


def test_limits_are_two_ends_of_a_column() -> None:
    assert limits_of("operator.mass", "0.1 kg..300 g") == (0.1, 0.3)
    assert stored_limits("operator.mass", 0.1, 0.3) == (0.1, 0.3)
    for text in ("0.1 kg", "0.1 kg...0.3 kg", "1 kg..2 kg..3 kg", "0.1 kg..0.3 kg:5"):
        with pytest.raises(SweepError) as caught:
            limits_of("operator.mass", text)
        told = f'operator.mass: "{text}" is no range to draw from; write its two ends, as in "0.05 kg..0.3 kg"'
        assert str(caught.value) == told
    with pytest.raises(SweepError, match=r"^operator.mass: .*a mass is needed"):
        limits_of("operator.mass", "0.1 m..0.3 m")
    for path in ("servo.period", "mass"):
        with pytest.raises(
            SweepError, match=f"^{path} cannot be drawn at random; those that can are {', '.join(axes.COLUMNS)}$"
        ):
            limits_of(path, "1..2")


def test_one_component_is_set_in_a_list_or_beside_the_value_of_all_axes() -> None:
    force = Axis("operator.force.y", "N", (7.0,))
    assert with_value(SLIDER, force, 0)["operator"]["force"] == ["-0.5 N", "7.0 N", "0 N"]
    with pytest.raises(SweepError) as caught:
        with_value(SLIDER, Axis("object.position.y", "m", (7.0,)), 0)
    assert (
        str(caught.value)
        == "object.position.y: the scenario has no object.position whose axis could be varied; write one into it first"
    )
    with pytest.raises(SweepError, match=r"has no reference\.force whose axis"):
        with_value(SLIDER, Axis("reference.force.y", "N", (7.0,)), 0)
    assert run.MOST_SEEDS == 90_071_992
