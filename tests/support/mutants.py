"""Mutants of a source file: small changes of its syntax tree."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

COMPARISONS: Final[dict[type[ast.cmpop], type[ast.cmpop]]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
OPERATORS: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.MatMult: ast.Mult,
}  # fmt: skip
NAMES: Final = {"min": "max", "max": "min", "any": "all", "all": "any", "sin": "cos", "cos": "sin"}
SYMMETRIC: Final = {
    "array_equal",
    "maximum",
    "minimum",
    "fmax",
    "fmin",
    "hypot",
    "union1d",
    "intersect1d",
    "logical_and",
    "logical_or",
}


class Mutant(NamedTuple):
    """One change of a file."""

    file: str
    line: int
    functions: tuple[str, ...]  # qualified names: the function around it, or the users of a constant; empty for any
    begin: int  # offsets of the replaced bytes
    end: int
    text: str


def mutants(file: Path, name: str) -> list[Mutant]:
    """Return every mutant of a file. Messages of errors, annotations and texts are left alone.

    So are changes that cannot change a value: the order of arguments of SYMMETRIC functions, and the number behind the
    minus of a length in `reshape`, because numpy takes every negative length as the unknown one.
    """
    data = file.read_bytes()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    tree = ast.parse(data)
    users = _users(tree)
    for node, function, constant in _nodes(tree, "", ""):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        same = f"({ast.unparse(node)})"
        functions = (function,) if function else tuple(sorted(users[constant]))
        found += [Mutant(name, node.lineno, functions, begin, end, text) for text in _changes(node) if text != same]
    return found


def _nodes(node: ast.AST, scope: str, constant: str) -> Iterator[tuple[Any, str, str]]:
    """Yield nodes, each with the function around it, or with the constant of the module that it defines."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list") or isinstance(node, ast.Raise | ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST):
                continue
            inner = _inner(child, scope)
            if isinstance(node, ast.Module):
                target = getattr(child, "target", None) or next(iter(getattr(child, "targets", [])), None)
                constant = target.id if isinstance(target, ast.Name) else ""
            if hasattr(child, "lineno"):
                yield child, inner if inner.endswith(")") else "", constant
            if not (_reshapes(node, field) and isinstance(child, ast.UnaryOp)):
                yield from _nodes(child, inner, constant)


def _reshapes(node: ast.AST, field: str) -> bool:
    """Return whether a field holds the lengths of a call of `reshape`."""
    return field == "args" and isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "reshape"


def _inner(child: ast.AST, scope: str) -> str:
    """Return the scope in a node: classes, then the outermost function, which ends with "()"."""
    if scope.endswith(")") or not isinstance(child, ast.FunctionDef | ast.ClassDef):
        return scope
    return f"{scope}.{child.name}".lstrip(".") + ("()" if isinstance(child, ast.FunctionDef) else "")


def _users(tree: ast.Module) -> dict[str, set[str]]:
    """Return the functions of a file that use each name."""
    users: dict[str, set[str]] = defaultdict(set)
    for node, function, _ in _nodes(tree, "", ""):
        if isinstance(node, ast.Name) and function:
            users[node.id].add(function)
    return users


def _changes(node: ast.AST) -> Iterator[str]:
    """Yield the replacements of a node."""
    match node:
        case ast.Compare(left, [operator], [right]) if type(operator) in COMPARISONS:
            yield _expression(ast.Compare(left, [COMPARISONS[type(operator)]()], [right]))
        case ast.BinOp(left, operator, right) if type(operator) in OPERATORS and not isinstance(left, ast.JoinedStr):
            yield _expression(ast.BinOp(left, OPERATORS[type(operator)](), right))
        case ast.BoolOp(operator, values):
            yield _expression(ast.BoolOp(ast.Or() if isinstance(operator, ast.And) else ast.And(), values))
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield _expression(operand)
        case ast.Constant(bool() as value):
            yield str(not value)
        case ast.Constant(int() | float() as value):
            yield repr(value + 1 if isinstance(value, int) else 2 * value or 1.0)
        case ast.Call(ast.Name(name) as function, arguments, keywords) if name in NAMES:
            yield _expression(ast.Call(ast.Name(NAMES[function.id]), arguments, keywords))
        case ast.Call(ast.Attribute(_, name), [_, _]) if name in SYMMETRIC:
            return
        case ast.Call(function, [first, second, *rest], keywords) if not isinstance(second, ast.Starred):
            yield _expression(ast.Call(function, [second, first, *rest], keywords))
        case ast.Expr(ast.Call()) | ast.AugAssign():
            yield "pass"
        case ast.If(test, [ast.Raise()], []):
            yield f"if False and {_expression(test)}: pass"


def _expression(node: ast.expr) -> str:
    return f"({ast.unparse(ast.fix_missing_locations(node))})"
