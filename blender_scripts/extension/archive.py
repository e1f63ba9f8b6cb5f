# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's zip: manifest, add-on and wheel."""

import re
import tomllib
import zipfile

from .wheel import entry

# Of platforms that were built and have not been run: what the manifest says of it, to readers and to users.
NOT_RUN = {
    "macos-arm64": (
        "Built on Linux, and not yet run on a Mac: docs/install.md has a checklist",
        " (not yet run)",
    )
}

OPTIONS = "core/settings/options.json"  # where addon/core/settings/parameters.py looks for it


def read_manifest(addon):
    return tomllib.loads((addon / "blender_manifest.toml").read_text())


def addon_files(addon):
    """Archive name → path of everything of the add-on that ships, but the manifest."""
    kept = [path for path in sorted(addon.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    names = {str(path.relative_to(addon)): path for path in kept}
    names.pop("blender_manifest.toml")
    return names


def platform_manifest(text, platform):
    """The manifest's text for one platform alone."""
    text = re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M)
    if platform in NOT_RUN:
        remark, mark = NOT_RUN[platform]
        text = re.sub(r'^(tagline = ".*)"$', rf'# {remark}.\n\1{mark}"', text, flags=re.M)
    return text


def write_extension(addon, options, wheels, licence, guide, path, platform=None):
    """Writes the extension's zip for `platform` to `path`; `options` is the library's options.json, that
    makes the panel; `guide` the user's guide, archive name → bytes. Without a platform: the manifest's own.

    Wheels, compressed already, are stored.
    """
    lines = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    # Keys after a table would belong to it: the wheels go before the first one.
    text = (addon / "blender_manifest.toml").read_text()
    text = platform_manifest(text, platform) if platform else text
    head, table, tail = text.partition("\n[")
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
