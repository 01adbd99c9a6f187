"""The references of the validation of bodies, and its law of energy: parts of `experiments.body_validation`."""

from __future__ import annotations

import os

import numpy as np
import pytest
from nightly import nightly
from palpate.fem import Body, ContactHistory

from experiments.body_validation import indenter as punch
from experiments.body_validation.passivity import energy_out, small_body
from experiments.body_validation.validation import flat_end, lattice_rows, linearized_mass_spring

PATHS = int(os.environ.get("PALPATE_CLOSED_PATHS", "60"))


@pytest.fixture(scope="module")
def body() -> Body:
    return small_body()


def test_the_limit_of_three_values_is_exact_for_one_power_of_the_cells() -> None:
    values = [600.0 + 40.0 * h**2.5 for h in (1.0, 1 / 1.5, 1 / 2.25)]
    limit, order = punch.extrapolate(values, 1.5)
    assert limit == pytest.approx(600.0, rel=1e-12)
    assert order == pytest.approx(2.5, rel=1e-9)


def test_the_reference_falls_with_finer_cells_and_stays_above_the_half_space() -> None:
    """Elements are too stiff (least energy), and so is a bonded bottom beside 2 E a / (1 - nu^2)."""
    radius = 10e-3
    coarse, fine = (punch.stiffness(radius, cells) for cells in (2, 3))
    half_space = 2 * punch.YOUNG * radius / (1 - punch.POISSON**2)
    assert half_space < fine < coarse < 1.4 * half_space


def test_a_flat_end_of_another_radius_is_that_of_the_reference() -> None:
    """Contact on a coarse condensed body against elements alone, taken to their limit by the order found finely."""
    coarse, fine = (punch.stiffness(15e-3, cells) for cells in (2, 3))
    limit = fine - (coarse - fine) / (1.5**2.5 - 1.0)
    assert flat_end(punch.SIDE / 12, radius=15e-3) == pytest.approx(limit, rel=0.05)


@nightly
def test_lattices_are_as_far_from_the_solid_as_is_said() -> None:
    rows = lattice_rows([0.45])
    assert len(rows) == 4
    for row in rows:
        assert abs(row["deviation"]) < row["tolerance"], row["name"]


def test_what_is_compared_is_what_lattices_do(body: Body) -> None:
    """Its compliance, put together in Python, beside the core's own contact."""
    at = ([0.02, 0.02, 0.02], 60e-3, 5e-4)
    one = linearized_mass_spring(body).indent(*at)
    two = body.mass_spring(1e-3, rayleigh_alpha=20.0, rayleigh_beta=2e-3).indent(*at)
    assert two.force[2] == pytest.approx(one.force[2], rel=0.03)
    assert two.displacement == pytest.approx(one.displacement, abs=0.03 * 5e-4)


@pytest.mark.parametrize("name", ["compliance", "modal", "standard linear solid"])
def test_no_closed_path_gives_energy_out(body: Body, name: str) -> None:
    """The ten-thousandth part of what is exchanged is what the finest steps of time leave; from rest to clear of it."""
    kind = {
        "compliance": lambda _period: body,
        "modal": body.modal,
        "standard linear solid": lambda period: body.viscoelastic(
            period, instantaneous_ratio=2.5, retardation_time="0.1 s"
        ),
    }[name]
    assert energy_out(kind, PATHS, piecewise_constant=name != "compliance", again=5) < 1e-4  # type: ignore[operator]


class _Late(Body):
    """A body whose force comes fifty ticks late: it gives energy."""

    def simulate_path(self, *arguments: object, **options: object) -> ContactHistory:
        found = super().simulate_path(*arguments, **options)  # type: ignore[arg-type]
        return found._replace(force=np.concatenate([np.zeros((50, 3)), found.force[:-50]]))


def test_a_body_that_gives_energy_is_found_out(body: Body) -> None:
    assert energy_out(lambda _period: _Late(body.contents), 20, piecewise_constant=True, finest=2000, again=5) > 1e-2
