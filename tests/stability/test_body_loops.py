"""Loops around linear responses of a body: equal to the recursion that they stand for, and to other ways to count."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest
from one_node import one_node
from palpate.linear.linear_device import SampledDevice
from palpate.linear.wall import wall_loop
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.stability import stability_interval
from palpate.stability.body.body_loop import BodyLoop, stiffness_margin, unstable_poles, worst_gain
from palpate.stability.body.multirate_loop import MultirateLoop
from palpate.stability.body.update_rate import slowest_update
from palpate.stability.body.zwidth import _boundary, _interval
from palpate.stability.contact_loop import judge

PERIOD = 1e-3


def sampled(a: Any, b: Any, c: Any, d: Any) -> control.StateSpace:
    return control.StateSpace(a, b, c, d, PERIOD)


def arm(axes: int, rng: np.random.Generator) -> control.StateSpace:
    """An arm of `axes` coupled coordinates on springs: from the force on the body to the tip, delayed by a tick."""
    root = rng.normal(size=(3, axes, axes))
    mass, damping, stiffness = (one @ one.T + np.eye(axes) for one in root)
    zero, inverse = np.zeros((axes, axes)), np.linalg.inv(0.2 * mass)
    a = np.block([[zero, np.eye(axes)], [-200.0 * inverse @ stiffness, -4.0 * inverse @ damping]])
    motion = control.StateSpace(a, np.vstack([zero, -inverse]), np.eye(axes, 2 * axes), zero)
    return control.c2d(motion, PERIOD) * sampled(zero, np.eye(axes), np.eye(axes), zero)


def frame(axes: int, rng: np.random.Generator) -> np.ndarray:
    return np.linalg.qr(rng.normal(size=(axes, axes)))[0]


def body_loop(axes: int, seed: int, stiffness: float = 300.0) -> BodyLoop:
    """A loop around a body of three random states, with its impulse response."""
    rng = np.random.default_rng(seed)
    path, basis = arm(axes, rng), frame(axes, rng)
    a = np.diag([0.9, 0.5, -0.3])
    b, c = rng.normal(size=(3, axes)), 0.1 * stiffness * rng.normal(size=(axes, 3))
    d = stiffness * (np.eye(axes) + 0.3 * np.ones((axes, axes)))
    markov = np.array([d, *(c @ np.linalg.matrix_power(a, k) @ b for k in range(400))])
    error = np.abs(rng.normal(size=(axes, axes)))
    return BodyLoop(path, sampled(a, b, c, d), markov, basis, basis[:, 0], error)


def elastic_loop(stiffness: float, seed: int = 0) -> BodyLoop:
    """A loop along one line around a body without states."""
    path = arm(1, np.random.default_rng(seed))
    body = sampled(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[stiffness]])
    return BodyLoop(path, body, np.full((1, 1, 1), stiffness), np.eye(1), np.ones(1), np.full((1, 1), 2.0))


def wall_limit(loop: BodyLoop, damping: float) -> Any:
    """The stable stiffnesses of a wall in the same place."""
    p = loop.path
    device = SampledDevice(p.A - np.eye(p.nstates), -p.B[:, 0], np.zeros(p.nstates), p.C[0], 0, PERIOD)
    return stability_interval(wall_loop(device), damping)


def multirate_loop(axes: int, every: int, updates: int, seed: int) -> MultirateLoop:
    rng = np.random.default_rng(seed)
    local = 200.0 * (np.eye(axes) + 0.2 * rng.normal(size=(axes, axes)))
    correction = 20.0 * rng.normal(size=(updates * every, axes, axes))
    correction[0] = 0.0
    basis = frame(axes, rng)
    error = np.abs(rng.normal(size=(axes, axes)))
    return MultirateLoop(arm(axes, rng), local, correction, every, basis, basis[:, 0], error)


@pytest.mark.parametrize(("axes", "damping", "scale"), [(1, 0.0, 1.0), (2, 3.0, 0.7), (3, 5.0, 2.5), (3, 0.0, 0.1)])
def test_the_matrix_advances_the_loop_by_a_tick(axes: int, damping: float, scale: float) -> None:
    """Tip, force of the body, force of the damper, arm: one after the other."""
    loop = body_loop(axes, 10 + axes)
    rng, p, b = np.random.default_rng(1), loop.path, loop.body
    x, y, last = rng.normal(size=p.nstates), rng.normal(size=b.nstates), rng.normal()
    state = np.concatenate([x, y, [last]])[: None if damping else -1]
    matrix = loop.matrix(scale, damping)
    for _ in range(5):
        tip = p.C @ x
        along = float(loop.normal @ tip)
        force = scale * (b.C @ y + b.D @ tip) + damping * (along - last) / PERIOD * loop.normal
        x, y, last = p.A @ x + p.B @ force, b.A @ y + b.B @ tip, along
        state = matrix @ state
        np.testing.assert_allclose(state[: p.nstates + b.nstates], np.concatenate([x, y]), rtol=1e-9, atol=1e-9)
    assert abs(loop.root(scale, damping)) == pytest.approx(np.abs(np.linalg.eigvals(matrix)).max(), rel=1e-12)
    assert loop.radius(scale) == pytest.approx(np.abs(np.linalg.eigvals(loop.matrix(scale))).max(), rel=1e-12)


@pytest.mark.parametrize(
    ("axes", "every", "updates", "damping"), [(1, 1, 4, 0.0), (1, 5, 3, 2.0), (2, 4, 2, 0.0), (3, 3, 3, 4.0)]
)
def test_the_monodromy_matrix_advances_the_loop_by_an_update(
    axes: int, every: int, updates: int, damping: float
) -> None:
    """f[k] = K x[k] + sum over the updates u of g[k - m u] x[m u], tick by tick."""
    loop, scale = multirate_loop(axes, every, updates, 20 + axes), 1.3
    rng, p = np.random.default_rng(2), loop.path
    x = rng.normal(size=p.nstates)
    sampled_tips = [rng.normal(size=axes) for _ in range(updates)]  # newest first
    last = rng.normal()
    state = np.concatenate([x, *sampled_tips, [last]])[: None if damping else -1]
    for tick in range(3 * every):
        tip = p.C @ x
        if tick % every == 0:
            sampled_tips = [tip, *sampled_tips[:-1]]
        along = float(loop.normal @ tip)
        late = sum(loop.correction[tick % every + every * age] @ one for age, one in enumerate(sampled_tips))
        force = scale * (loop.local @ tip + late)
        if damping:
            force = force + damping * (along - last) / PERIOD * loop.normal
        x, last = p.A @ x + p.B @ force, along
    end = np.concatenate([x, *sampled_tips, [last]])[: None if damping else -1]
    found = np.linalg.matrix_power(loop.matrix(scale, damping), 3) @ state
    np.testing.assert_allclose(found, end, rtol=1e-8, atol=1e-9)
    largest = np.abs(np.linalg.eigvals(loop.matrix(scale, damping))).max()
    assert abs(loop.root(scale, damping)) ** every == pytest.approx(largest, rel=1e-9)
    assert loop.radius() == abs(loop.root(1.0, 0.0))


def test_a_body_without_corrections_has_one_radius_at_any_rate_of_updates() -> None:
    elastic = elastic_loop(400.0)
    for every in (1, 2, 7):
        correction = np.zeros((2 * every, 1, 1))
        loop = MultirateLoop(
            elastic.path, np.full((1, 1), 400.0), correction, every, np.eye(1), np.ones(1), np.ones((1, 1))
        )
        assert loop.radius(1.7) == pytest.approx(elastic.radius(1.7), rel=1e-9)
        assert abs(loop.root(1.7, 2.0)) == pytest.approx(abs(elastic.root(1.7, 2.0)), rel=1e-9)
        assert loop.period == elastic.period == PERIOD


@pytest.mark.parametrize("damping", [0.0, 1.0, 4.0])
def test_an_elastic_body_has_the_limits_of_a_wall(damping: float) -> None:
    for seed in range(3):
        limit = wall_limit(elastic_loop(1.0, seed), damping)
        loop = elastic_loop(50.0, seed)
        low, high = _interval(loop, damping)
        assert 50.0 * high == pytest.approx(limit.stiffness, rel=1e-6)
        assert low == pytest.approx(1e-3)
        assert abs(loop.root(1.001 * high, damping)) > 1.0 > abs(loop.root(0.999 * high, damping))
        if not damping:
            assert 50.0 * stiffness_margin(loop.radius) == pytest.approx(limit.stiffness, rel=1e-6)


def test_the_boundary_of_an_elastic_body_is_that_of_a_wall() -> None:
    loop, stiffness = elastic_loop(50.0), 80.0
    found = _boundary(loop, 50.0)
    assert found.damping[0] == 0.0
    assert np.all(np.diff(found.damping) > 0.0)
    for damping, largest, angle in zip(found.damping, found.stiffness, found.angle, strict=True):
        limit = wall_limit(loop, float(damping))
        assert largest == pytest.approx(limit.stiffness, rel=1e-5)
        if 0.0 < angle < np.pi - 1e-6:
            assert angle / (2 * np.pi * PERIOD) == pytest.approx(limit.frequency, rel=1e-3)
    assert wall_limit(loop, 1.02 * float(found.damping[-1])).stiffness < 0.5 * found.stiffness.max()
    damping, inside = found.inside
    assert damping in found.damping
    assert abs(loop.root(inside / 50.0, damping)) < 1.0
    # The unit in which a body is measured does not matter.
    scaled = _boundary(elastic_loop(stiffness), stiffness)
    assert scaled.stiffness[0] == pytest.approx(found.stiffness[0], rel=1e-6)
    assert scaled.damping[-1] == pytest.approx(found.damping[-1], rel=1e-3)


@pytest.mark.parametrize("every", [1, 4])
def test_the_radius_of_a_contact_is_per_tick_and_its_margin_that_of_the_scaled_loop(every: int) -> None:
    loop, scaled = multirate_loop(3, every, 2, 3), elastic_loop(400.0)
    response: Any = SimpleNamespace(frame=np.eye(3), nodes=5, static=np.eye(3), one_tick=2.0 * np.eye(3))
    found = judge(loop, scaled, response, 1e-3)
    assert found.radius == pytest.approx(loop.radius(), rel=1e-12)
    assert found.radius**every == pytest.approx(np.abs(np.linalg.eigvals(loop.matrix())).max(), rel=1e-12)
    assert scaled.radius(found.stiffness_margin) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("states", [2, 30])
def test_an_unstable_contact_has_no_margin_and_fails_its_eigenvalues(
    states: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if the loop in which the force is scaled is stable."""
    monkeypatch.setattr("palpate.stability.contact_loop.unstable_poles", lambda _: states)
    loop: Any = SimpleNamespace(matrix=lambda: 1.5 * np.eye(states), doubt=lambda: 0.0)
    response: Any = SimpleNamespace(frame=np.eye(3), nodes=5, static=np.eye(3), one_tick=2.0 * np.eye(3))
    scaled = elastic_loop(400.0)
    assert scaled.radius() < 1.0
    found = judge(loop, scaled, response, 1e-3)
    assert np.isnan(found.stiffness_margin)
    assert found.criteria["eigenvalues"] is False


