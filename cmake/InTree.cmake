# SPDX-License-Identifier: GPL-3.0-or-later
# arapfields::arapfields for projects that take this one by FetchContent or add_subdirectory(): the same target as
# find_package(arapfields) gives, with the same headers, written into the build folder as they would be installed.
set(public_headers "${PROJECT_BINARY_DIR}/include")
add_custom_target(arapfields_headers
  COMMAND ${CMAKE_COMMAND} "-DROOTS=${PROJECT_SOURCE_DIR}/native;${ARAPFIELDS_GENERATED}"
          "-DTARGET=${public_headers}/arapfields" -P "${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake" VERBATIM)
add_library(arapfields_public INTERFACE)
add_dependencies(arapfields_public arapfields_headers)
target_include_directories(arapfields_public INTERFACE "${public_headers}")
target_include_directories(arapfields_public SYSTEM INTERFACE "${EIGEN_INCLUDE_DIR}")
target_compile_features(arapfields_public INTERFACE cxx_std_20)
target_compile_definitions(arapfields_public INTERFACE EIGEN_MAX_ALIGN_BYTES=16)
target_link_libraries(arapfields_public INTERFACE arapfields)
if(ARAPFIELDS_BACKEND STREQUAL "torch" AND NOT WIN32 AND NOT APPLE)  # the library finds libtorch itself; the linker need not
  target_link_options(arapfields_public INTERFACE LINKER:--allow-shlib-undefined)
endif()
add_library(arapfields::arapfields ALIAS arapfields_public)
