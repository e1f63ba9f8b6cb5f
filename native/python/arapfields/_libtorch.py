# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that the installed torch has the version that the library was built against.

The ABI of libtorch changes between versions: with another version the library fails to load or crashes. So
versions are compared before the library is loaded.
"""

from importlib import metadata
from pathlib import Path

HERE = Path(__file__).parent


def check(folder: Path = HERE) -> None:
    """ImportError in one line if torch is missing or has another version."""
    noted = folder / "libtorch.txt"
    built_against = noted.read_text(encoding="utf-8").strip() if noted.is_file() else ""
    if not built_against:
        return
    remedy = f"pip install torch=={built_against}"
    try:
        installed = metadata.version("torch")
    except metadata.PackageNotFoundError:
        needed = f"arapfields needs torch {built_against}, which is not installed"
        raise ImportError(f"{needed}: {remedy}") from None
    if installed.partition("+")[0] != built_against:
        found = f"arapfields was built against torch {built_against}, and torch {installed} is installed"
        raise ImportError(f"{found}: {remedy}, or build arapfields anew")
