# SPDX-License-Identifier: GPL-3.0-or-later
"""Damage that no reader of numbers sees: a flipped bit anywhere in a saved file is refused."""

import numpy as np
import pytest
from support.files import archives

import arapfields as af

FLIPS = 60  # bits a kind of file


def test_each_flipped_bit_is_seen(examples, tmp_path):
    rng = np.random.default_rng(1)
    for name, path in examples.items():
        whole = path.read_bytes()
        for bit in rng.integers(0, 8 * len(whole), FLIPS):
            damaged = bytearray(whole)
            damaged[bit // 8] ^= 1 << bit % 8
            (tmp_path / path.name).write_bytes(damaged)
            with pytest.raises(af.InvalidInput):
                archives.load(tmp_path / path.name)
                pytest.fail(f"{name}: bit {bit} of {8 * len(whole)}")


def test_an_old_file_loads_and_a_new_one_needs_its_checksum(examples, tmp_path):
    path = tmp_path / "radial.safetensors"
    texts, arrays = archives.read(examples["radial"])
    path.write_bytes(archives.packed(texts, arrays))  # version 1
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    assert np.array_equal(archives.load(path)(points), archives.load(examples["radial"])(points))
    header = archives.header_of(texts, arrays)
    for texts, message in (
        ({"version": "2"}, "checksum: it is missing"),
        ({"version": "2", "checksum": "12"}, "sixteen digits"),
    ):
        header["__metadata__"] |= texts
        path.write_bytes(archives.joined(header, b"".join(array.tobytes() for array in arrays.values())))
        with pytest.raises(af.InvalidInput, match=message):
            archives.load(path)
