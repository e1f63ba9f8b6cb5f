# SPDX-License-Identifier: GPL-3.0-or-later
"""What a figure of Blender's window lacks here, before it is tried: windowed.py says what it is made with."""

import io
import re
import zipfile

import windowed


def lacking():
    """One line; None where the film can be made."""
    missing, python = windowed.missing(), pythons_version()
    if missing or not python or has_native_module(windowed.extension(), python):
        return missing
    return f"the extension in dist is not for that Blender's Python (make extension PYTHONS={python})"


def pythons_version():
    """The newest Python of the system with that Blender, as "3.14"; None where none is found."""
    folders = (windowed.CHROOT / "usr/lib").glob("python3.*")
    minors = [int(found[1]) for path in folders if (found := re.fullmatch(r"python3\.(\d+)", path.name))]
    return f"3.{max(minors)}" if minors else None


def has_native_module(extension, python):
    """Whether a wheel in the extension has a module for that Python."""
    mark = f"cpython-{python.replace('.', '')}-"
    with zipfile.ZipFile(extension) as outer:
        wheels = [io.BytesIO(outer.read(name)) for name in outer.namelist() if name.endswith(".whl")]
    return any(mark in name for wheel in wheels for name in zipfile.ZipFile(wheel).namelist())
