"""A slide's numbers against closed forms, and the sliding experiment's demands on a few pairs of stiffnesses."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from palpate import Mesh, Proxy, Surface, simulate
from palpate.control import Controller
from palpate.metrics import summarize
from palpate.metrics.mesh_contact import sliding_metrics
from palpate.report.run import run_page
from palpate.scenario import Scenario
from palpate.simulation.meshes import box_mesh, touched_mesh
from palpate.simulation.trace import Trace

from experiments.hosseini2004.sliding import FIELDS, GROUNDS, pair, slide_controller, slide_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PERIOD = 5e-4


def dragged(surface: Surface, depth: float = 2e-3, ticks: int = 2000) -> Trace:
    """A tip led by nobody's loop: down onto a cube, 30 mm along x at constant depth, and up again."""
    mesh = Mesh(*box_mesh(0.08, 16))
    s = np.linspace(0.0, 1.0, ticks)
    height = np.interp(s, [0.0, 0.2, 0.8, 1.0], [1e-3, -depth, -depth, 1e-3])
    path = np.stack([np.interp(s, [0.2, 0.8], [-0.015, 0.015]), np.full(ticks, 1e-3), height], axis=1)
    c = Proxy(mesh, surface).simulate_path(path)
    values = {
        "tip": path, "proxy": c.position, "normal": c.normal, "depth": c.depth, "surface_stiffness": c.stiffness,
        "triangle": c.triangle, "touching": c.touching, "object_force": -c.force,
        "reference_force": np.tile([0.0, 0.0, -2.0], (ticks, 1)),
    }  # fmt: skip
    return Trace.of(PERIOD * np.arange(ticks), values)


def halves(**kw: Any) -> Surface:
    """1 N/mm for x < 0, 3 N/mm for x > 0."""
    vertices, triangles = box_mesh(0.08, 16)
    stiff = np.where(vertices[triangles].mean(axis=1)[:, 0] < 0.0, 1000.0, 3000.0)
    return Surface(stiffness=stiff, **kw)


def test_a_step_and_the_energy_it_makes() -> None:
    """From k1 to k2 at constant depth d the force steps by (k2 - k1) d, and the field makes (k2 - k1) d^2 / 2."""
    found = sliding_metrics(dragged(halves(tangential=0.0)), tangential=0.0)
    assert found is not None
    assert found.step_at_crossing == pytest.approx(2000.0 * 2e-3, rel=1e-9)
    assert found.energy_generated == pytest.approx(0.5 * 2000.0 * 4e-6, rel=2e-3)
    assert found.energy_dissipated == pytest.approx(0.0, abs=1e-12)
    assert found.path == pytest.approx(0.03, rel=1e-9)


def test_the_continuous_field_makes_none() -> None:
    """Where the force is the slope of a potential, in and out by another way gives back what was put in."""
    found = sliding_metrics(dragged(halves(tangential=0.0, field="continuous")), tangential=0.0)
    assert found is not None
    assert abs(found.energy_generated) < 1e-3 * 0.5 * 2000.0 * 4e-6
    discrete = sliding_metrics(dragged(halves(tangential=0.0)), tangential=0.0)
    assert discrete is not None
    assert discrete.step_at_crossing is not None
    assert found.step_at_crossing is not None
    assert found.step_at_crossing < 0.01 * discrete.step_at_crossing
    assert found.ripple_power < 0.05 * discrete.ripple_power


def test_friction_takes_force_times_way() -> None:
    """A proxy that slides with mu takes mu k d over its way."""
    found = sliding_metrics(dragged(Surface(stiffness=1000.0, tangential=1000.0, static_friction=0.2), ticks=20_000))
    assert found is not None
    held = 0.2 * 1000.0 * 2e-3
    assert found.energy_dissipated == pytest.approx(held * (0.03 - 0.2 * 2e-3), rel=0.01)
    assert found.energy_generated == pytest.approx(0.0, abs=1e-6)


def test_ripple_is_the_power_between_20_and_500_hz() -> None:
    """A sine of amplitude a in the band has power a^2/2; below it, none."""
    base = dragged(Surface(stiffness=1000.0, tangential=0.0), ticks=8000)
    for frequency, share in ((100.0, 1.0), (400.0, 1.0), (5.0, 0.0), (800.0, 0.0)):
        wave = 0.3 * np.sin(2 * np.pi * frequency * base.time)
        force = np.stack([wave, 0 * wave, 0 * wave], axis=1)
        found = sliding_metrics(Trace.of(base.time, {n: base[n] for n in base.channels} | {"object_force": force}))
        assert found is not None
        assert found.ripple_power == pytest.approx(share * 0.045, rel=0.02, abs=2e-4)


def test_lost_contact_is_counted() -> None:
    """Ticks apart after the first touch; a trace that never touches has no slide."""
    trace = dragged(Surface(stiffness=1000.0, tangential=0.0))
    apart = int(np.sum(trace["touching"][:, 0] == 0.0))
    found = sliding_metrics(trace)
    assert found is not None
    assert found.lost_ticks == apart - int(np.argmax(trace["touching"][:, 0]))
    assert not found.touching_at_end
    assert not found.settled
    away = {name: trace[name] for name in trace.channels} | {"touching": np.zeros(len(trace))}
    assert sliding_metrics(Trace.of(trace.time, away)) is None


