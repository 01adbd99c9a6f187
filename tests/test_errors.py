"""Texts of errors: shortened in their middle."""

from __future__ import annotations

import pytest
from palpate.errors import shorten


@pytest.mark.parametrize("length", [0, 9, 10, 11, 100])
def test_a_text_keeps_its_ends_and_as_many_characters_as_it_may_have(length: int) -> None:
    text = "".join(chr(ord("a") + k % 26) for k in range(length))
    found = shorten(text, 10)
    assert found == (text if length <= 10 else f"{text[:5]} … {text[-5:]}")
    assert shorten("x" * 600) == "x" * 600
    assert len(shorten("x" * 601)) == 603
