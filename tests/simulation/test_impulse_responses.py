"""Impulse responses measured on bodies of known dynamics: linear systems in place of the core's body."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.simulation.body_response import realization, response
from palpate.simulation.body_response.held_tip import _thin, contact_frame
from palpate.simulation.body_response.multirate import multirate_response
from palpate.simulation.body_response.realization import _offsets, realize
from palpate.simulation.body_response.response import _is_noise, _is_static, body_response

T = 1e-3
FRAME = contact_frame(np.array([1.0, -2.0, 2.0]))


class Body:
    """A tip held on f[k] = D x[k] + c s[k] + q x^2, s[k+1] = a s[k] + x[k], in the axes of the contact."""

    def __init__(self, a: float = 0.6, c: float = 200.0, square: float = 0.0, **values: Any) -> None:
        self.frame, self.radius, self.period, self.nodes = FRAME, 4e-3, T, 7
        self.rounds, self.memoryless, self.friction, self.core = False, c == 0.0, False, None
        self.relaxation = 0.0
        self.a, self.square = a, square
        self.direct = np.array([[900.0, 50.0, 0.0], [40.0, 500.0, -20.0], [0.0, 10.0, 400.0]])
        self.late = c * np.diag([1.0, 0.5, 0.25])
        self.state = np.zeros(3)
        self.offset = FRAME @ np.array([-3.0, 0.5, 0.2])
        self.force = self.offset
        vars(self).update(values)

    def move(self, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        forces = []
        for x in displacements @ FRAME:
            forces.append(self.offset + FRAME @ (self.direct @ x + self.late @ self.state + self.square * x**2))
            self.state = self.a * self.state + x
        return np.array(forces), np.full(len(forces), 7)


def test_the_measured_response_is_that_of_the_body() -> None:
    body: Any = Body()
    found = body_response(body)
    for k in range(1, 20):
        np.testing.assert_allclose(found.markov[k], body.late * 0.6 ** (k - 1), atol=1e-6)
    np.testing.assert_allclose(found.one_tick, body.direct, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(found.static, body.direct + body.late / 0.4, rtol=1e-6, atol=1e-5)
    assert found.system.nstates == 3
    assert (found.nodes, found.system.dt) == (7, T)
    assert found.error.max() < 1e-3
    assert found.asymmetry < 1e-6
    static: Any = Body(c=0.0)
    alone = body_response(static)
    assert alone.system.nstates == 0
    assert alone.markov.shape == (1, 3, 3)
    np.testing.assert_allclose(alone.static, static.direct, rtol=1e-7, atol=1e-6)


def test_the_asymmetry_is_the_square_of_the_force_at_the_smallest_step() -> None:
    """f = D x + q x^2 along each axis: forth and back differ by q times the step, on the diagonal."""
    body: Any = Body(c=0.0, square=1e7)
    found = body_response(body)
    least = 1e-6 * body.radius
    assert found.asymmetry == pytest.approx(3 * 1e7 * least / np.abs(body.direct).sum(), rel=1e-3)
    np.testing.assert_allclose(np.diag(found.error), 1e7 * least, rtol=1e-3)


def test_a_response_is_static_if_nothing_follows_the_tick_of_the_displacement() -> None:
    first = np.zeros((16, 3, 3))
    first[0] = np.eye(3) * 500.0
    assert _is_static(first, first)
    for size, static in ((4.9e-7, True), (5.1e-7, False)):
        later = first.copy()
        later[3, 0, 1] = -size
        assert _is_static(first, later) is static
        assert _is_static(later, first) is static


@pytest.mark.parametrize("rounds", [False, True])
def test_noise_has_random_signs_or_is_a_constant_of_rounding(rounds: bool) -> None:
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], 64)[:, None, None] * np.eye(3)
    assert abs(float(signs.mean(axis=0)[0, 0])) < 0.3
    assert _is_noise(signs, 64.0, rounds)
    assert _is_noise(signs, 127.0, rounds)
    assert not _is_noise(signs, 129.0, rounds)  # the quarter before had more than twice as much
    biased = signs + 0.5 * np.eye(3)
    assert not _is_noise(biased, 200.0, rounds)
    constant = np.ones((64, 1, 1)) * np.eye(3)
    for before, same in ((64.0, True), (64.0 / 0.981, True), (64.0 / 0.979, False)):
        assert _is_noise(constant, before, rounds) is (rounds and same)


def test_a_record_ends_where_its_noise_begins() -> None:
    """Noise of 1e-3 N/m around a response that decays by 0.6 per tick: it is cut off, and its gain is in the error."""
    rng = np.random.default_rng(1)
    body: Any = Body(rounds=True)
    quiet = body.move
    level = 1e-3 * 1e-6 * body.radius

    def move(displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        forces, nodes = quiet(displacements)
        return forces + level * rng.choice([-1.0, 1.0], forces.shape), nodes

    body.move = move
    forth, back, tail = response._record(body, 1e-6 * body.radius)
    assert len(forth) == len(back)
    assert 20 <= len(forth) <= 80
    assert 0.0 < tail.max() < 32 * 5e-3
    np.testing.assert_allclose(0.5 * (forth[0] + back[0]), body.direct, atol=0.02)


@pytest.mark.parametrize("share", [0.0, 2e-6, 1e-5])
def test_a_constant_that_a_displacement_leaves_is_no_part_of_a_response_or_is_refused(share: float) -> None:
    """Summed over the record it would be a stiffness; a lasting displacement has no such sum."""
    body: Any = Body(a=0.98, c=-5.0, rounds=True)
    real = body.move

    def move(displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        forces, nodes = real(displacements)
        if displacements[0].any() and not displacements[1:].any():
            forces[1:] += share * np.linalg.norm(body.force) * np.sign(displacements[0] @ FRAME) @ FRAME.T
        return forces, nodes

    body.move = move
    if share > 5e-6:
        with pytest.raises(StabilityError, match="shorter retardation_time"):
            body_response(body)
        return
    found = body_response(body)
    truth = body.direct + body.late / 0.02
    assert (np.abs(found.static - truth) <= found.error + 1e-6).all()
    np.testing.assert_allclose(found.static, truth, atol=0.1 * truth.max())


@pytest.mark.parametrize("friction", [False, True])
def test_a_response_that_stays_is_refused(friction: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(response, "_LONGEST", 512)
    body: Any = Body(a=1.0, friction=friction)
    with pytest.raises(
        StabilityError, match=r"after 512 ticks: give the body more damping \(rayleigh_beta\), or a shorter"
    ):
        body_response(body)
    slow: Any = Body(a=0.996)
    assert len(response._record(slow, 1e-9)[0]) == 512  # it decays still


@pytest.mark.parametrize("errors", [
    [9.0, 5.0, 1.3, 1.19, 1.0], [9.0, 1.15, 1.1, 1.05, 1.0], [9.0, 5.0, 3.0, 2.0, 1.0], [1.1, 1.0, 2.0, 3.0, 4.0],
])  # fmt: skip
def test_the_order_is_the_least_within_a_fifth_of_the_least_error(
    errors: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    markov = rng.normal(size=(64, 1, 1))
    left = iter(errors)
    monkeypatch.setattr(realization, "_error", lambda *_: np.full((1, 1), next(left)))
    monkeypatch.setattr(realization, "_ORDERS", (1, 2, 3, 4, 5))
    system, error = realize(markov, T)
    first = next(k for k, one in enumerate(errors) if one <= 1.2 * min(errors))
    assert (system.nstates, error[0, 0]) == (first + 1, errors[first])
    accurate = iter([9.0, 0.9e-5 * float(np.abs(markov).sum()), 1e-9, 1e-9, 1e-9])
    monkeypatch.setattr(realization, "_error", lambda *_: np.full((1, 1), next(accurate)))
    assert realize(markov, T)[0].nstates == 2


def test_offsets_are_dense_and_then_geometric() -> None:
    np.testing.assert_array_equal(_offsets(10), np.arange(11))
    np.testing.assert_array_equal(_offsets(24), np.arange(24))
    far = _offsets(2000)
    np.testing.assert_array_equal(far[:24], np.arange(24))
    assert far[-1] == 2000
    ratio = far[30:] / far[29:-1]
    assert ratio.max() < 1.2 * (2000 / 24) ** (1 / 39)


class Updated(Body):
    """A hyperelastic body: f[k] = K x[k] + sum of g[k - m u] x[m u], with updates at ticks that m divides."""

    def __init__(self, every: int, tail: float, square: float = 0.0) -> None:
        super().__init__(square=square, every=every)
        self.ticks, self.sampled = 0, []  # type: ignore[var-annotated]
        self.tail = tail

    def g(self, age: int) -> np.ndarray:
        shape = np.array([[80.0, 5.0, 0.0], [0.0, -30.0, 0.0], [2.0, 0.0, 10.0]])
        return shape * (0.0 if age == 0 else (1.0 + 0.1 * (age % self.every)) * self.tail ** (age // self.every))

    def move(self, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        forces = []
        for x in displacements @ FRAME:
            if self.ticks % self.every == 0:
                self.sampled.append((self.ticks, x))
            late = sum((self.g(self.ticks - at) @ one for at, one in self.sampled[-60:]), np.zeros(3))
            forces.append(self.offset + FRAME @ (self.direct @ x + late + self.square * x**2))
            self.ticks += 1
        return np.array(forces), np.full(len(forces), 7)


@pytest.mark.parametrize(("every", "tail"), [(4, 0.05), (3, 0.2)])
@pytest.mark.parametrize("ticks", [0, 1])
def test_the_corrections_of_a_slow_update_follow_the_tip_that_it_sampled(every: int, tail: float, ticks: int) -> None:
    body: Any = Updated(every, tail)
    body.move(np.zeros((ticks, 3)))
    found = multirate_response(body)
    np.testing.assert_allclose(found.local, body.direct, rtol=1e-6, atol=1e-3)
    assert found.every == every
    assert len(found.correction) % every == 0
    expected = np.array([body.g(age) for age in range(len(found.correction))])
    np.testing.assert_allclose(found.correction, expected, atol=1e-3)
    omitted = np.abs(body.g(len(expected))).max()
    assert omitted < 5e-5 * 900.0
    np.testing.assert_allclose(found.static, body.direct + expected.sum(axis=0) / every, atol=1e-2)
    assert (found.nodes, found.one_tick.tolist()) == (7, found.local.tolist())
    assert found.asymmetry < 1e-6
    assert found.error.max() < 0.05


def test_the_error_of_a_slow_update_counts_what_differs_forth_and_back() -> None:
    """q x^2 at the smallest of the steps, in the tick of the displacement."""
    body: Any = Updated(4, 0.01, square=1e6)
    found = multirate_response(body)
    step = 1e-4 * body.radius
    np.testing.assert_allclose(np.diag(found.error), 1e6 * step, rtol=1e-2)
    assert found.asymmetry == pytest.approx(1e6 * step / np.linalg.norm(body.direct, ord=2), rel=1e-3)


def test_updates_that_do_not_converge_are_refused() -> None:
    growing: Any = Updated(3, 1.1)
    with pytest.raises(StabilityError, match="has not settled 48 updates after a displacement"):
        multirate_response(growing)


def test_a_path_is_thinned_unless_its_parts_are_then_far_apart() -> None:
    """To about a hundred positions and the last one, no farther apart than half a radius."""
    path = np.linspace(0.0, 1.0, 1001)[:, None] * np.array([3e-3, 0.0, 4e-3])
    thin = _thin(path, 8e-3)
    np.testing.assert_array_equal(thin, np.vstack([path[::10], path[-1:]]))
    assert _thin(path, 1.01e-4) is not path
    assert len(_thin(path, 1.01e-4)) == len(thin)
    assert _thin(path, 0.99e-4) is path
    short = path[:5]
    np.testing.assert_array_equal(_thin(short, 1.0), np.vstack([short, short[-1:]]))
