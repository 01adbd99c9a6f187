#pragma once

#include <type_traits>

namespace palpate::math {

/// Call `use(std::integral_constant<int, lanes>())` with the number of doubles in the widest vector register that this machine has and this
/// build was compiled for (PALPATE_LANES_4, PALPATE_LANES_8), but at most `limit`; 0: no limit. Return its result. Two lanes always exist.
template <class Use>
decltype(auto) with_widest_lanes(Use use, int limit = 0) {
#if defined(PALPATE_LANES_8)
  if ((limit <= 0 || limit >= 8) && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return use(std::integral_constant<int, 8>());
#endif
#if defined(PALPATE_LANES_4)
  if ((limit <= 0 || limit >= 4) && __builtin_cpu_supports("avx2")) return use(std::integral_constant<int, 4>());
#endif
  static_cast<void>(limit);
  return use(std::integral_constant<int, 2>());
}

}  // namespace palpate::math
