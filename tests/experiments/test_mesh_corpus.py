"""Many surfaces: each is filled and pressed plausibly, or refused within 5 s with the reason."""

from __future__ import annotations

import pytest
from nightly import NIGHTLY

pytest.importorskip("trimesh")

from experiments.mesh_corpus.press import press
from experiments.mesh_corpus.shapes import SHAPES

REFUSED = {
    "plate, 80 x 80 x 0.5 mm": "too thin for a spacing",
    "two parts, one above": "1 of the 2 parts of the surface has no fixed place",
    "open bowl": "edges at a border",
    "Moebius band": "edges at a border",
    "no volume": "encloses no volume",
}
UNTOUCHED = {"cone": "no node is in contact"}  # its tip is smaller than a cell, whose points lie beside it
FEW = ("organ", "intersecting spheres", "sphere with cavity", "sheet on three-triangle edge", *REFUSED)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SHAPES if NIGHTLY else FEW)
def test_a_surface_is_pressed_plausibly_or_refused_at_once(name: str) -> None:
    found = press(SHAPES[name]())
    if name in REFUSED:
        assert REFUSED[name] in found.refusal
        assert found.seconds < 5.0
        return
    assert found.refusal == ""
    assert found.angle > 9.9
    assert not abs(found.volume_error) > 0.06  # or not known, of intersecting parts
    if name in UNTOUCHED:
        assert any(UNTOUCHED[name] in text for text in found.warnings)
        return
    assert 0.0 < found.force < 2.0 * found.hertz  # the thinnest plate, 6 mm on its base, has 1.7


def test_defects_that_repair_removes_leave_the_body_as_it_is() -> None:
    whole = press(SHAPES["sphere"]()).force
    for name in ("mixed orientation, repeated", "soup with rounding errors"):
        assert press(SHAPES[name]()).force == pytest.approx(whole, rel=0.01)