def test_a_margin_is_infinite_only_if_no_factor_up_to_10000_is_unstable() -> None:
    for edge in (1.02, 3.0, 9_500.0):
        assert stiffness_margin(lambda k, edge=edge: 0.5 + 0.5 * k / edge) == pytest.approx(edge, rel=1e-8)
    assert stiffness_margin(lambda k: 0.9) == np.inf
    assert stiffness_margin(lambda k: 0.9 if k < 11_000.0 else 1.1) == np.inf


@pytest.mark.parametrize("seed", range(12))
def test_nyquist_counts_the_unstable_eigenvalues(seed: int) -> None:
    """Of the body's impulse response, without its states; in one, two and three directions, with unstable arms too."""
    loop = body_loop(1 + seed % 3, seed, 40.0 * 6.0 ** (seed % 4))
    if seed % 4 == 3:  # an arm whose swing grows by itself
        p = loop.path
        loop = replace(loop, path=sampled(1.02 * p.A, p.B, p.C, p.D))
        assert np.abs(np.linalg.eigvals(loop.path.A)).max() > 1.0
    assert unstable_poles(loop) == int(np.sum(np.abs(np.linalg.eigvals(loop.matrix())) > 1.0))


@pytest.mark.parametrize("stiffness", [1.0, 50.0, 2e4])
def test_a_free_tip_has_a_pole_at_one_and_is_not_counted_as_unstable(stiffness: float) -> None:
    """A damped mass without a spring: the body alone holds it."""
    motion = control.StateSpace([[0.0, 1.0], [0.0, -5.0]], [[0.0], [-10.0]], [[1.0, 0.0]], [[0.0]])
    loop = replace(elastic_loop(stiffness), path=control.c2d(motion, PERIOD))
    assert np.abs(np.linalg.eigvals(loop.path.A)).max() == 1.0
    assert unstable_poles(loop) == int(np.sum(np.abs(np.linalg.eigvals(loop.matrix())) > 1.0))


