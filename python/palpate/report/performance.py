"""The pictures and tables of a loop's performance, as one HTML file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate.metrics.performance import DirectionalPerformance, Performance
from palpate.plotting.style import COLOURS, FAINT, INK, TITLE, new_figure
from palpate.report.html import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["performance_page", "ripple_figure", "stiffness_figure"]


def performance_page(p: Performance) -> Page:
    """Return the page of a loop's performance."""
    page = Page(f"Performance: {p.title}", "What a hand feels of the loop: exact for the sampled loop, at its start.")
    good = p.ripple is not None and not p.ripple.perceptible
    page.verdict(p.remark, "good" if good else "note")
    first = p.along[0]
    page.facts(
        [
            ("stiffness at rest", _stiffness(first.static_stiffness)),
            ("as wished to within 23 % up to", _hertz(first.transparency_bandwidth)),
            ("force bandwidth", _hertz(first.bandwidth)),
        ]
    )
    page.figure(
        stiffness_figure(p),
        "Force per motion that the hand feels, |jωZ|: of the loop, of the object as wished (dashed), and of the device "
        "without object (dotted), which is its mass at high frequency.",
        label="magnitude of the stiffness felt over frequency",
    )
    if p.ripple is not None:
        page.figure(
            ripple_figure(p),
            "Ripple of the tip in the quietest half second of contact against the least vibration that a fingertip "
            "feels (Verrillo 1963: flat to 40 Hz, 12 dB an octave to 0.1 µm at 250 Hz).",
            label="spectrum of the tip's ripple and the threshold of touch",
        )
    bandwidth = "command to hand" if p.topology == "impedance_display" else "reference to object"
    page.table(
        ("along", "stiffness at rest", "from 0.5 to 8 Hz", "as wished up to", "rate-hardness", "force bandwidth"),
        [
            (_name(a), _stiffness(a.static_stiffness), f"{a.band_stiffness[0]:.4g} to {a.band_stiffness[1]:.4g}",
             _hertz(a.transparency_bandwidth), None if math.isnan(a.rate_hardness) else a.rate_hardness,
             _hertz(a.bandwidth))
            for a in p.along
        ],
        f"Along each direction in which the object is felt. Rate-hardness: mean force rate in the first 10 ms of a "
        f"touch over the speed at contact (after Lawrence et al. 1996). Bandwidth: −3 dB, {bandwidth}; the hold alone "
        f"has {p.hold_bandwidth:.4g} Hz.",
        units=("", "", "N/m", "", "N/m", ""),
    )  # fmt: skip
    page.paragraph(
        "People notice a change of stiffness of about 23 % (Jones & Hunter 1990). The hand feels the device's mass and "
        "friction on top of the object; a controller that tracks force changes what is felt as well."
    )
    return page


def stiffness_figure(p: Performance) -> Figure:
    """Return |jwZ| over frequency, a panel for each direction."""
    figure, rows = new_figure(1, len(p.along), width=9.0 if len(p.along) > 1 else 7.0, height=3.4, sharey=True)
    for panel, a in zip(rows[0], p.along, strict=True):
        panel.loglog(a.frequency, np.abs(a.rendered) / 1e3, color=COLOURS[0], label="rendered")
        panel.loglog(
            a.frequency, np.abs(a.desired) / 1e3, color=INK, linestyle=(0, (4, 3)), linewidth=1.1, label="wished"
        )
        panel.loglog(a.frequency, np.abs(a.free) / 1e3, color=COLOURS[1], linestyle=":", label="device alone")
        panel.set_title(_name(a), **TITLE)
        panel.set_xlabel("frequency [Hz]")
    rows[0][0].set_ylabel("force per motion [N/mm]")
    handles, labels = rows[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def ripple_figure(p: Performance) -> Figure:
    """Return the ripple's spectrum against the threshold."""
    figure, rows = new_figure(1, 1, width=7.0, height=3.2)
    panel, b = rows[0][0], p.ripple
    assert b is not None
    floor = 1e-5 * float(b.threshold.min())
    panel.loglog(b.frequency, 1e6 * np.maximum(b.amplitude, floor), color=COLOURS[0], label="ripple of the tip")
    panel.loglog(b.frequency, 1e6 * b.threshold, color=INK, linestyle=(0, (4, 3)), label="least that is felt")
    panel.axvline(b.worst, color=FAINT, linewidth=0.8, label="most perceptible")
    ticks = [f for f in (20, 50, 100, 200, 500, 1000, 2000, 5000) if f <= b.frequency[-1] * 1.01]
    panel.set_xticks(ticks, labels=[str(f) for f in ticks])
    panel.minorticks_off()
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("amplitude [µm]")
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _name(a: DirectionalPerformance) -> str:
    for axis, name in enumerate("xyz"):
        if abs(abs(a.direction[axis]) - 1) < 1e-9:
            return f"along {name}"
    return "along (" + ", ".join(f"{part:.2f}" for part in a.direction).replace("-", "−") + ")"


def _stiffness(value: float) -> str:
    return "gives way to no force" if math.isinf(value) else f"{value / 1e3:.4g} N/mm"


def _hertz(value: float) -> str:
    return "beyond half the rate" if math.isinf(value) else f"{value:.3g} Hz"
