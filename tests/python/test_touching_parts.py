# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a shape that touch at rest, or nearly, come apart: there the field lives on the surface."""

import functools

import numpy as np
import pytest
from support.files import archives
from support.geometry import cases, slit
from support.geometry.meshes import check_closed, read

import arapfields as af

GAPS = [0.2, 0.02, 0.004, 0.0]
# A jaw of size 1 turned by 25° about its hinge; a field of finite resolution rounds the slit's end.
JAW_ERROR = 0.04


@functools.cache
def solved(gap):
    vertices, triangles, jaws = slit.slit_bar(gap)
    samples = af.sample_mesh(vertices, triangles, count=8000)
    field = af.deform(samples, slit.jaw_handles(), options=af.DeformOptions())
    return vertices, triangles, jaws, field


def test_a_slit_bar_is_closed():
    for gap in GAPS:
        vertices, triangles, _ = slit.slit_bar(gap)
        check_closed(vertices, triangles)
        corners = vertices[triangles]
        volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
        assert 1.7 < volume <= 2.0 + 1e-9


@pytest.mark.parametrize("gap", GAPS)
def test_the_jaws_of_a_slit_bar_come_apart(gap):
    vertices, triangles, jaws, field = solved(gap)
    deformed = field.apply(vertices, triangles=triangles)
    assert max(slit.jaw_errors(vertices, jaws, deformed)) < JAW_ERROR
    assert field.report.min_determinant > 0.0


def test_a_closed_slit_costs_what_an_open_one_does():
    energies = [solved(gap)[3].report.energy for gap in GAPS]
    assert max(energies[1:]) < 4.0 * energies[0]


# Neighbouring vertices of a bent animal; its field alone, without sides, stretches its edges by at most 1.17.
LONGEST_EDGE = 1.3


@pytest.mark.parametrize("name", ["spot.obj", "bunny.off", "rockerArm.obj"])
def test_folds_and_limbs_of_ordinary_shapes_are_not_torn(name, data_dir):
    vertices, triangles = read(data_dir / "meshes" / name)[:2]
    centered = vertices - vertices.mean(axis=0)
    axes = np.linalg.eigh(centered.T @ centered)[1][:, ::-1].copy()
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    vertices = centered @ axes
    vertices /= np.ptp(vertices[:, 0]) / 2.0
    low, high = vertices.min(axis=0) - 0.05, vertices.max(axis=0) + 0.05
    first, last = np.quantile(vertices[:, 0], [0.1, 0.9])
    handles = [
        cases.moved(cases.box(low, (first, *high[1:]))),
        cases.moved(cases.box((last, *low[1:]), high), cases.turn((0, 0, 1), 50.0)),
    ]
    field = af.deform(af.sample_mesh(vertices, triangles), handles)
    deformed = field.apply(vertices, triangles=triangles)

    def edges(places):
        return np.linalg.norm(places[triangles] - places[np.roll(triangles, 1, axis=1)], axis=2)

    assert np.max(edges(deformed) / edges(vertices)) < LONGEST_EDGE


def test_vertices_without_triangles_take_the_nearest_side():
    vertices, triangles, _, field = solved(0.02)
    assert np.allclose(field(vertices), field.apply(vertices, triangles=triangles), atol=1e-9)


def test_a_saved_field_keeps_the_sides(tmp_path):
    vertices, triangles, _, field = solved(0.004)
    field.save(tmp_path / "field.safetensors")
    loaded = af.DeformationField.load(tmp_path / "field.safetensors")
    assert np.array_equal(
        loaded.apply(vertices, triangles=triangles), field.apply(vertices, triangles=triangles)
    )
    assert np.array_equal(loaded(vertices), field(vertices))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("sides", 1e6, "whole numbers from 0 to"),
        ("others", 0.5, "whole numbers from 0 to"),
        ("starts", 0.0, "rise from 0 to the number of pairs"),
        ("excess", -1.0, "none may be negative"),
    ],
)
def test_what_nodes_see_is_checked_when_it_is_read(name, value, message, tmp_path):
    field = solved(0.02)[3]
    field.save(tmp_path / "whole.safetensors")
    texts, arrays = archives.read(tmp_path / "whole.safetensors")
    damaged = arrays[f"embedding.sight.{name}"].copy()
    damaged[-1] = value
    content = archives.packed(texts, arrays | {f"embedding.sight.{name}": damaged})
    (tmp_path / "field.safetensors").write_bytes(content)
    with pytest.raises(af.InvalidInput, match=message):
        af.DeformationField.load(tmp_path / "field.safetensors")


def test_a_finer_mesh_is_moved_by_its_own_triangles():
    field = solved(0.004)[3]
    vertices, triangles, jaws = slit.slit_bar(0.004, columns=70, rows=24, layers=9)
    deformed = field.apply(vertices, triangles=triangles)
    assert max(slit.jaw_errors(vertices, jaws, deformed)) < JAW_ERROR


def test_live_tracks_vertices_by_their_triangles():
    vertices, triangles, jaws = slit.slit_bar(0.0)
    samples = af.sample_mesh(vertices, triangles, count=8000)
    live = af.LiveDeformer(samples, slit.jaw_handles())
    live.track(vertices, triangles=triangles)
    live.follow(iterations=100, tolerance=1e-6)
    assert max(slit.jaw_errors(vertices, jaws, live.tracked())) < JAW_ERROR


def test_triangles_of_other_vertices_are_refused():
    vertices, triangles, _, field = solved(0.02)
    with pytest.raises(af.InvalidInput, match="triangles"):
        field.apply(vertices[:10], triangles=triangles)