@pytest.mark.parametrize(
    ("name", "ground", "options"),
    [
        ("slide-cube-small-steps", "cube, small steps", {}),
        ("slide-cube-large-steps", "cube, large steps", {"controller": "lqg"}),
        ("slide-cube-by-forces", "cube, small steps", {"controller": "lqg", "led_by": "forces"}),
        ("slide-organ", "organ, small steps", {"field": "continuous"}),
    ],
)
def test_the_files_are_the_experiment(name: str, ground: str, options: dict[str, Any]) -> None:
    """What lies in scenarios/ is what the report runs."""
    file = Scenario.from_file(SCENARIOS / f"{name}.toml").to_dict()
    computed = Scenario.from_dict(slide_scenario(GROUNDS[ground], **options)).to_dict()
    for tables in (file, computed):
        tables.pop("title")
        tables.pop("description", None)
    assert file == computed


@pytest.mark.parametrize("kind", ["lead_lag", "lqg"])
@pytest.mark.parametrize("tangential", [1.0, 0.0])
@pytest.mark.parametrize(("first", "second"), [(0.2, 3.5), (3.5, 0.2), (3.0, 3.5)])
def test_neighbouring_stiffnesses(kind: Any, tangential: float, first: float, second: float) -> None:
    """The hardest pairs: stable on both fields, and steps ten times smaller on the continuous one.

    The report holds all pairs of eight stiffnesses to this.
    """
    law = slide_controller(kind)
    discrete, continuous = (pair(first, second, law, tangential=tangential, field=field) for field in FIELDS)
    assert discrete.stable
    assert continuous.stable
    assert continuous.found.step_at_crossing is not None
    assert discrete.found.step_at_crossing is not None
    assert continuous.found.step_at_crossing < 0.1 * discrete.found.step_at_crossing
    assert continuous.found.lost_ticks == 0
    if tangential == 0.0:  # friction parts tip and proxy, and with them force and potential
        assert abs(continuous.found.energy_generated) < 1e-3 * abs(discrete.found.energy_generated)


def test_an_unstable_slide_is_told() -> None:
    """A loop gain beyond its limit on 3.5 N/mm does not pass for stable."""
    law = slide_controller("lqg")
    s = law.system
    strong = Controller(control.StateSpace(s.A, s.B, 6.0 * s.C, 6.0 * s.D, s.dt), law.antiwindup, "state_space")
    found = pair(0.5, 3.5, strong, tangential=0.0, field="continuous")
    assert not found.stable


def test_the_report_of_a_slide(tmp_path: Path) -> None:
    """Numbers, verdict and page of one run fit together."""
    trace = simulate(SCENARIOS / "slide-cube-small-steps.toml")
    summary = summarize(trace)
    found = sliding_metrics(trace)
    assert found is not None
    assert summary["sliding"] == found.to_dict()
    assert summary["stable"]
    assert "rests in contact" in summary["verdict"]
    page = run_page(trace, summary).save(tmp_path / "report.html").read_text("utf-8")
    for text in ("Sliding contact, from the first contact", "largest force step at a crossing", "20 to 500 Hz"):
        assert text in page
    assert summarize(Trace.load(trace.save(tmp_path / "trace.h5"))) == summary


def test_the_loop_meets_what_the_proxy_meets() -> None:
    """The tip's recorded way, followed by a proxy outside the loop, gives the recorded contact tick by tick."""
    scenario = Scenario.from_dict(slide_scenario(GROUNDS["organ, small steps"], field="continuous"))
    trace = simulate(scenario)
    origin = trace["tip"][0] + np.array(scenario.object.position)
    mesh, surface = touched_mesh(scenario, origin)
    contacts = Proxy(mesh, surface).simulate_path(trace["tip"])
    assert np.array_equal(contacts.triangle, trace["triangle"][:, 0].astype(int))
    np.testing.assert_allclose(-contacts.force, trace["object_force"], atol=1e-8)
    np.testing.assert_allclose(contacts.position, trace["proxy"], atol=1e-11)


def test_shading_takes_the_facets_out_of_an_organ() -> None:
    """With a smooth normal and a smooth stiffness, steps are at most a tenth of the discrete field's (1/60 seen)."""
    tables = tomllib.loads((SCENARIOS / "slide-organ.toml").read_text("utf-8"))
    largest = {}
    for field, shading in (("discrete", "0 deg"), ("continuous", "0 deg"), ("continuous", "30 deg")):
        tables["object"]["surface"] |= {"field": field, "shading": shading}
        found = sliding_metrics(simulate(Scenario.from_dict(tables)))
        assert found is not None
        assert found.settled
        assert found.step_at_crossing is not None
        assert found.step_elsewhere is not None
        largest[field, shading] = max(found.step_at_crossing, found.step_elsewhere)
    assert largest["continuous", "30 deg"] < 0.1 * largest["discrete", "0 deg"] < largest["continuous", "0 deg"]
