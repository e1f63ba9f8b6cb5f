# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files of the command line: read whole, written with other positions and all else as it was."""

import re
import sys

import numpy as np
import plyfile
import pytest
from support.files import odd_meshes
from support.files.odd_meshes import SURVEY
from support.geometry import meshes
from support.programs.cli import run

import arapfields as af
from arapfields.cli import files
from arapfields.cli.meshes import formats, stl
from arapfields.cli.meshes.mesh import Mesh, triangulated

FILES = odd_meshes.all_files()
SINGLE = 2.0**-24  # relative rounding of single precision
HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
THREE = "0 0 0\n1 0 0\n0 1 0\n"


def read(folder, name):
    path = folder / name
    path.write_bytes(FILES[name][0])
    return formats.read(path)


def turned(points):
    """Other positions, exact in single precision where the given ones are."""
    return points[:, [1, 2, 0]] * 2


def area(vertices, triangles):
    corners = vertices[triangles]
    return np.linalg.norm(np.cross(*(corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2)), axis=1).sum() / 2


@pytest.mark.parametrize("name", FILES)
def test_a_mesh_file_is_read_with_its_vertices_and_polygons(name, tmp_path):
    mesh, shape = read(tmp_path, name), FILES[name][1]
    assert mesh.vertices.shape == shape.vertices.shape and mesh.polygons() == shape.polygons
    bound = 0.0 if name.endswith((".obj", ".off")) and "binary" not in name else SINGLE
    assert np.abs(mesh.vertices - shape.vertices).max() <= bound * np.abs(shape.vertices).max()
    ears = [[row[i] for i in ear] for row in shape.polygons for ear in meshes.ears(shape.vertices[row])]
    assert area(mesh.vertices, mesh.triangles) == pytest.approx(
        area(shape.vertices, np.array(ears)), rel=1e-6
    )


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".obj")])
def test_an_obj_keeps_lines_other_than_positions_and_normals(name, tmp_path):
    mesh = read(tmp_path, name)
    formats.write_moved(tmp_path / "moved.obj", ".obj", mesh, mesh.vertices)

    def statements(content):
        joined = re.sub(r"\\\r?\n", " ", content.decode("utf-8-sig"))
        kept = [line.split() for line in joined.splitlines() if not line.startswith("vn ")]
        numbers = [[float(word) for word in row[1:4]] for row in kept if row[:1] == ["v"]]
        return [row[:1] + row[4:] if row[:1] == ["v"] else row for row in kept], numbers

    before, after = (statements((tmp_path / one).read_bytes()) for one in (name, "moved.obj"))
    faces = [[re.sub(r"/\d*/1$", lambda m: m[0][:-2].rstrip("/"), word) for word in row] for row in before[0]]
    normals = name in ("normals.obj", "all_of_a_corner.obj")
    assert after == ((faces if normals else before[0]), before[1])
    ends = [(tmp_path / one).read_bytes().count(b"\r\n") for one in (name, "moved.obj")]
    assert ends[0] == ends[1] or name == "continued_windows.obj"


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".ply")])
def test_a_ply_keeps_all_elements_and_properties(name, tmp_path):
    mesh = read(tmp_path, name)
    moved = turned(mesh.vertices)
    formats.write_moved(tmp_path / "moved.ply", ".ply", mesh, moved)
    plain = tmp_path / "plain.ply"  # plyfile reads no other letters
    plain.write_bytes(FILES[name][0].replace("größer".encode(), b"larger"))
    (tmp_path / "moved.ply").write_bytes(
        (tmp_path / "moved.ply").read_bytes().replace("größer".encode(), b"larger")
    )
    before, after = plyfile.PlyData.read(plain), plyfile.PlyData.read(tmp_path / "moved.ply")
    assert (after.text, after.byte_order) == (before.text, before.byte_order)
    assert (after.comments, after.obj_info) == (before.comments, before.obj_info)
    assert [one.name for one in after] == [one.name for one in before]
    for one, other in zip(before, after, strict=True):
        kept = [str(row) for row in one.properties if row.name not in ("nx", "ny", "nz")]
        assert [str(row) for row in other.properties] == kept
        for row in other.properties:
            if row.name in "xyz":
                expected = moved[:, "xyz".index(row.name)]
                assert other[row.name] == pytest.approx(expected, rel=SINGLE, abs=1e-7)
            else:
                assert all(map(np.array_equal, one[row.name], other[row.name])), row.name
    assert (tmp_path / "moved.ply").read_bytes().endswith(b"and more") == (name == "trailing.ply")


