"""Bodies with inertia and with creep: against finite elements in time, and their own compliance."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import Body, BodyError, block
from palpate.fem.elements import Elements
from palpate.fem.material import Material
from palpate.fem.selectors import half_space
from scipy import sparse
from scipy.linalg import eigh, lu_factor, lu_solve

BOTTOM, TOP = half_space("z", "<", 1e-9), half_space("z", ">", 0.02 - 1e-9)
VOLUME = block((0.03, 0.03, 0.02), 0.01)
PERIOD, ALPHA, BETA = 1e-3, 5.0, 2e-4


@pytest.fixture(scope="module")
def body() -> Body:
    return bodies.build(VOLUME, young=5e3, fixed=BOTTOM, touch=TOP, modes=40)


@pytest.fixture(scope="module")
def elements() -> Elements:
    return Elements(VOLUME, Material(5e3), [BOTTOM], TOP)


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_at_rest_every_kind_stores_what_its_forces_did(body: Body, tip: Literal["sphere", "flat"]) -> None:
    """Held for long: half of forces times displacements; of a flat end, half of its forces times how deep it is in.

    And what the body without inertia stores, also where the end's edge crosses patches.
    """
    deep, radius = 3e-4, 0.2 if tip == "sphere" else 0.012
    still = np.array([0.014, 0.016, 0.02 + (radius if tip == "sphere" else 0.0) - deep])
    settling = {"rayleigh_alpha": 50.0, "rayleigh_beta": 2e-3}
    kinds = {
        "modal": body.modal(PERIOD, **settling),
        "standard linear solid": body.modal(PERIOD, **settling, instantaneous_ratio=3.0, retardation_time=0.02),
        "viscoelastic": body.viscoelastic(PERIOD, instantaneous_ratio=3.0, retardation_time=0.02),
        "mass_spring": body.mass_spring(PERIOD, **settling),
    }
    elastic = body.simulate_path(still[None], radius, outward=[0, 0, 1], tip=tip)
    for name, kind in kinds.items():
        felt = kind.simulate_path(np.tile(still, (2000, 1)), radius, outward=[0, 0, 1], tip=tip)
        assert felt.nodes[-1] >= 4
        assert abs(np.diff(felt.energy[-10:])).max() < 1e-6 * felt.energy[-1]
        nodes, forces = kind.core.contact_forces()
        inward = -(kind.displacement()[nodes] * kind.normals[nodes]).sum(axis=1)
        done = 0.5 * (forces @ inward if tip == "sphere" else forces.sum() * deep)
        assert felt.energy[-1] == pytest.approx(done, rel=1e-2 if name == "mass_spring" else 1e-5), name
        if name != "mass_spring":
            assert felt.energy[-1] == pytest.approx(elastic.energy[0], rel=1e-5), name


def test_modes_are_those_of_the_dense_problem(body: Body, elements: Elements) -> None:
    k = elements.stiffness[elements.free][:, elements.free].toarray()
    m = elements.mass[elements.free][:, elements.free].toarray()
    squares = eigh(k, m, eigvals_only=True, subset_by_index=[0, 39])
    assert body.contents.frequencies == pytest.approx(np.sqrt(squares), rel=1e-8)


def test_modal_is_within_two_percent_of_all_elements_in_time(body: Body, elements: Elements) -> None:
    """A pulse on one node: 40 modes and static correction beside all unknowns, by Newmark at a tenth of a tick."""
    k = elements.stiffness[elements.free][:, elements.free].toarray()
    m = elements.mass[elements.free][:, elements.free].toarray()
    node = int(np.argmin(np.linalg.norm(body.nodes - [0.01, 0.01, 0.02], axis=1)))
    load = -(
        sparse.kron(elements.load, sparse.eye(3)).tocsr()[elements.free] @ np.eye(3 * len(body.nodes))[3 * node + 2]
    )
    t = (np.arange(300) + 0.5) * PERIOD
    force = 0.2 * np.sin(np.pi * t / 0.03) ** 2 * (t < 0.03)
    found = body.modal(PERIOD, rayleigh_alpha=ALPHA, rayleigh_beta=BETA).core.node_response(node, force)

    damping, h = ALPHA * m + BETA * k, PERIOD / 10
    u, v = np.zeros(len(k)), np.zeros(len(k))
    a = np.zeros(len(k))
    solver = lu_factor(m + h / 2 * damping + h * h / 4 * k)
    expected = []
    for f in force:
        for _ in range(10):
            guess, speed = u + h * v + h * h / 4 * a, v + h / 2 * a
            a = lu_solve(solver, load * f - damping @ speed - k @ guess)
            u, v = guess + h * h / 4 * a, speed + h / 2 * a
        expected.append(load @ u)
    assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max()


def test_modal_at_last_is_compliance(body: Body) -> None:
    """A tip that stays: after the ringing, the force is that of the body without inertia."""
    tip = np.tile([0.01, 0.01, 0.02 + 0.008 - 0.001], (4000, 1))
    moving = body.modal("1 ms", rayleigh_alpha=20.0, rayleigh_beta=1e-3)
    felt = moving.simulate_path(tip, 0.008, outward=[0, 0, 1])
    still = body.simulate_path(tip[:1], 0.008, outward=[0, 0, 1])
    assert felt.force[-1] == pytest.approx(still.force[0], rel=1e-4, abs=1e-6)
    assert np.abs(felt.force[:20, 2] - still.force[0, 2]).max() > 0.05 * still.force[0, 2]


@pytest.mark.filterwarnings("ignore:only 1 of the")
@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_a_body_that_is_held_has_gone_in_as_far_as_the_tip(body: Body, tip: Literal["sphere", "flat"]) -> None:
    """At rest every kind's pressed patch has moved as that of the body without a memory; `press` is that rest."""
    place = [0.0102, 0.0097, 0.02]
    way = np.tile(np.add(place, [0, 0, (0.008 if tip == "sphere" else 0.0) - 0.001]), (4000, 1))
    still = body.simulate_path(way[:1], 0.008, outward=[0, 0, 1], tip=tip)
    assert still.deflection[0, 2] < -5e-4
    moving = body.modal("1 ms", rayleigh_alpha=20.0, rayleigh_beta=1e-3)
    relaxing = body.viscoelastic("1 ms", instantaneous_ratio=2.0, retardation_time="0.2 s")
    for kind in (moving, relaxing):
        felt = kind.simulate_path(way, 0.008, outward=[0, 0, 1], tip=tip)
        assert felt.deflection[-1] == pytest.approx(still.deflection[0], rel=2e-3, abs=1e-6)
        pressed = kind.indent(place, 0.008, 0.001, tip=tip)
        assert pressed.force == pytest.approx(still.force[0], rel=1e-9, abs=1e-12)
    felt = body.mass_spring("1 ms", rayleigh_alpha=20.0).simulate_path(way, 0.008, outward=[0, 0, 1], tip=tip)
    assert felt.deflection[-1, 2] == pytest.approx(still.deflection[0, 2], rel=0.05)


