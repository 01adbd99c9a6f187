#pragma once

// Reject compiler options that change floating-point results.
//
// The core relies on exact rounding (sincos, rounding to integers), on NaN and infinity (input
// validation) and on the order of operations (bitwise reproducible results).
//
// Clang defines no macro for -fassociative-math and -freciprocal-math alone, so only the options
// below are detected.
#if defined(__FAST_MATH__)
#error "palpate does not support -ffast-math: remove the option from the compiler flags"
#elif defined(__ASSOCIATIVE_MATH__)
#error "palpate does not support -fassociative-math: remove the option (or -funsafe-math-optimizations) from the compiler flags"
#elif defined(__RECIPROCAL_MATH__)
#error "palpate does not support -freciprocal-math: remove the option from the compiler flags"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "palpate does not support -ffinite-math-only: remove the option from the compiler flags"
#elif defined(_M_FP_FAST)
#error "palpate does not support /fp:fast: remove the option from the compiler flags"
#endif
