"""`palpate identify`: inertia, gravity and friction of a device, from a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.console import output, print_paths, progress


def identify(
    recording: Annotated[
        Path, typer.Argument(help="Recording: .csv with a header 'time [s], theta1 [rad], …, tau1 [N*m], …', or .h5.")
    ],
    device: Annotated[
        str,
        typer.Option("--device", "-d", help="Catalog name, or a TOML file: mechanism, lengths, values to compare."),
    ] = "phantom-premium-1.5a",
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for identification.json.")] = None,
    write: Annotated[
        Path | None, typer.Option("--write", "-w", help="Device file (TOML) to write with the identified parameters.")
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Make the recording first: an experiment on the simulated device.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the noise, with --simulate.")] = 0,
) -> None:
    """Identify a device from recorded angles and torques, with confidence intervals and a test on data not used.

    No recording of a real PHANToM is public. With --simulate, write one of the nonlinear device to the given path
    instead: 20 s at 1 kHz, with encoder counts and noise.

    With --write, a scenario can name the identified device: name = "device.toml".

    Example: palpate identify --simulate recording.csv, then palpate identify recording.csv --write device.toml
    """
    with progress("reading") as tell:
        from palpate.identification import identify_recording, simulate_experiment

        if simulate:
            from palpate.devices import load

            tell("20 s of experiment", 0.1)
            path = simulate_experiment(load(device), seed=seed).save(recording)
        else:
            result = identify_recording(recording, device, out, write=write, progress=lambda text: tell(text, 0.5))
    if simulate:
        said = f"wrote {path}: 20 s of {device}, simulated with encoder counts and noise, seed {seed}"
        output.print(said, markup=False, soft_wrap=True)
        return
    output.print(result["summary"], markup=False, soft_wrap=True)
    print_paths(path for path in (out and out / "identification.json", write) if path)
