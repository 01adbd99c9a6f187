"""Linear laws of loops, contacts and bodies: against closed forms, and every number as recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import palpate
import pytest
from palpate.contact import Mesh, Surface
from palpate.errors import PalpateError, StabilityError
from palpate.scenario import Scenario
from palpate.simulation.admittance import display_matrix
from palpate.simulation.body_response import body_response, multirate_response
from palpate.simulation.body_response.held_tip import _thin
from palpate.simulation.body_response.realization import _hankel, _offsets, realize
from palpate.simulation.body_response.response import _is_noise, _is_static, _record
from palpate.simulation.contact_law import ContactLaw, closed_matrix
from palpate.simulation.linear_contact import contact_radius
from palpate.simulation.linear_evidence import linear_radii_of
from palpate.simulation.linear_loop import OwnDamping, scenario_loop
from palpate.simulation.meshes import box_mesh
from palpate.simulation.proxy_law import ProxyProbe
from palpate.simulation.trace import Trace
from stored import assert_same, plain

PERIOD = 1e-3
POSE = ["0.1 rad", "2.2305 rad", "3.2776 rad"]
DEVICE = "phantom-premium-1.5a"
HAND: dict[str, Any] = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"}
HAND["rest"] = ["1 mm", "2 mm", "3 mm"]
TISSUE = {**HAND, "tissue_stiffness": "900 N/m", "tissue_damping": "2 N*s/m"}
SPRING = {"kind": "spring", "stiffness": ["900 N/m", "0 N/m", "600 N/m"], "damping": ["1 N*s/m", "0 N*s/m", "2 N*s/m"]}
WALL = {"kind": "wall", "stiffness": "800 N/m", "normal": [0.0, 0.6, 0.8], "damping": "3 N*s/m"}
PUSH = {"kind": "force", "shape": "step", "force": ["0 N", "0.3 N", "-1 N"]}


def tables(topology: str = "impedance_display", **other: Any) -> dict[str, Any]:
    return {
        "device": {"name": DEVICE},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms", "topology": topology},
        "object": WALL,
        "run": {"duration": "0.3 s"},
        **other,
    }


LOOPS: dict[str, dict[str, Any]] = {
    "hand on a wall": tables(operator=HAND),
    "hand through tissue": tables(operator=TISSUE, object={**SPRING, "coupling": "bilinear"}),
    "late hand": tables(operator=HAND, object=SPRING, device={"name": DEVICE, "delay": 2}),
    "frozen kinematics": tables(
        operator=PUSH, object=SPRING, device={"name": DEVICE, "kinematics": "linear", "delay": 1}
    ),
    "linear device": tables(operator=PUSH, object=WALL, device={"name": DEVICE, "model": "linear"}),
    "no compensation": tables(
        operator=HAND, servo={"period": "1 ms", "topology": "impedance_display", "gravity_compensation": False}
    ),
    "tracking": tables(
        "force_tracking", object=SPRING, reference={"shape": "step", "force": "1 N"}, controller={"kind": "lqg"}
    ),
    "slider": {
        "device": {"name": "slider"}, "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "80 N/m", "damping": "1 N*s/m"},
    },
}  # fmt: skip


def signature(matrix: Any) -> list[float]:
    """Return sums that do not depend on the choice of states: traces of the powers of a matrix."""
    a, found = np.asarray(matrix, dtype=float), []
    power = np.eye(len(a))
    for _ in range(4):
        power = power @ a
        found.append(float(np.trace(power)))
    return found


def loop_numbers(name: str) -> dict[str, Any]:
    """Return the numbers of the loop of a scenario at its start, and about another pose under forces."""
    scenario = Scenario.from_dict(LOOPS[name])
    found: dict[str, Any] = {}
    moved = {"pose": [0.15, 2.1, 3.3], "tip_force": [0.2, -0.1, 0.4], "operator_force": [0.1, 0.2, -0.3]}
    for place, given in (("start", {}), ("moved", moved if name != "slider" else {"pose": [0.01]})):
        loop = scenario_loop(scenario, **given)  # type: ignore[arg-type]
        gain = loop.gain()
        r = loop.directions.shape[1]
        other = 300.0 * np.eye(r) + 20.0
        found[place] = {
            "directions": loop.directions,
            "stiffness": loop.stiffness,
            "damping": loop.damping,
            "felt": [loop.device_damping, *(loop.own.felt(t) for t in (0.0, 5e-4, 0.02, 10.0))],
            "longest": [loop.own.longest_interval(k) for k in (0.0, 300.0, 5000.0)],
            "rests": loop.rests,
            "normalized": loop.normalized,
            "radius": loop.spectral_radius(),
            "radii": [loop.spectral_radius(k, b) for k in (500.0, other) for b in (None, 0.0, 7.0)],
            "responses": [np.real(gain(z)) for z in (1.7, -1.9)],
            "path": [np.real(loop.path(z)) for z in (1.7, -1.9)],
            "matrix": [signature(loop.matrix(scale)) for scale in (1.0, 0.4)],
            "states": gain.nstates,
        }
    return found


def law_numbers() -> dict[str, Any]:
    """Return the laws of a proxy on a box: on its top, at an edge, with and without friction."""
    mesh = Mesh(*box_mesh(0.08, 2))
    found = {}
    for name, given in (
        ("slides", {}), ("sticks", {"static_friction": 0.5, "tangential": 0.7}),
        ("rubs", {"viscous": 2.0, "static_friction": 0.3, "dynamic_friction": 0.2, "tangential": 1.0}),
    ):  # fmt: skip
        core = Surface(stiffness=np.array([800.0]), period=PERIOD, **given).core_for(mesh)  # type: ignore[arg-type]
        for radius in (0.0, 0.004):
            probe = ProxyProbe(mesh, core, radius)
            top = int(np.argmax(probe.normals[:, 2]))
            place = np.array([0.003, 0.005, radius])
            for label, tip in (("deep", place - [0.0, 0.0, 1e-3]), ("aside", place - [2e-4, 1e-4, 1e-3])):
                law = probe.law(top, np.array([0.0, 0.0, 1.0]), place, tip)
                key = f"{name} {radius} {label}"
                found[key] = None if law is None else [law.A, law.C @ law.B, law.D]
    return found


class TwoRates:
    """A tip whose local force is K x, and to whose position of every m-th tick a correction g answers."""

    frame, radius, nodes = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.0, 1.0, 3.0], [2.0, -1.0, 1.0]]))[0], 0.01, 5

    def __init__(self, decay: float, every: int = 4, odd: float = 0.0) -> None:
        self.every, self.decay, self.odd, self.ticks = every, decay, odd, 3
        self.local = np.array([[900.0, 20.0, 0.0], [10.0, 500.0, -30.0], [5.0, 0.0, 400.0]])
        self.pending = np.zeros((0, 3))

    def correction(self, ticks: int) -> np.ndarray:
        """Return g (ticks, 3, 3), in the axes of the contact."""
        k = np.arange(ticks)
        size = np.where(k >= self.every, self.decay ** (k // self.every), 0.0) * (1.0 + k % self.every / self.every)
        return -0.3 * size[:, None, None] * self.local.T

    def move(self, path: np.ndarray) -> tuple[np.ndarray, None]:
        x = path @ self.frame
        forces = (x + self.odd * np.abs(x)) @ self.local.T
        n = len(path)
        after = np.vstack([self.pending, np.zeros((n, 3))])[: max(n, len(self.pending))]
        for tick in range(n):
            if (self.ticks + tick) % self.every == 0 and x[tick].any():
                answer = self.correction(400) @ x[tick]
                wanted = tick + len(answer)
                after = np.vstack([after, np.zeros((max(wanted - len(after), 0), 3))])
                after[tick:wanted] += answer
        forces = forces + after[:n]
        self.pending, self.ticks = after[n:], self.ticks + n
        if not path.any():
            self.pending = np.zeros((0, 3))  # a record begins at rest
            forces = np.zeros_like(forces)
        return forces @ self.frame.T, None


@pytest.mark.parametrize(("every", "decay"), [(4, 0.01), (5, 0.1), (3, 0.4), (6, 0.0)])
def test_a_response_at_two_rates_is_its_local_stiffness_and_its_correction(every: int, decay: float) -> None:
    held = TwoRates(decay, every)
    found = multirate_response(held)  # type: ignore[arg-type]
    n = len(found.correction)
    assert (found.every, found.nodes, n % every) == (every, 5, 0)
    np.testing.assert_allclose(found.local, held.local, atol=1e-6)
    np.testing.assert_allclose(found.one_tick, held.local, atol=1e-6)
    np.testing.assert_allclose(found.correction, held.correction(n), atol=1e-6)
    np.testing.assert_allclose(found.static, held.local + held.correction(400).sum(axis=0) / every, atol=1e-6)
    assert found.asymmetry < 1e-12
    size = np.linalg.norm(held.local, ord=2)
    sizes = np.linalg.norm(held.correction(100 * every), ord=2, axis=(1, 2)).reshape(-1, every).max(axis=1)
    kept = [number for number, level in enumerate(sizes) if level > 1e-5 * size or number == 0]
    assert n == every * (1 + max(kept))


def test_the_error_at_two_rates_is_the_odd_part_and_what_is_left_of_the_correction() -> None:
    """f = K (x + a |x|): the half difference of the answers is a K.

    The correction of the last update is added, and what a lasting displacement answers beyond the record.
    """
    held = TwoRates(0.1, 4, odd=0.2)
    held.local = np.diag([900.0, 500.0, 400.0])
    found = multirate_response(held)  # type: ignore[arg-type]
    last = np.abs(held.correction(24)[-4:]).max(axis=0)
    rest = np.abs(held.correction(400)[len(found.correction) :].sum(axis=0)) / 4
    np.testing.assert_allclose(found.error, 0.2 * np.abs(held.local) + last + rest, atol=1e-6)
    assert found.asymmetry == pytest.approx(0.2)


@pytest.mark.parametrize("decay", [0.999, 1.01])
def test_a_correction_that_does_not_decay_is_refused(decay: float) -> None:
    with pytest.raises(StabilityError, match="has not settled"):
        multirate_response(TwoRates(decay))  # type: ignore[arg-type]


class Coupled:
    """A tip whose force is a linear system of its displacement about which opposite answers differ by a share."""

    radius, period, friction, rounds, nodes, core, ticks = 0.01, PERIOD, False, True, 4, None, 0
    relaxation = 0.0

    def __init__(self, seed: int, size: int = 3, memoryless: bool = False, odd: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.frame = np.linalg.qr(rng.standard_normal((size, size)))[0]
        self.memoryless, self.odd = memoryless, odd
        self.a = 0.8 * np.linalg.qr(rng.standard_normal((4, 4)))[0]
        self.b, self.c = rng.standard_normal((4, size)), rng.standard_normal((size, 4))
        self.d = rng.standard_normal((size, size)) + 5.0 * np.eye(size)
        if memoryless:
            self.c = 0.0 * self.c
        self.bias = rng.standard_normal(size)

    @property
    def force(self) -> np.ndarray:
        return self.bias

    def move(self, path: np.ndarray) -> tuple[np.ndarray, None]:
        state, forces = np.zeros(4), np.empty_like(path)
        for tick, x in enumerate(path @ self.frame):
            forces[tick] = self.frame @ (self.c @ state + self.d @ (x + self.odd * np.abs(x))) + self.bias
            state = self.a @ state + self.b @ x
        return forces, None


@pytest.mark.parametrize(("seed", "size"), [(1, 3), (2, 9)])
def test_the_response_of_a_linear_body_is_its_system_in_the_axes_of_the_contact(seed: int, size: int) -> None:
    tip = Coupled(seed, size)
    found = body_response(tip)  # type: ignore[arg-type]
    exact = control.StateSpace(tip.a, tip.b, tip.c, tip.d, PERIOD)
    for z in (1.0, -1.0, 1.3, -1.1):
        np.testing.assert_allclose(np.real(found.system(z)), np.real(exact(z)), atol=1e-6)
    np.testing.assert_allclose(found.static, np.real(exact(1.0)), atol=1e-6)
    np.testing.assert_allclose(found.one_tick, tip.d, atol=1e-9)
    np.testing.assert_array_equal(found.frame, tip.frame)
    assert (found.nodes, len(found.markov), found.system.dt, found.system.nstates) == (4, 256, PERIOD, 4)
    assert found.asymmetry < 1e-6
    assert found.error.max() < 1e-4
    if size == 9:
        part = found.of_tip(1, 2)
        np.testing.assert_allclose(part.static, found.static[3:6, 3:6], atol=1e-9)
        np.testing.assert_array_equal(part.frame, tip.frame[3:6, 3:6])
        np.testing.assert_array_equal(part.markov, found.markov[:, 3:6, 3:6])
        np.testing.assert_array_equal(part.error, found.error[3:6, 3:6])
        assert (part.nodes, part.asymmetry, part.system.dt) == (2, found.asymmetry, PERIOD)


def test_a_body_without_memory_answers_within_the_tick_and_its_asymmetry_is_its_error() -> None:
    tip = Coupled(3, memoryless=True, odd=0.125)
    tip.d = np.diag([2.0, 3.0, 5.0])
    found = body_response(tip)  # type: ignore[arg-type]
    assert found.markov.shape == (1, 3, 3)
    assert found.system.nstates == 0
    np.testing.assert_allclose(found.one_tick, tip.d, atol=1e-8)
    np.testing.assert_allclose(found.error, 0.125 * tip.d, atol=1e-8)
    assert found.asymmetry == pytest.approx(0.125)


def test_a_response_is_static_if_nothing_is_left_after_the_first_tick() -> None:
    forth = np.zeros((5, 3, 3))
    forth[0, 1, 2], back = -3.0, np.zeros((5, 3, 3))
    back[0] = 7.0  # only the answers forth count as the measure
    for left, expected in ((2.9e-9, True), (3e-9, True), (3.1e-9, False)):
        for part in (forth, back):
            part[1, 0, 0] = -left
            assert _is_static(forth, back) is expected
            part[1, 0, 0] = 0.0


def test_noise_has_random_signs_or_stays_constant_where_the_model_rounds() -> None:
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], 64)[:, None, None] * np.eye(3)
    ones = np.ones(64)[:, None, None] * np.eye(3)
    assert _is_noise(signs, 64.0, False)
    assert _is_noise(signs, 128.0, False)
    assert not _is_noise(signs, 129.0, False)
    assert not _is_noise(ones, 64.0, False)
    assert _is_noise(ones, 64.0, True)
    assert _is_noise(ones, 64.0 / 0.98, True)
    assert not _is_noise(ones, 64.0 / 0.979, True)
    mixed = ones.copy()
    for negative, expected in ((22, False), (23, True)):  # the mean is 20/64, or 18/64
        mixed[:] = np.eye(3)
        mixed[:negative] *= -1.0
        assert _is_noise(mixed, 64.0, False) is expected


def test_a_level_of_noise_ends_the_record_where_it_begins() -> None:
    """The response decays below twice the level within some ticks; 32 more are kept, and the rest is an error."""

    class Noisy(Coupled):
        def __init__(self, level: float, decay: float) -> None:
            super().__init__(0)
            self.frame, self.bias, self.level, self.decay = np.eye(3), np.zeros(3), level, decay

        def move(self, path: np.ndarray) -> tuple[np.ndarray, None]:
            k = np.arange(len(path))[:, None]
            answer = self.decay**k + self.level * np.where(np.arange(len(path)) % 2, 1.0, -1.0)[:, None]
            answer[-1] = 0.0
            return path[0] * answer, None

    forth, back, tail = _record(Noisy(1e-3, 0.9), 1e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(forth, back)
    size = 0.9 ** np.arange(256.0) + 1e-3 * np.where(np.arange(256) % 2, 1.0, -1.0)
    size[-1] = 0.0
    mean = np.convolve(np.abs(size), np.ones(16) / 16, "valid")
    assert len(forth) == np.flatnonzero(mean > 2.0 * np.median(np.abs(size[-64:]))).max() + 32
    np.testing.assert_allclose(tail, 32.0 * np.median(np.abs(size[-64:])) * np.eye(3), rtol=1e-9)
    forth, _, tail = _record(Noisy(0.0, 0.9), 1e-6)  # type: ignore[arg-type]
    assert len(forth) == 256
    assert not tail.any()


def test_offsets_are_dense_at_first_and_geometric_after() -> None:
    assert [_offsets(n).tolist() for n in (0, 3, 23)] == [[0], [0, 1, 2, 3], list(range(24))]
    assert _offsets(24).tolist() == list(range(24))
    many = _offsets(500)
    assert many[:24].tolist() == list(range(24))
    assert many[-1] == 500
    assert len(many) <= 64
    expected = np.unique(np.rint(24.0 * (500 / 24) ** (np.arange(40) / 39)).astype(int))
    assert many[24:].tolist() == expected.tolist()
    markov = np.arange(60.0).reshape(15, 2, 2)
    found = _hankel(markov, np.array([0, 2, 5]), 1)
    for i, row in enumerate((0, 2, 5)):
        for j, column in enumerate((0, 2, 5)):
            block = found[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
            np.testing.assert_array_equal(block, markov[row + column + 1])


def test_a_path_is_thinned_to_a_hundred_positions_unless_they_are_far_apart() -> None:
    path = np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 1001)
    thin = _thin(path, 0.03)
    np.testing.assert_array_equal(thin, np.vstack([path[::10], path[-1:]]))
    assert _thin(path, 0.019) is path
    assert len(_thin(path, 0.0200001)) == len(thin)
    np.testing.assert_array_equal(_thin(path[:7], 1.0), np.vstack([path[:7], path[6:7]]))


def realized() -> list[Any]:
    """Return responses, errors and orders of realizations of noisy systems."""
    found = []
    for seed, order, n, outputs, inputs, noise in (
        (0, 3, 60, 2, 3, 0.0), (1, 6, 300, 1, 1, 1e-4), (2, 9, 41, 3, 2, 1e-2), (3, 2, 8, 1, 2, 0.0)
    ):  # fmt: skip
        rng = np.random.default_rng(seed)
        a = rng.uniform(0.5, 0.95) * np.linalg.qr(rng.standard_normal((order, order)))[0]
        b, c = rng.standard_normal((order, inputs)), rng.standard_normal((outputs, order))
        answers = [c @ np.linalg.matrix_power(a, k) @ b for k in range(n - 1)]
        markov = np.array([rng.standard_normal((outputs, inputs)), *answers])
        markov *= 1.0 + noise * rng.standard_normal(markov.shape)
        system, error = realize(markov, PERIOD)
        size = np.abs(markov).max()
        answers = [np.real(system(z)) for z in (1.0, -1.0, 1.5)]
        found.append([system.nstates, *(one / size for one in (*answers, error))])
    return found


def test_a_damper_on_a_contact_law_adds_its_backward_difference() -> None:
    """f = K x + b n n^T (x - x_before)/T, from the state-space form tick by tick."""
    rng = np.random.default_rng(4)
    normal = np.array([0.0, 0.6, 0.8])
    a, b, c, d = (0.3 * rng.standard_normal(shape) for shape in ((2, 2), (2, 3), (3, 2), (3, 3)))
    law = ContactLaw(a, b, c, d)
    assert law.damped(0.0, normal, PERIOD) is law
    with_damper = law.damped(2.0, normal, 0.5)
    scaled, along = law.scaled(3.0), law.scaled(3.0, normal)
    xi, zeta, before = np.zeros(2), np.zeros(3), np.zeros(3)
    for _ in range(4):
        x = rng.standard_normal(3)
        force = c @ xi + d @ x
        np.testing.assert_allclose(
            with_damper.C @ zeta + with_damper.D @ x, force + 4.0 * normal * (normal @ (x - before)), atol=1e-12
        )
        np.testing.assert_allclose(scaled.C @ xi + scaled.D @ x, 3.0 * force)
        np.testing.assert_allclose(along.C @ xi + along.D @ x, force + 2.0 * normal * (normal @ force))
        zeta = with_damper.A @ zeta + with_damper.B @ x
        xi, before = a @ xi + b @ x, x
    still = ContactLaw.stiffness(d)
    assert [m.shape for m in (still.A, still.B, still.C)] == [(0, 0), (0, 3), (3, 0)]
    np.testing.assert_array_equal(still.D, d)


def test_a_closed_matrix_moves_path_and_law_by_each_others_answers() -> None:
    rng = np.random.default_rng(5)
    p, q, s = (rng.standard_normal(shape) for shape in ((4, 4), (4, 2), (2, 4)))
    law = ContactLaw(*(rng.standard_normal(shape) for shape in ((2, 2), (2, 3), (3, 2), (3, 3))))
    directions = np.linalg.qr(rng.standard_normal((3, 3)))[0][:, :2]
    matrix = closed_matrix(SimpleNamespace(A=p, B=q, C=s), law, directions, 0.7)
    state, xi = rng.standard_normal(4), rng.standard_normal(2)
    x = directions @ (s @ state)
    force = 0.7 * directions.T @ (law.C @ xi + law.D @ x)
    expected = np.concatenate([p @ state + q @ force, law.A @ xi + law.B @ x])
    np.testing.assert_allclose(matrix @ np.concatenate([state, xi]), expected, atol=1e-12)


def test_damping_left_at_an_interval_is_what_the_turning_of_the_hold_leaves() -> None:
    """One joint: D - T (delay + 1/2) |S| over the square of the motion; an inactive hold takes none without delay."""
    for stiffness, delay, taken in ((-2.0, 0, 1.0), (2.0, 0, 0.0), (2.0, 1, 3.0), (-2.0, 2, 5.0)):
        own = OwnDamping.of(np.array([0.3]), np.array([[0.5]]), np.array([[stiffness]]), delay)
        assert own.turning[0, 0] == pytest.approx(taken)
        for interval in (0.0, 0.05, 0.1):
            left = 0.3 - interval * taken
            assert own.felt(interval) == pytest.approx(max(left, 0.0) / 0.25 if left > 0.0 else 0.0)
        for required in (4.0, 100.0):
            assert own.longest_interval(required) == pytest.approx(0.3 / (required * 0.25 + taken))
    assert OwnDamping.of(np.array([0.3]), np.zeros((1, 1)), np.zeros((1, 1)), 0).longest_interval(1.0) == np.inf
    assert OwnDamping.of(np.array([0.0]), np.ones((1, 1)), np.zeros((1, 1)), 0).longest_interval(1.0) == 0.0
    assert OwnDamping.of(np.array([0.3]), np.ones((1, 1)), np.array([[-6.0]]), 0).felt(0.1) == 0.0


TOOL = {"mass": "0.2 kg", "damping": "5 N*s/m"}
DISPLAYS: dict[str, dict[str, Any]] = {
    name: tables(
        "admittance_display", object=touched, operator=operator,
        servo={"period": "1 ms", "topology": "admittance_display", "tool": tool},
        controller={"kind": "workspace"}, device={"name": DEVICE, "delay": delay},
    )
    for name, touched, operator, tool, delay in (
        ("hand on a wall", WALL, HAND, TOOL, 0), ("push on a wall", {**WALL, "damping": "0 N*s/m"}, PUSH, TOOL, 1),
        ("push on a spring", {"kind": "spring", "stiffness": "500 N/m", "damping": "1 N*s/m"}, PUSH, TOOL, 0),
        ("free tool", WALL, PUSH, {"mass": "0.2 kg", "damping": "0 N*s/m"}, 0),
    )
}  # fmt: skip


def display_numbers() -> dict[str, Any]:
    """Return the eigenvalues of the loops of admittance displays, or why there are none."""
    found: dict[str, Any] = {}
    for name, given in DISPLAYS.items():
        scenario = Scenario.from_dict(given)
        for place, pose in (("start", {}), ("moved", {"pose": [0.15, 2.1, 3.3], "operator_force": [0.1, 0.2, -0.3]})):
            try:
                a = display_matrix(scenario, **pose)  # type: ignore[arg-type]
                values = np.abs(np.linalg.eigvals(a))
                found[f"{name} {place}"] = [len(a), float(values.max()), *signature(a)]
            except PalpateError as problem:
                found[f"{name} {place}"] = str(problem)
    return found


def rests() -> dict[str, Any]:
    """Return the linear loops of short runs where they rest, at their start, and on a mesh."""
    found: dict[str, Any] = {}
    press = {"rest": ["0 mm", "0 mm", "0 mm"], "shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.6 N"]}
    pressing, servo = {**HAND, **press}, {"period": "1 ms", "topology": "impedance_display"}
    cube = {
        "kind": "mesh", "position": ["0.5 mm", "0.3 mm", "-0.2 mm"],
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 2},
        "surface": {"stiffness": "800 N/m", "static_friction": 0.3, "damping": "0.5 N*s/m"},
    }  # fmt: skip
    smooth = {**cube, "surface": {"stiffness": "800 N/m"}}
    flat = {"kind": "wall", "stiffness": "800 N/m", "normal": [0.0, 0.0, 1.0]}
    cases = {
        "wall": tables(operator=pressing, object=flat),
        "mesh": tables(operator=pressing, object=cube),
        "smooth mesh": tables(operator=pressing, object=smooth),
        "guarded": tables(
            operator=pressing, object={**flat, "stiffness": "9000 N/m"}, guard={"kind": "passivity_controller"}
        ),
        "late": tables(operator=pressing, object=flat, servo={**servo, "jitter": "0.2 ms"}),
    }
    for name, given in cases.items():
        trace = palpate.simulate({**given, "run": {"duration": "0.8 s"}})
        scenario = Scenario.from_dict(trace.metadata["scenario"])
        radii, reason = linear_radii_of(trace, scenario)
        found[name] = [None if radii is None else [radii.start, radii.rest, str(radii)], reason]
        if "mesh" in name:
            found[f"{name} contact"] = list(contact_radius(trace, scenario))
    return found


def guarded() -> dict[str, Any]:
    """Return what the linear loop says of runs with a guard, of walls and dampers that no guard or one stabilizes."""
    found: dict[str, Any] = {}
    flat = {"kind": "wall", "normal": [0.0, 0.0, 1.0]}
    touched = {
        "stiff": {**flat, "stiffness": "60000 N/m"},
        "damper": {**flat, "stiffness": "800 N/m", "damping": "900 N*s/m"},
        "bilinear damper": {**flat, "stiffness": "800 N/m", "damping": "700 N*s/m", "coupling": "bilinear"},
        "spring": {"kind": "spring", "stiffness": "800 N/m", "damping": "900 N*s/m"},
        "along": {**flat, "normal": [1.0, 0.0, 0.0], "stiffness": "800 N/m"},
    }
    bending = {"name": DEVICE}
    for name, one in touched.items():
        for kind in ("passivity_controller", "energy_bound"):
            given = tables(operator=PUSH, object=one, guard={"kind": kind}, device=bending)
            scenario = Scenario.from_dict(given)
            for touching in (1.0, 0.0):
                run = Trace.of([0.0, 1.0], {"touching": [0.0, touching]}, metadata={"scenario": given})
                radii, reason = linear_radii_of(run, scenario)
                found[f"{name} {kind} {touching}"] = [None if radii is None else [radii.start, radii.rest], reason]
    return found


def formulas() -> dict[str, Any]:
    """Return the linear loops of runs on force laws, in fields and of a display, where they have one."""
    press = {"rest": ["0 mm", "0 mm", "0 mm"], "shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.6 N"]}
    hand = {**HAND, **press}
    law = {
        "kind": "force_law",
        "normal": [0.0, 0.0, 1.0],
        "law": {"formula": "500 * x + 1e5 * x^2", "deepest": "10 mm"},
    }

    def field(kind: str, **keys: Any) -> dict[str, Any]:
        return {"kind": "field", "field": {"kind": kind, **keys}}

    display, well = DISPLAYS["hand on a wall"], {"stiffness": "300 N/m", "radius": "20 mm"}
    cases = {
        "law": tables(operator=hand, object=law),
        "law off": tables(operator=hand, object={**law, "position": ["0 mm", "0 mm", "-50 mm"]}),
        "well": tables(operator=hand, object=field("gravity_well", **well, largest_force="4 N")),
        "left well": tables(operator=hand, object=field("gravity_well", **well, largest_force="0.1 N")),
        "viscous": tables(operator=hand, object=field("viscous", damping="3 N*s/m")),
        "constant": tables(operator=hand, object=field("constant", force=["0.1 N", "0 N", "0.2 N"])),
        "display": {**display, "operator": hand, "object": {**WALL, "normal": [0.0, 0.0, 1.0]}},
        "bilinear display": {**display, "object": {**WALL, "coupling": "bilinear"}},
        "none": tables(operator=hand, object={"kind": "none"}),
        "wall off": tables(operator=hand, object={**WALL, "position": ["0 mm", "0 mm", "-50 mm"]}),
    }
    found: dict[str, Any] = {}
    for name, given in cases.items():
        trace = palpate.simulate({**given, "run": {"duration": "1.2 s"}})
        radii, reason = linear_radii_of(trace, Scenario.from_dict(trace.metadata["scenario"]))
        found[name] = [None if radii is None else [radii.start, radii.rest], reason]
    return found


MEASURES: dict[str, Any] = {
    **{f"loop of {name}": lambda name=name: loop_numbers(name) for name in LOOPS},
    "laws of a proxy": law_numbers,
    "realizations": realized,
    "displays": display_numbers,
    "loops of runs": rests,
    "loops with a guard": guarded,
    "loops by a formula": formulas,
}
nan, inf = np.nan, np.inf
# fmt: off
STORED: dict[str, Any] = {
    "loop of hand on a wall": {"start": {"directions": [[0.0], [0.6], [0.8]], "stiffness": [[800.0]], "damping":
    [[3.0]], "felt": [0.02070549, 0.0207848661, 0.0207451815, 0.0191920393, 0.0], "longest": [0.250201826,
    6.92645635e-05, 4.15690724e-06], "rests": True, "normalized": False, "radius": 0.991997839, "radii": [0.992056902,
    0.992075068, 0.992019875, 0.992115094, 0.992157795, 0.992034084], "responses": [0.0282480426, -0.00154165772],
    "path": [-1.38790961e-05, 2.86609556e-07], "matrix": [[5.91869478, 5.80838756, 5.69411293, 5.56877057],
    [5.92469129, 5.83439851, 5.73919042, 5.63629614]], "states": 7}, "moved": {"directions": [[0.0], [0.6], [0.8]],
    "stiffness": [[800.0]], "damping": [[3.0]], "felt": [0.0212151813, 0.0212151813, 0.0212151813, 0.0212151813,
    0.0212151813], "longest": [inf, 7.07172709e-05, 4.24303625e-06], "rests": False, "normalized": False, "radius":
    0.99360705, "radii": [0.993670175, 0.993692564, 0.99363147, 0.993729284, 0.993774916, 0.99365226], "responses":
    [0.0273253251, -0.00149151082], "path": [-1.34257378e-05, 2.77286748e-07], "matrix": [[5.92143512, 5.81525115,
    5.70564524, 5.58572604], [5.92723628, 5.84041629, 5.74926728, 5.65109419]], "states": 7}},
    "loop of hand through tissue": {"start": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0,
    0.0], [0.0, 600.0]], "damping": [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0314320844, 0.0315471416, 0.0314896229,
    0.0292308459, 0.0], "longest": [0.250201826, 0.000105116836, 6.30928319e-06], "rests": True, "normalized": False,
    "radius": 1.00098947, "radii": [1.00098946, 0.993624463, 1.00382419, 1.00098944, 0.993622725, 1.00382408],
    "responses": [[[0.0380997875, 0.00695606178], [0.00802762221, 0.123171953]], [[-0.00435849664, -0.000980602202],
    [-0.00180098498, -0.0257739394]]], "path": [[[-2.68588581e-05, -4.90375112e-06], [-4.90375112e-06,
    -7.52407856e-05]], [[5.93441298e-07, 1.33516185e-07], [1.33516185e-07, 1.91075333e-06]]], "matrix": [[9.57805668,
    13.0169465, 8.336608, 11.5907197], [9.6335886, 13.1445783, 8.55112899, 11.8853741]], "states": 14}, "moved":
    {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0], [0.0, 600.0]], "damping": [[1.0,
    0.0], [0.0, 2.0]], "felt": [0.0268371799, 0.0268371799, 0.0268371799, 0.0268371799, 0.0268371799], "longest": [inf,
    8.94572662e-05, 5.36743597e-06], "rests": False, "normalized": False, "radius": 1.00102043, "radii": [1.00102042,
    0.995061249, 1.00397754, 1.0010204, 0.995051898, 1.00397742], "responses": [[[0.0343335672, 0.0113697705],
    [0.0131212495, 0.124504862]], [[-0.00394338822, -0.00159166605], [-0.00292327168, -0.0261424135]]], "path":
    [[[-2.42038202e-05, -8.01524291e-06], [-8.01524291e-06, -7.60550063e-05]], [[5.36921241e-07, 2.16717011e-07],
    [2.16717011e-07, 1.93807019e-06]]], "matrix": [[9.58332787, 13.0341278, 8.37189511, 11.6503238], [9.63858343,
    13.1600109, 8.58207821, 11.9367061]], "states": 14}},
    "loop of late hand": {"start": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0],
    [0.0, 600.0]], "damping": [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0309710631, 0.0315471416, 0.0312593501,
    0.0196326089, 0.0], "longest": [0.0500403653, 0.000104955906, 6.30870271e-06], "rests": True, "normalized": False,
    "radius": 0.992662477, "radii": [0.992662233, 0.99267228, 0.992636106, 0.992656633, 0.992676409, 0.992610432],
    "responses": [[[0.00487460324, 0.00015142377], [0.000164325347, 0.00691251083]], [[-0.000149461016,
    -4.66476443e-06], [-7.02244363e-06, -0.000294285321]]], "path": [[[-3.71606525e-06, -1.15435161e-07],
    [-1.15435161e-07, -4.85589604e-06]], [[6.15999848e-08, 1.92257102e-09], [1.92257102e-09, 8.05680275e-08]]],
    "matrix": [[5.92869098, 5.85179103, 5.73711459, 5.58354819], [5.92869098, 5.85179103, 5.75656132, 5.64269283]],
    "states": 14}, "moved": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0], [0.0,
    600.0]], "damping": [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0231803434, 0.0268371799, 0.0250186458, 0.0, 0.0],
    "longest": [0.00685479507, 8.83903844e-05, 5.36355509e-06], "rests": False, "normalized": False, "radius":
    0.994194647, "radii": [0.994191737, 0.994201661, 0.994166396, 0.994179492, 0.99419758, 0.994136185], "responses":
    [[[0.00462537238, 0.000262369372], [0.000284723713, 0.00686114754]], [[-0.000142105038, -8.03605396e-06],
    [-1.20976604e-05, -0.000292143802]]], "path": [[[-3.52606863e-06, -2.00012526e-07], [-2.00012526e-07,
    -4.81981439e-06]], [[5.85682368e-08, 3.31203959e-09], [3.31203959e-09, 7.99817325e-08]]], "matrix": [[5.93108376,
    5.85711165, 5.74667813, 5.59886952], [5.93108376, 5.85711165, 5.76568589, 5.65660487]], "states": 14}},
    "loop of frozen kinematics": {"start": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0,
    0.0], [0.0, 600.0]], "damping": [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0312017324, 0.0315471416, 0.0313745261,
    0.0245000898, 0.0], "longest": [0.0834006088, 0.000105036315, 6.30899294e-06], "rests": True, "normalized": False,
    "radius": 0.997844364, "radii": [0.997845748, 1.00897186, 0.997845952, 0.997850383, 1.00442311, 0.997850813],
    "responses": [[[0.0222431786, 0.00507178565], [0.00550391089, 0.078441627]], [[0.00075037683, 0.000163553084],
    [0.000246216573, 0.00355888351]]], "path": [[[-1.69566832e-05, -3.86638368e-06], [-3.86638368e-06,
    -5.51036223e-05]], [[-3.09265939e-07, -6.74079955e-08], [-6.74079955e-08, -9.74334102e-07]]], "matrix":
    [[5.9660332, 5.82248817, 5.52603524, 5.25705753], [5.9660332, 5.88849241, 5.75003194, 5.62178483]], "states": 11},
    "moved": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0], [0.0, 600.0]], "damping":
    [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0312017324, 0.0315471416, 0.0313745261, 0.0245000898, 0.0], "longest":
    [0.0834006088, 0.000105036315, 6.30899294e-06], "rests": True, "normalized": False, "radius": 0.997795872, "radii":
    [0.997798002, 1.00879845, 0.997798323, 0.997805198, 1.00429994, 0.997805714], "responses": [[[0.0250496298,
    0.00469853357], [0.00509885706, 0.0775212669]], [[0.00085071062, 0.000150632187], [0.000226765158,
    0.00351795646]]], "path": [[[-1.90961303e-05, -3.58184173e-06], [-3.58184173e-06, -5.44570883e-05]],
    [[-3.5061826e-07, -6.20826801e-08], [-6.20826801e-08, -9.63129289e-07]]], "matrix": [[5.96281783, 5.81434068,
    5.50993007, 5.23194204], [5.96281783, 5.88134369, 5.73770682, 5.60383756]], "states": 11}},
    "loop of linear device": {"start": {"directions": [[0.0], [0.6], [0.8]], "stiffness": [[800.0]], "damping":
    [[3.0]], "felt": [0.02070549, 0.0207848661, 0.0207451815, 0.0191920393, 0.0], "longest": [0.250201826,
    6.92645635e-05, 4.15690724e-06], "rests": True, "normalized": False, "radius": 0.999812981, "radii": [0.999812981,
    1.00159408, 0.999812981, 0.999812981, 1.00008002, 0.999812981], "responses": [0.187212206, -0.00972309898], "path":
    [-9.1982876e-05, 1.80762114e-06], "matrix": [[5.90208038, 5.65473578, 5.42485856, 5.17430675], [5.94044927,
    5.82039888, 5.70314454, 5.5706602]], "states": 7}, "moved": {"directions": [[0.0], [0.6], [0.8]], "stiffness":
    [[800.0]], "damping": [[3.0]], "felt": [0.0212151813, 0.0212151813, 0.0212151813, 0.0212151813, 0.0212151813],
    "longest": [inf, 7.07172709e-05, 4.24303625e-06], "rests": False, "normalized": False, "radius": 1.00091122,
    "radii": [1.0009113, 1.00151348, 1.0009113, 1.00091143, 1.00091143, 1.00091142], "responses": [0.18712004,
    -0.00972093746], "path": [-9.19375918e-05, 1.80721929e-06], "matrix": [[5.90214503, 5.65511022, 5.42574251,
    5.1758924], [5.94050131, 5.82070563, 5.7038916, 5.57203172]], "states": 7}},
    "loop of no compensation": {"start": {"directions": [[0.0], [0.6], [0.8]], "stiffness": [[800.0]], "damping":
    [[3.0]], "felt": [0.0207848661, 0.0207848661, 0.0207848661, 0.0207848661, 0.0207848661], "longest": [inf,
    6.92828871e-05, 4.15697322e-06], "rests": True, "normalized": False, "radius": 0.991997634, "radii": [0.992056736,
    0.992075054, 0.992019507, 0.992114896, 0.992157867, 0.992033549], "responses": [0.0282480761, -0.00154165768],
    "path": [-1.38791125e-05, 2.86609549e-07], "matrix": [[5.91869679, 5.80839949, 5.69414242, 5.56882496], [5.9246933,
    5.83441044, 5.73921993, 5.6363506]], "states": 7}, "moved": {"directions": [[0.0], [0.6], [0.8]], "stiffness":
    [[800.0]], "damping": [[3.0]], "felt": [0.0212151813, 0.0212151813, 0.0212151813, 0.0212151813, 0.0212151813],
    "longest": [inf, 7.07172709e-05, 4.24303625e-06], "rests": False, "normalized": False, "radius": 0.99360672,
    "radii": [0.993669854, 0.993692354, 0.993631012, 0.993728923, 0.993774723, 0.993651694], "responses":
    [0.0273253517, -0.00149151079], "path": [-1.34257508e-05, 2.77286743e-07], "matrix": [[5.92143733, 5.81526428,
    5.70567774, 5.58578606], [5.92723849, 5.84042942, 5.74929979, 5.65115426]], "states": 7}},
    "loop of tracking": {"start": {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0],
    [0.0, 600.0]], "damping": [[1.0, 0.0], [0.0, 2.0]], "felt": [0.0314320844, 0.0315471416, 0.0314896229,
    0.0292308459, 0.0], "longest": [0.250201826, 0.000105116836, 6.30928319e-06], "rests": True, "normalized": False,
    "radius": 0.99783766, "radii": [0.99783819, 0.997837992, 1.11808155, 0.997840251, 0.997839612, 1.10787198],
    "responses": [[[0.166632737, 0.0345208272], [0.053880308, 0.593237865]], [[-0.0104627613, -0.0043306644],
    [-0.00961875843, -0.0792086927]]], "path": [[[-0.000127029441, -2.63163257e-05], [-3.78498032e-05,
    -0.000416737343]], [[4.31220097e-06, 1.78487253e-06], [2.63337767e-06, 2.1685377e-05]]], "matrix": [[10.3867542,
    8.41882654, 8.93939959, 9.1509937], [10.6702688, 9.18429206, 9.2196572, 9.3107869]], "states": 16}, "moved":
    {"directions": [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], "stiffness": [[900.0, 0.0], [0.0, 600.0]], "damping": [[1.0,
    0.0], [0.0, 2.0]], "felt": [0.0268371799, 0.0268371799, 0.0268371799, 0.0268371799, 0.0268371799], "longest": [inf,
    8.94572662e-05, 5.36743597e-06], "rests": False, "normalized": False, "radius": 0.997831678, "radii": [0.997831698,
    0.997831696, 1.13088489, 0.997831768, 0.997831764, 1.120495], "responses": [[[0.150686616, 0.0589248735],
    [0.0797175306, 0.601439388]], [[-0.00967349826, -0.00652969435], [-0.0117888377, -0.0804341169]]], "path":
    [[[-0.000114873205, -4.49203072e-05], [-5.59999182e-05, -0.000422498744]], [[3.98690818e-06, 2.69119724e-06],
    [3.2274916e-06, 2.20208677e-05]]], "matrix": [[10.3835604, 8.43013338, 8.98878644, 9.20192506], [10.6670893,
    9.18363113, 9.22923984, 9.32276403]], "states": 16}},
    "loop of slider": {"start": {"directions": [[1.0], [0.0], [0.0]], "stiffness": [[80.0]], "damping": [[1.0]],
    "felt": [0.05, 0.05, 0.05, 0.05, 0.05], "longest": [inf, 0.000166666667, 1e-05], "rests": True, "normalized":
    False, "radius": 0.991484389, "radii": [0.993292349, 1.0016643, 0.9377111, 0.992517954, 1.00091568, 0.936723529],
    "responses": [0.0225456102, -0.00143296087], "path": [-4.58463365e-05, 8.92079181e-07], "matrix": [[1.99016951,
    1.9611127, 1.93809965, 1.91294112], [1.99556801, 1.98342648, 1.97362115, 1.96284234]], "states": 3}, "moved":
    {"directions": [[1.0], [0.0], [0.0]], "stiffness": [[80.0]], "damping": [[1.0]], "felt": [0.05, 0.05, 0.05, 0.05,
    0.05], "longest": [inf, 0.000166666667, 1e-05], "rests": True, "normalized": False, "radius": 0.991484389, "radii":
    [0.993292349, 1.0016643, 0.9377111, 0.992517954, 1.00091568, 0.936723529], "responses": [0.0225456102,
    -0.00143296087], "path": [-4.58463365e-05, 8.92079181e-07], "matrix": [[1.99016951, 1.9611127, 1.93809965,
    1.91294112], [1.99556801, 1.98342648, 1.97362115, 1.96284234]], "states": 3}},
    "laws of a proxy": {"slides 0.0 deep": [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0,
    0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 800.0]]], "slides 0.0 aside": [[[0.0, 0.0], [0.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 800.0]]],
    "slides 0.004 deep": [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0,
    0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 800.0]]], "slides 0.004 aside": [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 800.0]]], "sticks 0.0 deep": [[],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.7, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 800.0]]],
    "sticks 0.0 aside": [[], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.7, 0.0, 0.0], [0.0, 0.7, 0.0],
    [0.0, 0.0, 800.0]]], "sticks 0.004 deep": [[], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[0.7, 0.0,
    0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 800.0]]], "sticks 0.004 aside": [[], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0,
    0.0, 0.0]], [[0.7, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 800.0]]], "rubs 0.0 deep": [[], [[0.0, 0.0, 0.0], [0.0,
    0.0, 0.0], [0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 800.0]]], "rubs 0.0 aside": [[], [[0.0,
    0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 800.0]]],
    "rubs 0.004 deep": [[], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0],
    [0.0, 0.0, 800.0]]], "rubs 0.004 aside": [[], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[1.0, 0.0,
    0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 800.0]]]},
    "realizations": [[3, [[-2.2214581, -2.23320045, -3.40474431], [-0.996478637, -0.700006424, -0.876415056]],
    [[0.293157433, -0.324725347, -0.519148773], [-0.194037812, 0.55178425, -0.719582091]], [[-0.670309314,
    -0.770382223, -1.39332355], [-0.39251858, -0.1450221, -0.251197795]], [[4.08198377e-15, 8.84848594e-15,
    2.34852121e-15], [6.22388238e-15, 1.12772255e-14, 3.03128848e-15]]], [6, 1.57696671, -1.22604215, 1.08208365,
    [[1.09766097e-05]]], [22, [[-1.38524675, -1.05077975], [-1.8501418, -0.461172043], [0.830978666, 0.343577307]],
    [[-0.837619659, 0.695108975], [0.448446441, -0.470093852], [0.0260849365, -0.0623441019]], [[-0.645930646,
    -0.825486025], [-0.980192966, -0.2587496], [0.47526435, 0.30110742]], [[5.70912209e-06, 8.85372661e-06],
    [8.21943563e-06, 3.97720093e-06], [9.69824879e-06, 4.11456586e-06]]], [2, [[-0.117108847, -0.671290519]],
    [[0.196409016, 2.14572048]], [[-0.103369758, -0.524241214]], [[3.07924532e-16, 5.00096925e-16]]]],
    "displays": {"hand on a wall start": [24, 0.990035456, 16.7981348, 14.6272685, 13.159218, 11.8992251],
    "hand on a wall moved": [24, 0.990035499, 16.4837616, 14.6211172, 13.0573162, 11.8981445], "push on a wall start":
    [25, 0.990047385, 13.9449642, 12.1861826, 10.4666577, 9.03123285], "push on a wall moved": [25, 0.990047185,
    13.9417488, 12.1800036, 10.4592671, 9.02500008], "push on a spring start": [24, 0.990047864, 15.634889, 13.3386252,
    12.0592169, 11.1638559], "push on a spring moved": [24, 0.990047798, 15.6318253, 13.3337217, 12.0543337,
    11.1604263], "free tool start":
    "servo.tool.damping: along the surface nothing brakes a tool without damper, so its velocity is neutral there; "
    "give it a damper, or judge the loop by its run",
    "free tool moved":
    "servo.tool.damping: along the surface nothing brakes a tool without damper, so its velocity is neutral there; "
    "give it a damper, or judge the loop by its run"},
    "loops of runs": {"wall": [[0.992658098, 0.992695311, "the linear loop is stable (spectral radius 0.992695311)"],
    ""], "mesh": [[0.99305175, None, "the linear loop is stable (spectral radius 0.99305175)"], ""], "mesh contact":
    [0.99305175, ""], "smooth mesh": [[0.992706787, None, "the linear loop is stable (spectral radius 0.992706787)"],
    ""], "smooth mesh contact": [0.992706787, ""], "guarded": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "late": [None,
    "late ticks destabilize a loop, and the linear loop is that without them"]},
    "loops with a guard": {"stiff passivity_controller 1.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "stiff passivity_controller 0.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"], "stiff energy_bound 1.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"], "stiff energy_bound 0.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"],
    "damper passivity_controller 1.0": [[13.3330844, None], ""], "damper passivity_controller 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "damper energy_bound 1.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "damper energy_bound 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"],
    "bilinear damper passivity_controller 1.0": [[23.0962847, None], ""], "bilinear damper passivity_controller 0.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"],
    "bilinear damper energy_bound 1.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "bilinear damper energy_bound 0.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"],
    "spring passivity_controller 1.0": [[14.7856388, None], ""], "spring passivity_controller 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "spring energy_bound 1.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "spring energy_bound 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "along passivity_controller 1.0":
    [None, "a guard makes the loop nonlinear, and the linear loop is that without it"],
    "along passivity_controller 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "along energy_bound 1.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"], "along energy_bound 0.0": [None,
    "a guard makes the loop nonlinear, and the linear loop is that without it"]},
    "loops by a formula": {"law": [[0.992709464, None], ""], "law off": [None, "the tip is off the force law"], "well":
    [[0.9927468, 0.992818629], ""], "left well": [None,
    "the tip leaves the distance within which the force of the gravity well is linear"], "viscous": [[0.988639695,
    0.988934436], ""], "constant": [None, ""], "display": [[0.990041025, 0.990041029], ""], "bilinear display": [None,
    "the tip never touches the object"], "none": [None, ""], "wall off": [None, "the tip never touches the object"]},
}
# fmt: on


@pytest.mark.parametrize("name", MEASURES)
def test_every_number_of_a_linear_law_is_as_recorded(name: str) -> None:
    absolute = 1e-6 if name in ("laws of a proxy", "realizations") else 1e-13
    assert_same(plain(MEASURES[name]()), STORED[name], name, absolute)


@pytest.mark.parametrize("normalizes", [False, True])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_loop_of_a_rest_on_a_mesh_depends_on_the_last_fifth_alone(normalizes: bool, friction: float) -> None:
    """All samples before are those of another place; only the pose of the start counts besides."""
    press = {"rest": ["0 mm", "0 mm", "0 mm"], "shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.3 N"]}
    cube = {
        "kind": "mesh", "position": ["0.5 mm", "0.3 mm", "-0.1 mm"],
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 2},
        "surface": {"stiffness": "800 N/m", "static_friction": friction, "damping": "0.5 N*s/m"},
    }  # fmt: skip
    given = tables(
        "force_tracking",
        object=cube,
        operator={**HAND, **press},
        reference={"force": ["0 N", "0 N", "-0.3 N"]},
        controller={"kind": "lqg", "stiffness": "600 N/m", "normalize": normalizes},
        run={"duration": "0.5 s"},
    )
    trace = palpate.simulate(given)
    scenario = Scenario.from_dict(given)
    radius, reason = contact_radius(trace, scenario)
    assert (reason == "nothing holds the tip along the surface of the mesh") is (friction == 0.0)
    channels = {name: replace(one, values=one.values.copy()) for name, one in trace.channels.items()}
    for one in channels.values():
        one.values[1:400] = 3.0 * one.values[1:400] + 0.1
    assert contact_radius(replace(trace, channels=channels), scenario) == (radius, reason)
    if friction:
        assert radius == pytest.approx(0.995839262 if normalizes else 0.99528748, rel=1e-6)
