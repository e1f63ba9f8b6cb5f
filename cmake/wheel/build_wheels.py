# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the wheels of `arapfields` for each platform and Python, on Linux.

python cmake/wheel/build_wheels.py linux-x64 windows-x64 --output dist
"""

import argparse
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import check_wheel
import python_headers
from platforms import PLATFORMS, ROOT, definitions, python_library, run

WORK = ROOT / "build"
STUBS = "python/arapfields/_native.pyi"


def stubs():
    """An up-to-date _native.pyi, written by a build for this system."""
    newest = max(path.stat().st_mtime for path in (ROOT / "native/bindings").iterdir())
    found = [ROOT / build / STUBS for build in ("build/linux-x64", "build/eigen", "build/wheel")]
    for path in found:
        if path.exists() and path.stat().st_mtime > newest:
            return path
    run("make", "build", "BACKEND=eigen", cwd=ROOT)
    return ROOT / "build/eigen" / STUBS


def module_name(version):
    return "_native_cp{}{}".format(*version)


def settings(platform, build, pythons):
    """CMake definitions of a platform's build, with the modules for these Pythons."""
    (build / "tools").mkdir(parents=True, exist_ok=True)
    modules = []
    for version in pythons:
        headers = python_headers.headers(version)
        library = python_library(platform, version, headers, build / "tools")
        modules.append(f"{module_name(version)}|{headers}|{platform.module_suffix(version)}|{library}")
    given = {"ARAPFIELDS_MODULES": ";".join(modules), "ARAPFIELDS_WERROR": "ON"}
    if platform.name != "linux-x64":
        given["ARAPFIELDS_STUBS"] = stubs()
    return given | definitions(platform, build / "tools")


def build_wheels(platform, output, served):
    """Builds and checks the platform's wheels for the Pythons `served` in `output`; returns their paths."""
    build = WORK / platform.name
    targets = [*map(module_name, served), "stubs"]
    options = [f"build-dir={build}", "install.strip=false", f"build.targets={';'.join(targets)}"]
    options += [f"cmake.define.{name}={value}" for name, value in settings(platform, build, served).items()]
    made = []
    for pythons in [those for those in platform.wheels if set(those) <= set(served)]:
        tags = ["cp{0}{1}-cp{0}{1}-{2}".format(*version, platform.tag) for version in pythons]
        own = [
            f"wheel.tags={';'.join(tags)}",
            f"install.components={';'.join(['python', *map(module_name, pythons)])}",
        ]
        given = [part for option in [*options, *own] for part in ("-C", option)]
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "-v"]
        command = [*pip, "--no-build-isolation", "--no-deps", *given, "--wheel-dir", output, ROOT]
        with (build / "build.log").open("w") as log:
            done = subprocess.run(command, stdout=log, stderr=log, env=environment())
        if done.returncode:
            raise RuntimeError("\n".join((build / "build.log").read_text().splitlines()[-60:]))
        made += output.glob(f"arapfields-*-{platform.wheel_tags(pythons)}.whl")
    for wheel in made:
        pack(wheel)
    if said := check_wheel.problems(made):
        raise RuntimeError("\n".join(said))
    return made


def pack(wheel):
    """Compresses a wheel to the maximum: three wheels must fit into an extension's size limit."""
    with zipfile.ZipFile(wheel) as archive:
        files = [(info, archive.read(info)) for info in archive.infolist()]
    with zipfile.ZipFile(wheel, "w") as archive:
        for info, content in files:
            archive.writestr(info, content, zipfile.ZIP_DEFLATED, compresslevel=9)


def environment():
    """Environment variables with this Python's tools, such as ninja, first in PATH."""
    own = str(Path(sys.executable).parent)
    return {**os.environ, "PATH": f"{own}{os.pathsep}{os.environ['PATH']}"}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("platforms", nargs="+", choices=[*PLATFORMS, "all"], metavar="platform")
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    parser.add_argument(
        "--whole", action="store_true", help="refuse if headers of a Python are not to be had"
    )
    given = parser.parse_args()
    names = list(PLATFORMS) if "all" in given.platforms else given.platforms
    given.output.mkdir(parents=True, exist_ok=True)
    served = python_headers.pythons(given.whole)
    for name in names:
        start = time.monotonic()
        print(f"{name}: some minutes the first time; all output: {WORK / name / 'build.log'}", flush=True)
        for path in build_wheels(PLATFORMS[name], given.output.resolve(), served):
            print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
        print(f"{name}: {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    try:
        main()
    except RuntimeError as error:
        sys.exit(f"build_wheels: {error}")
