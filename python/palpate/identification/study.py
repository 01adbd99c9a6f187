"""Identification of a device from a recording, as `palpate identify` does it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from palpate.devices import Device, load
from palpate.errors import PalpateError, RecordingError
from palpate.files import write_json
from palpate.identification.arx_models import arx
from palpate.identification.base import true_values
from palpate.identification.order import OrderTable, Structure, select_order
from palpate.identification.parameters import ParameterFit, estimate_parameters, summary_rows
from palpate.identification.recording import Recording
from palpate.identification.residuals import independence, whiteness
from palpate.identification.servo import torque_response
from palpate.identification.weak_form import smooth

USED = 0.7  # fraction of the recording for the fit; the rest is for validation
ARX_RATE = 100.0  # Hz, maximum; at higher rates two samples differ by less than a count of the encoder
SPEEDS = 0.025  # s, window from which the speed at the start of the free run is taken


def identify_recording(
    path: str | os.PathLike[str] | Recording,
    device: str | Device,
    out: str | os.PathLike[str] | None = None,
    *,
    coulomb: bool = True,
    write: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Identify the parameters of a device from a recording, and an ARX model.

    Args:
        path: CSV or HDF5 file (see `Recording.load`), or a recording.
        device: catalog name, path of a device file, or a device; gives mechanism, lengths and catalog values.
        out: folder for `identification.json`, which is written atomically.
        coulomb: estimate Coulomb friction too.
        write: device file for the identified device, as `ParameterFit.save` writes it.
        progress: called with a description before each step.

    Returns:
        A dictionary for JSON. "parameters" has a row each, with its 95 % interval and the catalog's value. "free_run"
        has the NRMSE in percent per joint on validation data. Its entry "device" is the device with the fitted
        parameters, driven by the torques; its entry "arx" is the ARX model. "arx" has orders, coefficients with
        standard deviations, and residual tests. "summary" is text. The others are "recording" and "excitation".

    Raises:
        RecordingError: the recording is invalid or too short, or has too little excitation.
        DeviceError: the device is unknown or its file is wrong; or, with `write`, the parameters are those of no
            physical device.
    """
    report, arm = progress or (lambda _: None), load(device)
    recording = path if isinstance(path, Recording) else Recording.load(path)
    try:
        report("estimating inertia, gravity and friction")
        fit = estimate_parameters(recording, arm, coulomb=coulomb)
        used, unused = recording.split(USED)
        report("running the fitted device on data not used")
        run, failure = _device_free_run(arm, used, unused, coulomb)
        report("fitting ARX models")
        arx_part = _arx_part(recording, arm)
    except RecordingError as error:
        if isinstance(path, Recording) or "file" not in recording.metadata:
            raise
        raise RecordingError(f"{path}: {error}") from None
    result: dict[str, Any] = {
        "recording": _about(recording, None if isinstance(path, Recording) else str(path)),
        "device": arm.name,
        "method": fit.method,
        "parameters": summary_rows(fit, true_values(arm, fit.parameters)),
        "torque_error_percent": fit.torque_error.tolist(),
        "excitation": {"condition": fit.condition, "undetermined": fit.undetermined},
        "doubts": list(fit.doubts),
        "free_run": {"device": run, "device_failed": failure, "arx": arx_part["free_run"], "used": USED},
        "arx": arx_part,
    }
    result["summary"] = _summary(result, fit)
    if out is not None:
        _write(result, Path(out))
    if write is not None:
        fit.save(write)
    return result


def _about(recording: Recording, file: str | None) -> dict[str, Any]:
    return {
        "file": file,
        "samples": len(recording),
        "period": recording.period,
        "duration": recording.duration,
        "source": recording.metadata.get("source", "not stated"),
    }


def _device_free_run(
    device: Device, used: Recording, unused: Recording, coulomb: bool
) -> tuple[list[float] | None, str | None]:
    """Return the NRMSE of the free run per joint, percent, or None and the reason."""
    try:
        fitted = estimate_parameters(used, device, coulomb=coulomb).device
        begin = round(SPEEDS / unused.period)
        q, qd = smooth(unused.angle, unused.period, SPEEDS)
        run = torque_response(fitted, q[begin], qd[begin], unused.torque[begin:], unused.period)
    except PalpateError as error:
        return None, str(error)
    wanted = unused.angle[begin:]
    missed = np.linalg.norm(run - wanted, axis=0) / np.linalg.norm(wanted - wanted.mean(axis=0), axis=0)
    return (100 * (1 - missed)).tolist(), None


