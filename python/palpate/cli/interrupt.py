"""Ctrl-C that takes effect after imports.

Some libraries catch any exception of an import (trimesh: `except BaseException`), and so a KeyboardInterrupt in it.
Python itself drops one during the release of an import lock. The interrupt therefore waits until no import is running.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_AGAIN: Final = 0.02  # s


@contextmanager
def control_c() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt within the block, after an import that is running."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return

    def heard(_number: int, frame: FrameType | None) -> None:
        if _importing(frame) and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            raise KeyboardInterrupt

    heeded = [signal.SIGINT, *([signal.SIGALRM] if hasattr(signal, "setitimer") else [])]
    before = {number: signal.signal(number, heard) for number in heeded}
    try:
        yield
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
