"""Linear response of a body under the tip: equal to the states of its model, realized within the bound given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from palpate import fem, simulate
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.body_response import HeldTip, body_response, multirate_response, realization
from palpate.simulation.body_response.held_tip import contact_frame
from palpate.simulation.body_response.realization import realize
from palpate.simulation.body_response.response import _choose_step

PERIOD, DEPTH = 1e-3, 0.3e-3
PATH = np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, -0.2e-3 - DEPTH], 50)


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """24 x 24 x 12 mm of 20 kPa, bonded below, touched on its top, with 12 vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.024, 0.024, 0.012), 0.006)
    fem.build(shape, young=20e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1, modes=12, output=path)
    return path


def held(block: Path, kind: str, **options: Any) -> HeldTip:
    """A flat end of 40 mm that covers the whole top, held 0.3 mm deep: every node takes part, none of them partly."""
    body = {"file": str(block), "origin": ["12 mm", "12 mm", "12 mm"], "kind": kind, "tip": "flat", "radius": "40 mm"}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0 N", "-1 N"]},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-0.2 mm"], "body": {**body, **options}},
    }
    return HeldTip(Scenario.from_dict(tables), PATH)


def normal_compliance(block: Path) -> np.ndarray:
    return fem.load(block).compliance[2::3, 2::3].astype(float)


