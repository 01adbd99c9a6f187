"""`palpate performance`: rendering performance of a scenario's loop."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from palpate.cli.console import OutFolder, ScenarioFile, output, print_columns, print_paths, progress
from palpate.cli.settings import Settings, load_scenario
from palpate.files import default_name, write_folder

if TYPE_CHECKING:
    from palpate.arrays import Array
    from palpate.metrics import DeviceMeasures, GuardComparison
    from palpate.stability import AdmittanceCoupling, ImpedanceCoupling

    Couplings = tuple[tuple[Array, ImpedanceCoupling, AdmittanceCoupling], ...]

GuardsFlag = Annotated[
    bool,
    typer.Option("--guards", help="Compare the guards on a wall of the scenario's device instead; writes guards.json."),
]


def performance(
    scenario: ScenarioFile, out: OutFolder = None, settings: Settings = None, guards: GuardsFlag = False
) -> None:
    """Measure a loop's performance: impedance, stiffness, rate hardness, force bandwidth, precision and ripple.

    Writes performance.html and performance.json.

    Example: palpate performance scenarios/arm-through-tissue-on-a-wall.toml
    """
    if guards:
        return _guards(scenario, out, settings)
    with progress("reading the scenario") as tell:
        from palpate.metrics import measure_performance
        from palpate.report import performance_page

        loaded = load_scenario(scenario, settings)
        found = measure_performance(loaded, progress=tell)
        tell("drawing", 0.9)
        page = performance_page(found)
        folder = out if out is not None else Path("results") / default_name(scenario)
        paths = write_folder(folder, {"performance.html": page.save, "performance.json": found.save})
    output.print(f"[bold]{escape(loaded.title)}[/]")
    output.print(f"  {_device(found.device)}", markup=False, soft_wrap=True)
    for one in found.along:
        where = ", ".join(f"{part:.3g}" for part in one.direction)
        stiffness, transparent = one.static_stiffness, one.transparency_bandwidth
        parts = [
            "infinite stiffness at rest (an integrator admits no steady deflection)"
            if math.isinf(stiffness)
            else f"stiffness at rest {stiffness:.4g} N/m",
            f"transparent to within 23 % up to {transparent:.3g} Hz"
            if transparent
            else "not transparent to within 23 % at 0.1 Hz",
            *([] if math.isnan(one.rate_hardness) else [f"rate-hardness {one.rate_hardness:.4g} N/m"]),
            "force bandwidth above half the sampling rate"
            if math.isinf(one.bandwidth)
            else f"force bandwidth {one.bandwidth:.3g} Hz",
            *([] if math.isnan(one.precision) else [f"static error {100 * one.precision:.3g} %"]),
        ]
        output.print(f"  along ({where}): {'; '.join(parts)}", markup=False, soft_wrap=True)
    for sentence in (found.assumption, found.remark):
        if sentence:
            output.print(f"  {sentence}", markup=False, soft_wrap=True)
    print_paths(paths)


def _guards(scenario: Path, out: Path | None, settings: list[str] | None) -> None:
    """Compare the guards on one axis of the device of a scenario."""
    with progress("reading the scenario") as tell:
        from palpate.errors import StabilityError
        from palpate.metrics import compare_guards
        from palpate.stability import design_couplings

        loaded = load_scenario(scenario, settings)
        device, start = loaded.load_device(), loaded.start
        pose = device.inverse(start.tip) if start.tip is not None else start.pose
        with loaded.naming_place():
            if loaded.servo.jitter > 0.0:
                raise StabilityError("servo.jitter: the comparison takes no late ticks; remove it")
            found = compare_guards(
                device, pose, loaded.object.normal, period=loaded.period, delay=loaded.device.delay, progress=tell
            )
            couplings = design_couplings(device, pose, period=loaded.period)
        folder = out if out is not None else Path("results") / default_name(scenario)
        paths = write_folder(folder, {"guards.json": found.save})
    axis = found.axis
    output.print(
        f"{found.device}: m = {1e3 * axis.mass:.3g} g, b = {axis.damping:.3g} N s/m, {axis.coulomb:.3g} N of dry "
        f"friction, counts of {1e6 * axis.count:.3g} µm, T = {1e3 * found.period:.3g} ms; walls of "
        f"{found.stiffnesses[0]:g} to {found.stiffnesses[-1]:g} N/m",
        markup=False,
        soft_wrap=True,
    )
    print_columns(_guard_rows(found))
    output.print(
        "  wall: the largest up to which the tip rests and 90 % is felt; felt: share of its stiffness; step: largest "
        "change of the force in one tick; swing: of the tip on the stiffest wall. Passivity does not make the tip "
        "rest.",
        markup=False,
        soft_wrap=True,
    )
    output.print("virtual couplings (Adams & Hannaford 1999), without delay:")
    print_columns(_coupling_rows(couplings))
    output.print(
        "  impedance display: stiffest coupling; admittance display: least mass of the tool. By the two-port (for the "
        "latter, of a tip that does not know the force), and exactly (for the latter, in rigid grips).",
        markup=False,
        soft_wrap=True,
    )
    print_paths(paths)


def _guard_rows(found: GuardComparison) -> list[list[str]]:
    """Return the table of the guards, its header first."""
    rows = [["guard", "wall", "felt", "step", "swing", "passive for"]]
    for row in found.rows:
        none = row.stiffness == 0.0
        shown = ["none", "–", "–"] if none else [f"{row.stiffness:g} N/m", f"{row.felt:.0%}", f"{row.jump:.3g} N"]
        swing = "diverges" if math.isinf(row.swing) else _length(row.swing)
        rows.append([row.name, *shown, swing, row.guarantee])
    return rows


def _coupling_rows(couplings: Couplings) -> list[list[str]]:
    """Return the table of the virtual couplings, its header first."""
    rows = [["axis", "impedance, two-port", "exactly", "admittance, two-port", "exactly"]]
    for along, stiff, light in couplings:
        rows.append(
            [
                "xyz"[int(along.argmax())],
                f"{stiff.stiffness:.5g} N/m with {stiff.damping:.3g} N s/m",
                f"{stiff.exact:.5g} N/m",
                f"{light.mass:.3g} kg",
                f"{light.exact:.3g} kg",
            ]
        )
    return rows


def _length(value: float) -> str:
    return f"{1e3 * value:.3g} mm" if value >= 1e-3 else f"{1e6 * value:.3g} µm"


def _device(m: DeviceMeasures) -> str:
    """Return the measures of the device in one line; pairs are the least and the largest over the directions."""
    limits = [
        f"{name} {values[0]:.3g} to {values[1]:.3g} {unit}"
        for name, values, unit in (
            ("peak force", m.peak_force, "N"),
            ("peak acceleration", m.peak_acceleration, "m/s^2"),
            ("tip mass", tuple(1e3 * mass for mass in m.tip_mass), "g"),
        )
        if math.isfinite(values[1])
    ]
    parts = [*limits, f"isotropy {m.kinematic_isotropy:.2g} (Jacobian), {m.inertial_isotropy:.2g} (inertia)"]
    if math.isfinite(m.dynamic_range):
        parts.append(f"dynamic range {m.dynamic_range:.3g} dB")
    if m.resolution:
        parts.append(f"resolution {1e6 * m.resolution:.3g} µm")
    return f"device: {', '.join(parts)}"
