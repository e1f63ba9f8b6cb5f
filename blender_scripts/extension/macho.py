# SPDX-License-Identifier: GPL-3.0-or-later
"""Mach-O libraries of one 64-bit architecture: what they load, offer and ask for, and other names for the
libraries that they load. Layouts: Apple's <mach-o/loader.h> and <mach-o/fixup-chains.h>.

Whatever changes a file here leaves it unsigned; macho_sign.sign comes after.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

MAGIC, ARM64 = 0xFEEDFACF, 0x0100000C
HEADER = 32
SEGMENT, SYMTAB, ID_DYLIB, LOAD_DYLIB, BUILD_VERSION = 0x19, 0x2, 0xD, 0xC, 0x32
CODE_SIGNATURE, DYLD_INFO, DYLD_INFO_ONLY = 0x1D, 0x22, 0x80000022
WEAK_DYLIB, REEXPORT_DYLIB, RPATH = 0x80000018, 0x8000001F, 0x8000001C
EXPORTS_TRIE, CHAINED_FIXUPS = 0x80000033, 0x80000034
LOADS = (LOAD_DYLIB, WEAK_DYLIB, REEXPORT_DYLIB)
PLATFORM_MACOS = 1
UNDEFINED, EXTERNAL, TYPE_MASK = 0x0, 0x1, 0xEE  # of a symbol: type bits, debugging entries included


@dataclass
class Image:
    """A file's bytes and its load commands, as (kind, bytes)."""

    data: bytes
    commands: list

    def of(self, *kinds):
        return [body for kind, body in self.commands if kind in kinds]


def read(path):
    """The file at `path`; RuntimeError where it is no 64-bit Mach-O file."""
    data = Path(path).read_bytes()
    if len(data) < HEADER or struct.unpack_from("<I", data)[0] != MAGIC:
        raise RuntimeError(f"{Path(path).name} is no 64-bit Mach-O file")
    count, at, commands = struct.unpack_from("<I", data, 16)[0], HEADER, []
    for _ in range(count):
        kind, size = struct.unpack_from("<II", data, at)
        if size < 8 or at + size > len(data):
            raise RuntimeError(f"{Path(path).name} has a damaged load command")
        commands.append((kind, data[at : at + size]))
        at += size
    return Image(data, commands)


def is_arm64(image):
    return struct.unpack_from("<I", image.data, 4)[0] == ARM64


def text_at(command, field=8):
    """The string whose offset in the load command stands at `field`."""
    (offset,) = struct.unpack_from("<I", command, field)
    return command[offset:].split(b"\0", 1)[0].decode()


def install_name(image):
    """The name by which others load the library; empty for a bundle."""
    return "".join(text_at(command) for command in image.of(ID_DYLIB))


def loaded(image):
    """Install names of the libraries that it loads, in the order of their ordinals."""
    return [text_at(command) for command in image.of(*LOADS)]


def rpaths(image):
    return [text_at(command) for command in image.of(RPATH)]


def minimum_system(image):
    """(major, minor) of the oldest macOS that the file is for; RuntimeError for another system's file."""
    for command in image.of(BUILD_VERSION):
        platform, oldest = struct.unpack_from("<II", command, 8)
        if platform == PLATFORM_MACOS:
            return oldest >> 16, oldest >> 8 & 0xFF
    raise RuntimeError("the file does not say for which macOS it is")


def segments(image):
    """{name: (address, size in memory, offset, size in the file)}"""
    found = {}
    for command in image.of(SEGMENT):
        name = command[8:24].rstrip(b"\0").decode()
        found[name] = struct.unpack_from("<QQQQ", command, 24)
    return found


def undefined_symbols(image):
    """[(symbol, install name of the library that has it)]: what the file asks others for.

    The install name is "" where any library of the process will do (Python's own functions in a module), and
    None where the symbol may be any loaded library's, the file's own included (C++'s weak definitions).
    """
    names, found = loaded(image), []
    for command in image.of(CHAINED_FIXUPS):
        return [(symbol, library_of(names, ordinal)) for symbol, ordinal in chained(image, command)]
    for name, kind, _, described in symbols(image):
        if kind & TYPE_MASK == UNDEFINED and kind & EXTERNAL:
            ordinal = described >> 8
            found.append((name, library_of(names, ordinal if ordinal < 0xF0 else ordinal - 0x100)))
    return found


