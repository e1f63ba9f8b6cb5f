# SPDX-License-Identifier: GPL-3.0-or-later
# Eigen's headers from the cmeel-eigen wheel (or -DEIGEN_INCLUDE_DIR=...). Defines arapfields_eigen.
if(NOT EIGEN_INCLUDE_DIR)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c
            "import importlib.util as u, pathlib as p; print(p.Path(u.find_spec('cmeel').submodule_search_locations[0]).parent / 'cmeel.prefix/include/eigen3')"
    OUTPUT_VARIABLE EIGEN_INCLUDE_DIR OUTPUT_STRIP_TRAILING_WHITESPACE)
endif()
if(NOT EXISTS "${EIGEN_INCLUDE_DIR}/Eigen/Core")
  message(FATAL_ERROR "Eigen's headers were not found (pip install cmeel-eigen, or pass EIGEN_INCLUDE_DIR)")
endif()
set(EIGEN_INCLUDE_DIR "${EIGEN_INCLUDE_DIR}" CACHE PATH "folder that holds Eigen/Core")
add_library(arapfields_eigen INTERFACE)
target_include_directories(arapfields_eigen SYSTEM INTERFACE "${EIGEN_INCLUDE_DIR}")
# Eigen's alignment decides how matrices are laid out and freed. It is fixed, so that who uses the library may
# compile for any instruction set.
target_compile_definitions(arapfields_eigen INTERFACE EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY EIGEN_MAX_ALIGN_BYTES=16)
