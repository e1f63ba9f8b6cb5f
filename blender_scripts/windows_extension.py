# SPDX-License-Identifier: GPL-3.0-or-later
"""Packs the Blender extension for Windows from wheels that were built there, one a Python.

Not run on Windows yet.

python blender_scripts/windows_extension.py raw/*.whl --torch SITE_PACKAGES/torch/lib --output dist
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blender_scripts"))

from extension import archive, dependencies, guide, wheel  # noqa: E402
from extension.blender import extension_tool  # noqa: E402

PLATFORM, TAG = "windows-x64", "py3-none-win_amd64"
LIMIT = 200e6
SHIPPED = (".py", ".pyi", ".json", ".dll", ".typed", ".pyd")


def unpacked(path, folder):
    """The package of a wheel, archive name → file; what only pip installations use is left out."""
    with zipfile.ZipFile(path) as content:
        names = [n for n in content.namelist() if n.startswith("arapfields/") and n.endswith(SHIPPED)]
        content.extractall(folder, names)
    return {name: folder / name for name in names if "/include/" not in name and "/share/" not in name}


def merged(wheels, folder):
    """One wheel of the first one's library with the bindings of all, and its files.

    They were compiled from the same sources by the same compiler, and find the library by its name.
    """
    files = {}
    for number, path in enumerate(wheels):
        own = unpacked(path, folder / str(number))
        files |= own if number == 0 else {name: file for name, file in own.items() if name.endswith(".pyd")}
    bindings = sorted(name for name in files if name.endswith(".pyd"))
    if len(bindings) != len(wheels):
        raise RuntimeError(f"{len(wheels)} wheels have {len(bindings)} bindings: {', '.join(bindings)}")
    if "arapfields/arapfields.dll" not in files:
        raise RuntimeError(f"{wheels[0].name} lacks arapfields/arapfields.dll")
    version = wheels[0].name.split("-")[1]
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    return wheel.write_wheel(folder, "arapfields", version, TAG, files, licence), files


def with_private_libraries(path, torch, folder):
    """The wheel with torch's libraries inside, under names of their own.

    Windows takes a library of the same name that another add-on has loaded for ours.
    """
    command = [sys.executable, "-m", "delvewheel", "repair", "--ignore-existing", "--analyze-existing"]
    subprocess.run([*command, "--add-path", torch, "-w", folder, path], check=True)
    (made,) = folder.glob("*.whl")
    return made


def windows_addon(folder):
    """A copy of the add-on whose manifest names Windows alone."""
    copy = shutil.copytree(ROOT / "addon", folder / "addon", ignore=shutil.ignore_patterns("__pycache__"))
    manifest = copy / "blender_manifest.toml"
    text, count = re.subn(
        r"^platforms = .*$",
        f'platforms = ["{PLATFORM}"]',
        manifest.read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
    if count != 1:
        raise RuntimeError("the manifest has no line of platforms")
    manifest.write_text(text, encoding="utf-8", newline="\n")
    return copy


def pack(ours, options, others, folder, output):
    """The extension's zip, and its size checked."""
    version = ours.name.split("-")[1]
    path = output / f"arapfields-{version}-{PLATFORM}.zip"
    licence, pages = (ROOT / "LICENSE").read_text(encoding="utf-8"), guide.guide_files(ROOT / "docs")
    archive.write_extension(windows_addon(folder), options, [ours, *others], licence, pages, path)
    if path.stat().st_size > LIMIT:
        raise RuntimeError(f"{path} has {path.stat().st_size / 1e6:.0f} MB; the limit is {LIMIT / 1e6:.0f}")
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+", help="as pip builds them, one a Python")
    parser.add_argument("--torch", type=Path, required=True, help="the folder of torch's libraries")
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        raw, files = merged(given.wheels, folder)
        ours = with_private_libraries(raw, given.torch, folder / "repaired")
        requirements = (ROOT / "requirements.txt").read_text(encoding="utf-8")
        others = dependencies.dependency_wheels(requirements, folder)
        path = pack(ours, files["arapfields/options.json"], others, folder, given.output)
    extension_tool("validate", path)
    print(f"{path} ({path.stat().st_size / 1e6:.0f} MB)")


if __name__ == "__main__":
    main()
