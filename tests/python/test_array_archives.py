# SPDX-License-Identifier: GPL-3.0-or-later
"""NumPy archives as files of poses, tracks and frames: what is damaged is refused, whatever NumPy raises."""

import io
import zipfile

import numpy as np
import pytest

import arapfields as af
from arapfields._files import read_arrays, write_arrays

ARRAYS = {"points": np.arange(30.0).reshape(10, 3), "name": np.array("bent"), "count": np.array(3)}


def written(compressed):
    stream = io.BytesIO()
    (np.savez_compressed if compressed else write_arrays)(stream, **ARRAYS)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_what_is_written_is_read(compressed, tmp_path):
    (tmp_path / "a.npz").write_bytes(written(compressed))
    for source in (written(compressed), tmp_path / "a.npz"):
        found = read_arrays(source, set(ARRAYS))
        assert found.keys() == ARRAYS.keys() and all((found[name] == ARRAYS[name]).all() for name in found)


@pytest.mark.parametrize("compressed", [False, True])
def test_every_damage_is_invalid_input_or_harmless(compressed):
    content, random, refused = written(compressed), np.random.default_rng(1), 0
    for at in range(len(content)):
        changed = bytearray(content)
        changed[at] ^= 1 << random.integers(8)
        for damaged in (bytes(changed), content[:at]):
            try:
                read_arrays(damaged)
            except af.InvalidInput as error:
                refused += 1
                assert str(error).startswith("the archive: ")
    assert refused > len(content)


def test_every_compression_is_read_or_refused():
    for method in range(100):
        changed = bytearray(written(True))
        for signature, offset in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
            at = changed.find(signature)
            while at >= 0:
                changed[at + offset] = method
                at = changed.find(signature, at + 1)
        if method != zipfile.ZIP_DEFLATED:
            with pytest.raises(af.InvalidInput):
                read_arrays(bytes(changed))


def test_sizes_are_checked_before_memory_is_asked_for():
    for shape in ((10**15,), (10**9, 10**9), (-1,), (2,)):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive, archive.open("points.npy", "w") as entry:
            np.lib.format.write_array_header_1_0(
                entry, {"descr": "<f8", "fortran_order": False, "shape": shape}
            )
        with pytest.raises(af.InvalidInput, match="does not fit"):
            read_arrays(stream.getvalue())


def test_objects_and_other_names_are_refused(tmp_path):
    stream = io.BytesIO()
    np.savez(stream, points=np.array([{}], dtype=object))
    with pytest.raises(af.InvalidInput):
        read_arrays(stream.getvalue())
    with pytest.raises(af.InvalidInput, match="unknown array 'name'"):
        read_arrays(written(False), {"points", "count"})
    with pytest.raises(OSError):
        read_arrays(tmp_path / "none.npz")
