"""Texts of errors: shortened in their middle, without control characters."""

from __future__ import annotations

import pytest
from palpate.errors import printable, shorten


@pytest.mark.parametrize("length", [0, 9, 10, 11, 100])
def test_a_text_keeps_its_ends_and_as_many_characters_as_it_may_have(length: int) -> None:
    text = "".join(chr(ord("a") + k % 26) for k in range(length))
    found = shorten(text, 10)
    assert found == (text if length <= 10 else f"{text[:5]} … {text[-5:]}")
    assert shorten("x" * 600) == "x" * 600
    assert len(shorten("x" * 601)) == 603


def test_only_what_a_terminal_obeys_is_escaped() -> None:
    """Line feeds and tabs stay; letters, spaces and signs of every script too."""
    assert printable("plain") == "plain"
    assert printable("a\tb\nc") == "a\tb\nc"
    assert printable("a\x1b[0m\x7f\r") == "a\\x1b[0m\\x7f\\r"
    assert printable("é… µ Δ 日") == "é… µ Δ 日"
    assert printable("é\u202e\u2028\u2029\ud800") == "é\\u202e\\u2028\\u2029\\ud800"
