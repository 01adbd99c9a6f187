"""Formulas of one variable in scenario files: parsed by a small grammar, never executed as code.

sum     = term { ("+" | "-") term }
term    = factor { ("*" | "/") factor }
factor  = ("+" | "-") factor | power
power   = atom [ "^" factor ]
atom    = number | "x" | "pi" | function "(" sum ")" | "(" sum ")"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from palpate.arrays import Array

__all__ = ["evaluate_formula"]

LONGEST: Final = 500  # characters
DEEPEST: Final = 40  # nested brackets, signs and powers
FUNCTIONS: Final[Mapping[str, Callable[[Array], Array]]] = {
    "abs": np.abs,
    "atan": np.arctan,
    "cos": np.cos,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "sqrt": np.sqrt,
    "tanh": np.tanh,
}
_TOKEN: Final = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z]+)|(\*\*|[-+*/^()]))")


def evaluate_formula(text: str, x: Array) -> Array:
    """Return the values of a formula at every x (n,). They may be infinite or nan.

    Args:
        text: the formula, such as "300 * x + 2e6 * x^3".
        x: values of the variable, (n,).

    Raises:
        ValueError: the formula cannot be parsed; the message says where.
    """
    with np.errstate(all="ignore"):
        return np.broadcast_to(_Parser(text, x).parse(), x.shape).astype(float)


class _Parser:
    """Recursive descent over the tokens of a formula."""

    def __init__(self, text: str, x: Array) -> None:
        if len(text) > LONGEST:
            raise ValueError(f"a formula has at most {LONGEST} characters, not {len(text)}; write a table instead")
        self.x, self.tokens, self.at, self.depth = x, _tokens(text), 0, 0

    def parse(self) -> Array:
        value = self._sum()
        if self._next:
            raise ValueError(f'"{self._next}" after the end of the formula; an operator is missing before it')
        return value

    @property
    def _next(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def _take(self) -> str:
        token = self._next
        self.at += 1
        return token

    def _sum(self) -> Array:
        value = self._term()
        while self._next in ("+", "-"):
            value = value + self._term() if self._take() == "+" else value - self._term()
        return value

    def _term(self) -> Array:
        value = self._factor()
        while self._next in ("*", "/"):
            value = value * self._factor() if self._take() == "*" else value / self._factor()
        return value

    def _factor(self) -> Array:
        self.depth += 1
        if self.depth > DEEPEST:
            raise ValueError(f"a formula has at most {DEEPEST} nested brackets, signs and powers")
        if self._next in ("+", "-"):
            value = self._factor() if self._take() == "+" else -self._factor()
        else:
            value = self._atom()
            if self._next in ("^", "**"):
                self._take()
                value = value ** self._factor()
        self.depth -= 1
        return value

    def _atom(self) -> Array:
        token = self._take()
        if token == "x":
            return self.x
        if token == "pi":
            return np.asarray(np.pi)
        if token == "(":
            return self._closed(token)
        if token in FUNCTIONS:
            if self._take() != "(":
                raise ValueError(f"{token} needs brackets, as in {token}(100 * x)")
            return FUNCTIONS[token](self._closed(token))
        if token and (token[0].isdigit() or token[0] == "."):
            return np.asarray(float(token))
        if not token:
            raise ValueError("the formula ends where a number, x or a function must follow")
        known = ", ".join(FUNCTIONS)
        raise ValueError(f'"{token}" is no number, no variable and no function; known are x, pi, {known}')

    def _closed(self, opened: str) -> Array:
        value = self._sum()
        if self._take() != ")":
            raise ValueError(f'the bracket of "{opened}" is not closed')
        return value


def _tokens(text: str) -> list[str]:
    tokens, at = [], 0
    text = text.rstrip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise ValueError(f'"{text[at:].strip()[:12]}" cannot be read as part of a formula')
        tokens.append(match[match.lastindex or 0])
        at = match.end()
    if not tokens:
        raise ValueError('the formula is empty; write for example "300 * x + 2e6 * x^3"')
    return tokens
