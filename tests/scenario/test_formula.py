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


def test_a_formula_has_a_longest_length_and_a_deepest_nesting() -> None:
    """500 characters; 40 brackets, signs and powers in each other, whatever stands before or beside them."""
    x = np.array([0.5, 2.0])
    longest = "x" + "+x" * 249 + " "
    assert len(longest) == 500
    np.testing.assert_allclose(evaluate_formula(longest, x), 250.0 * x)
    with pytest.raises(ValueError, match=r"^a formula has at most 500 characters, not 501; write a table instead$"):
        evaluate_formula(longest + " ", x)
    beside = "+".join(["(x)"] * 60)
    np.testing.assert_allclose(evaluate_formula(beside, x), 60.0 * x)
    nested = f"{'(' * 39}x{')' * 39}"
    for before in ("", "(x)*x+", "((x))+-x^2-x+"):
        evaluate_formula(before + nested, x)
        with pytest.raises(ValueError, match=r"^a formula has at most 40 nested brackets, signs and powers$"):
            evaluate_formula(f"{before}({nested})", x)
    for deep in ("-" * 39 + "x", "x" + "^x" * 39):
        evaluate_formula(deep, x)
        with pytest.raises(ValueError, match="at most 40 nested"):
            evaluate_formula(f"-{deep}" if deep[0] == "-" else f"{deep}^x", x)


def test_operators_bind_and_associate_as_in_a_textbook() -> None:
    x = np.array([0.3, 1.7])
    for text, expected in (
        ("8 - 3 - 2", 3.0 + 0.0 * x),
        ("8 / 4 / 2", 1.0 + 0.0 * x),
        ("2 ^ 3 ^ 2", 512.0 + 0.0 * x),
        ("2 ** -1", 0.5 + 0.0 * x),
        ("-x^2", -(x**2)),
        ("+x - -x", 2.0 * x),
        ("2 + 3 * x", 2.0 + 3.0 * x),
        ("(2 + 3) * x", 5.0 * x),
        ("2*x/4*x", 0.5 * x**2),
        ("1e3*x + .5 + 2.", 1000.0 * x + 2.5),
        ("2.5E-1*x", 0.25 * x),
        ("pi*x", np.pi * x),
        ("sin(x)+cos(x)*tanh(x)", np.sin(x) + np.cos(x) * np.tanh(x)),
        ("exp(-x) + log(x) + sqrt(x) + abs(-x) + atan(x)", np.exp(-x) + np.log(x) + np.sqrt(x) + x + np.arctan(x)),
    ):
        found = evaluate_formula(text, x)
        assert found.shape == x.shape
        np.testing.assert_allclose(found, expected)
    known = "known are x, pi, abs, atan, cos, exp, log, sin, sqrt, tanh"
    for text, says in (
        ("", 'the formula is empty; write for example "300 * x + 2e6 * x^3"'),
        ("   ", 'the formula is empty; write for example "300 * x + 2e6 * x^3"'),
        ("x +", "the formula ends where a number, x or a function must follow"),
        ("x x", '"x" after the end of the formula; an operator is missing before it'),
        ("2 x", '"x" after the end of the formula; an operator is missing before it'),
        ("x)", '")" after the end of the formula; an operator is missing before it'),
        ("y", f'"y" is no number, no variable and no function; {known}'),
        ("*x", f'"*" is no number, no variable and no function; {known}'),
        ("(x", 'the bracket of "(" is not closed'),
        ("sin(x", 'the bracket of "sin" is not closed'),
        ("sin x", "sin needs brackets, as in sin(100 * x)"),
        ("x $ 123456789012345", '"$ 1234567890" cannot be read as part of a formula'),
    ):
        with pytest.raises(ValueError, match=r".") as caught:
            evaluate_formula(text, x)
        assert str(caught.value) == says
    assert np.isinf(evaluate_formula("1 / (x - x)", x)).all()
