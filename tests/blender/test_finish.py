# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylize finishes on the mesh: wherever the result goes, but not where a field alone is wanted."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.styles import SETTINGS, ball

pytestmark = pytest.mark.in_blender
EXACT = 1e-6  # single precision, of a ball of radius 1
FAST = {"width": 256, "layers": 4, "batch": 500}  # the method that contact needs


def angle(points, item):
    """The mean angle in degrees of triangles to the nearest axis, by area."""
    item.data.calc_loop_triangles()
    corners = points[np.array([triangle.vertices for triangle in item.data.loop_triangles])]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    cosines = np.abs(normals / areas[:, None]).max(axis=1)
    return np.average(np.degrees(np.arccos(np.clip(cosines, 0, 1))), weights=areas)


def stylized(name, result="MODIFIER", prepare=lambda item: None, **further):
    """A ball, and its (n, 3) points after Stylize."""
    item = ball(name)
    prepare(item)
    bpy.ops.arapfields.stylize(**{**SETTINGS, "style": "CUBE", "result": result, **further})
    return item, scenes.world_points(bpy.data.objects[f"{name}_stylized"] if result == "NEW" else item)


def both(**further):
    """A ball, and its points with and without the finish."""
    _, finished = stylized("Finished", **further)
    item, field_alone = stylized("Plain", finish=False, **further)
    return item, finished, field_alone


@pytest.mark.parametrize("result", ["MODIFIER", "NEW", "KEY", "REPLACE"])
def test_the_finish_brings_every_result_nearer_to_the_style(result):
    item, finished, field_alone = both(result=result)
    assert angle(finished, item) < 0.7 * angle(field_alone, item)


def on_ground(**further):
    def prepare(item):
        item.location.z = 1.0
        contact = item.arapfields.contact
        contact.use = contact.use_ground = True
        for name, value in further.items():
            setattr(contact, name, value)

    return prepare


def test_nothing_passes_the_ground():
    item, finished, field_alone = both(prepare=on_ground(), **FAST)
    assert angle(finished, item) < 0.9 * angle(field_alone, item)
    assert finished[:, 2].min() > min(0.0, field_alone[:, 2].min()) - EXACT


def test_with_contact_of_the_surface_with_itself_the_field_stays():
    _, finished, field_alone = both(prepare=on_ground(itself=True), **FAST)
    assert np.array_equal(finished, field_alone)


def test_what_the_region_leaves_out_stays_where_the_field_has_it():
    def of_upper_half(item):
        group = item.vertex_groups.new(name="Upper")
        group.add([v.index for v in item.data.vertices if v.co.z > 0.2], 1.0, "REPLACE")
        item.arapfields.stylize.region = "Upper"

    item, finished, field_alone = both(prepare=of_upper_half)
    low = np.array([vertex.co.z < 0.2 for vertex in item.data.vertices])
    away = np.linalg.norm(finished - field_alone, axis=1)
    assert away[low].max() < EXACT < 0.02 < away.max()


def test_what_handles_hold_stays_where_the_field_has_it():
    def with_a_handle(item):
        above = scenes.cube_empty((0, 0, 1), (1, 1, 0.4))
        scenes.activate(above, item)
        bpy.ops.arapfields.add_handle()
        scenes.activate(item)
        item.arapfields.stylize.use_handles = True

    item, finished, field_alone = both(prepare=with_a_handle)
    high = np.array([vertex.co.z > 0.6 for vertex in item.data.vertices])
    away = np.linalg.norm(finished - field_alone, axis=1)
    assert away[high].max() < EXACT < 0.02 < away.max()
