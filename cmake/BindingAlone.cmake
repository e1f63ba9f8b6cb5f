# SPDX-License-Identifier: GPL-3.0-or-later
# The binding module for a Python of which only the headers are at hand (no interpreter is run):
#   ARAPFIELDS_BINDING_HEADERS  folder with its Python.h
#   ARAPFIELDS_BINDING_NAME     file name of the module, with the Python's own suffix
#   ARAPFIELDS_LIBRARY          the built libarapfields.so
#   ARAPFIELDS_GENERATED        folder of what native/options/generate.py wrote for that library
#   EIGEN_INCLUDE_DIR, PYBIND11_INCLUDE_DIR
# For macOS only its objects are built: on other systems CMake has no linker for it.
foreach(name ARAPFIELDS_BINDING_NAME ARAPFIELDS_LIBRARY ARAPFIELDS_GENERATED EIGEN_INCLUDE_DIR PYBIND11_INCLUDE_DIR)
  if(NOT ${name})
    message(FATAL_ERROR "${name} is not given")
  endif()
endforeach()
add_library(arapfields_built SHARED IMPORTED)
set_target_properties(arapfields_built PROPERTIES IMPORTED_LOCATION "${ARAPFIELDS_LIBRARY}")

file(GLOB binding_sources CONFIGURE_DEPENDS native/bindings/*.cpp)
if(APPLE)
  add_library(_native OBJECT ${binding_sources} "${ARAPFIELDS_GENERATED}/options/bind_options.cpp")
else()
  add_library(_native MODULE ${binding_sources} "${ARAPFIELDS_GENERATED}/options/bind_options.cpp")
endif()
target_include_directories(_native PRIVATE native "${ARAPFIELDS_GENERATED}")
target_include_directories(_native SYSTEM PRIVATE
  "${ARAPFIELDS_BINDING_HEADERS}" "${PYBIND11_INCLUDE_DIR}" "${EIGEN_INCLUDE_DIR}")
# Debian keeps pyconfig.h beside other libraries' headers, which must not win over this system's.
cmake_path(GET ARAPFIELDS_BINDING_HEADERS PARENT_PATH include_dir)
target_compile_options(_native PRIVATE "SHELL:-idirafter \"${include_dir}\"" -Wall -Wextra -O1
  $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
target_compile_definitions(_native PRIVATE
  ARAPFIELDS_VERSION="${PROJECT_VERSION}" EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY
  EIGEN_MAX_ALIGN_BYTES=16)
target_link_libraries(_native PRIVATE arapfields_built)
# As in native/bindings: pybind11's functions are compiled anew in each unit.
set_target_properties(_native PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 5)
target_compile_options(_native PRIVATE -fpch-preprocess)
target_precompile_headers(_native PRIVATE <pybind11/eigen.h> <pybind11/numpy.h> <pybind11/pybind11.h> <pybind11/stl.h>)
set_target_properties(_native PROPERTIES
  PREFIX "" SUFFIX "" OUTPUT_NAME "${ARAPFIELDS_BINDING_NAME}"
  CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
  BUILD_RPATH "$ORIGIN" INSTALL_RPATH "$ORIGIN"
  LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}")
