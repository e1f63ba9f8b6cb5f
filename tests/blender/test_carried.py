# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a source's field moves as well."""

import pytest
from inside import in_blender

CLOSE = 1e-5  # single precision of positions of size one


def body():
    """(bar, moving): a bar whose right end a handle will move, with nothing carried yet."""
    import scenes

    bar, _, moving = scenes.bar_with_handles()
    return bar, moving


def link(name, data, location=(0, 0, 0)):
    import bpy

    item = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(item)
    item.location = location
    return item


def rider(kind):
    """An object of that kind at the right end of the bar."""
    import bpy
    import numpy as np
    from test_carried import link

    points = np.array([(0.9, 0.1, 0.27), (1.0, -0.1, 0.3), (0.95, 0.0, 0.35), (1.0, 0.1, 0.4)])
    at = np.array((0.2, 0.0, 0.1))  # where the object's origin is
    if kind == "MESH":
        mesh = bpy.data.meshes.new("Patch")
        mesh.from_pydata((points - at).tolist(), [], [(0, 1, 2, 3)])
        return link("Patch", mesh, at)
    if kind == "CURVES":
        curves = bpy.data.hair_curves.new("Hair")
        curves.add_curves([2, 2])
        curves.attributes["position"].data.foreach_set("vector", (points - at).astype(np.float32).ravel())
        return link("Hair", curves, at)
    if kind == "GREASEPENCIL":
        pencil = bpy.data.grease_pencils_v3.new("Ink")
        drawing = pencil.layers.new("Lines").frames.new(1).drawing
        drawing.add_strokes([2, 2])
        drawing.attributes["position"].data.foreach_set("vector", (points - at).astype(np.float32).ravel())
        return link("Ink", pencil, at)
    if kind == "CURVE":
        curve = bpy.data.curves.new("Cord", "CURVE")
        curve.dimensions = "3D"
        spline = curve.splines.new("POLY")
        spline.points.add(3)
        spline.points.foreach_set("co", np.c_[points - at, np.ones(4)].astype(np.float32).ravel())
        return link("Cord", curve, at)
    if kind == "LATTICE":
        item = link("Cage", bpy.data.lattices.new("Cage"), (1.0, 0, 0.3))
        item.scale = (0.2, 0.2, 0.2)
        return item
    if kind == "ARMATURE":
        item = link("Tail", bpy.data.armatures.new("Tail"))
        bpy.context.view_layer.objects.active = item
        bpy.ops.object.mode_set(mode="EDIT")
        bone = item.data.edit_bones.new("Tip")
        bone.head, bone.tail = (0.9, 0, 0.3), (0.9, 0, 0.5)
        bpy.ops.object.mode_set(mode="OBJECT")
        return item
    item = link("Spot", None, (1.0, 0.05, 0.3))
    item.rotation_mode, item.rotation_euler, item.scale = "XYZ", (0.1, 0.2, 0.3), (0.1, 0.2, -0.3)
    return item


def shown(item):
    """(n, 3) where an object's points are seen, in world space."""
    import bpy
    import numpy as np

    bpy.context.view_layer.update()
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = np.array(seen.matrix_world)
    if item.type == "MESH":
        points = [v.co for v in seen.data.vertices]
    elif item.type == "CURVES":
        points = [p.vector for p in seen.data.attributes["position"].data]
    elif item.type == "GREASEPENCIL":
        points = [p.vector for p in seen.data.layers[0].frames[0].drawing.attributes["position"].data]
    elif item.type == "CURVE":
        points = [v.co for v in seen.to_mesh().vertices]
    elif item.type == "LATTICE":
        points = [p.co_deform for p in seen.data.points]
    elif item.type == "ARMATURE":
        points = [seen.pose.bones[0].head, seen.pose.bones[0].tail]
    else:
        points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    points = np.array([tuple(point) for point in points])
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def taken(session, points):
    """Where a live session's field takes (n, 3) points."""
    import arapfields

    return arapfields.Attachment(session.samples, points).positions(session.solver.field)


KINDS = ["MESH", "CURVES", "GREASEPENCIL", "CURVE", "LATTICE", "EMPTY", "ARMATURE"]


