# SPDX-License-Identifier: GPL-3.0-or-later
"""The place of the C++ package inside this package."""

from pathlib import Path

from ._native import InvalidInput


def cmake_dir() -> str:
    """The folder of arapfieldsConfig.cmake as a str, the value of CMake's variable arapfields_DIR.

    InvalidInput if the package was installed without its C++ part, as in Blender's extension.
    """
    folder = Path(__file__).parent / "share" / "cmake" / "arapfields"
    if not (folder / "arapfieldsConfig.cmake").is_file():
        raise InvalidInput(f"{folder}: there is no C++ package; a pip installation of arapfields has one")
    return str(folder)
