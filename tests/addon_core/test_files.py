# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the extension: the cache of fits, and checks that exported meshes are whole."""

import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af
from addon.core.files import FitCache, are_whole_meshes, fit_key

# The cache of fits: keys that follow content and options, files that come and go.

V = np.random.default_rng(0).normal(size=(10, 3))
F = np.arange(9).reshape(3, 3)
OPTIONS = {"width": 64, "seed": 0}


def test_equal_content_has_an_equal_key():
    assert fit_key(V, F, OPTIONS, 1) == fit_key(V.copy(), F.astype(np.int32), dict(OPTIONS), 1)


def test_the_machine_does_not_enter_the_key():
    assert fit_key(V, F, {**OPTIONS, "threads": 3, "device": "cpu"}, 1) == fit_key(V, F, OPTIONS, 1)


@pytest.mark.parametrize("change", ["vertex", "triangle", "option", "version"])
def test_every_change_of_content_changes_the_key(change):
    v, f, options, version = V.copy(), F.copy(), dict(OPTIONS), 1
    if change == "vertex":
        v[3, 1] += 1e-4
    if change == "triangle":
        f[0] = f[0][::-1]
    if change == "option":
        options["seed"] = 1
    if change == "version":
        version = 2
    assert fit_key(v, f, options, version) != fit_key(V, F, OPTIONS, 1)


def test_meshes_in_any_unit_have_different_keys():
    for scale in (1e-9, 1e9):
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V * scale * 1.01, F, OPTIONS, 1)
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V[::-1] * scale, F, OPTIONS, 1)


def read(path):
    text = Path(path).read_text()
    if text == "broken":
        raise ValueError("not a fit")
    return text


@pytest.fixture(scope="module")
def fit():
    options = af.FitOptions(iterations=1, width=4, layers=1, near_points=300, uniform_points=50)
    return af.fit_sdf(*sphere(1.0, 1), options)


KEY = fit_key(V, F, OPTIONS, 1)


def test_saved_fits_are_found_counted_and_cleared(tmp_path, fit):
    cache = FitCache(tmp_path / "fits")
    assert cache.load(KEY, af.NeuralSdf.load) is None and cache.size() == 0 and cache.clear() == 0
    cache.save(KEY, fit.save)
    assert cache.load(KEY, af.NeuralSdf.load).report == fit.report
    assert cache.size() == cache.path(KEY).stat().st_size
    assert cache.clear() == 1 and cache.load(KEY, af.NeuralSdf.load) is None


def test_no_other_file_is_cleared(tmp_path, fit):
    field = af.deform(af.sample_mesh(*sphere(1.0, 1), 50), [af.PointHandle([0, 0, 1], [0, 0, 1])])
    cache, others = FitCache(tmp_path), []
    cache.save(KEY, fit.save)
    header = b'{"__metadata__":{"format":"pt"}}'
    contents = [b"", b"precious", b"\xff" * 40, b"[" * 9000, len(header).to_bytes(8, "little") + header]
    for number, content in enumerate(contents):  # named as fits are, of other programs
        others.append(cache.path(f"{number:032x}"))
        others[-1].write_bytes(content)
    others.append(cache.path("f" * 32))
    field.save(others[-1])
    for name in ("my_network", KEY.upper(), f"{KEY}.old", KEY[:-1], f"x{KEY}"):
        others.append(cache.path(name))
        fit.save(others[-1])
    (tmp_path / "other.txt").write_text("kept")
    cache.path("0" * 31 + "a").mkdir()
    assert cache.size() == cache.path(KEY).stat().st_size
    assert cache.clear() == 1 and not cache.path(KEY).exists()
    assert all(path.exists() for path in others) and len(list(tmp_path.iterdir())) == len(others) + 2


def test_a_fit_that_cannot_be_read_now_is_not_removed(tmp_path):
    def refused(path):
        raise PermissionError(13, "Permission denied", path)

    cache = FitCache(tmp_path)
    cache.save(KEY, lambda path: Path(path).write_text("fit"))
    assert cache.load(KEY, refused) is None and cache.path(KEY).exists()


def test_a_broken_file_is_removed_and_counts_as_missing(tmp_path):
    cache = FitCache(tmp_path)
    cache.save("a", lambda path: Path(path).write_text("broken"))
    assert cache.load("a", read) is None
    assert not cache.path("a").exists()


# Exported mesh files that are whole, and all their beginnings, which are not.

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 1, 2, 3), (0, 1, 4), (1, 2, 4)]
MESH = SimpleNamespace(vertices=CORNERS, polygons=FACES, loops=[i for face in FACES for i in face])


def ply():
    head = "ply\nformat binary_little_endian 1.0\ncomment Created in Blender\nelement vertex 5\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 3\nproperty list uchar uint vertex_indices\nend_header\n"
    body = b"".join(struct.pack("<3f", *corner) for corner in CORNERS)
    return head.encode() + body + b"".join(struct.pack(f"<B{len(f)}I", len(f), *f) for f in FACES)


def stl():
    return b" " * 80 + struct.pack("<I", 4) + bytes(4 * 50)


def obj():
    lines = ["mtllib x.mtl", "o x", *("v {} {} {}".format(*c) for c in CORNERS), "vn 0 0 1", "usemtl skin"]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in f) for f in FACES), ""]).encode()


@pytest.mark.parametrize("name", ["ply", "stl", "obj"])
def test_truncated_files_are_incomplete(name, tmp_path):
    content, path = {"ply": ply, "stl": stl, "obj": obj}[name](), tmp_path / f"x.{name}"
    path.write_bytes(content)
    assert are_whole_meshes(path, [MESH])
    for length in range(len(content)):
        path.write_bytes(content[:length])
        assert not are_whole_meshes(path, [MESH]), length
    path.write_bytes(content)
    assert not are_whole_meshes(path, [MESH, MESH])


def test_materials_belong_to_an_obj(tmp_path):
    path, materials = tmp_path / "x.obj", tmp_path / "x.mtl"
    path.write_bytes(obj())
    materials.write_text("newmtl skin\nKd 1 1 1\n")
    assert are_whole_meshes(path, [MESH])
    for text in ("newmtl skin\nKd 1", "newmtl other\n", ""):
        materials.write_text(text)
        assert not are_whole_meshes(path, [MESH])
