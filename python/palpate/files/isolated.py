"""Programs that run in a process of their own, because a library may crash, hang or exhaust the memory."""

from __future__ import annotations

import os
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
    resource.setrlimit(resource.RLIMIT_AS, ({memory}, {memory}))
except (ImportError, ValueError, OSError):
    pass
"""


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
    limit = "" if memory is None else _LIMIT.format(memory=memory)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    with TemporaryDirectory() as folder:
        np.savez(Path(folder) / "inputs.npz", **inputs)
        try:
            done = subprocess.run(
                [sys.executable, "-c", limit + program],
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
        if done.returncode < 0:
            raise IsolatedError(f"the process was killed by signal {-done.returncode}")
        result = Path(folder) / "result.npz"
        if done.returncode != 0 or not result.is_file():
            lines = [*done.stdout.strip().splitlines(), *done.stderr.strip().splitlines()]
            raise IsolatedError((lines or ["no message"])[-1][:300])
        with np.load(result) as arrays:
            return dict(arrays)
