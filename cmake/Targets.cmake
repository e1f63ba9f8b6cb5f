# SPDX-License-Identifier: GPL-3.0-or-later
# Options shared by all our targets, and arapfields_sources(), by which each folder lists its files.
add_library(arapfields_options INTERFACE)
set(ARAPFIELDS_GENERATED "${PROJECT_BINARY_DIR}/generated")  # what native/options/generate.py writes
target_include_directories(arapfields_options INTERFACE "${PROJECT_SOURCE_DIR}/native" "${ARAPFIELDS_GENERATED}")
target_link_libraries(arapfields_options INTERFACE arapfields_eigen)
target_compile_options(arapfields_options INTERFACE -Wall -Wextra -Wshadow -Wno-unknown-pragmas
  # What the library offers says so (core/export.h).
  -fvisibility=hidden -fvisibility-inlines-hidden)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # STB_GNU_UNIQUE symbols are shared by the whole process: two libtorch copies would then clash.
  target_compile_options(arapfields_options INTERFACE -fno-gnu-unique
    --param=ggc-min-expand=100 --param=ggc-min-heapsize=1000000)  # a seventh of the time goes into freeing memory
endif()
if(WIN32 AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC keeps the stack aligned to 16 bytes on Windows, and moves wider vectors to it as if it were to 32 (its bug
  # 54412): the assembler makes these moves unaligned ones.
  target_compile_options(arapfields_options INTERFACE -Wa,-muse-unaligned-vector-move)
  target_compile_definitions(arapfields_options INTERFACE _WIN32_WINNT=0x0A00)  # zig says so itself
endif()
if(WIN32)
  target_compile_definitions(arapfields_options INTERFACE NOMINMAX WIN32_LEAN_AND_MEAN)
endif()
if(ARAPFIELDS_ONE_MODULE)
  target_compile_definitions(arapfields_options INTERFACE ARAPFIELDS_ONE_MODULE)
endif()
if(ARAPFIELDS_WERROR)
  target_compile_options(arapfields_options INTERFACE -Werror)
endif()
if(ARAPFIELDS_SANITIZE)
  target_compile_options(arapfields_options INTERFACE
    -fsanitize=${ARAPFIELDS_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer -g1 -O1)
  target_link_options(arapfields_options INTERFACE -fsanitize=${ARAPFIELDS_SANITIZE})
  # The assertions of Eigen and of the standard library see what stays within an array's memory; a number that was
  # never set is NaN.
  target_compile_options(arapfields_options INTERFACE -UNDEBUG)
  target_compile_definitions(arapfields_options INTERFACE _GLIBCXX_ASSERTIONS EIGEN_INITIALIZE_MATRICES_BY_NAN)
endif()

# For the library's own sources, beside those of bindings: what the headers mark is theirs to export.
add_library(arapfields_own INTERFACE)
target_link_libraries(arapfields_own INTERFACE arapfields_options)
if(WIN32)
  target_compile_definitions(arapfields_own INTERFACE ARAPFIELDS_BUILDING)
endif()

# Object libraries make up the one shared library: sources that need only Eigen, those that need JSON too, kernels
# compiled once per instruction set, and the tensors' backend of libtorch, which alone sees torch's headers. Precompiled headers save more than half of the
# compiler's time; what each source includes is complete without them (tests/packaging).
set(ARAPFIELDS_STANDARD_HEADERS <algorithm> <array> <cmath> <cstdint> <functional> <memory> <optional> <string>
  <utility> <vector>)
add_library(arapfields_plain OBJECT)
target_link_libraries(arapfields_plain PRIVATE arapfields_own)
# Templates of Eigen's take the compiler longer than all else, and each unit compiles them again: so several sources
# of one folder form one unit, and what they keep to themselves has names that differ. Clang, which takes half as long,
# would also warn of lambdas' names.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set_target_properties(arapfields_plain PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endif()
set(ARAPFIELDS_UNIT_SIZE 8)
target_precompile_headers(arapfields_plain PRIVATE <Eigen/Dense> ${ARAPFIELDS_STANDARD_HEADERS})
target_compile_options(arapfields_plain PRIVATE -fpch-preprocess  # lets ccache see through the header
  $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)  # which takes a source within a unit for a header
add_library(arapfields_io OBJECT)
target_link_libraries(arapfields_io PRIVATE arapfields_own arapfields_json)
target_compile_options(arapfields_io PRIVATE -Os)  # files are read once; their code is a fifth of the library
set_target_properties(arapfields_io PROPERTIES UNITY_BUILD ON)  # a JSON or torch header takes longer than any source
if(ARAPFIELDS_BACKEND STREQUAL "torch")
  add_library(arapfields_torch OBJECT)
  target_link_libraries(arapfields_torch PRIVATE arapfields_own libtorch::libtorch)
  set_target_properties(arapfields_torch PROPERTIES UNITY_BUILD ON)
endif()

set(ARAPFIELDS_SIMD_baseline "")
set(ARAPFIELDS_SIMD_neon -DARAPFIELDS_NEON)
set(ARAPFIELDS_SIMD_avx2 -mavx2 -mfma)
set(ARAPFIELDS_SIMD_avx512 -mavx2 -mfma -mavx512f -mavx512dq -mavx512bw -mavx512vl -mprefer-vector-width=512)
set(ARAPFIELDS_SIMD_LEVELS baseline)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND ARAPFIELDS_SIMD_LEVELS avx2 avx512)
elseif(APPLE AND CMAKE_SYSTEM_PROCESSOR STREQUAL "arm64")
  set(ARAPFIELDS_SIMD_LEVELS neon)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  list(APPEND ARAPFIELDS_SIMD_LEVELS neon)
endif()
set(ARAPFIELDS_SIMD_FLAGS -O3 -fno-math-errno -fno-trapping-math -ffp-contract=fast)
foreach(level ${ARAPFIELDS_SIMD_LEVELS})
  add_library(arapfields_simd_${level} OBJECT)
  target_link_libraries(arapfields_simd_${level} PRIVATE arapfields_own)
  # Kernels live in the namespace arapfields::SIMD_LEVEL; Eigen, where one uses it, is renamed likewise,
  # so that no inline function compiled for a newer processor can be picked by the linker for all.
  target_compile_definitions(arapfields_simd_${level} PRIVATE SIMD_LEVEL=${level} Eigen=Eigen_${level})
  target_compile_options(arapfields_simd_${level} PRIVATE ${ARAPFIELDS_SIMD_${level}} ${ARAPFIELDS_SIMD_FLAGS})
endforeach()

# arapfields_sources([PLAIN a.cpp ...] [JSON d.cpp ...] [TORCH b.cpp ...] [SIMD c.cpp ...])
function(arapfields_sources)
  cmake_parse_arguments(arg "" "" "PLAIN;JSON;TORCH;SIMD" ${ARGN})
  list(TRANSFORM arg_PLAIN PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  list(TRANSFORM arg_JSON PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  list(TRANSFORM arg_TORCH PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  list(TRANSFORM arg_SIMD PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  target_sources(arapfields_plain PRIVATE ${arg_PLAIN})
  get_filename_component(folder "${CMAKE_CURRENT_SOURCE_DIR}" NAME)
  set(count 0)
  foreach(source IN LISTS arg_PLAIN)
    math(EXPR unit "${count} / ${ARAPFIELDS_UNIT_SIZE}")
    math(EXPR count "${count} + 1")
    set_source_files_properties("${source}" TARGET_DIRECTORY arapfields_plain
      PROPERTIES UNITY_GROUP "${folder}_${unit}")
  endforeach()
  target_sources(arapfields_io PRIVATE ${arg_JSON})
  if(arg_TORCH)
    target_sources(arapfields_torch PRIVATE ${arg_TORCH})
  endif()
  foreach(level ${ARAPFIELDS_SIMD_LEVELS})
    target_sources(arapfields_simd_${level} PRIVATE ${arg_SIMD})
  endforeach()
endfunction()
