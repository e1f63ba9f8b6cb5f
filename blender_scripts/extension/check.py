# SPDX-License-Identifier: GPL-3.0-or-later
"""What a finished zip must hold; read from the zip itself, not from what was meant to go into it."""

import io
import re
import tomllib
import zipfile
from pathlib import Path

from . import dependencies
from .archive import OPTIONS

LIMITS = {"linux-x64": 10e6, "macos-arm64": 200e6}
PLATFORM_TAGS = {"linux-x64": r"(many)?linux.*_x86_64", "macos-arm64": r"macosx_\d+_\d+_arm64"}
LIBRARY = re.compile(r"arapfields/libarapfields\.(so|dylib)")


def check_platforms(manifest, names):
    """Each declared platform needs a wheel: Blender itself would take a zip without native code."""
    for platform in manifest["platforms"]:
        tag = PLATFORM_TAGS.get(platform)
        if not tag or not any(re.search(rf"-{tag}\.whl$", name) for name in names):
            raise RuntimeError(f"the manifest declares {platform}, for which no wheel was built")


def check_zip(path, pythons):
    """RuntimeError unless the zip is small, whole, and serves its platforms and these (major, minor)."""
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        missing = {"blender_manifest.toml", "__init__.py", "LICENSE", OPTIONS, "guide/index.html"} - names
        if missing:
            raise RuntimeError(f"{path.name} lacks {', '.join(sorted(missing))}")
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        wheels = [name.removeprefix("./") for name in manifest.get("wheels", [])]
        if not set(wheels) <= names:
            raise RuntimeError(f"{path.name} lacks {', '.join(sorted(set(wheels) - names))}")
        check_platforms(manifest, wheels)
        size, limit = path.stat().st_size, min(LIMITS[platform] for platform in manifest["platforms"])
        if size > limit:
            raise RuntimeError(f"{path} has {size / 1e6:.0f} MB; the limit is {limit / 1e6:.0f}")
        for name in dependencies.SHIPPED:
            if not any(Path(wheel).name.startswith(f"{name}-") for wheel in wheels):
                raise RuntimeError(f"{path.name} lacks the wheel of {name}")
        ours = [wheel for wheel in wheels if Path(wheel).name.startswith("arapfields-")]
        for wheel in ours:
            with zipfile.ZipFile(io.BytesIO(archive.read(wheel))) as content:
                check_wheel(wheel, content.namelist(), pythons)


def check_wheel(wheel, names, pythons):
    """A wheel has the library once, and a binding for each Python."""
    copies = sum(1 for name in names if LIBRARY.fullmatch(name))
    if copies != 1:
        raise RuntimeError(f"{wheel} has {copies} copies of libarapfields")
    for major, minor in pythons:
        if not any(name.startswith(f"arapfields/_native.cpython-{major}{minor}-") for name in names):
            raise RuntimeError(f"{wheel} has no binding for Python {major}.{minor}")
