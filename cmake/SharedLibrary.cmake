# SPDX-License-Identifier: GPL-3.0-or-later
# libarapfields, of the object libraries: what C++ programs link with, and the bindings.
add_library(arapfields SHARED)
target_link_libraries(arapfields PRIVATE ${object_libraries} arapfields_options)
if(NOT WIN32 AND NOT APPLE)
  set(exports "${PROJECT_SOURCE_DIR}/cmake/exports.map")
  target_link_options(arapfields PRIVATE "LINKER:--version-script=${exports}")
endif()
set_target_properties(arapfields PROPERTIES
  LINK_DEPENDS "${exports}"
  LIBRARY_OUTPUT_DIRECTORY "${package_dir}"
  RUNTIME_OUTPUT_DIRECTORY "${package_dir}")  # where Windows has it
if(ARAPFIELDS_BACKEND STREQUAL "torch")
  set_target_properties(arapfields PROPERTIES
    BUILD_RPATH "${LIBTORCH_DIR}/lib;${LIBTORCH_DIR}/../torch.libs"
    # Beside the torch of the same site-packages (torch.libs: wheels that keep OpenMP there), or through the links
    # that Install.cmake makes.
    INSTALL_RPATH "$ORIGIN/../torch/lib;$ORIGIN/../torch.libs;$ORIGIN/arapfields/libtorch;$ORIGIN/arapfields/torch.libs")
  # The version that `import` compares with the torch that is installed (python/arapfields/_libtorch.py).
  file(WRITE "${ARAPFIELDS_GENERATED}/libtorch.txt" "${LIBTORCH_VERSION}\n")
  set(libtorch_note "${ARAPFIELDS_GENERATED}/libtorch.txt")
endif()