@pytest.mark.parametrize("seed", [0, 1, 3, 6, 9, 12])
def test_nyquist_counts_by_the_measured_response_whatever_states_realize_it(seed: int) -> None:
    """The contour is refined where the determinant turns, also where a wrong realization expects no pole."""
    loop = body_loop(1 + seed % 2, seed, 40.0 * 6.0 ** (seed % 4))
    axes = len(loop.normal)
    elastic = sampled(np.zeros((0, 0)), np.zeros((0, axes)), np.zeros((axes, 0)), 0.1 * loop.body.D)
    wrong = replace(loop, body=elastic)
    assert unstable_poles(wrong) == int(np.sum(np.abs(np.linalg.eigvals(loop.matrix())) > 1.0))


@pytest.mark.parametrize(("share", "unstable"), [(0.3, 0), (-0.0425, 0), (-0.0445, 2)])
def test_nyquist_resolves_a_resonance_of_the_measured_response_that_no_state_expects(
    share: float, unstable: int
) -> None:
    """A mode of the body that decays by 2 % in a tick: of the closed loop's poles some are 0.1 % beside the circle."""
    loop = replace(elastic_loop(20.0), path=sampled([[0.0]], [[0.01]], [[1.0]], [[0.0]]))
    mode = 0.98 * np.array([[np.cos(1.0), np.sin(1.0)], [-np.sin(1.0), np.cos(1.0)]])
    body = sampled(mode, [[0.0], [1.0]], [[100.0 * share, 0.0]], [[20.0]])
    rings = control.impulse_response(body, np.arange(800) * PERIOD).outputs * PERIOD
    whole = replace(loop, markov=rings.reshape(-1, 1, 1), body=body)
    assert int(np.sum(np.abs(np.linalg.eigvals(whole.matrix())) > 1.0)) == unstable
    assert unstable_poles(replace(whole, body=loop.body)) == unstable


