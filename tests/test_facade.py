"""The package itself: names that are imported when they are first used, its version, and where a command begins."""

from __future__ import annotations

import importlib
import importlib.metadata
import runpy
import signal
import subprocess
import sys
from typing import Any

import palpate
import pytest
from palpate import __main__ as beginning


def test_every_public_name_is_that_of_its_module() -> None:
    assert dir(palpate) == sorted(palpate.__all__)
    for name, module in palpate._LAZY_ATTRIBUTES.items():
        assert getattr(palpate, name) is getattr(sys.modules.get(module) or importlib.import_module(module), name)
        assert palpate.__getattr__(name) is getattr(palpate, name)
    for name in palpate._SUBPACKAGES:
        assert palpate.__getattr__(name) is importlib.import_module(f"palpate.{name}")
    for name in ("nothing", "cli", "_private"):
        with pytest.raises(AttributeError, match=f"^module 'palpate' has no attribute '{name}'$"):
            palpate.__getattr__(name)


def test_the_version_is_that_of_the_installed_package(monkeypatch: pytest.MonkeyPatch) -> None:
    assert palpate.__version__ == importlib.metadata.version("palpate")

    def missing(_: str) -> str:
        raise importlib.metadata.PackageNotFoundError

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert palpate.__version__ == "unknown"


def test_the_package_imports_no_typing() -> None:
    """Its import takes longer than the rest, and an interrupt during it would end in a traceback."""
    code = "import sys; before = set(sys.modules); import palpate; print('typing' in set(sys.modules) - before)"
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=False,
                          env={"PYTHONPATH": str(next(iter(palpate.__path__)) + "/..")})  # fmt: skip
    assert (done.stdout.strip(), done.stderr) == ("False", "")


@pytest.mark.parametrize(
    ("before", "after"),
    [(signal.default_int_handler, signal.SIG_DFL), (signal.SIG_IGN, signal.SIG_IGN)],
)
def test_an_interrupt_ends_a_command_unless_it_is_ignored(
    before: Any, after: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr("palpate.cli.main.main", lambda: seen.append(signal.getsignal(signal.SIGINT)))
    kept = signal.signal(signal.SIGINT, before)
    try:
        beginning.main()
        assert seen == [after]
        runpy.run_module("palpate", run_name="__main__", alter_sys=False)
        assert seen == [after, after]
        runpy.run_module("palpate.__main__", run_name="other")
        assert len(seen) == 2
    finally:
        signal.signal(signal.SIGINT, kept)
