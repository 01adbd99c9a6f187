"""Page of the performance of a loop."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate.metrics.device_performance import DeviceMeasures
from palpate.metrics.performance import DirectionalPerformance, Performance
from palpate.plotting.style import COLORS, FAINT, INK, TITLE, new_figure
from palpate.report.html import Page

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def performance_page(p: Performance) -> Page:
    """Return the page of a loop's performance."""
    page = Page(
        f"Performance: {p.title}", "Rendered impedance of the sampled loop, linearized at the start of the run."
    )
    good = p.ripple is not None and not p.ripple.perceptible
    page.verdict(p.remark, "good" if good else "note")
    first = p.along[0]
    page.facts(
        [
            ("stiffness at rest", _stiffness(first.static_stiffness)),
            ("transparent to within 23 % up to", _hertz(first.transparency_bandwidth)),
            ("force bandwidth", _hertz(first.bandwidth)),
        ]
    )
    page.figure(
        stiffness_figure(p),
        "Dynamic stiffness |jωZ|: rendered by the loop, desired (dashed), and of the device without object (dotted), "
        "which is that of its mass at high frequency.",
        label="magnitude of the dynamic stiffness over frequency",
    )
    if p.ripple is not None:
        page.figure(
            ripple_figure(p),
            "Ripple of the tip in the half second of contact with the least ripple, and the detection threshold of a "
            "fingertip (Verrillo 1963: constant to 40 Hz, falling by 12 dB per octave to 0.1 µm at 250 Hz).",
            label="spectrum of the tip's ripple and the detection threshold",
        )
    bandwidth = "command to hand" if p.topology == "impedance_display" else "reference to object"
    page.table(
        ("along", "stiffness at rest", "stiffness, 0.5 to 8 Hz", "transparent up to", "rate-hardness",
         "force bandwidth", "static error"),
        [
            (_direction(a), a.static_stiffness, f"{a.band_stiffness[0]:.4g} to {a.band_stiffness[1]:.4g}",
             _hertz(a.transparency_bandwidth), None if math.isnan(a.rate_hardness) else a.rate_hardness,
             _hertz(a.bandwidth), 100.0 * a.precision if math.isfinite(a.precision) else None)
            for a in p.along
        ],
        f"Performance along each direction of the object's stiffness. Rate-hardness: mean force rate in the first "
        f"10 ms of a contact over the speed at contact (after Lawrence et al. 1996). Bandwidth: −3 dB, {bandwidth}; "
        f"that of the zero-order hold alone is {p.hold_bandwidth:.4g} Hz.",
        units=("", "N/m", "N/m", "", "N/m", "", "%"),
    )  # fmt: skip
    page.table(
        ("measure of the device", "least", "largest"),
        _device_rows(p.device),
        "Measures of the device at this pose, after Hayward & Astley (1996), over the principal axes of the tip's "
        "inertia; from its file, without the loop.",
    )
    if p.assumption:
        page.paragraph(p.assumption)
    page.paragraph(
        "The just-noticeable difference of stiffness is about 23 % (Jones & Hunter 1990). The rendered impedance "
        "includes the device's mass and friction, and the controller if it tracks force."
    )
    return page


def _device_rows(m: DeviceMeasures) -> list[tuple[str, float | str | None, float | str | None]]:
    """Return the measures of a device; a single number stands under "least"."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    pairs = (
        ("peak force [N]", m.peak_force),
        ("continuous force [N]", m.continuous_force),
        ("peak acceleration [m/s²]", m.peak_acceleration),
        ("apparent mass [kg]", m.tip_mass),
        ("force that moves a joint [N]", m.moving_force),
    )
    singles = (
        ("kinematic isotropy", m.kinematic_isotropy),
        ("inertial isotropy", m.inertial_isotropy),
        ("dynamic range [dB]", m.dynamic_range),
        ("resolution [µm]", 1e6 * m.resolution),
    )
    rows: list[tuple[str, float | str | None, float | str | None]] = [
        (name, finite(low), finite(high)) for name, (low, high) in pairs
    ]
    return rows + [(name, finite(value), None) for name, value in singles]


def stiffness_figure(p: Performance) -> Figure:
    """Return |jwZ| over frequency, with one panel per direction."""
    figure, rows = new_figure(1, len(p.along), width=9.0 if len(p.along) > 1 else 7.0, height=3.4, sharey=True)
    for panel, a in zip(rows[0], p.along, strict=True):
        panel.loglog(a.frequency, np.abs(a.rendered) / 1e3, color=COLORS[0], label="rendered")
        panel.loglog(
            a.frequency, np.abs(a.desired) / 1e3, color=INK, linestyle=(0, (4, 3)), linewidth=1.1, label="desired"
        )
        panel.loglog(a.frequency, np.abs(a.free) / 1e3, color=COLORS[1], linestyle=":", label="free device")
        panel.set_title(f"along {_direction(a)}", **TITLE)
        panel.set_xlabel("frequency [Hz]")
    rows[0][0].set_ylabel("dynamic stiffness [N/mm]")
    handles, labels = rows[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def ripple_figure(p: Performance) -> Figure:
    """Return the spectrum of the ripple and the detection threshold."""
    figure, rows = new_figure(1, 1, width=7.0, height=3.2)
    panel, ripple = rows[0][0], p.ripple
    assert ripple is not None
    floor = 1e-5 * float(ripple.threshold.min())
    amplitude = 1e6 * np.maximum(ripple.amplitude, floor)
    panel.loglog(ripple.frequency, amplitude, color=COLORS[0], label="ripple of the tip")
    threshold = 1e6 * ripple.threshold
    panel.loglog(ripple.frequency, threshold, color=INK, linestyle=(0, (4, 3)), label="detection threshold")
    panel.axvline(ripple.worst, color=FAINT, linewidth=0.8, label="most perceptible")
    ticks = [f for f in (20, 50, 100, 200, 500, 1000, 2000, 5000) if f <= ripple.frequency[-1] * 1.01]
    panel.set_xticks(ticks, labels=[str(f) for f in ticks])
    panel.minorticks_off()
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("amplitude [µm]")
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _direction(a: DirectionalPerformance) -> str:
    for axis, name in enumerate("xyz"):
        if abs(abs(a.direction[axis]) - 1) < 1e-9:
            return name
    return "(" + ", ".join(f"{part:.2f}" for part in a.direction).replace("-", "−") + ")"


def _stiffness(value: float) -> str:
    return "infinite" if math.isinf(value) else f"{value / 1e3:.4g} N/mm"


def _hertz(value: float) -> str:
    return "above the Nyquist frequency" if math.isinf(value) else f"{value:.3g} Hz"