def test_a_modal_body_that_relaxes_comes_from_its_ringing_to_the_closed_form(body: Body) -> None:
    """Under a tip that stays, a standard linear solid's force falls as 1 + (instant - 1) exp(-instant t / creep)."""
    tip = np.tile([0.01, 0.01, 0.02 + 0.008 - 0.001], (1000, 1))
    moving = body.modal(
        "1 ms", rayleigh_alpha=20.0, rayleigh_beta=1e-3, instantaneous_ratio=2.5, retardation_time="0.2 s"
    )
    felt = moving.simulate_path(tip, 0.008, outward=[0, 0, 1]).force[:, 2]
    still = body.simulate_path(tip[:1], 0.008, outward=[0, 0, 1]).force[0, 2]
    time = 1e-3 * np.arange(1, 1001)
    expected = still * (1.0 + 1.5 * np.exp(-2.5 * time / 0.2))
    assert felt[100:] == pytest.approx(expected[100:], rel=0.01)
    assert np.abs(felt[:50] / expected[:50] - 1.0).max() > 0.05  # it has inertia


def test_a_relaxing_body_starts_stiff_and_ends_as_compliance(body: Body) -> None:
    tip = np.tile([0.01, 0.01, 0.02 + 0.008 - 0.001], (2000, 1))
    felt = body.viscoelastic("1 ms", instantaneous_ratio=2.5, retardation_time="0.2 s").simulate_path(
        tip, 0.008, outward=[0, 0, 1]
    )
    still = body.simulate_path(tip[:1], 0.008, outward=[0, 0, 1]).force[0, 2]
    assert still > 0
    assert felt.force[0, 2] == pytest.approx(2.5 * still, rel=0.02)
    assert felt.force[-1, 2] == pytest.approx(still, rel=1e-4)
    assert (np.diff(felt.force[:, 2]) < 1e-9).all()


