"""Programs that run in a process of their own, because a library may crash, hang or exhaust the memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_LIMIT: Final = """
try:
    import resource
    resource.setrlimit(resource.RLIMIT_{name}, ({most}, resource.getrlimit(resource.RLIMIT_{name})[1]))
except (ImportError, ValueError, OSError):
    pass
"""
_OUT_OF_TIME: Final = [-signal.SIGXCPU] if hasattr(signal, "SIGXCPU") else []


class IsolatedError(Exception):
    """A program failed, was killed or took too long; the text is a reason in words."""


def run_isolated(
    program: str, inputs: dict[str, Any], *, seconds: float | None = None, memory: int | None = None
) -> dict[str, NDArray[Any]]:
    """Run a program of Python in a temporary folder and return the arrays that it makes.

    Args:
        program: reads `inputs.npz` and writes `result.npz`.
        inputs: arrays, numbers and texts by name.
        seconds: time after which the program is killed; None for any.
        memory: address space of the program, bytes; None for any.

    Raises:
        IsolatedError: the program ended with an exception, was killed or took too long.
    """
    limit = "" if memory is None else _LIMIT.format(name="AS", most=memory)
    with TemporaryDirectory() as folder:
        np.savez(Path(folder) / "inputs.npz", **inputs)
        said = _run([limit + program], folder, seconds)
        result = Path(folder) / "result.npz"
        if not result.is_file():
            raise IsolatedError(said)
        with np.load(result) as arrays:
            return dict(arrays)


def try_isolated(program: str, argument: str, *, seconds: int, memory: int) -> None:
    """Run a program of Python with a text as `sys.argv[1]`.

    Args:
        program: uses what the caller is going to use.
        argument: text for it.
        seconds: time of computing after which the program is killed; eight times as long on the clock.
        memory: address space of the program, bytes.

    Raises:
        IsolatedError: as `run_isolated`.
    """
    limits = _LIMIT.format(name="AS", most=memory) + _LIMIT.format(name="CPU", most=seconds)
    _run([limits + program, argument], None, 8.0 * seconds)


def _run(words: list[str], folder: str | None, seconds: float | None) -> str:
    """Run a program and return the last line of its output. Raise IsolatedError."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    try:
        done = subprocess.run(
            [sys.executable, "-c", *words],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise IsolatedError(f"it did not end within {seconds:g} s") from None
    except OSError as problem:
        raise IsolatedError(f"no process can be started: {problem.strerror}") from None
    if done.returncode in _OUT_OF_TIME:
        raise IsolatedError("it took too long")
    if done.returncode < 0:
        raise IsolatedError(f"the process was killed by signal {-done.returncode}")
    lines = [*done.stdout.strip().splitlines(), *done.stderr.strip().splitlines()]
    said = (lines or ["no message"])[-1][:300]
    if done.returncode != 0:
        raise IsolatedError(said)
    return said
