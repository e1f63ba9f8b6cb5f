# SPDX-License-Identifier: GPL-3.0-or-later
# Headers that come in wheels. Defines arapfields_eigen and arapfields_json.

# arapfields_headers(target FOLDER header module place wheel): an interface target for the folder FOLDER that holds
# `header`: the one given by -DFOLDER=..., or `place`, seen from a module that the wheel installs.
function(arapfields_headers target folder header module place wheel)
  if(NOT ${folder})
    execute_process(
      COMMAND ${Python_EXECUTABLE} -c
              "import importlib.util as u, os.path as p; print(p.normpath(p.join(u.find_spec('${module}').submodule_search_locations[0], '${place}')))"
      OUTPUT_VARIABLE ${folder} OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  endif()
  if(NOT EXISTS "${${folder}}/${header}")
    message(FATAL_ERROR "${header} was not found (pip install ${wheel}, or pass ${folder})")
  endif()
  set(${folder} "${${folder}}" CACHE PATH "folder that holds ${header}")
  add_library(${target} INTERFACE)
  target_include_directories(${target} SYSTEM INTERFACE "${${folder}}")
endfunction()

arapfields_headers(arapfields_eigen EIGEN_INCLUDE_DIR Eigen/Core cmeel ../cmeel.prefix/include/eigen3 cmeel-eigen)
arapfields_headers(arapfields_json JSON_INCLUDE_DIR nlohmann/json.hpp nlohmann_json include nlohmann_json)
# Eigen's alignment decides how matrices are laid out and freed. It is fixed, so that who uses the library may
# compile for any instruction set.
target_compile_definitions(arapfields_eigen INTERFACE EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY EIGEN_MAX_ALIGN_BYTES=16)
