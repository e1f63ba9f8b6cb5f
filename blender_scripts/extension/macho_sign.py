# SPDX-License-Identifier: GPL-3.0-or-later
"""Ad-hoc signatures of Mach-O files: what macOS on ARM asks of every library, in the form that linkers
write.

A signature holds the SHA-256 of each page of the file, so whatever changes one byte must sign again. Nobody
vouches by it. Layout: Apple's <kern/cs_blobs.h>.
"""

import hashlib
import struct
from pathlib import Path

from . import macho

SUPER_BLOB, CODE_DIRECTORY, DIRECTORY_SLOT = 0xFADE0CC0, 0xFADE0C02, 0
VERSION, AD_HOC, BY_LINKER, SHA256 = 0x20400, 0x2, 0x20000, 2
DIRECTORY = ">9I4B4I4Q"
PAGE_BITS = 12
SYSTEM_PAGE = 1 << 14  # to which segments are rounded on ARM


def rounded(size, step):
    """The first multiple of `step` that is not smaller."""
    return -(-size // step) * step


def page_hashes(data, bits=PAGE_BITS):
    page = 1 << bits
    return [hashlib.sha256(data[at : at + page]).digest() for at in range(0, len(data), page)]


def sign(path, identifier):
    """Signs the unsigned library at `path`."""
    path = Path(path)
    image = macho.read(path)
    if image.of(macho.CODE_SIGNATURE):
        raise RuntimeError(f"{path.name} is signed already")
    code = image.data.ljust(rounded(len(image.data), 16), b"\0")
    name = identifier.encode() + b"\0"
    pages = rounded(len(code), 1 << PAGE_BITS) >> PAGE_BITS
    directory_size = struct.calcsize(DIRECTORY) + len(name) + 32 * pages
    size = rounded(20 + directory_size, 16)
    code = with_signature_command(bytearray(code), image, len(code), size)
    _, _, text_offset, text_size = macho.segments(image)["__TEXT"]
    hashes_at = struct.calcsize(DIRECTORY) + len(name)
    begun = (CODE_DIRECTORY, directory_size, VERSION, AD_HOC | BY_LINKER)
    places = (hashes_at, struct.calcsize(DIRECTORY), 0, pages, len(code))
    kinds, unused = (
        (32, SHA256, 0, PAGE_BITS),
        (0, 0, 0, 0, 0),
    )  # the latter: scattering, team, a 64-bit limit
    directory = struct.pack(DIRECTORY, *begun, *places, *kinds, *unused, text_offset, text_size, 0)
    blob = directory + name + b"".join(page_hashes(code))
    whole = struct.pack(">5I", SUPER_BLOB, 20 + len(blob), 1, DIRECTORY_SLOT, 20) + blob
    path.write_bytes(bytes(code) + whole.ljust(size, b"\0"))


def with_signature_command(code, image, offset, size):
    """The file's bytes with the command that names the signature, in a last segment that reaches over it."""
    count, used = struct.unpack_from("<II", code, 16)
    end = macho.HEADER + used
    first = min(place for place in macho.section_offsets(image) if place)
    if end + 16 > first:
        raise RuntimeError("no room for the command that names the signature")
    struct.pack_into("<4I", code, end, macho.CODE_SIGNATURE, 16, offset, size)
    struct.pack_into("<II", code, 16, count + 1, used + 16)
    at = macho.HEADER
    for kind, body in image.commands:
        if kind == macho.SEGMENT and body[8:24].rstrip(b"\0") == b"__LINKEDIT":
            _, _, start, _ = struct.unpack_from("<4Q", body, 24)
            length = offset + size - start
            struct.pack_into("<Q", code, at + 32, rounded(length, SYSTEM_PAGE))
            struct.pack_into("<Q", code, at + 48, length)
        at += len(body)
    return code


def check_signature(path):
    """Pages whose hashes were recomputed and found right; RuntimeError where it is not signed, or wrongly."""
    image, name = macho.read(path), Path(path).name
    commands = image.of(macho.CODE_SIGNATURE)
    if len(commands) != 1:
        raise RuntimeError(f"{name} is not signed")
    offset, size = struct.unpack_from("<II", commands[0], 8)
    if offset + size != len(image.data):
        raise RuntimeError(f"the signature of {name} does not end where the file does")
    magic, _, count = struct.unpack_from(">3I", image.data, offset)
    slots = dict(struct.unpack_from(">II", image.data, offset + 12 + 8 * i) for i in range(count))
    if magic != SUPER_BLOB or DIRECTORY_SLOT not in slots:
        raise RuntimeError(f"the signature of {name} has no directory")
    start = offset + slots[DIRECTORY_SLOT]
    magic, _, _, flags, hashes, _, _, pages, limit = struct.unpack_from(">9I", image.data, start)
    length, kind, _, bits = struct.unpack_from(">4B", image.data, start + 36)
    if magic != CODE_DIRECTORY or not flags & AD_HOC or (length, kind) != (32, SHA256) or limit != offset:
        raise RuntimeError(f"the signature of {name} is none that is known here")
    found = page_hashes(image.data[:limit], bits)
    noted = [image.data[at : at + 32] for at in range(start + hashes, start + hashes + 32 * pages, 32)]
    if found != noted:
        wrong = sum(a != b for a, b in zip(found, noted, strict=False)) + abs(len(found) - len(noted))
        raise RuntimeError(f"{name} was changed after it was signed: {wrong} of {pages} pages")
    return pages
