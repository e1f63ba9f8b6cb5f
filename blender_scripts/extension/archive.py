# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's zip: manifest, add-on and wheels."""

import re
import tomllib
import zipfile
from pathlib import Path

OPTIONS = "core/settings/options.json"  # read by addon/core/settings/parameters.py
RUN = ("linux-x64", "windows-x64")  # the manifests of the others say that they are untested
TIMESTAMP = (2020, 1, 1, 0, 0, 0)  # for reproducible archives


def entry(name, method=zipfile.ZIP_DEFLATED):
    info = zipfile.ZipInfo(name, TIMESTAMP)
    info.external_attr = 0o100644 << 16
    info.compress_type = method
    return info


def read_manifest(addon):
    return tomllib.loads((addon / "blender_manifest.toml").read_text())


def addon_files(addon):
    """{archive name: path} of all shipped files of the add-on except the manifest."""
    kept = [path for path in sorted(addon.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    names = {str(path.relative_to(addon)): path for path in kept}
    names.pop("blender_manifest.toml")
    return names


def manifest_text(text, platform, wheels):
    """The manifest for one platform and its wheels."""
    text = re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M)
    if platform not in RUN:
        text = re.sub(r'^(tagline = ".*)"$', r'\1 (not yet run)"', text, flags=re.M)
    # Keys after a table belong to it: the wheels are inserted before the first table.
    head, table, tail = text.partition("\n[")
    lines = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    return f"{head}\nwheels = [\n{lines}]\n{table}{tail}"


def write_extension(addon, wheels, licence, guide, path, platform):
    """Writes the extension's zip to `path`; `guide`: {archive name: content} of the user's guide.

    options.json is taken from the first wheel. Wheels are stored, as they are compressed.
    """
    manifest = manifest_text((addon / "blender_manifest.toml").read_text(), platform, wheels)
    tomllib.loads(manifest)
    with zipfile.ZipFile(wheels[0]) as content:
        options = content.read("arapfields/options.json")
    partial = path.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", compresslevel=9) as archive:
        archive.writestr(entry("blender_manifest.toml"), manifest)
        archive.writestr(entry("LICENSE"), licence)
        archive.writestr(entry(OPTIONS), options)
        for name, source in addon_files(addon).items():
            archive.writestr(entry(name), source.read_bytes())
        for name, content in guide.items():
            archive.writestr(entry(name), content)
        for wheel in wheels:
            archive.writestr(entry(f"wheels/{wheel.name}", zipfile.ZIP_STORED), wheel.read_bytes())
    partial.replace(path)


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
