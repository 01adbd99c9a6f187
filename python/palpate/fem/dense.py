"""Dense products and solutions in place, by scipy's BLAS and LAPACK, without the interpreter's lock.

scipy's own wrappers hold it, so threads would take turns. Arrays are of one precision, float64 or float32, and
have their columns in one piece (Fortran's order); of symmetric and triangular ones the lower triangle counts.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_blas, cython_lapack
from threadpoolctl import threadpool_info, threadpool_limits

__all__ = [
    "add_square",
    "cholesky",
    "one_thread",
    "solve_transposed",
    "subtract_product",
    "subtract_square",
    "threads",
]

Real = NDArray[Any]
_LETTERS = {np.dtype(np.float64): "d", np.dtype(np.float32): "s"}
_NUMBERS = {"d": ctypes.c_double, "s": ctypes.c_float}

_name_of = ctypes.pythonapi.PyCapsule_GetName
_name_of.restype, _name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
_pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_of.restype, _pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]


def threads() -> int:
    """Return how many threads a product takes."""
    return max((pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"), default=1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let products take a thread each."""
    with threadpool_limits(1, "blas"):
        yield


def cholesky(a: Real) -> bool:
    """Put the factor L of a = L L^T (n, n) in its place; False, and a half done, if it is not positive definite."""
    _fit(a.shape == (len(a), len(a)))
    wrong = ctypes.c_int()
    _call("potrf", a, b"L", len(a), a, _leading(a), wrong)
    return wrong.value == 0


def solve_transposed(factor: Real, b: Real) -> None:
    """Put b L^-T in the place of b (m, n); the factor L is (n, n)."""
    _fit(factor.shape == (b.shape[1], b.shape[1]))
    _call("trsm", b, b"R", b"L", b"T", b"N", *b.shape, 1.0, factor, _leading(factor), b, _leading(b))


def add_square(c: Real, a: Real) -> None:
    """Put c + a a^T in the place of c (m, m), the lower triangle; a is (m, n)."""
    _square(1.0, c, a)


def subtract_square(c: Real, a: Real) -> None:
    """Put c - a a^T in the place of c (m, m), the lower triangle; a is (m, n)."""
    _square(-1.0, c, a)


def subtract_product(c: Real, a: Real, b: Real) -> None:
    """Put c - a b^T in the place of c (m, k); a is (m, n) and b (k, n)."""
    _fit(c.shape == (len(a), len(b)) and a.shape[1] == b.shape[1])
    sizes = *c.shape, a.shape[1]
    _call("gemm", c, b"N", b"T", *sizes, -1.0, a, _leading(a), b, _leading(b), 1.0, c, _leading(c))


def _square(factor: float, c: Real, a: Real) -> None:
    _fit(c.shape == (len(a), len(a)))
    _call("syrk", c, b"L", b"N", *a.shape, factor, a, _leading(a), 1.0, c, _leading(c))


def _call(name: str, like: Real, *given: object) -> None:
    """Call a routine in the precision of `like`: Fortran's way, everything by its address."""
    letter = _LETTERS[like.dtype]
    arguments: list[object] = []
    for value in given:
        if isinstance(value, np.ndarray):
            if value.dtype != like.dtype or not value.flags.f_contiguous:
                raise ValueError(f"{name}: arrays of one precision with columns in one piece are needed")
            arguments.append(ctypes.c_void_p(value.ctypes.data))
        elif isinstance(value, bytes):
            arguments.append(value)
        elif isinstance(value, float):
            arguments.append(ctypes.byref(_NUMBERS[letter](value)))
        elif isinstance(value, int):
            arguments.append(ctypes.byref(ctypes.c_int(value)))
        else:
            arguments.append(ctypes.byref(value))  # type: ignore[arg-type]  # a number to be filled in
    _routine(letter + name)(*arguments)


@cache
def _routine(name: str) -> Callable[..., None]:
    for module in (cython_blas, cython_lapack):
        capsule = module.__pyx_capi__.get(name)
        if capsule is not None:
            return ctypes.CFUNCTYPE(None)(_pointer_of(capsule, _name_of(capsule)))
    raise ImportError(f"scipy has no {name}")


def _fit(sizes: bool) -> None:
    if not sizes:
        raise ValueError("the sizes of the arrays do not fit each other")


def _leading(a: Real) -> int:
    return max(len(a), 1)
