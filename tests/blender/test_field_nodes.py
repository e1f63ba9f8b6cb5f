# SPDX-License-Identifier: GPL-3.0-or-later
"""Field as Nodes: the group against the library, on all kinds of geometry, and without the extension."""

import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.riders import link, rider, shown

    from addon.field_modifier import field_nodes, inputs
    from addon.poses import applying
    from addon.solver import setup

pytestmark = pytest.mark.in_blender

EXACT = 1e-5  # of the size, in single precision
TURN = 2e-3  # radians, of differences over a hundredth of the cube
ALONE = """
import bpy, numpy as np, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
assert not hasattr(bpy.types.Object, "arapfields")
mesh = bpy.data.objects["Cloud"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
flat = np.empty(3 * len(mesh.vertices), np.float32)
mesh.vertices.foreach_get("co", flat)
np.save(sys.argv[2], flat.reshape(-1, 3))
"""


def cloud(count, place=None):
    """A mesh of points about the bar, with a matrix to the world."""
    points = np.random.default_rng(0).uniform([-1.1, -0.4, -0.4], [1.1, 0.4, 1.0], (count, 3))
    place = Matrix() if place is None else place
    mesh = bpy.data.meshes.new("Cloud")
    mesh.vertices.add(count)
    local = np.c_[points, np.ones(count)] @ np.array(place.inverted()).T
    mesh.vertices.foreach_set("co", local[:, :3].astype(np.float32).ravel())
    item = link("Cloud", mesh)
    item.matrix_world = place
    return item


def press(*items):
    scenes.activate(*items)
    assert bpy.ops.arapfields.field_as_nodes() == {"FINISHED"}


def by_field(source, points):
    """Where the library's field takes points of the world."""
    pose = applying.solved_pose(bpy.context, source)
    place = np.array(source.matrix_world)
    local = (points - place[:3, 3]) @ np.linalg.inv(place[:3, :3]).T
    return pose.to_local(pose.field(pose.to_solve(local))) @ place[:3, :3].T + place[:3, 3], pose


def body(curl=0.0):
    """(bar, moving) with a handle at each end; curled up by so many radians to either side."""
    if not curl:
        return scenes.bar_with_handles()[::2]
    bar, middle = scenes.bar(), np.array([0.0, 0.0, 1.0 / curl])
    for vertex in bar.data.vertices:
        angle, radius = vertex.co.x * curl, 1.0 / curl - vertex.co.z
        vertex.co.x, vertex.co.z = radius * np.sin(angle), middle[2] - radius * np.cos(angle)
    ends = [middle + np.array([side * np.sin(curl), 0.0, -np.cos(curl)]) / curl for side in (-1, 1)]
    empties = [scenes.cube_empty(end, (0.2, 0.5, 0.2)) for end in ends]
    bpy.context.view_layer.update()
    scenes.activate(*empties, bar)
    bpy.ops.arapfields.add_handle()
    return bar, empties[1]


@pytest.mark.parametrize(("curl", "count"), [(0.0, 50_000), (2.4, 2_000)])
def test_the_group_is_the_librarys_field(curl, count):
    setup.SAMPLES = 6000  # so dense that the ends of the curl are told apart
    bar, moving = body(curl)
    place = Matrix.Translation((3, 0, 1)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Diagonal((2, 0.5, 1, 1))
    points = cloud(count, place)
    bpy.context.view_layer.update()
    rest = scenes.world_points(points)
    scenes.activate(points, bar)
    with pytest.raises(RuntimeError, match="Deform Bar first"):
        bpy.ops.arapfields.field_as_nodes()
    bpy.ops.arapfields.live()
    moving.location.z += 0.3
    moving.rotation_euler.y = -0.6
    step(refined=True)
    press(points, bar)
    after, pose = by_field(bar, rest)
    assert ("nodes" in pose.field.arrays()) == bool(curl)
    size = np.ptp(rest, axis=0).max()
    assert np.abs(after - rest).max() > 0.2 * size
    assert np.abs(scenes.world_points(points) - after).max() < EXACT * size
    if curl:
        inputs.put(points.modifiers["ARAP Field"], "Factor", 0.5)
        assert np.abs(scenes.world_points(points) - (rest + after) / 2).max() < EXACT * size
        inputs.put(points.modifiers["ARAP Field"], "Factor", 0.0)
        assert np.array_equal(scenes.world_points(points), rest)


def test_it_follows_what_is_solved_and_works_alone():
    bar, moving = body()
    points = cloud(500)
    rest = scenes.world_points(points)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    press(points, bar)
    for height in (0.2, 0.5):
        moving.location.z = height
        step(refined=True)
        assert np.abs(scenes.world_points(points) - by_field(bar, rest)[0]).max() < EXACT
    scenes.activate(bar)
    bpy.ops.arapfields.live()  # ends it: all is what it was when live mode began
    kept = scenes.world_points(points)
    assert np.abs(kept - rest).max() < EXACT
    assert bpy.ops.arapfields.deform(samples=2000, result="MODIFIER") == {"FINISHED"}
    shown_now = scenes.world_points(points)
    assert np.abs(shown_now - by_field(bar, rest)[0]).max() < 5 * EXACT and np.ptp(shown_now - rest) > 0.2
    folder = Path(tempfile.mkdtemp())
    bar.name, points.modifiers["ARAP Field"].name = "Body", "Follows"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "all.blend"))
    program = [sys.executable, "-c", ALONE, str(folder / "all.blend"), str(folder / "out.npy")]
    subprocess.run(program, check=True, cwd=folder, capture_output=True)
    assert np.array_equal(np.load(folder / "out.npy"), shown_now)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "all.blend"))
    bar, points = bpy.data.objects["Body"], bpy.data.objects["Cloud"]
    assert np.array_equal(scenes.world_points(points), shown_now)
    scenes.activate(bar)
    bpy.ops.arapfields.remove_field()
    assert np.abs(scenes.world_points(points) - rest).max() == 0
    bpy.data.objects.remove(field_nodes.of(bar))
    assert np.abs(scenes.world_points(points) - rest).max() == 0


