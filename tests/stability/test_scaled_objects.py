"""Z-widths of meshes and bodies: curves over scaled objects, from loops whose limits are known in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.simulation.verdict import State
from palpate.stability import mesh_zwidth as mesh
from palpate.stability.body import zwidth as body
from palpate.stability.maps.boundary_curve import Boundary

T = 1e-3
STIFFEST = 800.0


def contact(*sites: Any) -> Any:
    return SimpleNamespace(scenario=SimpleNamespace(period=T, title="a title"), sites=sites, found=[])


def rays(monkeypatch: pytest.MonkeyPatch, limit: Any, kind: str | None = None) -> tuple[Boundary, list[float]]:
    """The curve of a loop on one site with a given largest scale over the ratio of damping to stiffness."""
    asked: list[float] = []

    def modes(site: Any, damping: float, which: str | None) -> list[Any]:
        assert (site, which) == ("a site", kind)
        asked.append(damping / (T * STIFFEST))
        return [asked[-1]]

    monkeypatch.setattr(mesh, "_modes", modes)
    monkeypatch.setattr(mesh, "_largest_scale", lambda found: (limit(found[0]), SimpleNamespace(angle=0.1 + found[0])))
    told: list[Any] = []
    found = mesh._boundary(contact("a site"), STIFFEST, kind, lambda *what: told.append(what))
    assert {text for text, _ in told} == {kind or "every contact mode"}
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1] < 1.0) == (0.1, True)
    return found, asked


@pytest.mark.parametrize("kind", [None, "sliding"])
def test_a_curve_over_rays_has_no_gap_wider_than_six_percent_of_its_size(
    kind: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scale 3/(1 + ratio): the points lie on the line B/T + K = 3 times the stiffest."""
    found, asked = rays(monkeypatch, lambda ratio: 3.0 / (1.0 + ratio), kind)
    np.testing.assert_allclose(found.damping / T + found.stiffness, 3.0 * STIFFEST, rtol=1e-12)
    assert found.stiffness[0] == pytest.approx(3.0 * STIFFEST)
    assert found.stiffness[-1] == pytest.approx(3.0 * STIFFEST / 101.0)
    ratio = found.damping / (T * found.stiffness)
    assert (np.diff(ratio) > 0.0).all()
    np.testing.assert_allclose(found.angle, 0.1 + ratio, rtol=1e-9)
    assert len(asked) == len(set(asked)) == len(found.damping)
    assert set(mesh.RATIOS) <= {round(one, 9) for one in asked}
    assert len(asked) <= len(mesh.RATIOS) + mesh.MORE
    size = np.hypot(np.diff(found.damping) / found.damping.max(), np.diff(found.stiffness) / found.stiffness.max())
    assert size.max() < 0.06 or len(asked) == len(mesh.RATIOS) + mesh.MORE
    assert len(asked) > len(mesh.RATIOS)
    assert found.inside == (0.0, 0.5 * found.stiffness[0])
    assert found.jump == np.inf


def test_rays_without_a_stable_surface_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = rays(monkeypatch, lambda ratio: 0.0 if ratio > 0.5 or ratio == 0.0 else 1.0)
    ratio = found.damping / (T * found.stiffness)
    assert 0.0 < ratio.min() <= 0.01
    assert 0.45 <= ratio.max() <= 0.5
    assert found.inside == (0.5 * found.damping[0], 0.5 * found.stiffness[0])
    with pytest.raises(StabilityError, match=r"object\.surface: no stiffness of the surface makes every contact mode"):
        rays(monkeypatch, lambda _: 0.0)


