# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the content of a finished zip."""

import tomllib
import zipfile
from pathlib import Path

from .archive import OPTIONS

LIMIT = 10e6  # bytes
PARTS = {"blender_manifest.toml", "__init__.py", "LICENSE", OPTIONS, "guide/index.html"}


def check_zip(path, wheels):
    """RuntimeError if the zip is too large or incomplete, or its wheels differ from these files.

    Blender accepts a zip without native code.
    """
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        listed = {name.removeprefix("./") for name in manifest.get("wheels", [])}
        wanted = {f"wheels/{wheel.name}" for wheel in wheels}
        if missing := (PARTS | listed | wanted) - names:
            raise RuntimeError(f"{path.name} lacks {', '.join(sorted(missing))}")
        if listed != wanted:
            raise RuntimeError(
                f"{path.name} has other wheels than its manifest: {', '.join(listed ^ wanted)}"
            )
        for wheel in wheels:
            if archive.read(f"wheels/{wheel.name}") != Path(wheel).read_bytes():
                raise RuntimeError(f"{path.name} has another {wheel.name}")
    if path.stat().st_size > LIMIT:
        raise RuntimeError(f"{path} has {path.stat().st_size / 1e6:.1f} MB; the limit is {LIMIT / 1e6:.0f}")