def test_whole_numbers_as_positions_become_doubles(tmp_path):
    shape = odd_meshes.bracket()
    doubled = [(f"short {axis}", (shape.vertices[:, k] * 2).astype(int)) for k, axis in enumerate("xyz")]
    for form in odd_meshes.ORDERS:
        elements = [("vertex", doubled), ("face", odd_meshes.faces(shape))]
        (tmp_path / "a.ply").write_bytes(odd_meshes.ply(form, elements))
        mesh = formats.read(tmp_path / "a.ply")
        formats.write_moved(tmp_path / "b.ply", ".ply", mesh, mesh.vertices / 16)
        assert np.array_equal(formats.read(tmp_path / "b.ply").vertices, shape.vertices / 8)


@pytest.mark.parametrize("form", odd_meshes.ORDERS)
def test_lists_of_vertices_are_kept(form, tmp_path):
    shape = odd_meshes.bracket()
    near = [list(range(1 + i % 3)) for i in range(len(shape.vertices))]
    rows = odd_meshes.points(shape, "double")
    elements = [("vertex", [rows[0], ("list uchar int near", near), *rows[1:]])]
    elements.append(("face", odd_meshes.faces(shape)))
    (tmp_path / "a.ply").write_bytes(odd_meshes.ply(form, elements))
    mesh = formats.read(tmp_path / "a.ply")
    assert np.array_equal(mesh.vertices, shape.vertices) and mesh.polygons() == shape.polygons
    formats.write_moved(tmp_path / "b.ply", ".ply", mesh, turned(mesh.vertices))
    again = plyfile.PlyData.read(tmp_path / "b.ply")["vertex"]
    assert [row.tolist() for row in again["near"]] == near
    assert np.array_equal(formats.read(tmp_path / "b.ply").vertices, turned(shape.vertices))


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".stl")])
def test_an_stl_keeps_its_header_names_and_attributes(name, tmp_path):
    mesh = read(tmp_path, name)
    formats.write_moved(tmp_path / "moved.stl", ".stl", mesh, turned(mesh.vertices))
    before, after = FILES[name][0], (tmp_path / "moved.stl").read_bytes()
    again = formats.read(tmp_path / "moved.stl")
    assert np.array_equal(again.vertices, turned(mesh.vertices)) and again.polygons() == mesh.polygons()
    if b"endsolid" in before.lower():
        before, after = before.lower().removeprefix(b"\xef\xbb\xbf"), after.lower()
        words = (b"vertex ", b"facet ")
        kept = [
            [line for line in one.splitlines() if not line.strip().startswith(words)]
            for one in (before, after)
        ]
        assert kept[0] == kept[1] and b"facet normal " in after
    else:
        assert after[: stl.HEADER] == before[: stl.HEADER]
        rows = [np.frombuffer(one, stl.FACET, 12, stl.HEADER) for one in (before, after)]
        assert np.array_equal(rows[0]["attribute"], rows[1]["attribute"])
        assert np.linalg.norm(rows[1]["normal"], axis=1) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".off")])
def test_an_off_keeps_rows_other_than_positions_and_normals(name, tmp_path):
    mesh = read(tmp_path, name)
    formats.write_moved(tmp_path / "moved.off", ".off", mesh, mesh.vertices)
    before, after = FILES[name][0], (tmp_path / "moved.off").read_bytes()
    if name == "binary.off":
        assert after == before
        return
    rows = [[line.split() for line in one.decode().splitlines()] for one in (before, after)]
    if name in ("normals.off", "all.off"):
        header, count = [rows[0][0][0].replace("N", "")], len(mesh.vertices)
        moved = [row[:3] + row[6:] for row in rows[0][2 : 2 + count]]
        rows[0] = [header, rows[0][1], *moved, *rows[0][2 + count :]]
    plain = [[[float(w) if w[0] in "-.0123456789" else w for w in row] for row in one] for one in rows]
    assert plain[0] == plain[1]