def library_of(names, ordinal):
    if ordinal > 0:
        return names[ordinal - 1]
    return None if ordinal == -3 else ""


def chained(image, command):
    """(symbol, ordinal) of each import of chained fixups."""
    start = struct.unpack_from("<I", command, 8)[0]
    _, _, imports, strings, count, form, _ = struct.unpack_from("<7I", image.data, start)
    size = {1: 4, 2: 8, 3: 16}[form]
    for place in range(start + imports, start + imports + count * size, size):
        if form == 3:
            ordinal, name = struct.unpack_from("<h2xI", image.data, place)
        else:
            (bits,) = struct.unpack_from("<I", image.data, place)
            ordinal, name = bits & 0xFF, bits >> 9
            ordinal = ordinal - 0x100 if ordinal > 0xF0 else ordinal
        at = start + strings + name
        yield image.data[at : image.data.index(b"\0", at)].decode(), ordinal


def symbols(image):
    """(name, type, section, description) of each entry of the symbol table."""
    for command in image.of(SYMTAB):
        table, count, strings, _ = struct.unpack_from("<4I", command, 8)
        for name, kind, section, described, _ in struct.iter_unpack(
            "<IBBHQ", image.data[table : table + 16 * count]
        ):
            at = strings + name
            yield image.data[at : image.data.index(b"\0", at)].decode(), kind, section, described


def exports(image, symbol):
    """Whether dyld finds the symbol in the file: a walk down the trie of its exports."""
    start, size = export_trie(image)
    trie, at, rest = image.data[start : start + size], 0, symbol.encode()
    while size:
        terminal, at = uleb(trie, at)
        if not rest:
            return terminal > 0
        at += terminal
        children, at = trie[at], at + 1
        for _ in range(children):
            end = trie.index(b"\0", at)
            edge, (child, at) = trie[at:end], uleb(trie, end + 1)
            if rest.startswith(edge):
                rest, at = rest[len(edge) :], child
                break
        else:
            return False
    return False


def export_trie(image):
    for command in image.of(EXPORTS_TRIE):
        return struct.unpack_from("<II", command, 8)
    for command in image.of(DYLD_INFO, DYLD_INFO_ONLY):
        return struct.unpack_from("<II", command, 40)
    return 0, 0


def uleb(data, at):
    """A number of seven bits a byte, lowest first, and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value, shift, at = value | (byte & 0x7F) << shift, shift + 7, at + 1
        if byte < 0x80:
            return value, at


def rename(path, own, renamed):
    """Gives the library at `path` the install name `own`, its libraries the `renamed` names, and no search
    paths; RuntimeError where the longer commands have no room."""
    image, changed = read(path), []
    for kind, body in image.commands:
        if kind in (RPATH, CODE_SIGNATURE):
            continue
        if kind in (ID_DYLIB, *LOADS):
            new = own if kind == ID_DYLIB else renamed.get(text_at(body), text_at(body))
            text = new.encode() + b"\0"
            size = -(-(24 + len(text)) // 8) * 8
            body = struct.pack("<III", kind, size, 24) + body[12:24] + text.ljust(size - 24, b"\0")
        changed.append(body)
    data = bytearray(image.data)
    first = min(offset for offset in section_offsets(image) if offset)
    size = sum(map(len, changed))
    if HEADER + size > first:
        raise RuntimeError(f"{Path(path).name} has no room for longer names")
    struct.pack_into("<II", data, 16, len(changed), size)
    data[HEADER:first] = b"".join(changed).ljust(first - HEADER, b"\0")
    for command in image.of(CODE_SIGNATURE):  # at the file's end
        del data[struct.unpack_from("<I", command, 8)[0] :]
    Path(path).write_bytes(data)


def section_offsets(image):
    """Where in the file the sections lie; 0 for those that have nothing there."""
    for command in image.of(SEGMENT):
        for at in range(72, 72 + 80 * struct.unpack_from("<I", command, 64)[0], 80):
            yield struct.unpack_from("<I", command, at + 48)[0]