def test_a_sweep_over_a_relaxing_body_loses_energy(body: Body) -> None:
    t = np.linspace(0, 2 * np.pi, 2001)
    path = np.stack([0.01 + 3e-3 * np.sin(t), 0.01 + 2e-3 * np.cos(2 * t), 0.027 - 5e-4 * np.cos(t)], axis=1)
    felt = body.viscoelastic("1 ms", instantaneous_ratio=2.5, retardation_time="0.2 s").simulate_path(
        path, 0.008, outward=[0, 0, 1]
    )
    work = -(felt.force[1:] * np.diff(path, axis=0)).sum()
    assert work > 0.0


@pytest.mark.parametrize(
    ("size", "spacing", "count"), [((24e-3, 24e-3, 12e-3), 6e-3, 12), ((18e-3, 18e-3, 6e-3), 6e-3, 4)]
)
def test_residual_vectors_of_loads_that_span_a_small_body_are_its_higher_modes(
    size: tuple[float, float, float], spacing: float, count: int
) -> None:
    """They complete the modes to all motions: no frequency is below its own, and the compliance is the body's."""
    top = half_space("z", ">", size[2] - 1e-9)
    data = bodies.build(block(size, spacing), young=20e3, fixed=BOTTOM, touch=top, order=1, modes=count).contents
    dense = Elements(block(size, spacing), Material(20e3), [BOTTOM], top, order=1)
    free = dense.free
    stiffness, mass = (matrix[free][:, free].toarray() for matrix in (dense.stiffness, dense.mass))
    squares = eigh(stiffness, mass, eigvals_only=True)
    frequencies = np.sort(np.concatenate([data.frequencies, data.residual_frequencies]))
    assert len(frequencies) <= len(free)
    assert (frequencies >= np.sqrt(squares[: len(frequencies)]) * (1.0 - 1e-6)).all()  # Rayleigh and Ritz: from above
    shapes = np.hstack([data.shapes, data.residual_shapes]).astype(float)
    softness = shapes / np.concatenate([data.frequencies, data.residual_frequencies]) ** 2 @ shapes.T
    assert np.abs(softness - data.compliance).max() < 1e-5 * np.abs(data.compliance).max()


def test_modes_come_back_from_a_file_and_their_absence_is_told(body: Body, tmp_path: Path) -> None:
    again = Body.load(body.save(tmp_path / "b.h5"))
    assert np.array_equal(again.contents.shapes, body.contents.shapes)
    plain = bodies.build(VOLUME, young=5e3, fixed=BOTTOM, touch=TOP)
    with pytest.raises(BodyError, match="built without modes"):
        plain.modal(PERIOD)
    with pytest.raises(BodyError, match="period: 0 s must be positive"):
        body.modal(0.0)
    with pytest.raises(BodyError, match=r"1 or more, not 0\.5"):
        body.viscoelastic(PERIOD, instantaneous_ratio=0.5, retardation_time=0.1)
    with pytest.raises(BodyError, match="fewer than"):
        bodies.build(VOLUME, young=5e3, fixed=BOTTOM, touch=TOP, modes=100_000)