@pytest.mark.parametrize("suffix", formats.FORMATS)
@pytest.mark.parametrize(
    "name", ["colours.obj", "texture.obj", "colours.ply", "wedges.ply", "face_colours.off", "plain.stl"]
)
def test_another_format_gets_the_attributes_it_supports(name, suffix, tmp_path):
    mesh = read(tmp_path, name)
    other = tmp_path / f"other{suffix}"
    formats.write_moved(other, name[-4:], mesh, turned(mesh.vertices))
    again = formats.read(other)
    if suffix == ".stl":
        assert area(again.vertices, again.triangles) == pytest.approx(
            area(turned(mesh.vertices), mesh.triangles)
        )
        return
    assert np.array_equal(again.vertices, turned(mesh.vertices)) and again.polygons() == mesh.polygons()
    holds = {"colours": True, "texture": suffix != ".off", "face_colours": suffix != ".obj"}
    for data, is_held in holds.items():
        given, found = getattr(mesh, data), getattr(again, data)
        if given is None or not is_held:
            assert found is None or suffix == name[-4:]
        elif data == "texture":
            assert found == pytest.approx(given, abs=1e-6)
        else:
            assert found[:, :3] == pytest.approx(given[:, :3], abs=0.5 / 255)  # of bytes


def polygon(rng, corners):
    """A random polygon about the origin (k, 3), in a random plane."""
    angles = (np.arange(corners) + rng.uniform(0, 0.8, corners)) * 2 * np.pi / corners
    flat = rng.uniform(0.2, 1, corners)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.pad(flat, [(0, 0), (0, 1)]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]


def test_triangles_cover_a_polygon_and_nothing_else():
    rng = np.random.default_rng(5)
    sizes = np.concatenate([[4] * 40, rng.integers(3, 25, 60)])
    outlines = [polygon(rng, size) for size in sizes]
    vertices, corners = np.concatenate(outlines), np.arange(sizes.sum())
    found = np.split(triangulated(vertices, sizes, corners), np.cumsum(sizes - 2)[:-1])
    for outline, first, rows in zip(outlines, np.cumsum(sizes) - sizes, found, strict=True):
        edges = np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]]) - first
        inner = {(a, b) for a, b in edges.tolist() if (b - a) % len(outline) != 1}
        assert inner == {(b, a) for a, b in inner}  # each inner edge is of two triangles
        normals = np.cross(*(vertices[rows[:, 1:]] - vertices[rows[:, :1]]).transpose(1, 0, 2))
        total = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(np.linalg.norm(total))
        assert normals.sum(axis=0) == pytest.approx(total)


def test_corners_on_straight_edges_stay_corners_of_triangles():
    outline = [
        (0, 0),
        (1, 0),
        (2, 0),
        (3, 0),
        (3, 1),
        (1, 1),
        (1, 2),
        (3, 2),
        (3, 3),
        (1.5, 3),
        (0, 3),
        (0, 1.5),
    ]
    vertices = np.pad(np.array(outline, float), [(0, 0), (0, 1)])
    rows = triangulated(vertices, np.array([12]), np.arange(12))
    assert rows.shape == (10, 3) and np.unique(rows).tolist() == list(range(12))
    assert area(vertices, rows) == pytest.approx(7.0)
    edges = {(a, b) for row in rows.tolist() for a, b in zip(row, row[1:] + row[:1], strict=True)}
    assert {(i, (i + 1) % 12) for i in range(12)} <= edges