@pytest.mark.parametrize("decay", [1e-2, 1e-4, 1e-6])
def test_the_doubt_of_a_narrow_resonance_is_that_at_its_peak(decay: float) -> None:
    """1/(1 - 2 r cos a z^-1 + r^2 z^-2) at z = exp(j a): 1 / (decay |1 - r exp(-2 j a)|)."""
    r, a = 1.0 - decay, 0.7
    path = sampled([[2.0 * r * np.cos(a), -r * r], [1.0, 0.0]], [[1.0], [0.0]], [[1.0, 0.0]], [[0.0]])
    loop = replace(elastic_loop(0.0), path=path)
    assert loop.doubt() == pytest.approx(2.0 / (decay * abs(1.0 - r * np.exp(-2j * a))), rel=1e-4 + decay)


def test_some_of_these_loops_are_stable_and_some_are_not() -> None:
    counts = {
        int(np.sum(np.abs(np.linalg.eigvals(body_loop(1, seed, 40.0 * 6.0 ** (seed % 4)).matrix())) > 1))
        for seed in range(12)
    }
    assert 0 in counts
    assert max(counts) >= 2


def test_along_the_normal_the_loop_is_the_body_between_two_projections() -> None:
    whole, multirate = body_loop(3, 4), multirate_loop(3, 4, 2, 5)
    path, n = arm(1, np.random.default_rng(6)), whole.normal
    line, slow = whole.along_normal(path), multirate.along_normal(path)
    for angle in (0.1, 1.0, 2.5):
        z = np.exp(1j * angle)
        felt = n @ np.atleast_2d(whole.body(z)) @ n
        measured = n @ np.tensordot(z ** -np.arange(len(whole.markov)), whole.markov, 1) @ n
        assert measured == pytest.approx(felt, rel=1e-9)
        assert line.gain()(z) == pytest.approx(-felt * path(z), rel=1e-9)
        assert np.tensordot(z ** -np.arange(len(line.markov)), line.markov, 1)[0, 0] == pytest.approx(felt, rel=1e-9)
    m = multirate.normal
    assert slow.local[0, 0] == pytest.approx(m @ multirate.local @ m)
    np.testing.assert_allclose(slow.correction[:, 0, 0], [m @ one @ m for one in multirate.correction])
    for one, of in ((line, whole), (slow, multirate)):
        assert (one.error, one.axes, one.normal) == (of.error[:1, :1], np.eye(1), np.ones(1))
    assert slow.every == 4


