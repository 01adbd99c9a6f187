"""Programs of the examples and the documentation, run in the test's process: the imports are paid once."""

from __future__ import annotations

import socket
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest


def _offline(*_: Any) -> None:
    raise OSError("examples and code blocks of the documentation must not use the network")


def run_program(code: str, name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a program as a script in `folder`, without a network; `name` is its file in tracebacks."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setattr(sys, "argv", [name])
    monkeypatch.setattr(socket.socket, "connect", _offline)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exec(compile(code, name, "exec"), {"__name__": "__main__", "__file__": name})
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
