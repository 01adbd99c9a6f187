"""Ctrl-C and SIGTERM that are never lost.

Some libraries catch any exception of an import (trimesh: `except BaseException`), and so a KeyboardInterrupt in it.
Python itself drops one during the release of an import lock, and prints and drops one in a finalizer or a weak
reference's callback. The interrupt therefore waits until no import and no HDF5 output runs, and one that Python dropped
is raised again. Compiled code that converts an argument may replace it by another exception, such as a TypeError.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

import typer

_AGAIN: Final = 0.02  # s
_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
_HELD: Final = ("<frozen importlib", "hdf5_output.py")  # files of code that an exception must not leave


@contextmanager
def control_c() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM raise KeyboardInterrupt within the block.

    Raises:
        KeyboardInterrupt: at the end of the block also for a signal that a library dropped or replaced.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    dropped = False  # whether a signal came whose exception has not left the block

    def heard(_number: int, frame: FrameType | None) -> None:
        nonlocal dropped
        dropped = True
        if _held(frame):
            _raise_later()
        else:
            raise KeyboardInterrupt

    with _handlers(heard), _unraisable():
        try:
            yield
        except typer.Exit:
            raise
        except Exception:
            if dropped:
                raise KeyboardInterrupt from None
            raise
    if dropped:
        raise KeyboardInterrupt


@contextmanager
def _handlers(heard: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Handle the signals that are not ignored (SIGINT is under nohup), and the timer."""
    numbers = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    if hasattr(signal, "SIGALRM"):
        numbers.append(signal.SIGALRM)
    before = {number: signal.signal(number, heard) for number in numbers}
    try:
        yield
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _unraisable() -> Iterator[None]:
    """Raise again an interrupt that Python drops in a finalizer or callback, without its traceback."""
    before = sys.unraisablehook

    def hook(dropped: sys.UnraisableHookArgs) -> None:
        if dropped.exc_type is not None and issubclass(dropped.exc_type, KeyboardInterrupt):
            _raise_later()
        else:
            before(dropped)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _raise_later() -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)


def _held(frame: FrameType | None) -> bool:
    while frame is not None:
        file = frame.f_code.co_filename
        if file.startswith(_HELD[0]) or file.endswith(_HELD[1]):
            return True
        frame = frame.f_back
    return False
