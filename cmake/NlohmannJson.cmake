# SPDX-License-Identifier: GPL-3.0-or-later
# The headers of nlohmann/json from the nlohmann_json wheel (or -DJSON_INCLUDE_DIR=...). Defines arapfields_json.
if(NOT JSON_INCLUDE_DIR)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c
            "import importlib.util as u, pathlib as p; print(p.Path(u.find_spec('nlohmann_json').origin).parent / 'include')"
    OUTPUT_VARIABLE JSON_INCLUDE_DIR OUTPUT_STRIP_TRAILING_WHITESPACE)
endif()
if(NOT EXISTS "${JSON_INCLUDE_DIR}/nlohmann/json.hpp")
  message(FATAL_ERROR "nlohmann/json's headers were not found (pip install nlohmann_json, or pass JSON_INCLUDE_DIR)")
endif()
set(JSON_INCLUDE_DIR "${JSON_INCLUDE_DIR}" CACHE PATH "folder that holds nlohmann/json.hpp")
add_library(arapfields_json INTERFACE)
target_include_directories(arapfields_json SYSTEM INTERFACE "${JSON_INCLUDE_DIR}")