@pytest.mark.parametrize("kind", KINDS)
@in_blender
def test_each_kind_follows_live_and_comes_back(kind):
    import bpy
    import numpy as np
    import scenes
    from test_carried import CLOSE, body, rider, shown, taken
    from test_live import step

    from addon.live import sessions

    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    counts = len(item.modifiers), len(bpy.data.node_groups)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert np.abs(shown(item) - before).max() < 0.01
    moving.location.z += 0.4
    moving.rotation_euler.x = 0.3
    step(refined=True)
    session = sessions.live[bar.session_uid]
    assert not session.carrying.warnings
    after = taken(session, before)  # the bar's own coordinates are the world's
    spread = 0.05 if kind in ("EMPTY", "ARMATURE") else CLOSE
    assert np.abs(shown(item) - after).max() < spread and np.abs(after - before).max() > 0.3
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert (len(item.modifiers), len(bpy.data.node_groups)) == counts
    if kind in ("CURVE", "LATTICE"):
        assert item.data.shape_keys is None


@pytest.mark.parametrize("kind", KINDS)
@in_blender
def test_each_kind_goes_with_a_solve_and_is_released(kind):
    import bpy
    import numpy as np
    import scenes
    from test_carried import CLOSE, body, rider, shown

    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)
    for _ in range(2):  # a second one starts from rest again
        assert bpy.ops.arapfields.deform(field="radial", samples=2000) == {"FINISHED"}
    assert np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1
    bpy.ops.arapfields.release()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert not bar.arapfields.carried and item.arapfields.carried_by is None


@in_blender
def test_what_is_rigid_stays_so():
    import bpy
    import numpy as np
    import scenes
    from test_carried import CLOSE, body
    from test_live import step

    bar, moving = body()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.7, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    eye.parent = bar
    eye.location.x += 0.05
    bpy.context.view_layer.update()
    before = scenes.world_points(eye)
    scenes.activate(eye, bar)
    bpy.ops.arapfields.carry(way="RIGID")
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    moving.rotation_euler.y = -0.5
    step(refined=True)
    after = scenes.world_points(eye)
    one, other = (points - points.mean(axis=0) for points in (before, after))
    assert np.abs(np.linalg.norm(one, axis=1) - np.linalg.norm(other, axis=1)).max() < CLOSE
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) > 0.2
    assert np.abs(other - one).max() > 0.01  # it turns as well
    assert not eye.modifiers and np.allclose(eye.location[0], 0.75)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE and not any(eye.delta_location)


@in_blender
def test_an_eye_on_a_bone_does_not_move_twice():
    """A child of a bone that is a handle: it is where the field has it, not the bone's motion on top."""
    import bpy
    import numpy as np
    import scenes
    from test_bones import rigged_bar
    from test_carried import CLOSE, taken
    from test_live import step

    from addon.live import sessions

    bar, rig = rigged_bar()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.8, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    before = scenes.world_points(eye)
    rig.data.bones.active = rig.data.bones["Second"]
    scenes.activate(eye, rig)
    bpy.ops.object.parent_set(type="BONE", keep_transform=True)
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    rig.pose.bones["Second"].rotation_euler.z = 0.7  # posed before it is carried
    bpy.context.view_layer.update()
    scenes.activate(eye, bar)
    for way in ("RIGID", "FOLLOW"):
        assert bpy.ops.arapfields.carry(way=way) == {"FINISHED"}
        bpy.ops.arapfields.live()
        for angle in (0.7, -0.5):
            rig.pose.bones["Second"].rotation_euler.z = angle
            step(refined=True)
            step(refined=True)
            after = taken(sessions.live[bar.session_uid], before)
            assert np.abs(scenes.world_points(eye) - after).max() < 0.02
        bpy.ops.arapfields.live()


@in_blender
def test_what_moves_anyway_is_named_and_left():
    import bpy
    import pytest
    import scenes
    from test_carried import body, rider

    bar, _ = body()
    patch, spot, cage = rider("MESH"), rider("EMPTY"), rider("LATTICE")
    for item in (spot, cage):
        scenes.activate(item, bar)
        bpy.ops.arapfields.carry()
    patch.parent = spot
    scenes.activate(patch, bar)
    with pytest.raises(RuntimeError, match="Patch moves with Spot already"):
        bpy.ops.arapfields.carry()
    patch.parent = None
    patch.modifiers.new("Cage", "LATTICE").object = cage
    with pytest.raises(RuntimeError, match="Patch moves with Cage already"):
        bpy.ops.arapfields.carry()
    assert len(bar.arapfields.carried) == 2