def instancer():
    """A point cloud's worth of cubes, made by nodes: an instance on each vertex of a mesh."""
    points = cloud(20)
    group = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    made = [group.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeMeshToPoints")]
    made += [group.nodes.new(kind) for kind in ("GeometryNodeInstanceOnPoints", "NodeGroupOutput")]
    for before, after in itertools.pairwise(made):
        group.links.new(before.outputs[0], after.inputs[0])
    cube = group.nodes.new("GeometryNodeMeshCube")
    group.links.new(cube.outputs[0], made[2].inputs["Instance"])
    made[2].inputs["Rotation"].default_value = (0.3, 0.2, 0.1)
    points.modifiers.new("Cubes", "NODES").node_group = group
    return points


def instances(item):
    """(n, 4, 4) world matrices of what is instanced by an object."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = depsgraph.object_instances
    return np.array([np.array(i.matrix_world) for i in seen if i.is_instance and i.parent.original == item])


def test_instances_turn_and_curves_bend():
    bar, moving = body()
    cubes, hair, cord = instancer(), rider("CURVES"), rider("CURVE")
    spline = cord.data.splines.new("BEZIER")
    spline.bezier_points.add(1)
    for number, point in enumerate(spline.bezier_points):
        point.handle_left_type = point.handle_right_type = "FREE"
        point.co = (0.5, 0.1 * number, 0.1)
        point.handle_left, point.handle_right = (0.3, 0.1 * number, 0.2), (0.8, 0.1 * number, 0.1)
    bpy.context.view_layer.update()
    rest, strands, before = instances(cubes), shown(hair), bezier(cord)
    assert len(rest) == 20
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    moving.location.z, moving.rotation_euler.y = 0.4, -0.6
    step(refined=True)
    press(cubes, hair, cord, bar)
    after, pose = by_field(bar, rest[:, :3, 3])
    placed = instances(cubes)
    assert np.abs(placed[:, :3, 3] - after).max() < EXACT
    slopes = pose.field.jacobian(rest[:, :3, 3])
    unfolded = np.linalg.det(slopes) > 0.1
    left, _, right = np.linalg.svd(slopes)
    turned = left @ right @ rest[:, :3, :3]
    assert unfolded.sum() > 15 and np.abs(placed[:, :3, :3] - turned)[unfolded].max() < TURN
    assert np.abs(left @ right - np.eye(3)).max() > 0.3
    assert np.abs(shown(hair) - by_field(bar, strands)[0]).max() < EXACT
    assert np.abs(bezier(cord) - by_field(bar, before)[0]).max() < EXACT
    modifier = cubes.modifiers["ARAP Field"]
    inputs.put(modifier, "Realize Instances", True)
    assert len(scenes.world_points(cubes)) == 160 and not len(instances(cubes))


def bezier(item):
    """(n, 3) points and handles in the world of the Bézier curves that an object shows."""
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    geometry = seen.evaluated_geometry()
    curves = geometry.curves
    kinds = [kind.value for kind in curves.attributes["curve_type"].data]
    of_bezier = [p.index for c in curves.curves if kinds[c.index] == 2 for p in c.points]
    places = [curves.attributes[name].data for name in ("position", "handle_left", "handle_right")]
    return np.array([item.matrix_world @ place[index].vector for place in places for index in of_bezier])
