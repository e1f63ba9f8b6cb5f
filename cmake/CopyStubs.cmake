# SPDX-License-Identifier: GPL-3.0-or-later
# The stub of a module is one file, or a folder when the module has submodules: make it one file.
if(EXISTS "${STUBS}/_native/__init__.pyi")
  configure_file("${STUBS}/_native/__init__.pyi" "${PACKAGE}/_native.pyi" COPYONLY)
else()
  configure_file("${STUBS}/_native.pyi" "${PACKAGE}/_native.pyi" COPYONLY)
endif()