@in_blender
def test_bad_ones_are_named_and_the_rest_goes_on():
    import bpy
    import numpy as np
    import scenes
    from test_carried import body, link, rider, shown
    from test_live import step

    from addon.core.runtime import jobs
    from addon.live import sessions

    bar, moving = body()
    good = rider("MESH")
    bad = [link(name, bpy.data.meshes.new(name)) for name in ("Hollow", "Gone", "Dark", "Torn", "Lone")]
    for item in bad[1:]:
        item.data.from_pydata([(0.9, 0, 0.3), (1.0, 0, 0.3), (0.9, 0.1, 0.3)], [], [(0, 1, 2)])
    scenes.activate(good, *bad, bar)
    bpy.ops.arapfields.carry()
    assert len(bar.arapfields.carried) == 6
    bad[2].hide_set(True)
    bad[3].data.vertices[0].co.x = float("nan")
    bpy.data.objects.remove(bad[1])
    before = shown(good)
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    told = "\n".join(text for _, text in jobs.messages())
    for words in (
        "Hollow is empty",
        "Gone, which Bar carries, was deleted",
        "Dark is hidden",
        "Torn has points",
    ):
        assert words in told, told
    moving.location.z += 0.4
    step()
    assert np.abs(shown(good) - before - [0, 0, 0.4]).max() < 0.1
    bad[4].data.clear_geometry()
    bpy.context.view_layer.update()
    moving.location.z += 0.1
    for _ in range(3):
        step()
    assert sessions.is_live(bar) and np.abs(shown(good) - before - [0, 0, 0.5]).max() < 0.1
    bpy.data.objects.remove(bad[4])
    moving.location.z -= 0.1
    for _ in range(3):
        step()
    assert sessions.is_live(bar) and np.abs(shown(good) - before - [0, 0, 0.4]).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(shown(good) - before).max() < 1e-5 and len(bar.arapfields.carried) == 6


@in_blender
def test_a_moved_or_edited_one_follows_from_where_it_is():
    import bpy
    import numpy as np
    import scenes
    from test_carried import CLOSE, body, rider, shown, taken
    from test_live import step

    from addon.live import sessions

    bar, moving = body()
    patch, spot = rider("MESH"), rider("EMPTY")
    scenes.activate(patch, spot, bar)
    bpy.ops.arapfields.carry()
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    session = sessions.live[bar.session_uid]
    patch.location.x -= 0.5
    spot.location.x -= 0.5
    rest = np.array([v.co for v in patch.data.vertices]) + np.array(patch.location)
    for _ in range(2):
        step(refined=True)
    assert np.abs(shown(patch) - taken(session, rest)).max() < CLOSE
    assert np.abs(shown(spot)[0] - taken(session, np.array([spot.location]))[0]).max() < 0.02
    patch.data.vertices[0].co.z += 0.1
    patch.data.update()
    rest[0, 2] += 0.1
    for _ in range(2):
        step(refined=True)
    assert sessions.live[bar.session_uid] is session
    assert np.abs(shown(patch) - taken(session, rest)).max() < CLOSE


@in_blender
def test_a_shirt_of_the_same_armature_is_not_posed_twice():
    import bpy
    import numpy as np
    import scenes
    from test_bones import rigged_bar
    from test_carried import CLOSE, taken
    from test_live import step

    from addon.live import sessions

    bar, rig = rigged_bar()
    shirt = bar.copy()
    shirt.data, shirt.name = bar.data.copy(), "Shirt"
    bpy.context.collection.objects.link(shirt)
    for vertex in shirt.data.vertices:
        vertex.co.y *= 1.1
        vertex.co.z *= 1.1
    rest = np.array([vertex.co for vertex in shirt.data.vertices])
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    scenes.activate(shirt, bar)
    bpy.ops.arapfields.carry()
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.7
    step(refined=True)
    after = taken(sessions.live[bar.session_uid], rest)
    assert np.abs(scenes.world_points(shirt) - after).max() < CLOSE
    assert not shirt.modifiers["Armature"].show_viewport
    bpy.ops.arapfields.live()
    assert shirt.modifiers["Armature"].show_viewport and len(shirt.modifiers) == 1
