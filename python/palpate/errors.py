"""Exceptions and warnings of palpate; messages state the problem, its place and the remedy."""

from __future__ import annotations

import unicodedata


def printable(text: str) -> str:
    """Return text with its control characters escaped, so that a terminal shows and does not obey them.

    Line feeds and tabs remain. Besides the control characters (Cc), the escaped are those that reorder or hide text
    (Cf), line separators and unpaired surrogates.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_escaped(char) for char in text)


def shorten(text: str, most: int = 600) -> str:
    """Return text of at most `most` characters; a longer one loses its middle."""
    return text if len(text) <= most else f"{text[: most // 2]} … {text[-most // 2 :]}"


def _escaped(char: str) -> str:
    if char in "\n\t" or unicodedata.category(char) not in ("Cc", "Cf", "Cs", "Zl", "Zp"):
        return char
    return char.encode("unicode_escape").decode("ascii")


class PalpateError(ValueError):
    """Base of every error that palpate raises on purpose; the text shows control characters escaped."""

    def __str__(self) -> str:
        return printable(super().__str__())


class ScenarioError(PalpateError):
    """A scenario file has an unknown key, a wrong dimension, a missing or an impossible value."""


class DeviceError(PalpateError):
    """A device file or a device parameter is wrong (unknown name, negative mass, missing unit)."""


class PoseError(PalpateError):
    """A pose or a tip position is out of reach, singular, not finite, or has the wrong shape."""


class RecordingError(PalpateError):
    """A recording has gaps, repeated time stamps, non-finite samples or too little excitation."""


class DesignError(PalpateError):
    """A controller with the stated specification does not exist for this plant."""


class StabilityError(PalpateError):
    """A loop cannot be tested as described: a negative delay, a rate of zero, a controller that is not causal."""


class OutputError(PalpateError):
    """A file or folder cannot be written: no permission, a full disk, a folder where a file should be."""


class PalpateWarning(UserWarning):
    """Base of every warning of palpate: execution continues, but the input is probably not as intended."""
