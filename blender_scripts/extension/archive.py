# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's zip: manifest, add-on and wheel."""

import tomllib
import zipfile

from .wheel import entry

OPTIONS = "core/settings/options.json"  # where addon/core/settings/parameters.py looks for it


def read_manifest(addon):
    return tomllib.loads((addon / "blender_manifest.toml").read_text())


def addon_files(addon):
    """Archive name → path of everything of the add-on that ships, but the manifest."""
    kept = [path for path in sorted(addon.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    names = {str(path.relative_to(addon)): path for path in kept}
    names.pop("blender_manifest.toml")
    return names


def write_extension(addon, options, wheels, licence, guide, path):
    """Writes the extension's zip to `path`; `options` is the library's options.json, which makes the panel;
    `guide` the user's guide, archive name → bytes.

    Wheels, compressed already, are stored.
    """
    lines = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    # Keys after a table would belong to it: the wheels go before the first one.
    head, table, tail = (addon / "blender_manifest.toml").read_text().partition("\n[")
    manifest = f"{head}\nwheels = [\n{lines}]\n{table}{tail}"
    tomllib.loads(manifest)
    partial = path.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", compresslevel=9) as archive:
        archive.writestr(entry("blender_manifest.toml"), manifest)
        archive.writestr(entry("LICENSE"), licence)
        for name, source in addon_files(addon).items():
            archive.writestr(entry(name), source.read_bytes())
        archive.writestr(entry(OPTIONS), options.read_bytes())
        for name, content in guide.items():
            archive.writestr(entry(name), content)
        for wheel in wheels:
            archive.writestr(entry(f"wheels/{wheel.name}", method=zipfile.ZIP_STORED), wheel.read_bytes())
    partial.replace(path)
    return path
