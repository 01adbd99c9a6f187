#pragma once

// PALPATE_INLINE marks functions that the library palpate::core compiles. The library and the programs that link it define
// PALPATE_COMPILED; without it the core is headers only, and the functions are inline.
#if defined(PALPATE_COMPILED)
#define PALPATE_INLINE
#else
#define PALPATE_INLINE inline
#endif
