"""Bodies of a user's own springs: closed forms of chains and lattices, a dense solution, files, and mistakes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate.cli.body import _rows
from palpate.fem import Body, BodyError, build_springs, load
from palpate.simulation import simulate

PERIOD = 1e-3


def chain(links: int, tension: float = 0.0, stiffness: float = 40.0) -> dict[str, Any]:
    """Two parallel chains of `links` springs along x, clamped at both ends, and joined by rungs along y."""
    step, count = 10e-3, links + 1
    x = np.arange(count) * step
    points = np.concatenate([np.stack([x, np.full(count, y), np.zeros(count)], axis=1) for y in (0.0, step)])
    along = [(row * count + i, row * count + i + 1) for row in (0, 1) for i in range(links)]
    rungs = [(i, count + i) for i in range(count)]
    quads = [(i, i + 1, count + i + 1, count + i) for i in range(links)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    lengths = [step * (1.0 - tension)] * len(along) + [step] * len(rungs)
    return {
        "points": points,
        "springs": np.array(along + rungs),
        "stiffness": [stiffness] * len(along) + [stiffness] * len(rungs),
        "masses": 1e-3,
        "fixed": [0, links, count, count + links],
        "triangles": np.array(triangles),
        "rest_lengths": lengths,
    }


def lattice(side: int = 4, jitter: float = 1e-3) -> dict[str, Any]:
    """An irregular cubic lattice with springs to all 26 neighbors, fixed at its bottom, touched at its top."""
    random = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    index = {tuple(g): i for i, g in enumerate(grid.tolist())}
    ways = [w for w in np.ndindex(3, 3, 3) if w > (1, 1, 1)]
    pairs = [
        (i, index[to])
        for g, i in index.items()
        for w in ways
        if (to := tuple(int(a + b - 1) for a, b in zip(g, w, strict=True))) in index
    ]
    top = side - 1
    cells = [(x, y) for x in range(top) for y in range(top)]
    corner = lambda x, y: index[(x, y, top)]  # noqa: E731
    faces = [
        t
        for x, y in cells
        for t in (
            (corner(x, y), corner(x + 1, y), corner(x + 1, y + 1)),
            (corner(x, y), corner(x + 1, y + 1), corner(x, y + 1)),
        )
    ]
    points = 5e-3 * grid + jitter * random.uniform(-1, 1, size=grid.shape)
    return {
        "points": points,
        "springs": np.array(pairs),
        "stiffness": random.uniform(10.0, 60.0, size=len(pairs)),
        "masses": random.uniform(1e-4, 3e-4, size=len(grid)),
        "fixed": grid[:, 2] == 0,
        "triangles": np.array(faces),
    }


def test_the_middle_of_a_tensioned_string_yields_as_the_closed_form() -> None:
    """A string of n links under the tension T gives n l / (4 T) at its middle, across it; half of that with two."""
    links, tension, k, step = 8, 0.3, 40.0, 10e-3
    body = build_springs(**chain(links, tension, k))
    nodes = body.nodes
    middle = [int(np.argmin(np.linalg.norm(nodes - [0.04, y, 0.0], axis=1))) for y in (0.0, step)]
    weights = body.patch_weights.toarray()
    compliance = body.compliance.astype(float)[2::3, 2::3]
    # Green's function of a tensioned string between its clamped ends, per unit force at vertex j.
    a = np.arange(links + 1) * step
    span, pull = links * step, k * tension * step
    green = np.minimum.outer(a, a) * (span - np.maximum.outer(a, a)) / (span * pull)
    whole = np.kron(np.eye(2), green)
    expected = weights @ whole @ weights.T
    assert np.abs(compliance - expected).max() < 1e-5 * expected.max()
    assert compliance[middle[0], middle[0]] > 0.0


def test_compliance_is_that_of_the_dense_stiffness() -> None:
    given = lattice()
    body = build_springs(**given)
    x, pairs, k = given["points"], given["springs"], given["stiffness"]
    stiffness = np.zeros((3 * len(x), 3 * len(x)))
    for (a, b), each in zip(pairs, k, strict=True):
        axis = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a])
        block = each * np.outer(axis, axis)
        for p, q, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
            stiffness[3 * p : 3 * p + 3, 3 * q : 3 * q + 3] += sign * block
    free = np.flatnonzero(np.repeat(~given["fixed"], 3))
    load_of = np.kron(body.patch_weights.toarray(), np.eye(3))[:, free]
    expected = load_of @ np.linalg.solve(stiffness[np.ix_(free, free)], load_of.T)
    assert np.abs(body.compliance - expected).max() < 1e-6 * np.abs(expected).max()


def dense_ticks(
    given: dict[str, Any], body: Body, node: int, force: float, ticks: int, law: dict[str, float], damping: float
) -> np.ndarray:
    """Positions after ticks of the scheme of the model, in dense algebra, under a force into a node."""
    x0, pairs, k = given["points"], given["springs"], given["stiffness"]
    (a, b), masses, still = pairs.T, np.asarray(given["masses"]), np.asarray(given["fixed"])
    rest = np.linalg.norm(x0[b] - x0[a], axis=1)
    limit, h = law.get("stiffness_limit", 1.0), PERIOD
    damper = np.zeros((len(x0), len(x0)))
    weight = damping + 0.5 * h * (limit if law.get("exponent", 1.0) > 0.0 else 1.0) * k
    for p, q, w in zip(a, b, weight, strict=True):
        damper[[p, q, p, q], [p, q, q, p]] += [w, w, -w, -w]
    free = np.flatnonzero(~still)
    system = (np.diag(masses) / h**2 + damper / h)[np.ix_(free, free)]
    x, v = x0.copy(), np.zeros_like(x0)
    push = np.outer(body.patch_weights.toarray()[node], -force * body.normals[node])
    for _ in range(ticks):
        edge = x[b] - x[a]
        length = np.linalg.norm(edge, axis=1)
        e = (length - rest) / rest
        m = np.abs(e)
        if "hardening_strain" in law:
            e0 = law["hardening_strain"]
            knee = np.minimum(m, e0 * np.sqrt((limit - 1) / 3))
            size = knee + knee**3 / e0**2 + limit * (m - knee)
        elif "exponent" in law:
            rate = law["exponent"]
            knee = np.minimum(m, np.log(limit) / abs(rate))
            size = np.expm1(rate * knee) / rate + (limit if rate > 0 else 1 / limit) * (m - knee)
        else:
            size = m
        pull = (k * rest * np.sign(e) * size / length)[:, None] * edge
        total = push.copy()
        np.add.at(total, a, pull)
        np.add.at(total, b, -pull)
        step = np.linalg.solve(system, (masses[:, None] * v / h + total)[free])
        x[free] += step
        v[free] = step / h
    return x


@pytest.mark.parametrize(
    "law",
    [
        {},
        {"hardening_strain": 0.1, "stiffness_limit": 4.0},
        {"exponent": 6.0, "stiffness_limit": 8.0},
        {"exponent": -6.0, "stiffness_limit": 8.0},
    ],
)
def test_ticks_are_those_of_dense_algebra(law: dict[str, float]) -> None:
    """numpy beside the core: the same scheme, without its vector registers and its factor in single precision."""
    given = lattice()
    body = build_springs(**given, damping=0.02).mass_spring(PERIOD, **law)
    node, force, ticks = 5, 0.4, 60
    body.core.node_response(node, np.full(ticks, force))
    expected = dense_ticks(given, body, node, force, ticks, law, 0.02)
    moved = np.abs(expected - given["points"]).max()
    assert moved > 1e-3
    assert np.abs(body.core.positions() - expected).max() < 1e-6 * moved


@pytest.mark.parametrize("law", [{}, {"hardening_strain": 0.05}, {"exponent": 8.0}, {"exponent": -8.0}])
def test_forces_are_the_same_bits_for_each_width_of_the_registers(law: dict[str, float]) -> None:
    body = build_springs(**lattice()).mass_spring(PERIOD, **law)
    from palpate import _core

    results = []
    for lanes in (2, 4, 8):
        static, dynamic = body.kind.friction
        core = _core.MassSpringBody(
            *body._arrays()[:3],
            *body._network_arrays().values(),
            **body.kind.options,
            static_friction=static,
            dynamic_friction=dynamic,
            lanes=lanes,
        )
        core.node_response(4, np.full(200, 0.05))
        results.append(core.positions())
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.parametrize("law", [{}, {"hardening_strain": 0.03}, {"exponent": 10.0}, {"exponent": -10.0}])
def test_no_tick_makes_energy_while_a_tip_shakes_it(law: dict[str, float]) -> None:
    springy = build_springs(**lattice()).mass_spring(PERIOD, **law)
    core, inward, random = springy.core, -springy.normals, np.random.default_rng(2)
    place, before, total, pressed = np.zeros(3), springy.displacement(), 0.0, 0
    for _ in range(1500):
        place = 0.95 * place + random.normal(size=3) * [1e-3, 1e-3, 6e-4]
        had = core.energy
        springy.simulate_path((place + np.array([0.0075, 0.0075, 0.021]))[None], 0.006, outward=[0, 0, 1], go_on=True)
        nodes, forces = core.contact_forces()
        now = springy.displacement()
        work = (forces * np.einsum("ij,ij->i", inward[nodes], (now - before)[nodes])).sum()
        assert core.energy <= had + work + 1e-9 * (had + abs(work))
        before, total, pressed = now, total + work, pressed + (len(nodes) > 0)
    assert 50 < pressed < 1450
    assert 0 <= core.energy < total
    assert core.limited_steps == 0


@pytest.mark.parametrize("law", [{"hardening_strain": 0.05}, {"exponent": 8.0}])
def test_closed_paths_of_the_tip_give_no_work(law: dict[str, float]) -> None:
    body = build_springs(**lattice()).mass_spring(PERIOD, **law)
    t, random = np.linspace(0, 2 * np.pi, 400), np.random.default_rng(4)
    for _ in range(10):
        a, b = random.normal(size=(2, 3)) * [2e-3, 2e-3, 1e-3]
        way = np.outer(1 - np.cos(t), a) + np.outer(np.sin(2 * t), b) + [0.0075, 0.0075, 0.0205]
        body.core.reset()
        felt = body.simulate_path(way, 0.006, outward=[0, 0, 1])
        assert -(felt.force[1:] * np.diff(way, axis=0)).sum() > -1e-9


def test_hardening_springs_press_harder_and_softening_ones_less() -> None:
    body, at = build_springs(**lattice(jitter=0.0)), [0.0075, 0.0075, 0.015]
    models = [
        body.mass_spring(PERIOD, rayleigh_alpha=30.0, **law)
        for law in ({"exponent": -10.0}, {}, {"exponent": 10.0}, {"hardening_strain": 0.05})
    ]
    deep = [m.indent(at, "12 mm", "3 mm", tip="flat").force[2] for m in models]
    assert deep[0] < 0.95 * deep[1] < 0.9 * min(deep[2:])
    shallow = [m.indent(at, "12 mm", "0.01 mm", tip="flat").force[2] for m in models]
    assert 0.0 < max(shallow) < 1.02 * min(shallow)


def test_a_body_of_springs_comes_from_a_file_and_runs_in_a_scenario(tmp_path: Path) -> None:
    given = lattice()
    body = build_springs(**given, damping=0.02, output=tmp_path / "net.h5")
    again = load(tmp_path / "net.h5")
    assert np.array_equal(again.spring_network.stiffness, body.spring_network.stiffness)
    assert np.array_equal(again.spring_network.damping, np.full(len(given["springs"]), 0.02))
    assert np.array_equal(again.compliance, body.compliance)
    trace = simulate(scenario(tmp_path / "net.h5"))
    assert trace["touching"].any()


def test_its_rows_state_springs_and_masses() -> None:
    rows = dict(_rows(build_springs(**{**lattice(), "stiffness": 20.0, "masses": "0.5 g"})))
    assert rows["springs"].endswith(", 20 N/m")
    assert rows["vertices"] == "64, 32 g, 16 fixed"
    assert "material" not in rows


def scenario(file: Path) -> dict[str, Any]:
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 deg", "0 deg", "0 deg"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.2 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-0.5 mm"],
            "body": {
                "file": str(file),
                "kind": "mass_spring",
                "hardening_strain": 0.1,
                "radius": "6 mm",
                "origin": ["7.5 mm", "7.5 mm", "20.5 mm"],
            },
        },
        "run": {"duration": "0.1 s"},
    }


MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"springs": [[0, 1], [1, 640]]}, "springs: row 1 names vertex 640, but there are 64, from 0 to 63"),
    ({"springs": [[0, 1], [1, -2]]}, "springs: row 1 names vertex -2"),
    ({"springs": [[3, 3]]}, "springs: row 0 joins vertex 3 to itself"),
    ({"springs": [[0, 1], [1, 0]]}, "springs: vertices 0 and 1 are joined twice"),
    ({"springs": [[0.5, 1.0]]}, "springs: one or more rows of 2 whole numbers"),
    ({"stiffness": -1.0}, "stiffness: -1 N/m must be positive"),
    ({"stiffness": 1e300}, r"stiffness: 1e\+300 N/m must be between 1e-09 and 1e\+15 N/m"),
    ({"masses": 1e-20}, "masses: 1e-20 kg must be between 1e-15 and"),
    ({"stiffness": "20 mm"}, "stiffness"),
    ({"stiffness": [1.0, 2.0]}, "stiffness: one number is needed, or one for each of the"),
    ({"stiffness": float("nan")}, "stiffness: nan is not a finite number"),
    ({"masses": 0.0}, "masses: 0 kg must be positive"),
    ({"damping": -0.1}, "damping: -0.1 N\\*s/m must not be negative"),
    ({"rest_lengths": 0.0}, "rest_lengths: 0 m must be positive"),
    ({"rest_lengths": 1e-3}, "rest_lengths: the springs pull vertex"),
    ({"fixed": []}, "fixed: no vertex is fixed"),
    ({"fixed": list(range(64))}, "fixed: all vertices are fixed"),
    ({"fixed": [64]}, "fixed: row 0 names vertex 64"),
    ({"fixed": "z < -1 m"}, "fixed: no vertex is fixed"),
    ({"triangles": [[0, 1, 99]]}, "triangles: row 0 names vertex 99"),
    ({"triangles": [[3, 3, 7]]}, "triangles: row 0 with vertices 3, 3, 7 has no area"),
    ({"triangles": [[9, 10, 18], [10, 18, 9]]}, "triangles: the one with vertices 9, 10, 18 is given twice"),
    ({"triangles": [[0, 4, 16]]}, "triangles: all of their vertices are fixed"),
    ({"points": [[0.0, 0.0]]}, "points: two or more rows"),
]


@pytest.mark.parametrize(("changed", "sentence"), MISTAKES)
def test_mistakes_are_told(changed: dict[str, Any], sentence: str) -> None:
    with pytest.raises(BodyError, match=sentence):
        build_springs(**{**lattice(), **changed})


def test_a_point_that_is_not_finite_is_told() -> None:
    given = lattice()
    given["points"][5, 1] = np.nan
    with pytest.raises(BodyError, match="points: vertex 5 has a number that is not finite"):
        build_springs(**given)


def test_a_loose_part_is_told() -> None:
    given = lattice()
    far = given["points"] + [1.0, 0.0, 0.0]
    count = len(far)
    given["points"] = np.concatenate([given["points"], far])
    given["springs"] = np.concatenate([given["springs"], given["springs"] + count])
    given["stiffness"] = np.tile(given["stiffness"], 2)
    given["masses"] = np.tile(given["masses"], 2)
    given["fixed"] = np.concatenate([given["fixed"], np.zeros(count, dtype=bool)])
    with pytest.raises(BodyError, match=f"springs: vertex {count} belongs to a part without a fixed vertex"):
        build_springs(**given)


def test_a_mechanism_is_told() -> None:
    """A ladder without tension has no stiffness across its plane, and one under pressure a negative one."""
    with pytest.raises(BodyError, match=r"can move along [xyz] without stiffness"):
        build_springs(**chain(4))
    with pytest.raises(BodyError, match="with negative stiffness"):
        build_springs(**chain(4, tension=-0.2))


@pytest.mark.parametrize("ratio", [0.9, 0.999, 1.001, 1.08, 1.12, 1.2, 1.32, 1.46, 2.0])
def test_a_membrane_is_refused_exactly_if_it_is_compressed(ratio: float) -> None:
    """Across its plane a net of springs has the stiffness of its tension: negative if the rest lengths are longer."""
    side, step = 7, 5e-3
    at = np.arange(side * side).reshape(side, side)
    x, y = np.meshgrid(step * np.arange(side), step * np.arange(side), indexing="ij")
    corners = [at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()]
    inner = np.zeros((side, side), dtype=bool)
    inner[1:-1, 1:-1] = True
    threads = [np.stack([at[:-1], at[1:]], axis=-1), np.stack([at[:, :-1], at[:, 1:]], axis=-1)]

    def made() -> Body:
        return build_springs(
            np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3),
            np.concatenate([pairs.reshape(-1, 2) for pairs in threads]),
            stiffness="200 N/m",
            rest_lengths=ratio * step,
            masses="0.1 g",
            fixed=~inner.ravel(),
            triangles=np.concatenate(
                [np.stack([corners[0], *corners[1:3]], axis=1), np.stack([corners[0], *corners[2:]], axis=1)]
            ),
        )

    if ratio < 1.0:
        assert np.linalg.eigvalsh(made().compliance.astype(float)).min() > 0.0
    else:
        with pytest.raises(BodyError, match=r"can move along [xyz] with"):
            made()


def test_other_models_are_refused_in_one_sentence() -> None:
    body = build_springs(**lattice())
    for model in (
        lambda: body.signed_distance(PERIOD),
        lambda: body.modal(PERIOD),
        lambda: body.hyperelastic(PERIOD),
    ):
        with pytest.raises(BodyError, match="the body consists of springs"):
            model()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"stiffness_limit": 2.0}, "stiffness_limit: linear springs have none"),
        ({"hardening_strain": 0.1, "exponent": 2.0}, "exponent: a spring has one law"),
        ({"hardening_strain": 0.1, "stiffness_limit": 1.0}, "stiffness_limit: 1 must be above 1 and at most 100"),
        ({"hardening_strain": -0.1}, "hardening_strain: -0.1 must be positive"),
        ({"exponent": 0.0}, "exponent: 0 must be between"),
    ],
)
def test_mistakes_of_a_law_are_told(options: dict[str, float], sentence: str) -> None:
    with pytest.raises(BodyError, match=sentence):
        build_springs(**lattice()).mass_spring(PERIOD, **options)


def test_a_stiffer_network_is_stiffer_in_each_model() -> None:
    body = build_springs(**lattice())
    stiff = body.scaled_stiffness(3.0)
    assert np.allclose(3.0 * stiff.compliance, body.compliance, rtol=1e-5)
    assert np.array_equal(stiff.spring_network.stiffness, 3.0 * body.spring_network.stiffness)
