# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Blender extension: one zip with the add-on, our library, a binding per Python and what the
add-on takes from PyPI.

python blender_scripts/build_extension.py --output dist [--build build/eigen] [--python 3.11 3.13]
                                          [--platform macos-arm64]
"""

import argparse
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blender_scripts"))

from extension import (  # noqa: E402
    archive,
    bindings,
    check,
    dependencies,
    guide,
    libraries,
    macos,
    macos_check,
    wheel,
)
from extension.blender import extension_tool  # noqa: E402

WHEEL_TAGS = {"linux-x64": "py3-none-linux_x86_64", "macos-arm64": macos.WHEEL_TAG}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    parser.add_argument("--build", type=Path, default=ROOT / "build/eigen", help="CMake build folder to take")
    parser.add_argument("--platform", choices=WHEEL_TAGS, default="linux-x64", help="whom the zip is for")
    parser.add_argument("--jobs", type=int, help="compilers at a time for another platform's library")
    parser.add_argument(
        "--python",
        nargs="+",
        metavar="X.Y",
        help="Pythons that must be served (default: 3.11, and all at hand)",
    )
    parser.add_argument(
        "--repository", action="store_true", help="also index.json, to serve the output folder"
    )
    parser.add_argument(
        "--python-include", nargs="+", default=[], metavar="DIR", help="further folders with Python.h"
    )
    return parser.parse_args()


def own_headers():
    import sysconfig

    return [sysconfig.get_paths()["include"]]


def wanted_headers(options):
    found = bindings.find_headers([*options.python_include, *own_headers()])
    given = [tuple(map(int, text.split("."))) for text in options.python or ["3.11"]]
    missing = [f"{major}.{minor}" for major, minor in given if (major, minor) not in found]
    if missing:
        raise RuntimeError(f"no headers of Python {', '.join(missing)} at hand (pass --python-include DIR)")
    if options.python:
        return {version: found[version] for version in given}
    for version in bindings.SERVED:
        if version not in found:
            print("no headers of Python {}.{} at hand: Blenders with it will not be served".format(*version))
    return found


def linux_files(options, headers, work):
    """Paths of the library and of a binding for each of the Pythons."""
    shutil.rmtree(work / "files", ignore_errors=True)
    (work / "files").mkdir(parents=True)
    library = libraries.stripped(options.build / "python/arapfields/libarapfields.so", work / "files")
    modules = bindings.gather_bindings(ROOT, options.build, headers, work, work / "files")
    for module in modules:
        libraries.stripped(module, work / "files")
        missing = libraries.missing_symbols(module, library)
        if missing:
            raise RuntimeError(f"{module.name} was built for another library: {missing[0]} is missing")
    foreign = libraries.foreign_needs([library, *modules])
    if foreign:
        raise RuntimeError(f"the libraries need what would not be shipped: {', '.join(foreign)}")
    print("needs glibc {}.{} or newer".format(*libraries.glibc_floor([library, *modules])))
    return [library, *modules]


def build_wheel(options, version, headers):
    if options.platform == "linux-x64":
        native = linux_files(options, headers, ROOT / "build/extension")
    else:
        native = macos.build_files(options.build, headers, ROOT / "build/macos", options.jobs)
    package = options.build / "python/arapfields"
    files = {f"arapfields/{path.name}": path for path in native}
    for path in package.rglob("*"):
        if path.suffix in (".py", ".pyi", ".json") or path.name == "py.typed":
            files[f"arapfields/{path.relative_to(package).as_posix()}"] = path
    licence = (ROOT / "LICENSE").read_text()
    tag = WHEEL_TAGS[options.platform]
    return wheel.write_wheel(options.output / "wheels", "arapfields", version, tag, files, licence)


def build(options):
    options.output, options.build = options.output.resolve(), options.build.resolve()
    if not (options.build / "python/arapfields/libarapfields.so").exists():
        raise RuntimeError(f"no built package in {options.build} (run make build BACKEND=eigen)")
    addon = ROOT / "addon"
    manifest = archive.read_manifest(addon)
    version = bindings.cached(options.build, "CMAKE_PROJECT_VERSION")
    if manifest["version"] != version:
        raise RuntimeError(f"the manifest says version {manifest['version']}, the library is {version}")
    headers = wanted_headers(options)
    print("Pythons:", ", ".join(f"{a}.{b}" for a, b in headers))
    folder = options.output / "wheels"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    wheels = [build_wheel(options, version, headers)]
    wheels += dependencies.dependency_wheels((ROOT / "requirements.txt").read_text(), folder)
    path = options.output / f"arapfields-{version}-{options.platform}.zip"
    options_table = options.build / "python/arapfields/options.json"
    licence, pages = (ROOT / "LICENSE").read_text(), guide.guide_files(ROOT / "docs")
    archive.write_extension(addon, options_table, wheels, licence, pages, path, options.platform)
    check.check_zip(path, headers)
    if options.platform == "macos-arm64":
        print("\n".join(macos_check.report(path, headers)))
    extension_tool("validate", path)
    print(f"{path} ({path.stat().st_size / 1e6:.0f} MB)")
    if options.repository:
        extension_tool("server-generate", f"--repo-dir={options.output}", "--html")
        print(f"{options.output / 'index.json'} (a repository: serve this folder)")


if __name__ == "__main__":
    try:
        build(arguments())
    except RuntimeError as error:
        sys.exit(f"build_extension: {error}")