def test_an_elastic_body_answers_at_once(block: Path) -> None:
    found = body_response(held(block, "compliance"))
    expected = np.linalg.inv(normal_compliance(block)).sum()
    assert found.system.nstates == 0
    assert found.nodes == 25
    np.testing.assert_allclose(found.frame[:, 0], [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(found.static[0, 0], expected, rtol=1e-5)
    np.testing.assert_array_equal(found.static, found.one_tick)


def test_creep_is_the_standard_linear_solid(block: Path) -> None:
    """One state: the total delayed force. The instantaneous modulus is three times the long-term one."""
    ratio, time = 3.0, 0.05
    found = body_response(held(block, "viscoelastic", instantaneous_ratio=ratio, retardation_time=f"{time} s"))
    stiffness, decay = np.linalg.inv(normal_compliance(block)).sum(), np.exp(-PERIOD / time)
    gain = (1.0 - decay) * (1.0 - 1.0 / ratio)
    within = 1.0 / ratio + gain
    a, b, c, d = decay - gain * decay / within, gain * stiffness / within, -decay / within, stiffness / within
    expected = np.array([d, *(c * a**k * b for k in range(60))])
    np.testing.assert_allclose(found.markov[:61, 0, 0], expected, atol=2e-5 * stiffness)
    np.testing.assert_allclose(found.static[0, 0], stiffness, rtol=1e-3)
    np.testing.assert_allclose(found.one_tick[0, 0], d, rtol=1e-5)


@pytest.mark.parametrize(("law", "ratio"), [({"hardening_strain": 0.02}, 1.2), ({"exponent": -60.0}, 0.9)])
def test_nonlinear_springs_answer_with_their_tangent_at_the_depth(
    block: Path, law: dict[str, float], ratio: float
) -> None:
    """Not with the stiffness of small displacements: the differences of forces at rest, 1 um apart."""
    found = body_response(held(block, "mass_spring", rayleigh_beta="2 ms", **law))
    body = fem.load(block).mass_spring(PERIOD, rayleigh_beta=2e-3, **law)

    def force(depth: float) -> float:
        body.core.reset()
        down = np.append(np.linspace(0.0, depth, 100), np.full(3000, depth))
        path = np.array([0.012, 0.012, 0.012]) - down[:, None] * [0.0, 0.0, 1.0]
        return float(body.simulate_path(path, 0.04, outward=[0, 0, 1], tip="flat").force[-1, 2])

    tangent = (force(DEPTH + 1e-6) - force(DEPTH - 1e-6)) / 2e-6
    assert found.static[0, 0] == pytest.approx(tangent, rel=1e-3)
    assert (tangent / (force(1e-6) / 1e-6) - ratio) * np.sign(ratio - 1.0) > 0.0


def test_modes_answer_as_their_oscillators_under_a_held_force(block: Path) -> None:
    """States of every mode, exact for forces held over a tick, and the residual compliance without inertia."""
    beta = 1e-3
    found = body_response(held(block, "modal", rayleigh_beta=f"{beta} s"))
    contents = fem.load(block).contents
    shapes, omega = contents.shapes[2::3].astype(float), contents.frequencies
    a, b = np.zeros((24, 24)), np.zeros((24, 12))
    for k, w in enumerate(omega):
        one = control.StateSpace([[0, 1], [-(w**2), -beta * w**2]], [[0], [1]], np.eye(2), np.zeros((2, 1)))
        sampled = control.c2d(one, PERIOD)
        rows = slice(2 * k, 2 * k + 2)
        a[rows, rows], b[rows, k] = sampled.A, sampled.B[:, 0]
    place = np.kron(shapes, [[1.0, 0.0]])  # nodes by states
    within = normal_compliance(block) - shapes / omega**2 @ shapes.T + place @ b @ shapes.T
    inverse, state, expected = np.linalg.inv(within), np.zeros(24), []
    for tick in range(60):
        force = inverse @ ((1.0 if tick == 0 else 0.0) - place @ a @ state)
        expected.append(force.sum())
        state = a @ state + b @ (shapes.T @ force)
    np.testing.assert_allclose(found.markov[:60, 0, 0], expected[: len(found.markov)], atol=2e-4 * expected[0])
    assert found.one_tick[0, 0] > 1.2 * found.static[0, 0]


def test_the_frame_of_a_contact_is_orthonormal_and_begins_with_the_normal() -> None:
    for normal in ([0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [1.0, 2.0, 2.0]):
        frame = contact_frame(np.array(normal))
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(frame[:, 0], np.array(normal) / np.linalg.norm(normal), atol=1e-15)


class Relaxing:
    """A tip whose force on its body is 1000 N/m of its displacement and decays by a factor from tick to tick."""

    frame, radius, period, friction, memoryless, rounds, nodes, core = (
        np.eye(3),
        0.01,
        PERIOD,
        False,
        False,
        False,
        4,
        None,
    )
    relaxation = 0.0

    def __init__(self, decay: float) -> None:
        self.decay, self.ticks, self.state = decay, 0, np.zeros(3)

    def move(self, path: np.ndarray) -> tuple[np.ndarray, None]:
        forces = np.empty((len(path), 3))
        if len(path) == 1:
            self.state = np.zeros(3)  # at rest when a record begins
        for tick, moved in enumerate(path):
            self.state = self.decay * self.state + 1000.0 * moved
            forces[tick] = self.state
        self.ticks = max(self.ticks, len(path))
        return forces, None


class Softening(Relaxing):
    """A tip on 1000 N/m, with 4 % more in one direction; moved by more than 0.3 um, on 100 N/m, with 10 % more."""

    def move(self, path: np.ndarray) -> tuple[np.ndarray, None]:
        far = np.abs(path) > 0.3e-6
        odd = np.where(far, 0.10, 0.04) * (path > 0.0)
        return np.where(far, 100.0, 1000.0) * (1.0 + odd) * path, None


def test_the_step_is_that_whose_answers_differ_least_for_their_size() -> None:
    """The answers to large steps differ by 10 N/m in 100, and those to small ones by 40 N/m in 1000."""
    assert _choose_step(Softening(0.0)) < 0.3e-6  # type: ignore[arg-type]


def test_a_record_is_as_long_as_a_response_takes_to_decay() -> None:
    """256 ticks or a power of two times as many: after three quarters of them 1e-5 of the response is left."""
    for decay, ticks in ((0.9, 256), (0.975, 1024), (0.99, 2048)):
        tip = Relaxing(decay)
        found = body_response(tip)  # type: ignore[arg-type]
        assert tip.ticks == ticks
        assert decay ** (0.75 * ticks) < 1e-5 < decay ** (0.375 * ticks) or ticks == 256
        np.testing.assert_allclose(found.markov[:50, 1, 1], 1000.0 * decay ** np.arange(50), rtol=1e-6)
        np.testing.assert_allclose(found.static, 1000.0 / (1.0 - decay) * np.eye(3), atol=1e-2 / (1.0 - decay))


def test_a_response_that_decays_too_slowly_is_refused_after_4096_ticks() -> None:
    """A quarter of 4096 ticks must lose a tenth: 0.99988 to the power of 1024 is 0.88, and 0.9999 is 0.90."""
    tip = Relaxing(0.9998)
    body_response(tip)  # type: ignore[arg-type]
    assert tip.ticks == 4096
    with pytest.raises(StabilityError, match="has not decayed after 4096 ticks: give the body more damping"):
        body_response(Relaxing(0.99992))  # type: ignore[arg-type]


def test_a_realization_reproduces_a_random_system_within_its_bound() -> None:
    rng = np.random.default_rng(3)
    a = rng.standard_normal((6, 6))
    a *= 0.9 / np.abs(np.linalg.eigvals(a)).max()
    b, c, d = rng.standard_normal((6, 3)), rng.standard_normal((3, 6)), rng.standard_normal((3, 3))
    markov = np.array([d, *(c @ np.linalg.matrix_power(a, k) @ b for k in range(255))])
    system, error = realize(markov, PERIOD)
    assert system.nstates == 6
    assert error.max() < 1e-5 * np.abs(markov).sum(axis=0).max()
    noisy, bound = realize(markov + 1e-4 * rng.standard_normal(markov.shape), PERIOD)
    for angle in np.linspace(0.0, np.pi, 50):
        z = np.exp(1j * angle)
        true = d + c @ np.linalg.solve(z * np.eye(6) - a, b)
        assert np.all(np.abs(noisy(z) - true) <= bound + 1e-4 * np.sqrt(len(markov)) * 4)


def test_a_realization_uses_the_whole_of_a_short_record() -> None:
    """Five values give a 2 x 2 Hankel matrix, which is enough for two states."""
    record = np.array([3.0, *(0.02**k - 2.0 * 0.03**k for k in range(4))])[:, None, None]
    system, error = realize(record, PERIOD)
    assert system.nstates == 2
    assert sorted(system.poles().real) == pytest.approx([0.02, 0.03], rel=1e-6)
    assert error.max() < 1e-5 * np.abs(record).sum()


def test_a_hyperelastic_body_follows_its_local_model_between_updates(block: Path) -> None:
    """The local model is the tangent: the corrections after an update are small, and end after a few updates."""
    found = multirate_response(held(block, "neo-hookean", update_interval="5 ms"))
    assert found.every == 5
    assert not found.correction[0].any()
    assert np.abs(found.correction[:5]).max() < 1e-3 * found.local[0, 0]  # published after the update
    assert np.abs(found.correction).max() < 0.1 * found.local[0, 0]
    assert found.static[0, 0] == pytest.approx(found.local[0, 0], rel=0.1)


def test_the_static_stiffness_of_a_hyperelastic_body_is_the_slope_between_two_rests(tmp_path: Path) -> None:
    """A ball deep in a soft block, where the energy tank delays the updates."""
    path = tmp_path / "deep.h5"
    fem.build(fem.block((0.064, 0.064, 0.032), 0.008), young=5e3, poisson=0.4, fixed="z < 0.001 mm",
              touch="z > 31.9 mm", order=1, output=path)  # fmt: skip

    def press(force: float) -> tuple[Scenario, Any]:
        body = {"file": str(path), "origin": ["32 mm", "32 mm", "32 mm"], "rotation": ["0 deg", "90 deg", "0 deg"],
                "kind": "neo-hookean", "update_interval": "20 ms", "radius": "10 mm"}  # fmt: skip
        hand = {"kind": "arm", "mass": "0.15 kg", "damping": "6 N*s/m", "stiffness": "10 N/m"}
        tables = {
            "device": {"name": "slider"},
            "servo": {"period": "1 ms", "topology": "impedance_display"},
            "operator": {**hand, "shape": "ramp", "rise": "0.5 s", "force": [f"{-force} N", "0 N", "0 N"]},
            "object": {"kind": "body", "position": ["-10.2 mm", "0 mm", "0 mm"], "body": body},
            "run": {"duration": "4 s"},
        }
        scenario = Scenario.from_dict(tables)
        return scenario, simulate(scenario)

    (scenario, trace), (_, further) = press(1.2), press(1.21)
    force, tip = (further[name][-1, 0] - trace[name][-1, 0] for name in ("object_force", "tip"))
    found = multirate_response(HeldTip(scenario, trace["tip"] - trace["tip"][0]))
    assert found.static[0, 0] == pytest.approx(abs(force / tip), rel=0.01)
    assert found.local[0, 0] < 0.9 * found.static[0, 0]
    summed = found.local + found.correction.sum(axis=0) / found.every
    assert found.error[0, 0] >= abs(summed[0, 0] - found.static[0, 0])


@pytest.mark.parametrize(
    ("errors", "chosen"),
    [
        ((5.0, 3.0, 1.21, 1.19, 1.0, 1.1), 3),  # the first within 1.2 times the least
        ((1.0, 0.99, 0.98, 0.97), 0),
        ((5.0, 3.0, 4.9e-5, 1e-9), 2),  # 1e-5 of the whole suffices
        ((5.0, 3.0, 5.1e-5, 0.9e-6), 3),
    ],
)
def test_the_order_is_the_least_whose_error_suffices_or_is_near_the_least(
    errors: tuple[float, ...], chosen: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    markov = np.random.default_rng(0).standard_normal((41, 1, 1))
    markov[0] = 0.0
    left = iter(errors[1:])
    monkeypatch.setattr(realization, "_ORDERS", tuple(range(1, len(errors))))
    monkeypatch.setattr(realization, "_error", lambda *_: np.full((1, 1), next(left)))
    system, error = realize(errors[0] * markov / np.abs(markov).sum(), PERIOD)  # the whole is the first error
    assert system.nstates == chosen
    assert error.max() == pytest.approx(errors[chosen])


def test_the_error_is_that_of_the_record_and_of_the_tail_as_far_as_it_is_in_doubt() -> None:
    """One state a, out = 1: the record is exact but for one value in its last quarter."""
    for a, n in ((0.5, 8), (-0.6, 12), (0.4, 17)):
        answer = a ** np.arange(n)
        tail = abs(a) ** n / (1.0 - abs(a))
        level = np.abs(answer[-(n // 4) :]).sum()
        parts = np.array([[a]]), np.array([[1.0]]), np.array([[1.0]])
        for place, change in ((n - 1, 0.0), (n - 2, 0.1 * level), (n - 2, 0.24 * level), (n - 2, 3.0 * level),
                              (n - n // 4, 0.1 * level), (n - n // 4 - 1, 0.1 * level)):  # fmt: skip
            record = np.concatenate([[7.0], answer])
            record[1 + place] += np.sign(answer[place]) * change
            quarter = np.abs(record[-(n // 4) :]).sum()
            doubt = min(4.0 * change / quarter, 1.0) if place >= n - n // 4 else 0.0
            found = realization._error(record[:, None, None], *parts)
            np.testing.assert_allclose(found, change + doubt * tail, rtol=1e-9, atol=1e-15)
    record = 0.99 ** np.arange(-1, 20)[:, None, None]
    slow = realization._error(record, np.array([[0.99]]), np.array([[1.0]]), np.array([[1.0]]))
    np.testing.assert_allclose(slow, 0.99**20 / 0.01, rtol=1e-9)  # more than four times the last quarter: in full
    unstable = realization._error(record, np.array([[1.0]]), np.array([[1.0]]), np.array([[1.0]]))
    assert np.isinf(unstable).all()


class Settling(HeldTip):
    """A tip whose force changes in each block of ticks by a given amount, N."""

    def __init__(self, changes: list[float], nodes: int = 3) -> None:
        self.changes, self.blocks, self.count = iter(changes), 0, nodes

    def move(self, displacements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        assert not displacements.any()
        self.blocks += 1
        forces = np.tile([0.0, 0.0, 2.0], (len(displacements), 1))
        forces[0, 1] += next(self.changes)
        return forces, np.full(len(forces), self.count)


@pytest.mark.parametrize(
    ("changes", "blocks"),
    [
        ([1e-3, 1e-6, 1.9e-9, 1.0], 3),  # at rest within 1e-9 of the force
        ([1e-3, 1e-6, 2.1e-9, 1e-12], 4),
        ([1e-3, 1e-4, 0.91e-4, 0.95e-4, 2e-4, 1e-4, 1.0], 6),  # four blocks without a tenth less
        ([1e-3, 1e-4, 0.89e-4, 0.95e-4, 2e-4, 1e-4, 1e-3, 1.0], 7),
        ([1.0, 0.89, 0.79, 0.7, 0.62, 0.55, 1e-12], 7),
        ([0.8**k for k in range(40)], 30),  # 6000 ticks
    ],
)
def test_a_tip_is_held_until_its_force_rests_or_stops_settling(changes: list[float], blocks: int) -> None:
    tip = Settling(changes)
    tip._settle(200)
    assert tip.blocks == blocks
    assert (tip.nodes, tip.force.tolist()) == (3, [0.0, 0.0, 2.0])


def test_a_tip_off_its_body_has_no_loop() -> None:
    with pytest.raises(StabilityError, match="the tip does not touch the body where the run has left it"):
        Settling([0.0], nodes=0)._settle(200)


@pytest.mark.parametrize(
    ("force", "flat", "outward"),
    [([0.0, 3.0, -4.0], False, [0.0, 0.6, -0.8]), ([0.0, 3.0, -4.0], True, [0, 0, 1]), ([0.0] * 3, False, [0, 0, 1])],
)
def test_a_hyperelastic_body_is_brought_into_equilibrium_against_the_force_of_the_tip(
    force: list[float], flat: bool, outward: list[float]
) -> None:
    """Along the force on the tip, or the axis of a flat end; a body that finds none has no loop."""
    asked: list[Any] = []

    class Pressed(HeldTip):
        def __init__(self) -> None:
            self._position, self.radius, self._flat, self.ticks = np.array([1.0, 2.0, 3.0]), 0.008, flat, 5

        def _step(self, positions: np.ndarray) -> np.ndarray:
            np.testing.assert_array_equal(positions, [[1.0, 2.0, 3.0]])
            return np.array([[*force, *range(7)]])

    class Core:
        def __init__(self, found: float) -> None:
            self.found = found

        def settle(self, *given: Any) -> np.ndarray:
            asked.append(given)
            return np.array([[9.0, 9.0, self.found]])

    tip = Pressed()
    tip._equilibrate(Core(1.0))  # type: ignore[arg-type]
    assert tip.ticks == 0
    position, axis, radius, is_flat, updates = asked[0]
    np.testing.assert_array_equal(position, [[1.0, 2.0, 3.0]])
    np.testing.assert_allclose(axis, [outward])
    assert (radius, is_flat, updates) == (0.008, flat, 200)
    for none in (0.0, -1.0, np.nan):
        with pytest.raises(StabilityError, match="the hyperelastic body finds no equilibrium under the tip held still"):
            tip._equilibrate(Core(none))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["mass_spring", "modal"])
def test_linear_bodies_at_two_rates_are_left_undecided(block: Path, kind: str) -> None:
    """Their motion outlasts an update, so the response about one update would not be that of the loop."""
    with pytest.raises(StabilityError, match=f"does not take {kind} at two rates.*remove update_interval"):
        held(block, kind, rayleigh_beta="2 ms", update_interval="20 ms")


def test_an_update_interval_does_not_change_a_static_body(block: Path) -> None:
    one = body_response(held(block, "compliance")).static
    np.testing.assert_array_equal(one, body_response(held(block, "compliance", update_interval="20 ms")).static)
