# SPDX-License-Identifier: GPL-3.0-or-later
"""The native part of the extension for macOS on ARM, built on Linux: torch's libraries under names of our
own, libarapfields and a binding per Python. Nothing of it has run; macos_check.py says what can be said
without.
"""

import json
import shutil
import sys
from pathlib import Path

import pybind11

from . import macho, macho_sign, macos_tools
from .bindings import cached
from .macos_headers import macos_headers

ROOT = Path(__file__).resolve().parents[2]
WHEEL_TAG = "py3-none-macosx_{}_{}_arm64".format(*macos_tools.SYSTEM)
LIBRARY = "libarapfields.dylib"
SHIPPED = ("libomp.dylib", "libc10.dylib", "libtorch_cpu.dylib")  # each needs those before it
# Two copies of LLVM's OpenMP in a process end it, when the second finds what the first has put into the
# environment under this name. Ours looks for a name of its own.
REGISTERED, OUR_REGISTERED = b"__KMP_REGISTERED_LIB", b"__AMP_REGISTERED_LIB"
TARGETS = ["arapfields_plain", "arapfields_io", "arapfields_torch", "arapfields_simd_neon"]


def module_name(version):
    return f"_native.cpython-{version[0]}{version[1]}-darwin.so"


def private_name(name):
    """libtorch_cpu.dylib → libarapfields-torch_cpu.dylib"""
    return name.replace("lib", "libarapfields-", 1)


def in_own_folder(name):
    return f"@loader_path/{name}"


def private_libraries(torch, output):
    """Copies of what is shipped of libtorch, under names of our own and signed anew; their paths."""
    output.mkdir(parents=True, exist_ok=True)
    originals = [torch / "lib" / name for name in SHIPPED]
    renamed = {
        macho.install_name(macho.read(path)): in_own_folder(private_name(path.name)) for path in originals
    }
    renamed |= {f"@rpath/{name}": in_own_folder(private_name(name)) for name in SHIPPED}
    copies = []
    for path in originals:
        copy = output / private_name(path.name)
        copies.append(copy)
        if copy.exists() and copy.stat().st_mtime >= Path(__file__).stat().st_mtime:
            continue
        partial = copy.with_suffix(".partial")
        shutil.copyfile(path, partial)
        macho.rename(partial, in_own_folder(copy.name), renamed)
        if path.name == "libomp.dylib":
            keep_registration_apart(partial)
        macho_sign.sign(partial, copy.stem)
        partial.chmod(0o755)
        partial.rename(copy)
    return copies


def keep_registration_apart(path):
    data = path.read_bytes()
    if data.count(REGISTERED) < 1:
        raise RuntimeError(f"{path.name} registers itself under another name than {REGISTERED.decode()}")
    path.write_bytes(data.replace(REGISTERED, OUR_REGISTERED))


def cmake(build):
    beside = Path(sys.executable).parent / "cmake"
    return [str(beside) if beside.exists() else "cmake", *build]


def configure(folder, settings, build, work):
    """Configures `folder` for macOS on ARM with the tools of the Linux build `build`. Objects alone are built
    by CMake, so that it needs none of Apple's programs; macos_tools links them."""
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_SYSTEM_NAME": "Darwin",
        "CMAKE_SYSTEM_PROCESSOR": "arm64",
        "CMAKE_CXX_COMPILER": macos_tools.compiler(work),
        "CMAKE_TRY_COMPILE_TARGET_TYPE": "STATIC_LIBRARY",
        "CMAKE_OSX_SYSROOT": "",
        "CMAKE_OSX_DEPLOYMENT_TARGET": "",
        "CMAKE_INSTALL_NAME_TOOL": shutil.which("true"),
        "CMAKE_AR": shutil.which("ar"),
        "CMAKE_RANLIB": shutil.which("ranlib"),
        "EIGEN_INCLUDE_DIR": cached(build, "EIGEN_INCLUDE_DIR"),
        **settings,
    }
    for name in ("CMAKE_CXX_COMPILER_LAUNCHER", "CMAKE_MAKE_PROGRAM"):
        if cached(build, name):
            settings[name] = cached(build, name)
    given = [f"-D{name}={value}" for name, value in settings.items()]
    macos_tools.run(cmake(["-S", ROOT, "-B", folder, "-G", "Ninja", *given]))


def objects(folder, targets, jobs):
    """Compiles the targets in the configured `folder`; paths of their objects."""
    command = ["--build", folder, *(["--parallel", str(jobs)] if jobs else []), "--target", *targets]
    macos_tools.run(cmake(command))
    entries = json.loads((folder / "compile_commands.json").read_text())
    outputs = [folder / entry["output"] for entry in entries]
    parts = {f"{target}.dir" for target in targets}
    return [path for path in outputs if path.suffix == ".o" and parts & set(path.parts)]


def build_library(torch, shipped, stubs, build, work, jobs):
    """Compiles and links libarapfields; its path."""
    folder = work / "build"
    configure(folder, {"LIBTORCH_DIR": torch, "Python_EXECUTABLE": sys.executable}, build, work)
    inputs = [*objects(folder, TARGETS, jobs), *shipped, *stubs]
    output = work / "libraries" / LIBRARY
    kind = ("-dylib", "-install_name", in_own_folder(LIBRARY))
    return macos_tools.link(work, output, inputs, ROOT / "cmake/exports.macos", *kind)


def build_binding(version, headers, library, stubs, build, work, jobs):
    """Compiles and links the binding for one Python, whose functions the process has; its path."""
    folder = work / "binding-{}.{}".format(*version)
    settings = {
        "ARAPFIELDS_BINDING_HEADERS": macos_headers(headers, work / "python-headers"),
        "ARAPFIELDS_BINDING_NAME": module_name(version),
        "ARAPFIELDS_LIBRARY": library,
        "ARAPFIELDS_GENERATED": work / "build/generated",
        "PYBIND11_INCLUDE_DIR": pybind11.get_include(),
    }
    configure(folder, settings, build, work)
    exported = folder / "exports"
    exported.write_text("_PyInit__native\n")
    inputs = [*objects(folder, ["_native"], jobs), library, *stubs]
    output = work / "libraries" / module_name(version)
    return macos_tools.link(work, output, inputs, exported, "-bundle", "-undefined", "dynamic_lookup")


def build_files(build, headers, work, jobs):
    """Everything native of the extension: paths of libarapfields, of torch's libraries and of the bindings
    for the Pythons of `headers`, in that order. `build` is the CMake folder of the Linux build."""
    version = (build / "generated/libtorch.txt").read_text().strip()
    torch = macos_tools.torch_wheel(version, work)
    stubs = macos_tools.write_stubs([torch / "lib" / name for name in SHIPPED], work)
    shipped = private_libraries(torch, work / "libraries")
    library = build_library(torch, shipped, stubs, build, work, jobs)
    modules = [
        build_binding(python, folder, library, stubs, build, work, jobs) for python, folder in headers.items()
    ]
    return [library, *shipped, *modules]