@pytest.mark.parametrize(("critical", "expected"), [(5.0, 5.0), (0.5, 0.5), (1.5e-4, 1.5e-4), (0.6e-4, 0.0)])
def test_the_largest_scale_is_searched_from_one_down_to_the_smallest(
    critical: float, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two sites with two modes each; the mode of the second site is stable below a critical scale."""
    sites = [SimpleNamespace(limit=10.0), SimpleNamespace(limit=critical)]

    def stability(site: Any, modes: list[str], scale: float = 1.0) -> list[Any]:
        return [
            SimpleNamespace(site=site, mode=mode, stable=scale < site.limit, radius=scale / site.limit)
            for mode in modes
        ]

    starts = []

    def margin(found: list[Any], start: float) -> tuple[float, Any]:
        starts.append(start)
        return min(one.site.limit for one in found), found[-1]

    monkeypatch.setattr(mesh, "mode_stability", stability)
    monkeypatch.setattr(mesh, "gain_margin", margin)
    found = [one for site in sites for one in stability(site, ["a", "b"])]
    scale, worst = mesh._largest_scale(found)
    assert scale == expected
    assert worst.site is sites[1]
    if expected:
        assert starts[0] < critical
        assert starts[0] == 1.0 or 1.5 * starts[0] >= critical
    else:
        assert starts == []
    monkeypatch.setattr(mesh, "gain_margin", lambda found, start: (np.inf, found[0]))
    assert mesh._largest_scale(found[:2])[0] == 0.0


def test_the_map_of_a_mesh_has_a_curve_for_all_modes_and_for_each_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        [SimpleNamespace(stiffness=k, damping=b) for k, b in pairs]
        for pairs in ([(1.0, 5.0), (4.0, 2.0)], [(3.0, 7.0)])
    ]
    asked: list[Any] = []

    def made(kinds: list[str], stable: bool) -> Any:
        one = contact(*(SimpleNamespace(points=part) for part in points))
        one.found = [
            SimpleNamespace(mode=SimpleNamespace(kind=kind), stable=stable or kind != "edge") for kind in kinds
        ]
        monkeypatch.setattr(mesh, "mesh_contact", lambda _s, last: asked.append(last) or one)
        monkeypatch.setattr(mesh, "_boundary", lambda _c, stiffest, kind, _r: (stiffest, kind))
        return mesh.mesh_zwidth(SimpleNamespace(title="a title"), False, lambda *_: None)  # type: ignore[arg-type]

    both = made(["sticking", "sliding", "edge", "vertex"], False)
    assert both.curves == {
        "every contact mode": (4.0, None), "sliding": (4.0, "sliding"), "sticking": (4.0, "sticking")
    }  # fmt: skip
    assert (both.here, both.stable_here, both.title, asked) == ((7.0, 4.0), False, "a title", [2])
    assert both.passive is both.simulated is None
    one = made(["sticking", "edge"], True)
    assert (list(one.curves), one.stable_here) == (["every contact mode"], True)


def body_of(
    friction: float, directions: int, static: float, monkeypatch: pytest.MonkeyPatch, state: State = State.STABLE,
    rests: bool = True,
) -> dict[str, Any]:  # fmt: skip
    """What the boundaries of a body are made of, without a run."""
    seen: dict[str, Any] = {"arms": []}
    loop = SimpleNamespace(
        normal=np.ones(directions), path="own", radius=lambda: 2.0,
        along_normal=lambda path: seen.update(projected=path) or SimpleNamespace(normal=np.ones(1), path=path),
    )  # fmt: skip
    monkeypatch.setattr(
        body, "replace", lambda one, path: SimpleNamespace(normal=one.normal, path=path, radius=one.radius)
    )
    found = SimpleNamespace(static_stiffness=static, loop=loop, normal="the normal", state=state)
    run = SimpleNamespace(trace="a trace", rests=rests)
    monkeypatch.setattr(body, "contact_of", lambda _s: (found, run, 17))

    def device_loop(_s: Any, trace: str, row: int, normal: str, across: bool, arm: Any = None) -> Any:
        assert (trace, row, normal) == ("a trace", 17, "the normal")
        seen["arms"].append((across, arm))
        return SimpleNamespace(path=f"path of {arm}")

    def boundary(one: Any, stiffness: float) -> Any:
        assert stiffness == static
        if "lost" in one.path:
            raise StabilityError("no body of any stiffness is stable in this loop")
        return SimpleNamespace(inside=(2.0, 3.0), path=one.path)

    monkeypatch.setattr(body, "device_loop", device_loop)
    monkeypatch.setattr(body, "_boundary", boundary)
    options = {"static_friction": friction} if friction else {}
    seen["scenario"] = SimpleNamespace(object=SimpleNamespace(body=SimpleNamespace(options=options, contact_points=())))
    return seen


@pytest.mark.parametrize(("friction", "directions", "across"), [(0.0, 3, False), (0.3, 3, True), (0.3, 1, False)])
def test_the_boundaries_of_a_body_are_those_of_each_operator_along_the_normal_or_with_friction_across(
    friction: float, directions: int, across: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = body_of(friction, directions, 40.0, monkeypatch)
    shares: list[float] = []
    for low, least in ((0.25, 10.0), (body._SCALES[0], 0.0), (1.01 * body._SCALES[0], 40.0 * 1.01 * body._SCALES[0])):
        monkeypatch.setattr(body, "_interval", lambda _loop, damping, low=low: (low, 9.0 + damping))
        shares.clear()
        seen["arms"].clear()
        curves, never, stiffness, found, doubt = body.body_boundaries(
            seen["scenario"], "mine", [("one", "one"), ("lost", "lost"), ("two", "two")], shares.append  # type: ignore[list-item]
        )  # fmt: skip
        assert list(curves) == ["mine", "one", "two"]
        assert [curves[name].path for name in ("one", "two")] == ["path of one", "path of two"]
        assert (never, stiffness, doubt) == (["lost"], 40.0, "")
        assert found == pytest.approx(least)
        assert shares == [0.25, 0.5, 0.75]
        projected = directions == 3 and not across
        assert curves["mine"].path == ("path of None" if projected else "own")
        whole = [False, True] if projected else [across]  # along the normal, and whether the arm holds the tip across
        assert seen["arms"] == [(False, None)] * projected + [(d, arm) for arm in ("one", "lost", "two") for d in whole]


@pytest.mark.parametrize(
    ("state", "rests", "said"),
    [
        (State.STABLE, False, "undecided: small motions decay, but the run"),
        (State.UNSTABLE, True, "unstable: a motion across"),
        (State.UNSTABLE, False, "unstable: a motion across"),
        (State.UNDECIDED, True, "undecided: the response"),
    ],
)
def test_a_loop_whose_small_motions_grow_or_whose_run_does_not_rest_is_not_called_stable(
    state: State, rests: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = body_of(0.3, 3, 40.0, monkeypatch, state, rests)
    monkeypatch.setattr(body, "_interval", lambda _loop, damping: (0.25, 9.0 + damping))
    assert body.body_boundaries(seen["scenario"], "mine", [], lambda _: None)[-1].startswith(said)


def test_a_body_without_stiffness_has_no_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = body_of(0.0, 1, 0.0, monkeypatch)
    with pytest.raises(StabilityError, match="the body has no stiffness along its force where the run leaves the tip"):
        body.body_boundaries(seen["scenario"], "mine", [], lambda _: None)


@pytest.mark.parametrize(
    ("stiffness", "least", "stable"), [(50.0, 0.0, True), (50.0, 50.0, False), (70.0, 0.0, False), (69.0, 68.0, True)]
)
@pytest.mark.parametrize("doubt", ["", "undecided: some reason"])
def test_a_body_is_stable_between_the_least_stiffness_and_the_curve_and_in_all_directions(
    stiffness: float, least: float, stable: bool, doubt: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    curve = Boundary(np.array([0.5, 0.0, 1.0]), np.array([90.0, 70.0, 10.0]), np.ones(3), (0.0, 1.0))
    told: list[tuple[str, float]] = []

    def boundaries(_s: Any, own: str, others: Any, progress: Any) -> Any:
        assert (own, others) == ("mine", [("one", None)])
        progress(0.5)
        return {"mine": curve}, ["two"], stiffness, least, doubt

    monkeypatch.setattr(body, "body_boundaries", boundaries)
    monkeypatch.setattr(body, "operator_name", lambda _s: "mine")
    monkeypatch.setattr(body, "other_operators", lambda _s: [("one", None)])
    scenario: Any = SimpleNamespace(title="a title")
    found = body.body_zwidth(scenario, False, lambda *what: told.append(what))
    assert (found.here, found.never) == ((0.0, stiffness), ("two",))
    assert found.stable_here == (stable and not doubt)
    assert f", is {(doubt or 'stable') if stable else 'unstable'}." in found.verdict
    assert found.curves == {"mine": curve}
    assert told == [("the body's response", 0.05), ("exact boundary", pytest.approx(0.55))]
