"""Formulas of scenario files: the values of the grammar, and refusals in place of execution."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.scenario.formula import evaluate_formula

X = np.linspace(0.1, 2.0, 7)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("300 * x + 2e6*x^3", 300 * X + 2e6 * X**3),
        ("-x^2", -(X**2)),
        ("2^3^2 * x", 512 * X),
        ("x**2 / 2 - -1", X**2 / 2 + 1),
        ("6 / 2 / 3 - 1 - 1 + x", X - 1),
        ("exp(-x) * (1 - cos(2 * pi * x))", np.exp(-X) * (1 - np.cos(2 * np.pi * X))),
        ("sqrt(x) + log(x) + abs(-x) + tanh(x) + atan(x) + sin(x)",
         np.sqrt(X) + np.log(X) + X + np.tanh(X) + np.arctan(X) + np.sin(X)),
        (".5e1", np.full(7, 5.0)),
    ],
)  # fmt: skip
def test_a_formula_has_the_values_of_its_mathematics(text: str, expected: np.ndarray) -> None:
    assert evaluate_formula(text, X) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("x +", "ends where a number"),
        ("2 x", "an operator is missing"),
        ("(x", "is not closed"),
        ("sin x", "needs brackets"),
        ("__import__('os')", "cannot be read"),
        ("x.real", "cannot be read"),
        ("eval(x)", "no number, no variable and no function"),
        ("x; x", "cannot be read"),
        ("(" * 60 + "x" + ")" * 60, "nested brackets"),
        ("x" + "+x" * 300, "at most 500 characters"),
    ],
)
def test_other_text_is_refused_and_not_executed(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        evaluate_formula(text, X)


def test_values_that_are_not_finite_stay_so() -> None:
    assert np.isinf(evaluate_formula("1 / (x - x)", X)).all()
