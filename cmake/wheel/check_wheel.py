# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks wheels: their tags, and the dependencies of their libraries, which are read by LIEF.

python cmake/wheel/check_wheel.py dist/*.whl
"""

import hashlib
import re
import struct
import sys
import zipfile
from email.parser import HeaderParser
from pathlib import Path

import lief

sys.path.insert(0, str(Path(__file__).parent))

import python_headers
from platforms import GLIBC, MACOS, PLATFORMS, declared, zig_library

LIMIT = 10e6  # bytes
PARTS = ("__init__.py", "py.typed", "_native.pyi", "options.json")
KERNELS = {"x64": (b"baseline", b"avx2", b"avx512"), "arm64": (b"neon",)}  # names by compiled_for()
MACHINES = {
    ("linux", "x64"): lief.ELF.ARCH.X86_64,
    ("linux", "arm64"): lief.ELF.ARCH.AARCH64,
    ("windows", "x64"): lief.PE.Header.MACHINE_TYPES.AMD64,
    ("windows", "arm64"): lief.PE.Header.MACHINE_TYPES.ARM64,
    ("macos", "x64"): lief.MachO.Header.CPU_TYPE.X86_64,
    ("macos", "arm64"): lief.MachO.Header.CPU_TYPE.ARM64,
}
SYSTEM = {  # libraries of every such system
    "linux": r"ld-linux\S*|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+)\.so\.\d+",
    "windows": r"(kernel32|ntdll|msvcrt|advapi32|shell32|bcrypt|bcryptprimitives|ws2_32|api-ms-win-\S+)\.dll",
    "macos": r"/usr/lib/libSystem\.B\.dylib|@rpath/_native\.so",  # the second is its install name
}
NEWEST = {"GLIBC": GLIBC, "GLIBCXX": (3, 4, 25), "CXXABI": (1, 3, 11), "GCC": (7, 0, 0)}  # manylinux_2_28


class Wheel:
    """A wheel, its platform and its problems."""

    def __init__(self, path):
        self.path, self.problems = Path(path), []
        python, _, tag = self.path.stem.split("-")[-3:]
        (self.platform,) = [one for one in PLATFORMS.values() if one.tag == tag]
        pythons = [(int(one[2]), int(one[3:])) for one in python.split(".")]
        self.modules = {f"_native{self.platform.module_suffix(one)}": one for one in pythons}
        with zipfile.ZipFile(self.path) as archive:
            self.files = {name: archive.read(name) for name in archive.namelist()}
        self.headers = {
            name: declared(python_headers.at_hand(version) or python_headers.fetch(version))
            for name, version in self.modules.items()
        }
        self.natives = {
            Path(name).name: lief.parse(list(data))
            for name, data in self.files.items()
            if name.endswith((".so", ".dll", ".pyd", ".dylib"))
        }
        self.exported = exported(self.natives.get(self.platform.library))

    def complain(self, said):
        self.problems.append(f"{self.path.name}: {said}")

    def check(self):
        """The problems."""
        wanted = [*PARTS, *self.modules, *filter(None, [self.platform.library])]
        for name in wanted:
            if f"arapfields/{name}" not in self.files:
                self.complain(f"lacks {name}")
        for name in sorted(self.natives.keys() - set(wanted)):
            self.complain(f"carries {name}")
        if self.path.stat().st_size > LIMIT:
            self.complain(f"has {self.path.stat().st_size / 1e6:.1f} MB")
        self.check_needs()
        text = b"".join(data for name, data in self.files.items() if Path(name).name in self.natives)
        processor = self.platform.name.partition("-")[2]
        for kernel in KERNELS[processor]:
            if kernel + b"\0" not in text:
                self.complain(f"lacks kernels for {kernel.decode()}")
        for name, image in self.natives.items():
            {"linux": self.check_elf, "windows": self.check_pe, "macos": self.check_macho}[
                self.platform.system
            ](name, image)
        return self.problems

    def check_needs(self):
        (metadata,) = [data for name, data in self.files.items() if name.endswith(".dist-info/METADATA")]
        needs = HeaderParser().parsestr(metadata.decode()).get_all("Requires-Dist", [])
        if [need for need in needs if "extra ==" not in need and not need.startswith("numpy")]:
            self.complain(f"depends on {', '.join(needs)}")

    def check_image(self, name, machine, libraries):
        processor = self.platform.name.partition("-")[2]
        if machine != MACHINES[self.platform.system, processor]:
            self.complain(f"{name} is for {machine}")
        for library in libraries:
            if (
                not re.fullmatch(SYSTEM[self.platform.system], library, flags=re.I)
                and library not in self.natives
            ):
                self.complain(f"{name} asks for {library}")

    def check_elf(self, name, image):
        self.check_image(name, image.header.machine_type, image.libraries)
        for symbol in image.dynamic_symbols:
            version = symbol.symbol_version and symbol.symbol_version.symbol_version_auxiliary
            if symbol.shndx != 0 or symbol.binding == lief.ELF.Symbol.BINDING.WEAK or not symbol.name:
                continue
            if version:
                family, _, number = version.name.partition("_")
                if not number or tuple(map(int, number.split("."))) > NEWEST.get(family, ()):
                    self.complain(f"{name} asks for {symbol.name}@{version.name}")
            else:
                self.check_symbol(name, symbol.name)

    def check_symbol(self, name, symbol):
        if symbol not in self.exported and symbol not in self.headers.get(name, {}):
            self.complain(f"{name} asks for {symbol}, which nobody has")

    def check_pe(self, name, image):
        python = "python{}{}.dll".format(*self.modules.get(name, ("", "")))
        self.check_image(
            name, image.header.machine, [one.name for one in image.imports if one.name != python]
        )
        for library in image.imports:
            for entry in library.entries if library.name in (python, self.platform.library) else []:
                self.check_symbol(name, entry.name)

    def check_macho(self, name, image):
        self.check_image(name, image.header.cpu_type, [one.name for one in image.libraries])
        if tuple(image.build_version.minos[:2]) > MACOS:
            self.complain(f"{name} needs macOS {image.build_version.minos}")
        system = system_symbols(self.platform.name.partition("-")[2])
        for symbol in image.imported_symbols:
            if symbol.name not in system:
                self.check_symbol(name, symbol.name.removeprefix("_"))
        (content,) = [data for file, data in self.files.items() if Path(file).name == name]
        said = signature_problem(content, image)
        if said and (image.has_code_signature or self.platform.name == "macos-arm64"):  # not for Intel
            self.complain(f"{name} {said}")


def exported(library):
    """The names of a library's exported symbols."""
    if isinstance(library, lief.PE.Binary):
        return {entry.name for entry in library.get_export().entries}
    return {symbol.name for symbol in library.dynamic_symbols if symbol.shndx} if library else set()


def system_symbols(processor):
    """libSystem's symbols by ziglang's list, with C's underscore."""
    text = (zig_library() / "libc/darwin/libSystem.tbd").read_text()
    wanted, found = {"x64": "x86_64-macos", "arm64": "arm64e-macos"}[processor], set()
    for targets, body in re.findall(r"- targets:\s*\[([^\]]*)\]\s*((?:\s*[\w-]+:\s*\[[^\]]*\])+)", text):
        if wanted in targets:
            for names in re.findall(r"[\w-]*symbols:\s*\[([^\]]*)\]", body):
                found |= set(re.findall(r"[^\s,'\"]+", names))
    return found


def signature_problem(data, image):
    """The problem of a Mach-O file's ad-hoc signature (<kern/cs_blobs.h>), if any; recomputes hashes."""
    if not image.has_code_signature:
        return "is not signed"
    limit = image.code_signature.data_offset
    magic, _, _, slot, offset = struct.unpack_from(">5I", data, limit)
    start = limit + offset
    directory, _, _, flags, hashes, _, _, pages, covered = struct.unpack_from(">9I", data, start)
    length, kind, _, bits = struct.unpack_from(">4B", data, start + 36)
    if (magic, slot, directory) != (0xFADE0CC0, 0, 0xFADE0C02) or not flags & 2 or (length, kind) != (32, 2):
        return "has a signature of another kind"
    page = 1 << bits
    found = [hashlib.sha256(data[at : min(at + page, limit)]).digest() for at in range(0, limit, page)]
    noted = [data[at : at + 32] for at in range(start + hashes, start + hashes + 32 * pages, 32)]
    return "" if covered == limit and found == noted else "was changed after it was signed"


def problems(paths):
    return [problem for path in paths for problem in Wheel(path).check()]


if __name__ == "__main__":
    found = problems(sys.argv[1:])
    print("\n".join(found))
    sys.exit(bool(found))
