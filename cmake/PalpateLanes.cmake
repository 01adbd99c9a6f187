# palpate_add_lanes(TARGET SOURCE...): compile sources once for each SIMD width and add them to a target. Each copy sees its width as
# PALPATE_LANES; the target sees PALPATE_LANES_4 and PALPATE_LANES_8 for the wide copies that it contains. The width is chosen when the
# program runs. With PALPATE_NATIVE_LANES, of the wide copies only the widest that this machine runs, and the hyperelastic solvers, whose
# compilation takes longest, in that width only.
include(CheckCXXCompilerFlag)
check_cxx_compiler_flag(-fno-weak palpate_local_inlines)
check_cxx_compiler_flag(-mavx512f palpate_x86)
set(palpate_wide)
if(palpate_local_inlines AND palpate_x86)
  set(palpate_wide 4 8)
endif()
if(palpate_wide AND PALPATE_NATIVE_LANES)
  include(CheckCXXSourceRuns)
  set(palpate_avx512 "__builtin_cpu_supports(\"avx512f\") && __builtin_cpu_supports(\"avx512dq\") && __builtin_cpu_supports(\"avx512vl\")")
  check_cxx_source_runs("int main() { return !(${palpate_avx512}); }" palpate_runs_8)
  check_cxx_source_runs("int main() { return !__builtin_cpu_supports(\"avx2\"); }" palpate_runs_4)
  if(palpate_runs_8)
    set(palpate_wide 8)
  elseif(palpate_runs_4)
    set(palpate_wide 4)
  else()
    set(palpate_wide)
  endif()
endif()
set(palpate_flags_2)
set(palpate_flags_4 -mavx2 -mfma)
set(palpate_flags_8 -mavx512f -mavx512dq -mavx512vl -mfma -mprefer-vector-width=512)

# Options of a source that shares templates with others. -fno-weak: each width needs its own copy of them, so the linker must not merge
# them. -fno-rtti: with -fno-weak, type information is compared by a function that not every standard library has. -w: with -fno-weak, g++
# warns about constants in headers; the core's tests compile these headers with all warnings.
set(palpate_own_copy)
if(palpate_local_inlines)
  set(palpate_own_copy -fno-weak -fno-rtti -w)
endif()

# Hyperelastic solvers, and the servo's contact with their local models. -ffp-contract=fast: fused multiply-add speeds the solver up, and
# its results need not be the same bits on another machine.
set(palpate_core_source ${CMAKE_CURRENT_LIST_DIR}/../core/src)
set(palpate_hyperelastic_lanes ${palpate_core_source}/hyperelastic_lanes.cpp ${palpate_core_source}/local_contact_lanes.cpp)

function(palpate_add_lanes target)
  set_source_files_properties(${palpate_core_source}/hyperelastic_lanes.cpp PROPERTIES
                              COMPILE_OPTIONS "-ffp-contract=fast;${palpate_own_copy}")
  set_source_files_properties(${palpate_core_source}/local_contact_lanes.cpp PROPERTIES COMPILE_OPTIONS "${palpate_own_copy}")
  foreach(lanes IN ITEMS 2 ${palpate_wide})
    set(sources ${ARGN})
    set(optimization -O3)
    if(lanes EQUAL 2 AND PALPATE_NATIVE_LANES AND palpate_wide)
      set(optimization -O1)  # this machine uses the wide copy; tests compare the results of both
      list(REMOVE_ITEM sources ${palpate_hyperelastic_lanes})
      target_compile_definitions(${target} PRIVATE PALPATE_NATIVE_SOLVERS)
    endif()
    if(NOT sources)
      continue()
    endif()
    set(copy ${target}_lanes_${lanes})
    add_library(${copy} OBJECT ${sources})
    target_link_libraries(${copy} PRIVATE palpate palpate_warnings)
    target_compile_definitions(${copy} PRIVATE PALPATE_LANES=${lanes} EIGEN_DONT_VECTORIZE)
    target_compile_options(${copy} PRIVATE $<$<CONFIG:Release>:${optimization}> -ffp-contract=off -Wno-psabi ${palpate_flags_${lanes}})
    set_target_properties(${copy} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${copy}>)
  endforeach()
  foreach(lanes IN LISTS palpate_wide)
    target_compile_definitions(${target} PRIVATE PALPATE_LANES_${lanes})
  endforeach()
endfunction()