def test_convex_meshes_need_no_further_package(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    (tmp_path / "ball.ply").write_bytes(FILES["ascii.ply"][0])
    assert len(files.read_mesh(tmp_path / "ball.ply")[1]) == 64
    (tmp_path / "c.obj").write_bytes(FILES["plain.obj"][0])
    with pytest.raises(ImportError, match="mapbox-earcut: pip install 'arapfields"):
        files.read_mesh(tmp_path / "c.obj")


def test_rows_that_are_no_polygons_make_no_triangles(tmp_path):
    shape = odd_meshes.bracket()
    polygons = [[0, 1], *shape.polygons, [2], []]
    elements = [("vertex", odd_meshes.points(shape)), ("face", [("list uchar int vertex_indices", polygons)])]
    for form in odd_meshes.ORDERS:
        (tmp_path / "a.ply").write_bytes(odd_meshes.ply(form, elements))
        mesh = files.read_surface(tmp_path / "a.ply")
        assert mesh.polygons() == polygons and len(mesh.triangles) == 28
        for suffix in formats.FORMATS:
            formats.write(tmp_path / f"b{suffix}", mesh)
            assert len(files.read_mesh(tmp_path / f"b{suffix}")[1]) == 28


@pytest.mark.parametrize(
    "name", ["faces.ply", "faces_text.ply", "none.stl", "none_text.stl", "none.off", "none.obj"]
)
def test_a_file_without_faces_is_refused_by_name(name, tmp_path):
    shape = odd_meshes.Shape(odd_meshes.triangles().vertices, [])
    elements = [("vertex", odd_meshes.points(shape)), ("face", odd_meshes.faces(shape))]
    content = {
        "faces.ply": odd_meshes.ply("binary_little_endian", elements),
        "faces_text.ply": odd_meshes.ply("ascii", elements),
        "none.stl": bytes(84),
        "none_text.stl": b"solid nothing\nendsolid nothing\n",
        "none.off": odd_meshes.text(odd_meshes.off(shape)),
        "none.obj": odd_meshes.text(odd_meshes.obj(shape)),
    }
    (tmp_path / name).write_bytes(content[name])
    with pytest.raises(af.InvalidInput, match=f"{name}: has no faces"):
        files.read_mesh(tmp_path / name)


def test_colours_in_comments_of_an_obj_are_taken_along(tmp_path):
    lines = odd_meshes.obj(odd_meshes.bracket())
    lines += ["#MRGB " + "".join(f"ff{i:02x}40ff" for i in range(16)), "#MRGB", "#MRGB of another program"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    mesh = formats.read(tmp_path / "a.obj")
    formats.write_moved(tmp_path / "b.ply", ".obj", mesh, mesh.vertices)
    found = formats.read(tmp_path / "b.ply").colours * 255
    assert found == pytest.approx(np.stack([np.arange(16), [64] * 16, [255] * 16, [255] * 16], axis=1))


# Precision


def survey(shape):
    """A shape of metres in survey coordinates, with relief of micrometres."""
    relief = np.random.default_rng(0).normal(0, 1e-6, shape.vertices.shape)
    return odd_meshes.Shape(shape.vertices + relief + SURVEY, shape.polygons)


@pytest.mark.parametrize("suffix", formats.FORMATS)
def test_doubles_stay_doubles_where_the_format_has_them(suffix, tmp_path):
    shape = survey(odd_meshes.triangles())
    sizes = np.full(12, 3)
    mesh = Mesh(shape.vertices, sizes, np.array(shape.polygons).ravel())
    said = formats.write(tmp_path / f"a{suffix}", mesh)
    again = formats.read(tmp_path / f"a{suffix}")
    if suffix != ".stl":
        assert said == "" and np.array_equal(again.vertices, shape.vertices)
        return
    step = np.abs(shape.vertices.astype(np.float32) - shape.vertices).max()
    assert step > 0.05 and f"up to {step:.3g} of" in said
    assert formats.write(tmp_path / "b.stl", Mesh(shape.vertices - SURVEY, sizes, mesh.corners)) == ""


def test_a_single_precision_file_reports_its_loss(tmp_path, capsys):
    shape, far = odd_meshes.ball(), FILES["far.obj"][1]
    assert np.array_equal(read(tmp_path, "far.obj").vertices, far.vertices)
    for form in odd_meshes.ORDERS:
        elements = [("vertex", odd_meshes.points(shape)), ("face", odd_meshes.faces(shape))]
        path = tmp_path / f"{form}.ply"
        path.write_bytes(odd_meshes.ply(form, elements))
        mesh = formats.read(path)
        files.write_moved_mesh(tmp_path / "moved.ply", path, mesh, lambda points: points + SURVEY)
        error = capsys.readouterr().err
        if form == "ascii":  # digits are digits, whatever the header calls them
            assert error == ""
            assert np.array_equal(formats.read(tmp_path / "moved.ply").vertices, mesh.vertices + SURVEY)
        else:
            assert "note: single precision" in error and "moves points by up to 0.2" in error
        files.write_moved_mesh(tmp_path / "near.ply", path, mesh, lambda points: points + 1)
        assert capsys.readouterr().err == ""


def test_a_text_stl_keeps_its_digits(tmp_path):
    shape = survey(odd_meshes.triangles())
    lines = ["solid far"]
    for corners in odd_meshes.facets(shape):
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {' '.join(map(repr, row.tolist()))}" for row in corners]
        lines += ["endloop", "endfacet"]
    (tmp_path / "a.stl").write_text("\n".join([*lines, "endsolid far"]))
    mesh = formats.read(tmp_path / "a.stl")
    assert np.array_equal(mesh.vertices, shape.vertices)
    assert formats.write_moved(tmp_path / "b.stl", ".stl", mesh, mesh.vertices + 1e-3) == ""
    assert np.array_equal(formats.read(tmp_path / "b.stl").vertices, mesh.vertices + 1e-3)


@pytest.mark.parametrize("suffix", [".xyz", ".csv", ".txt", ".npy", ".npz", ".ply"])
def test_points_of_a_survey_keep_their_digits(suffix, tmp_path):
    samples = af.sample_mesh(
        *[survey(odd_meshes.ball()).vertices, formats.read(written(tmp_path)).triangles], 300
    )
    field = af.deform(
        samples, [af.PointHandle(SURVEY, SURVEY + np.array([0, 0, 1e-3]))], af.DeformOptions(iterations=2)
    )
    field.save(tmp_path / "f.safetensors")
    np.save(tmp_path / "points.npy", samples.points)
    assert (
        run("warp", tmp_path / "f.safetensors", tmp_path / "points.npy", "-o", tmp_path / f"out{suffix}") == 0
    )
    found = (
        formats.read(tmp_path / "out.ply").vertices
        if suffix == ".ply"
        else np.load(tmp_path / "out.npz")["points"]
        if suffix == ".npz"
        else np.load(tmp_path / "out.npy")
        if suffix == ".npy"
        else np.loadtxt(tmp_path / f"out{suffix}", delimiter="," if suffix == ".csv" else None)
    )
    assert np.array_equal(found, field(samples.points))


def written(folder):
    (folder / "ball.ply").write_bytes(FILES["ascii.ply"][0])
    return folder / "ball.ply"


def test_points_and_colours_of_a_cloud_are_kept(tmp_path):
    shape = odd_meshes.ball()
    shade = [("uchar red", np.arange(len(shape.vertices)))]
    (tmp_path / "cloud.ply").write_bytes(
        odd_meshes.ply("binary_little_endian", [("vertex", odd_meshes.points(shape) + shade)])
    )
    mesh = formats.read(tmp_path / "cloud.ply")
    assert mesh.polygons() == []
    formats.write_moved(tmp_path / "moved.ply", ".ply", mesh, turned(mesh.vertices))
    again = plyfile.PlyData.read(tmp_path / "moved.ply")["vertex"]
    assert np.array_equal(again["red"], np.arange(len(shape.vertices)))
    with pytest.raises(af.InvalidInput, match=r"cloud\.ply: has no faces"):
        files.read_mesh(tmp_path / "cloud.ply")


# Damaged files

BINARY = FILES["binary_little_endian.ply"][0]
STL = FILES["plain.stl"][0]
DAMAGED = {
    "word.obj": ("v 0 0 0\nv 1 0 x\n", "line 2: 'v 1 0 x' cannot be read; three coordinates"),
    "short.obj": ("v 0 0 0\n\nv 1 0\n", "line 3: 'v 1 0'"),
    "underscore.obj": ("v 1_0 0 0\n", "line 1"),
    "zero.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4: a face names a vertex beyond the 3"),
    "beyond.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n", "line 5: a face names a vertex beyond the 3"),
    "back.obj": ("v 0 0 0\nv 1 0 0\nf -1 -2 -3\n", "line 3: a face names"),
    "nan.obj": ("v 0 0 0\n# c\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "line 3: vertex 1 is NaN"),
    "face.obj": ("v 0 0 0\nf 1 a 3\n", "line 2: 'f 1 a 3'"),
    "nothing.obj": ("v 0 0 0\nf\n", "line 2: 'f'"),
    "no.ply": ("plywood\n", "is no PLY file"),
    "format.ply": ("ply\nformat ebcdic 1.0\nend_header\n", "line 2: 'format ebcdic 1.0'"),
    "kind.ply": (HEAD.replace("float y", "blob y") + FACE, "line 5: 'property blob y'"),
    "twice.ply": (HEAD.replace("float y", "float x") + FACE, "line 5: 'property float x'"),
    "count.ply": (HEAD.replace("vertex 3", "vertex -3") + FACE, "line 3"),
    "huge.ply": (
        HEAD.replace("vertex 3", "vertex 3000000000000") + FACE + THREE,
        "of 3000000000000 rows of vertex, 3 are",
    ),
    "row.ply": (HEAD + FACE + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 11: '1 0' is no row of vertex"),
    "list.ply": (HEAD + FACE + THREE + "4 0 1 2\n", "line 13: '4 0 1 2' is no row of face"),
    "index.ply": (HEAD + FACE + THREE + "3 0 1 7\n", r"face 0 \(line 13\) names a vertex beyond the 3"),
    "inf.ply": (HEAD + FACE + "0 0 0\n1 0 inf\n0 1 0\n3 0 1 2\n", r"vertex 1 \(line 11\) is NaN"),
    "axes.ply": (
        HEAD.replace("float z", "float q") + FACE + THREE + "3 0 1 2\n",
        "no vertices with x, y and z",
    ),
    "unlisted.ply": (
        HEAD + FACE.replace("vertex_indices", "corners") + THREE + "3 0 1 2\n",
        "no list vertex_indices",
    ),
    "cut.ply": (BINARY[:-9], "cut off or damaged at row"),
    "cut_early.ply": (BINARY[:300], "of 34 rows of vertex, "),
    "wide.ply": (BINARY.replace(b"vertex 34", b"vertex 3000000000"), "of 3000000000 rows of vertex, "),
    "cut.stl": (STL[:-1], "of the 12 triangles it tells of, 11 are there"),
    "huge.stl": (STL[:80] + b"\xff\xff\xff\xff" + STL[84:], "of the 4294967295 triangles"),
    "header.stl": (STL[:40], "is cut off"),
    "end.stl": (FILES["text.stl"][0][:-16], "the last solid has no end"),
    "facet.stl": (
        FILES["text.stl"][0].replace(b"vertex", b"vertices", 1),
        "line 8: a facet does not have three",
    ),
    "vertex.stl": ("solid a\nfacet\nvertex 1 2\nendfacet\n", "line 3: a vertex needs three coordinates"),
    "rows.off": ("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 4: a vertex needs three"),
    "corner.off": ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", "line 6: a face needs"),
    "huge.off": ("OFF\n3000000000 1 0\n0 0 0\n", "line 2: is cut off"),
    "counts.off": ("OFF\nthree one\n", "line 2: is no OFF file"),
    "wide.off": ("4OFF\n3 1 0\n", "another dimension"),
    "index.off": ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n", "line 6: a face names a vertex"),
    "cut.off": (FILES["binary.off"][0][:-30], "face 8 is cut off"),
    "empty.off": ("", "is empty"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_named_with_the_place(name, tmp_path):
    content, words = DAMAGED[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(af.InvalidInput, match=f"{name}: .*{words}"):
        files.read_mesh(path)
