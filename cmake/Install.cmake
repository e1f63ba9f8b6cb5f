# SPDX-License-Identifier: GPL-3.0-or-later
# Two layouts from one build. `cmake --install BUILD --prefix P` makes a C++ development package; the component
# `python`, which pip installs, is the Python package with the same headers and CMake files inside.
include(CMakePackageConfigHelpers)

# arapfields_install(library headers cmake_files component [EXCLUDE_FROM_ALL]): the library, its public headers and
# what find_package(arapfields) reads.
function(arapfields_install library_dir include_dir cmake_dir component)
  set(places "")
  foreach(kind LIBRARY RUNTIME ARCHIVE)  # Windows has the library as the two last
    list(APPEND places ${kind} DESTINATION ${library_dir} COMPONENT ${component} ${ARGN})
  endforeach()
  install(TARGETS arapfields ${places})
  set(library_file "${library_dir}/${CMAKE_SHARED_LIBRARY_PREFIX}arapfields${CMAKE_SHARED_LIBRARY_SUFFIX}")
  set(import_file "${library_dir}/${CMAKE_IMPORT_LIBRARY_PREFIX}arapfields${CMAKE_IMPORT_LIBRARY_SUFFIX}")
  set(made "${PROJECT_BINARY_DIR}/cmake/${component}")
  configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/arapfieldsConfig.cmake.in"
    "${made}/arapfieldsConfig.cmake" INSTALL_DESTINATION ${cmake_dir} PATH_VARS library_file import_file include_dir)
  write_basic_package_version_file("${made}/arapfieldsConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
  install(FILES "${made}/arapfieldsConfig.cmake" "${made}/arapfieldsConfigVersion.cmake"
    DESTINATION ${cmake_dir} COMPONENT ${component} ${ARGN})
  install(CODE "set(ROOTS \"${PROJECT_SOURCE_DIR}/native\" \"${ARAPFIELDS_GENERATED}\")
set(TARGET \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${include_dir}/arapfields\")
include(\"${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake\")" COMPONENT ${component} ${ARGN})
endfunction()

if(TARGET arapfields)
  arapfields_install(lib include lib/cmake/arapfields cpp)
endif()
# The library finds libtorch, and the OpenMP of wheels that keep it in torch.libs, through these links.
if(ARAPFIELDS_BACKEND STREQUAL "torch")
  set(links "${LIBTORCH_DIR}/lib>libtorch" "${LIBTORCH_DIR}/../torch.libs>torch.libs")
endif()
foreach(link ${links})
  string(REPLACE ">" ";" link "${link}")
  list(GET link 0 from)
  list(GET link 1 name)
  if(EXISTS "${from}")
    install(CODE "file(MAKE_DIRECTORY \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/arapfields\")
file(CREATE_LINK \"${from}\" \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/arapfields/${name}\" SYMBOLIC)" COMPONENT cpp)
  endif()
endforeach()

if(NOT ARAPFIELDS_PYTHON)
  return()
endif()
if(TARGET arapfields)
  arapfields_install(arapfields arapfields/include arapfields/share/cmake/arapfields python EXCLUDE_FROM_ALL)
endif()
if(TARGET _native)
  install(TARGETS _native LIBRARY DESTINATION arapfields COMPONENT python EXCLUDE_FROM_ALL)
endif()
install(FILES "${ARAPFIELDS_GENERATED}/options.json" ${libtorch_note}
  DESTINATION arapfields COMPONENT python EXCLUDE_FROM_ALL)
install(DIRECTORY python/arapfields/ DESTINATION arapfields COMPONENT python EXCLUDE_FROM_ALL
  PATTERN "__pycache__" EXCLUDE)