def test_the_gain_is_the_product_of_the_responses_with_negative_feedback_understood() -> None:
    loop = body_loop(3, 7)
    z = np.exp(0.4j)
    np.testing.assert_allclose(loop.gain()(z), -loop.body(z) @ loop.path(z), rtol=1e-9)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_doubt_is_the_largest_gain_of_an_error_around_the_loop(axes: int) -> None:
    """Where E |T| has the spectral radius r, errors below E / r cannot make the loop unstable."""
    loop, multirate = body_loop(axes, 30 + axes, 100.0), multirate_loop(axes, 3, 2, 40 + axes)
    z = np.exp(1j * np.concatenate([np.geomspace(1e-4, 0.2, 2000), np.linspace(0.2, np.pi, 300)]))[:, None, None]

    def response(of: control.StateSpace) -> np.ndarray:
        return of.C @ np.linalg.solve(z * np.eye(of.nstates) - of.A, np.tile(of.B, (len(z), 1, 1))) + of.D

    for one, felt in ((loop, response(loop.body)), (multirate, multirate.local)):
        forward = response(one.path)
        closed = one.axes.T @ np.linalg.solve(np.eye(axes) - forward @ felt, forward) @ one.axes
        largest = np.abs(np.linalg.eigvals(one.error @ np.abs(closed))).max()
        assert one.doubt() == pytest.approx(largest, rel=2e-2)
    gains = np.array([[[3.0, 4.0j], [0.0, 1.0]], [[1.0, 0.0], [0.0, -7.0]]])
    assert worst_gain(gains, np.diag([2.0, 1.0])) == pytest.approx(7.0)
    assert worst_gain(gains, np.array([[0.0, 1.0], [1.0, 0.0]])) == pytest.approx(2.0 + np.sqrt(7.0))


@pytest.mark.parametrize("period", [1e-3, 0.4e-3])
def test_the_slowest_update_is_found_wherever_it_is(period: float, tmp_path: Path) -> None:
    """To one tick, or to 2 %; 0.2 s is the longest tested; an undecided loop is said to be so."""
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": f"{period} s"},
        "reference": {"force": ["0 N", "0 N", "-1 N"]},
        "object": {
            "kind": "body",
            "body": {
                "file": str(one_node(512.0, tmp_path / "one.h5")),
                "kind": "neo-hookean",
                "radius": "8 mm",
                "update_interval": f"{5 * period} s",
            },
        },
    }
    scenario, trace = Scenario.from_dict(tables), Trace(period * np.arange(2), {})
    most = round(0.2 / period)
    asked: list[int] = []

    def found(edge: int, doubtful: int = 10**6) -> tuple[float | None, str]:
        def stable(s: Scenario, of: Trace, row: int) -> bool | None:
            assert (of, row) == (trace, 7)
            assert s.object.body is not None
            ticks = round(s.object.body.options["update_interval"] / period)
            asked.append(ticks)
            return None if ticks >= doubtful else ticks <= edge

        return slowest_update(scenario, trace, 7, 5, stable)

    for edge in (5, 6, 9, 10, 11, 47, 100, most - 1):
        interval, sentence = found(edge)
        assert interval is not None
        assert interval <= edge * period + 1e-12
        assert interval >= edge * period - max(1, edge // 50) * period
        assert sentence == f"The slowest stable updates of the body's model are {interval:.4g} s apart."
    interval, sentence = found(most)
    assert interval == pytest.approx(0.2)
    assert "the longest tested" in sentence
    assert max(asked) == most
    interval, sentence = found(most, doubtful=40)
    assert interval is None
    assert f"Updates every {20 * period:.4g} s are stable" in sentence
    assert f"at {40 * period:.4g} s the criteria do not decide" in sentence

    def between(s: Scenario, _: Trace, __: int) -> bool | None:
        assert s.object.body is not None
        ticks = round(s.object.body.options["update_interval"] / period)
        return None if 20 < ticks < 40 else ticks <= 20

    interval, sentence = slowest_update(scenario, trace, 7, 5, between)
    assert interval is None
    assert f"Updates every {20 * period:.4g} s are stable, every {40 * period:.4g} s unstable" in sentence


@pytest.mark.parametrize("seen", [0.0, 1e-3])
def test_motions_across_a_contact_do_not_count_in_the_loop_along_its_normal(seen: float) -> None:
    """A motion that grows by itself, and of which the normal sees nothing or little; the body's stiffness is any."""
    for stiffness in (1.0, 30.0, 300.0, 3000.0):
        loop = elastic_loop(stiffness)
        p = loop.path
        n = p.nstates
        a, b, c = np.eye(n + 1), np.ones((n + 1, 1)), np.zeros((1, n + 1))
        a[:n, :n], a[n, n], b[:n], c[:, :n], b[n] = p.A, 1.002, p.B, p.C, 1e-6
        c[0, n] = seen
        slides = replace(loop, path=sampled(a, b, c, p.D))
        assert slides.radius() >= 1.0015
        assert slides.radius_along_normal() == pytest.approx(loop.radius(), abs=1e-5)
        assert loop.radius_along_normal() == pytest.approx(loop.radius(), rel=1e-12)


def test_a_body_that_pulls_the_tip_in_is_unstable_along_the_normal() -> None:
    loop = elastic_loop(-5000.0)
    assert loop.radius() > 1.0
    assert loop.radius_along_normal() == pytest.approx(loop.radius(), rel=1e-12)
