"""In-place BLAS and LAPACK routines of scipy that release the global interpreter lock.

scipy's own wrappers do not release it, so threads could not run in parallel. All arrays of a call have one precision,
float64 or float32, and Fortran order. Symmetric and triangular arrays use the lower triangle.
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

Real = NDArray[Any]
_LETTERS = {np.dtype(np.float64): "d", np.dtype(np.float32): "s"}
_NUMBERS = {"d": ctypes.c_double, "s": ctypes.c_float}

_name_of = ctypes.pythonapi.PyCapsule_GetName
_name_of.restype, _name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
_pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_of.restype, _pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]


def threads() -> int:
    """Return the number of threads of a BLAS product."""
    return max((pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"), default=1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit each BLAS product to one thread."""
    with threadpool_limits(1, "blas"):
        yield


def potrf(a: Real) -> bool:
    """Replace a (n, n) by its Cholesky factor L, a = L L^T.

    Return False if a is not positive definite; its content is then undefined.
    """
    _check_shapes(a.shape == (len(a), len(a)))
    info = ctypes.c_int()
    _call("potrf", a, b"L", len(a), a, _leading(a), info)
    return info.value == 0


def trsm(factor: Real, b: Real) -> None:
    """Replace b (m, n) by b L^-T, with the factor L (n, n)."""
    _check_shapes(factor.shape == (b.shape[1], b.shape[1]))
    _call("trsm", b, b"R", b"L", b"T", b"N", *b.shape, 1.0, factor, _leading(factor), b, _leading(b))


def syrk(alpha: float, a: Real, c: Real) -> None:
    """Add alpha a a^T to the lower triangle of c (m, m); a is (m, n)."""
    _check_shapes(c.shape == (len(a), len(a)))
    _call("syrk", c, b"L", b"N", *a.shape, alpha, a, _leading(a), 1.0, c, _leading(c))


def gemm(alpha: float, a: Real, b: Real, c: Real) -> None:
    """Add alpha a b^T to c (m, k); a is (m, n) and b (k, n)."""
    _check_shapes(c.shape == (len(a), len(b)) and a.shape[1] == b.shape[1])
    sizes = *c.shape, a.shape[1]
    _call("gemm", c, b"N", b"T", *sizes, alpha, a, _leading(a), b, _leading(b), 1.0, c, _leading(c))


def _call(name: str, like: Real, *values: object) -> None:
    """Call a Fortran routine in the precision of `like`, with every argument by reference."""
    letter = _LETTERS[like.dtype]
    arguments: list[object] = []
    for value in values:
        if isinstance(value, np.ndarray):
            if value.dtype != like.dtype or not value.flags.f_contiguous:
                raise ValueError(f"{name}: the arrays must have one precision and Fortran order")
            arguments.append(ctypes.c_void_p(value.ctypes.data))
        elif isinstance(value, bytes):
            arguments.append(value)
        elif isinstance(value, float):
            arguments.append(ctypes.byref(_NUMBERS[letter](value)))
        elif isinstance(value, int):
            arguments.append(ctypes.byref(ctypes.c_int(value)))
        else:
            arguments.append(ctypes.byref(value))  # type: ignore[arg-type]  # output argument
    _routine(letter + name)(*arguments)


@cache
def _routine(name: str) -> Callable[..., None]:
    for module in (cython_blas, cython_lapack):
        capsule = module.__pyx_capi__.get(name)
        if capsule is not None:
            return ctypes.CFUNCTYPE(None)(_pointer_of(capsule, _name_of(capsule)))
    raise ImportError(f"scipy has no {name}")


def _check_shapes(consistent: bool) -> None:
    if not consistent:
        raise ValueError("the shapes of the arrays do not match")


def _leading(a: Real) -> int:
    return max(len(a), 1)
