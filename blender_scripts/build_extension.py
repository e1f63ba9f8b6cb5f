# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Blender extension: one zip with the add-on, our library, libtorch and a binding per Python.

python blender_scripts/build_extension.py --output dist [--build build/wheel] [--python 3.11 3.13]
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blender_scripts"))

from extension import archive, bindings, libraries, wheel  # noqa: E402

LIMIT = 200e6
WHEEL_TAG = "py3-none-linux_x86_64"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    parser.add_argument("--build", type=Path, default=ROOT / "build/wheel", help="CMake build folder to take")
    parser.add_argument(
        "--python", nargs="+", metavar="X.Y", help="Pythons that must be served (default: at hand)"
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
    if not options.python:
        return found
    wanted = [tuple(map(int, text.split("."))) for text in options.python]
    missing = [f"{major}.{minor}" for major, minor in wanted if (major, minor) not in found]
    if missing:
        raise RuntimeError(f"no headers of Python {', '.join(missing)} at hand (pass --python-include DIR)")
    return {version: found[version] for version in wanted}


def build_wheel(options, version, headers, work):
    package = options.build / "python/arapfields"
    torch = libraries.library_folder(bindings.cached(options.build, "LIBTORCH_DIR"))
    shipped = libraries.prepare_libraries(package / "libarapfields.so", torch, work / "libraries")
    folder = work / "bindings"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    modules = bindings.gather_bindings(ROOT, options.build, headers, work, folder)
    for module in modules:
        libraries.strip(module)
        libraries.make_private(module, {})
        missing = libraries.missing_symbols(module, shipped[0])
        if missing:
            raise RuntimeError(f"{module.name} was built for another library: {missing[0]} is missing")
    foreign = libraries.foreign_needs([*shipped, *modules], [path.name for path in shipped])
    if foreign:
        raise RuntimeError(f"the libraries need what would not be shipped: {', '.join(foreign)}")
    print("needs glibc {}.{} or newer".format(*libraries.glibc_floor([shipped[0], *modules])))
    files = {f"arapfields/{path.name}": path for path in [*shipped, *modules]}
    for path in package.rglob("*"):
        if path.suffix in (".py", ".pyi") or path.name == "py.typed":
            files[f"arapfields/{path.relative_to(package).as_posix()}"] = path
    licence = (ROOT / "LICENSE").read_text()
    return wheel.write_wheel(options.output / "wheels", "arapfields", version, WHEEL_TAG, files, licence)


def validate(path):
    """Asks Blender's extension tool, in a process of its own."""
    code = "import sys, bpy, addon_utils; from bl_pkg import bl_extension_cli as c; "
    code += "sys.exit(c.cli_extension_handler(['validate', sys.argv[1]]))"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"Blender does not accept {path.name}:\n{done.stdout}{done.stderr}")


def build(options):
    options.output, options.build = options.output.resolve(), options.build.resolve()
    if not (options.build / "python/arapfields/libarapfields.so").exists():
        raise RuntimeError(f"no built package in {options.build} (run make build)")
    addon = ROOT / "addon"
    manifest = archive.read_manifest(addon)
    version = bindings.cached(options.build, "CMAKE_PROJECT_VERSION")
    if manifest["version"] != version:
        raise RuntimeError(f"the manifest says version {manifest['version']}, the library is {version}")
    headers = wanted_headers(options)
    print("Pythons:", ", ".join(f"{a}.{b}" for a, b in headers))
    (options.output / "wheels").mkdir(parents=True, exist_ok=True)
    wheels = [build_wheel(options, version, headers, ROOT / "build/extension")]
    archive.check_platforms(manifest, wheels)
    path = options.output / f"arapfields-{version}-linux-x64.zip"
    archive.write_extension(addon, wheels, (ROOT / "LICENSE").read_text(), path)
    validate(path)
    size = path.stat().st_size
    if size > LIMIT:
        raise RuntimeError(f"{path} has {size / 1e6:.0f} MB; the limit is {LIMIT / 1e6:.0f}")
    print(f"{path} ({size / 1e6:.0f} MB)")


if __name__ == "__main__":
    try:
        build(arguments())
    except RuntimeError as error:
        sys.exit(f"build_extension: {error}")
