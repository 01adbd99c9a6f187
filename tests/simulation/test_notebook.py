"""What a notebook shows of results: tables, and plots without palpate.plotting."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from typing import Any

import matplotlib as mpl
import numpy as np
import palpate
import pytest
from palpate.simulation.trace import Trace
from palpate.stability import certify, zwidth

mpl.use("Agg")

WALL: dict[str, Any] = {
    "title": "a <wall>",
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display", "period": "1 ms"},
    "operator": {"kind": "force", "force": ["-1 N", "0 N", "0 N"]},
    "object": {"kind": "wall", "stiffness": "90 N/m", "normal": [1, 0, 0]},
    "run": {"duration": "0.1 s"},
}


class Text(HTMLParser):
    """Collects the text of a page and checks that its tags are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.words, self.open = "", list[str]()

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data + " "


def shown(result: Any) -> str:
    page = Text()
    page.feed(result._repr_html_())
    assert not page.open
    return page.words


def test_a_trace_draws_a_channel() -> None:
    trace = palpate.simulate(WALL)
    ax = trace.plot("object_force")
    assert ax.get_ylabel() == "object force [N]"
    assert [line.get_label() for line in ax.get_lines()] == ["x"]  # y and z stay zero
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), trace["object_force"][:, 0])
    assert trace.plot(ax=ax) is ax
    assert len(ax.get_lines()) == 2
    assert trace.plot("touching").get_ylabel() == "touching"
    with pytest.raises(KeyError, match="no channel 'force'"):
        trace.plot("force")


def test_a_trace_is_a_table() -> None:
    words = shown(palpate.simulate(WALL))
    for text in ("a <wall>", "101 samples to 0.1 s, ran to its end", "object_force", "force of the tip on the object"):
        assert text in words
    assert "diverged at 0.5 s" in shown(Trace.of([0.0, 0.1], {"angle": [0.0, 1.0]}, unstable_from=0.5))
    assert "0 samples" in shown(Trace.of([], {"angle": np.zeros((0, 1))}))


def test_a_certificate_and_a_zwidth_are_tables() -> None:
    certificate = certify(WALL)
    words = shown(certificate)
    assert certificate.claim in words
    assert "spectral radius" in words
    found = zwidth(WALL, simulated=False)
    assert "nobody holds it" in shown(found)
    ax = found.plot()
    assert ax.get_lines()[-1].get_ydata()[0] == pytest.approx(0.09)
    assert found.plot(ax) is ax


def test_a_plot_needs_no_plotting_package() -> None:
    code = (
        "import sys, matplotlib; matplotlib.use('Agg'); from palpate.simulation import Trace\n"
        "Trace.of([0.0, 1.0], {'tip': [[0.0, 1.0, 2.0]] * 2}).plot('tip')\n"
        "assert not [name for name in sys.modules if name.startswith('palpate.plotting')]"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
