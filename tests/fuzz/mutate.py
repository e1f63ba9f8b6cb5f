# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutations of files: bytes, lines and numbers of texts, nodes of JSON, headers and arrays of archives.

Mutations of the structure keep lengths and offsets consistent, to pass the first checks.
"""

import json

import numpy as np
from support.files import archives

NUMBERS = [0, 1, -1, 2, 7, 64, 255, 65536, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 2**64, 10**30, -(2**31)]
FLOATS = [0.5, -0.0, 1e-320, 1e-160, 1e160, 1.7e308, float("nan"), float("inf"), -float("inf")]
ODD = [None, True, False, "", "x", "\u0000", "\ud800", "é" * 40, [], {}, [[]], [1, 2, 3], {"a": 1}]
TOKENS = [
    "0",
    "-1",
    "1",
    "3",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "1e-320",
    "2147483648",
    "99999999999999999999",
    "x",
    "",
    "\\",
]
TOKENS += ["1/1", "1//1", "-1/-1", "1/", "\x00", "4294967296", "0x10", "1,2", "\u00e9", "1_000"]


def odd_value(rng):
    """Any JSON value."""
    kind = rng.integers(4)
    if kind == 0:
        return NUMBERS[rng.integers(len(NUMBERS))]
    if kind == 1:
        return FLOATS[rng.integers(len(FLOATS))]
    return ODD[rng.integers(len(ODD))]


def mutate_bytes(rng, content):
    """Replaces, removes, doubles or truncates bytes."""
    data = bytearray(content)
    for _ in range(1 + int(rng.integers(4))):
        at = int(rng.integers(len(data) + 1))
        length = int(rng.integers(1, 16))
        kind = rng.integers(6)
        if kind == 0:
            del data[at if rng.integers(3) else int(rng.integers(12)) :]
        elif kind == 1:
            data[at : at + length] = rng.bytes(length)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + 20 * length]
        elif kind == 4 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        else:
            data[at:at] = rng.bytes(length)
    return bytes(data)


def mutate_text(rng, content):
    """Replaces, removes, doubles or joins words and lines of a text."""
    lines = content.decode("latin-1").split("\n")
    for _ in range(1 + int(rng.integers(4))):
        at = int(rng.integers(len(lines)))
        kind = rng.integers(7)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines[at:at] = [lines[at]] * int(rng.integers(1, 50))
        elif kind == 2:
            lines[at] += " \\" if rng.integers(2) else "\r"
        elif kind == 3:
            lines = lines[: at + 1]
        else:
            words = lines[at].split(" ")
            words[rng.integers(len(words))] = TOKENS[rng.integers(len(TOKENS))]
            lines[at] = " ".join(words)
        lines = lines or [""]
    return "\n".join(lines).encode("latin-1", errors="replace")


def nodes(value, path=()):
    """All paths of a JSON value."""
    yield path
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from nodes(value[key], (*path, key))


def mutate_json(rng, value):
    """A copy with one node replaced, removed, renamed, doubled or nested."""
    value = json.loads(json.dumps(value))
    places = list(nodes(value))
    path = places[rng.integers(len(places))]
    if not path:
        return odd_value(rng)
    parent = value
    for key in path[:-1]:
        parent = parent[key]
    key, kind = path[-1], rng.integers(6)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[str(odd_value(rng))] = parent.pop(key)
    elif kind == 2:
        for _ in range(int(rng.integers(1, 60))):
            parent[key] = [parent[key]]
    elif kind == 3 and isinstance(parent, list):
        parent += [parent[key]] * int(rng.integers(1, 5))
    elif kind == 4 and isinstance(parent[key], int | float) and not isinstance(parent[key], bool):
        parent[key] = [parent[key] + 1, parent[key] - 1, -parent[key], parent[key] * 2**20][rng.integers(4)]
    else:
        parent[key] = odd_value(rng)
    return value


def dumped(rng, value):
    text = json.dumps(value).encode()
    if rng.integers(10) == 0:  # a duplicate member
        text = text.replace(b"{", b'{"a": 1, "a": 2, ' if rng.integers(2) else b'{"width": 3, ', 1)
    if rng.integers(20) == 0:
        text = b"[" * int(rng.integers(100000)) + text
    return text


def mutate_array(rng, array):
    array = array.copy()
    kind = rng.integers(6)
    if kind == 0 and array.ndim:
        return np.ascontiguousarray(array[: rng.integers(len(array) + 1)])
    if kind == 1 and array.ndim:
        return np.concatenate([array, array[: rng.integers(len(array) + 1)]])
    if kind == 2:
        return np.ascontiguousarray(array.T)
    if kind == 3:
        return array.reshape(-1)
    if kind == 4:
        return array.astype("<f4" if array.dtype == "<f8" else "<f8")
    if array.size:
        values = np.array([*FLOATS, 0, -1, 1e9], array.dtype)
        flat = array.reshape(-1)
        flat[rng.integers(array.size, size=1 + rng.integers(4))] = values[rng.integers(len(values))]
    return array


def mutate_archive(rng, content, texts, arrays):
    """A saved file with one part changed; `texts` and `arrays`: those of the valid file."""
    kind = rng.integers(5)
    with np.errstate(all="ignore"):
        if kind == 0:
            return mutate_bytes(rng, content)
        if kind == 1:  # the header, with its correct length
            header = mutate_json(rng, archives.header_of(texts, arrays))
            return archives.joined(dumped(rng, header), b"".join(a.tobytes() for a in arrays.values()))
        if kind == 2:  # the metadata
            return archives.packed({**texts, "structure": mutate_json(rng, texts["structure"])}, arrays)
        if kind == 3:
            name = ("format", "version", "kind", "structure", "report")[rng.integers(5)]
            text = dumped(rng, odd_value(rng)).decode() if rng.integers(2) else str(odd_value(rng))
            return archives.packed({**texts, name: text}, arrays)
        changed = dict(arrays)
        name = list(arrays)[rng.integers(len(arrays))]
        if rng.integers(8) == 0:
            changed[str(odd_value(rng))] = changed.pop(name)
        else:
            changed[name] = mutate_array(rng, arrays[name])
        return archives.packed(texts, changed)
