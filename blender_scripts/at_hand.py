# SPDX-License-Identifier: GPL-3.0-or-later
"""What a figure lacks here, before it is tried."""

import io
import os
import re
import zipfile
from pathlib import Path

import windowed

ROOT = Path(__file__).resolve().parents[1]
PEERS = ROOT / "build" / "bench" / "peers"  # what make bench PEERS=path keeps of its results


def data_folder():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def lacking(figure):
    """One line; None where the figure can be made."""
    if figure.published and not data_folder().is_dir():
        return f"no published shapes at {data_folder()}"
    if figure.peers and not any(PEERS.glob("moved-*.npz")):
        return "no results of others' code (make bench PEERS=path)"
    return lacking_of_window() if figure.window else None


def lacking_of_window():
    """windowed.py says what a film is made with."""
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
