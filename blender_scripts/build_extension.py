# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Blender extension: a zip with the add-on and its wheels for each platform.

python blender_scripts/build_extension.py linux-x64 windows-x64 --output dist
"""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "blender_scripts"), str(ROOT / "cmake/wheel")]

from extension import archive, guide  # noqa: E402
from extension.blender import extension_tool  # noqa: E402
from platforms import PLATFORMS  # noqa: E402


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("platforms", nargs="+", choices=[*PLATFORMS, "all"], metavar="platform")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="has the wheels, gets the zips")
    given = parser.parse_args()
    given.platforms = list(PLATFORMS) if "all" in given.platforms else given.platforms
    return given


def own_wheels(platform, folder, version):
    """The wheels for all Pythons, built by build_wheels.py."""
    names = map(platform.wheel_tags, platform.wheels)
    wheels = [folder / f"arapfields-{version}-{name}.whl" for name in names]
    missing = [wheel.name for wheel in wheels if not wheel.exists()]
    if missing:
        raise RuntimeError(f"{folder} lacks {', '.join(missing)} (make wheels PLATFORM={platform.name})")
    return wheels


def polib(folder):
    """The wheel of polib (reads translations), in the version of requirements.txt."""
    (pinned,) = [line for line in (ROOT / "requirements.txt").read_text().splitlines() if "polib==" in line]
    command = [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*command, "--only-binary", ":all:", "--dest", folder, pinned], check=True)
    (wheel,) = folder.glob(f"{pinned.replace('==', '-')}-*-none-any.whl")
    return wheel


def build(platform, folder):
    addon = ROOT / "addon"
    version = archive.read_manifest(addon)["version"]
    wheels = [*own_wheels(platform, folder, version), polib(ROOT / "build")]
    path = folder / f"arapfields-{version}-{platform.name}.zip"
    licence, pages = (ROOT / "LICENSE").read_text(), guide.guide_files(ROOT / "docs")
    archive.write_extension(addon, wheels, licence, pages, path, platform.name)
    archive.check_zip(path, wheels)
    extension_tool("validate", path)
    print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    given = arguments()
    try:
        for name in given.platforms:
            build(PLATFORMS[name], given.output.resolve())
    except (RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"build_extension: {error}")
