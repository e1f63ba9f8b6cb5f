# SPDX-License-Identifier: GPL-3.0-or-later
"""The platforms of wheels, with cross compilers on Linux."""

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = [(3, 11), (3, 12), (3, 13), (3, 14)]
BLENDERS = [(3, 11), (3, 13), (3, 14)]  # of the Blender versions that the extension supports
GLIBC = (2, 28)
MACOS = (11, 0)
ONE_MODULE = {"ARAPFIELDS_ONE_MODULE": "ON"}


@dataclass(frozen=True)
class Platform:
    """A platform of Blender; `compiler`: its GCC, or "zig" with this `target`.

    `library`: the library's file; without one, the library is linked into each Python's module.
    """

    name: str
    tag: str
    suffix: str  # of the module's file, after "cp311"
    compiler: str
    target: str
    library: str = ""

    @property
    def system(self):
        return self.name.partition("-")[0]

    @property
    def wheels(self):
        """The Pythons of each wheel."""
        return self.extension_wheels + [[version] for version in PYTHONS if version not in BLENDERS]

    @property
    def extension_wheels(self):
        """The Pythons of each wheel in the zip: one wheel for all if the library is a separate file."""
        return [BLENDERS] if self.library else [[version] for version in BLENDERS]

    def wheel_tags(self, pythons):
        """The tags in a wheel's file name."""
        served = ".".join(map("cp{0[0]}{0[1]}".format, pythons))
        return f"{served}-{served}-{self.tag}"

    def module_suffix(self, version):
        return self.suffix.format("{}{}".format(*version))


PLATFORMS = {
    platform.name: platform
    for platform in [
        Platform(
            "linux-x64",
            "manylinux_{}_{}_x86_64".format(*GLIBC),
            ".cpython-{}-x86_64-linux-gnu.so",
            "g++",
            "x86_64-linux-gnu",
            "libarapfields.so",
        ),
        Platform(
            "linux-arm64",
            "manylinux_{}_{}_aarch64".format(*GLIBC),
            ".cpython-{}-aarch64-linux-gnu.so",
            "aarch64-linux-gnu-g++",
            "aarch64-linux-gnu",
            "libarapfields.so",
        ),
        Platform(
            "windows-x64",
            "win_amd64",
            ".cp{}-win_amd64.pyd",
            "x86_64-w64-mingw32-g++-posix",
            "x86_64-windows-gnu",
            "libarapfields.dll",
        ),
        Platform("windows-arm64", "win_arm64", ".cp{}-win_arm64.pyd", "zig", "aarch64-windows-gnu"),
        Platform(
            "macos-arm64",
            "macosx_{}_{}_arm64".format(*MACOS),
            ".cpython-{}-darwin.so",
            "zig",
            "aarch64-macos.{}.{}".format(*MACOS),
        ),
        Platform(
            "macos-x64",
            "macosx_{}_{}_x86_64".format(*MACOS),
            ".cpython-{}-darwin.so",
            "zig",
            "x86_64-macos.{}.{}".format(*MACOS),
        ),
    ]
}


def run(*command, **keywords):
    """The output of a command; RuntimeError with the end of its output if it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **keywords)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {(done.stdout + done.stderr).strip()[-4000:]}")
    return done.stdout


def zig(*command):
    return [sys.executable, "-m", "ziglang", *command]


def zig_library():
    import ziglang

    return Path(ziglang.__file__).parent / "lib"


def definitions(platform, work):
    """CMake definitions of the platform; tools that they refer to are made in `work`."""
    found = {"linux": linux, "windows": windows, "macos": macos}[platform.system](platform, work)
    if platform.compiler == "zig":
        script = work / "clang++"  # by this name CMake and ccache recognize it
        script.write_text(f'#!/bin/sh\nexec {shlex.join(zig("c++", "-target", platform.target))} "$@"\n')
        script.chmod(0o755)
        found["CMAKE_CXX_COMPILER"] = script
        found["CMAKE_MODULE_LINKER_FLAGS"] = "-s"
        # Options of GCC.
        found["CMAKE_CXX_FLAGS"] = "-Wno-unused-command-line-argument -Wno-unknown-warning-option"
    elif not shutil.which(platform.compiler):
        package = platform.compiler.replace("x86_64-w64-mingw32-g++", "g++-mingw-w64-x86-64")
        package = "g++-aarch64-linux-gnu" if platform.name == "linux-arm64" else package
        raise RuntimeError(f"{platform.name} needs {platform.compiler} (Debian: {package})")
    return found


def linux(platform, work):
    import old_glibc

    given = {} if platform.name == "linux-x64" else cross("Linux", "aarch64")
    return given | {"CMAKE_CXX_COMPILER": platform.compiler} | old_glibc.link_flags(platform, GLIBC, work)


def windows(platform, work):
    if platform.compiler != "zig":
        flags = {f"CMAKE_{kind}_LINKER_FLAGS": "-static -s" for kind in ("MODULE", "SHARED")}
        return flags | {"CMAKE_TOOLCHAIN_FILE": ROOT / "cmake/mingw-w64.cmake"}
    return ONE_MODULE | cross("Windows", "arm64")


def macos(platform, work):
    processor = "arm64" if platform.name == "macos-arm64" else "x86_64"
    # No install name to change.
    return ONE_MODULE | cross("Darwin", processor) | {"CMAKE_INSTALL_NAME_TOOL": "/bin/true"}


def cross(system, processor):
    return {"CMAKE_SYSTEM_NAME": system, "CMAKE_SYSTEM_PROCESSOR": processor}


def python_library(platform, version, headers, work):
    """The import library of a Python's DLL, for the linker of Windows; "" for other systems."""
    if platform.system != "windows":
        return ""
    name = "python{}{}".format(*version)
    definition, library = work / f"{name}.def", work / f"lib{name}.a"
    lines = [
        f"  {symbol}{'' if kind == 'FUNC' else ' DATA'}" for symbol, kind in sorted(declared(headers).items())
    ]
    definition.write_text("\n".join([f"LIBRARY {name}.dll", "EXPORTS", *lines, ""]))
    machine = "arm64" if platform.name == "windows-arm64" else "i386:x86-64"
    run(*zig("dlltool", "-m", machine, "-d", definition, "-l", library))
    return library


DECLARED = re.compile(r"PyAPI_(FUNC|DATA)\((?:[^()]|\([^()]*\))*\)\s*(?:\w+\s+)*?\**(_?Py\w+)\s*[(;\[,]")


def declared(headers):
    """{name: FUNC or DATA} of the symbols declared in a Python's headers."""
    texts = (path.read_text(errors="replace") for path in Path(headers).rglob("*.h"))
    return {name: kind for text in texts for kind, name in DECLARED.findall(text)}
