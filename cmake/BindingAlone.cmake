# SPDX-License-Identifier: GPL-3.0-or-later
# The binding module for a Python of which only the headers are at hand (no interpreter is run):
#   ARAPFIELDS_BINDING_HEADERS  folder with its Python.h
#   ARAPFIELDS_BINDING_NAME     file name of the module, with the Python's own suffix
#   ARAPFIELDS_LIBRARY          the built libarapfields.so
#   ARAPFIELDS_GENERATED        folder of what native/options/generate.py wrote for that library
#   EIGEN_INCLUDE_DIR, PYBIND11_INCLUDE_DIR
foreach(name ARAPFIELDS_BINDING_NAME ARAPFIELDS_LIBRARY ARAPFIELDS_GENERATED EIGEN_INCLUDE_DIR PYBIND11_INCLUDE_DIR)
  if(NOT ${name})
    message(FATAL_ERROR "${name} is not given")
  endif()
endforeach()
add_library(arapfields_built SHARED IMPORTED)
set_target_properties(arapfields_built PROPERTIES IMPORTED_LOCATION "${ARAPFIELDS_LIBRARY}")

file(GLOB binding_sources CONFIGURE_DEPENDS native/bindings/*.cpp)
add_library(_native MODULE ${binding_sources} "${ARAPFIELDS_GENERATED}/options/bind_options.cpp")
target_include_directories(_native PRIVATE native "${ARAPFIELDS_GENERATED}")
target_include_directories(_native SYSTEM PRIVATE
  "${ARAPFIELDS_BINDING_HEADERS}" "${PYBIND11_INCLUDE_DIR}" "${EIGEN_INCLUDE_DIR}")
# Debian keeps pyconfig.h beside other libraries' headers, which must not win over this system's.
cmake_path(GET ARAPFIELDS_BINDING_HEADERS PARENT_PATH include_dir)
target_compile_options(_native PRIVATE "SHELL:-idirafter \"${include_dir}\"" -Wall -Wextra -fno-gnu-unique -O1)
target_compile_definitions(_native PRIVATE
  ARAPFIELDS_VERSION="${PROJECT_VERSION}" EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY
  EIGEN_MAX_ALIGN_BYTES=16)
target_link_libraries(_native PRIVATE arapfields_built)
set_target_properties(_native PROPERTIES
  PREFIX "" SUFFIX "" OUTPUT_NAME "${ARAPFIELDS_BINDING_NAME}"
  CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
  BUILD_RPATH "$ORIGIN" INSTALL_RPATH "$ORIGIN"
  LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}")
