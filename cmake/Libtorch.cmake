# SPDX-License-Identifier: GPL-3.0-or-later
# The C++ libtorch of an installed torch wheel, found without importing torch.
# Defines the imported target libtorch::libtorch and LIBTORCH_DIR (the wheel's torch folder).
if(NOT LIBTORCH_DIR)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c
            "import importlib.util as u, pathlib as p; print(p.Path(u.find_spec('torch').origin).parent)"
    OUTPUT_VARIABLE LIBTORCH_DIR OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE libtorch_status)
  if(libtorch_status)
    message(FATAL_ERROR "torch is not installed in ${Python_EXECUTABLE}; pip install torch==2.13.0")
  endif()
endif()
set(LIBTORCH_DIR "${LIBTORCH_DIR}" CACHE PATH "torch folder of a torch wheel")
set(LIBTORCH_VERSION "")  # as pip names it, e.g. 2.13.0
if(EXISTS "${LIBTORCH_DIR}/version.py")
  file(STRINGS "${LIBTORCH_DIR}/version.py" LIBTORCH_VERSION REGEX "^__version__")
  string(REGEX REPLACE "^[^'\"]*['\"]([^'\"+]*).*$" "\\1" LIBTORCH_VERSION "${LIBTORCH_VERSION}")
endif()

add_library(libtorch::libtorch INTERFACE IMPORTED)
target_include_directories(libtorch::libtorch SYSTEM INTERFACE
  "${LIBTORCH_DIR}/include" "${LIBTORCH_DIR}/include/torch/csrc/api/include")
# torch >= 2.6 wheels for Linux use the C++11 ABI of libstdc++.
target_compile_definitions(libtorch::libtorch INTERFACE _GLIBCXX_USE_CXX11_ABI=1)
foreach(name c10 torch_cpu torch)
  find_library(LIBTORCH_${name} NAMES ${name} PATHS "${LIBTORCH_DIR}/lib" NO_DEFAULT_PATH REQUIRED)
  target_link_libraries(libtorch::libtorch INTERFACE "${LIBTORCH_${name}}")
endforeach()
# The OpenMP library that libtorch brings along: a call tells it to keep to one thread (core/parallel.h).
file(GLOB LIBTORCH_OPENMP "${LIBTORCH_DIR}/lib/libgomp*.so*" "${LIBTORCH_DIR}/../torch.libs/libgomp*.so*"
  "${LIBTORCH_DIR}/lib/libomp.dylib")
if(NOT LIBTORCH_OPENMP)
  message(FATAL_ERROR "no OpenMP library (libgomp, or libomp.dylib) beside libtorch in ${LIBTORCH_DIR}/lib")
endif()
list(GET LIBTORCH_OPENMP 0 LIBTORCH_OPENMP)
target_link_libraries(libtorch::libtorch INTERFACE "${LIBTORCH_OPENMP}")
# A CUDA build registers its kernels when libtorch_cuda is loaded, though no symbol of it is named by us.
find_library(LIBTORCH_torch_cuda NAMES torch_cuda PATHS "${LIBTORCH_DIR}/lib" NO_DEFAULT_PATH)
if(LIBTORCH_torch_cuda)
  target_link_libraries(libtorch::libtorch INTERFACE -Wl,--no-as-needed "${LIBTORCH_torch_cuda}" -Wl,--as-needed
    # CUDA's own libraries are found when torch_cuda is loaded; the linker need not see them.
    -Wl,--allow-shlib-undefined)
endif()