def arx_structures(device: Device) -> list[Structure]:
    """Return structures with the coupling of the mass matrix (3.15), of orders two to four."""
    poses = np.random.default_rng(0).uniform(-1.0, 1.0, (20, device.dof)) + device.model.working_pose
    coupled = np.any(np.nan_to_num(device.mass_matrix(poses)) != 0.0, axis=0).astype(int)
    return [(n * coupled, n * coupled, coupled) for n in (2, 3, 4)]


def _arx_part(recording: Recording, device: Device) -> dict[str, Any]:
    coarse = recording.decimate(max(1, round(1 / (ARX_RATE * recording.period))))
    used, unused = coarse.split(USED)
    table: OrderTable = select_order(used, arx_structures(device))
    chosen = table.chosen()
    model = arx(used, chosen.na, chosen.nb, chosen.nk)
    part: dict[str, Any] = {
        "period": model.period,
        "na": model.na.tolist(),
        "nb": model.nb.tolist(),
        "nk": model.nk.tolist(),
        "coefficients": model.coefficients(),
        "order_table": str(table),
        "one_step": None,
        "free_run": None,
    }
    try:
        fit = model.fit(unused)
        part["one_step"], part["free_run"] = fit.one_step.tolist(), fit.free_run.tolist()
    except RecordingError as error:
        part["failed"] = str(error)
    error_now = model.residuals(unused)
    lags = min(25, len(error_now) // 8)
    white = [whiteness(e, lags) for e in error_now.T]
    past = unused.torque[model.reach :]
    part["white"] = [{"passed": w.passed, "p_value": w.p_value, "limit": w.limit} for w in white]
    part["independent"] = [
        [bool(independence(error_now[:, k], past[:, j], lags).passed) for j in range(coarse.dof)]
        for k in range(coarse.dof)
    ]
    return part


def _summary(result: dict[str, Any], fit: ParameterFit) -> str:
    about = result["recording"]
    lines = [
        f"{result['device']}: {about['duration']:g} s, {about['samples']} samples; source: {about['source']}",
        "",
        f"{'':5}{'value':>12}  {'95 % interval':>26}{'catalog':>13}  unit",
    ]
    for row in result["parameters"]:
        interval = f"{row['low']:.4g} … {row['high']:.4g}"
        mark = "" if row["determined"] else "  not determined by this recording"
        lines.append(
            f"{row['name']:5}{row['value']:>12.4g}  {interval:>26}{row['catalog']:>13.4g}  {row['unit']}, "
            f"{row['meaning']}{mark}"
        )
    outside = [row["name"] for row in result["parameters"] if not row["inside"]]
    names = ", ".join(outside) if outside else "none"
    lines += ["", f"Parameters whose interval does not hold the catalog's value: {names}."]
    if fit.undetermined:
        lines.append(f"Too little excitation for {', '.join(fit.undetermined)}: move more, or at more poses.")
    lines += [f"Doubt: {doubt}" for doubt in fit.doubts]
    left = ", ".join(f"{share:.2g} %" for share in fit.torque_error)
    lines.append(f"Torque that the fit leaves unexplained, per joint: {left}.")
    runs = result["free_run"]
    lines.append(f"Free run on the last {100 * (1 - USED):.0f} %, not used for the fit, NRMSE per joint:")
    for name, key in (("fitted device", "device"), ("ARX", "arx")):
        values = runs[key]
        why = runs["device_failed"] if key == "device" else result["arx"].get("failed")
        lines.append(f"  {name:14}" + (", ".join(f"{v:.1f} %" for v in values) if values else f"none: {why}"))
    white = ["yes" if w["passed"] else "no" for w in result["arx"]["white"]]
    free = ["yes" if all(row) else "no" for row in result["arx"]["independent"]]
    lines.append(f"ARX residuals per joint: white {', '.join(white)}; independent of the torques {', '.join(free)}.")
    return "\n".join(lines)


def _write(result: dict[str, Any], folder: Path) -> None:
    write_json(folder / "identification.json", result, indent=2)
