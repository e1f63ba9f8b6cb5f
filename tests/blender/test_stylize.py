# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles: stylize, live, of objects, and their finish on the mesh."""

import json
import math

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.live import SETTINGS, ball, pin, step
    from support.blender.scenes import FIT

    from addon.core.runtime import jobs
    from addon.core.settings.choices import STYLES, style_identifier, style_name
    from addon.live import sessions
    from addon.solver import frame_solver, style_settings
    from addon.stylize import ball as picture

pytestmark = pytest.mark.in_blender

# Stylizing inside Blender.


def test_a_ball_turns_towards_a_cube_and_keeps_its_mesh():
    item = ball()
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    assert len(result.data.polygons) == len(item.data.polygons)
    assert json.loads(result["arapfields_report"])["preference"] > 0.75


@pytest.mark.parametrize("frame", ["UPRIGHT", "OBJECT", "WORLD", "EMPTY"])
def test_the_style_stands_along_the_chosen_axes(frame):
    """A ball, turned: the cube's axes are those along which its result is most flat."""
    item = ball()
    item.rotation_euler.z = math.radians(20)
    empty = scenes.cube_empty((0, 0, 0), (1, 1, 1), "Axes")
    empty.rotation_euler.z = math.radians(-25)
    bpy.context.view_layer.update()
    scenes.activate(item)
    item.arapfields.stylize.frame_object = empty
    bpy.ops.arapfields.stylize(style="CUBE", frame=frame, **SETTINGS)
    points = scenes.world_points(bpy.data.objects["Ball_stylized"])
    points -= points.mean(axis=0)

    def reach(degrees):
        turn = math.radians(degrees)
        return np.abs(points @ [math.cos(turn), math.sin(turn), 0]).max()

    # A cube reaches least along its axes.
    flattest = min((20, 0, -25), key=reach)
    assert flattest == {"UPRIGHT": 20, "OBJECT": 20, "WORLD": 0, "EMPTY": -25}[frame]


def test_imported_objects_are_styled_upright():
    """A ball, turned as an import turns objects: the flat side of a cone lies below, and there it stands."""
    item = ball()
    item.rotation_euler.x = math.radians(90)
    bpy.context.view_layer.update()
    lowest = scenes.world_points(item)[:, 2].argmin()
    start = scenes.world_points(item)[lowest]

    def low_and_high():
        points = scenes.world_points(bpy.data.objects["Ball_stylized"])
        radii = np.linalg.norm(points[:, :2] - points[:, :2].mean(axis=0), axis=1)
        heights = points[:, 2] - points[:, 2].min()
        return radii[heights < 0.1 * np.ptp(heights)].max(), radii[heights > 0.9 * np.ptp(heights)].max()

    bpy.ops.arapfields.stylize(style="CONE", **SETTINGS)
    assert item.arapfields.stylize.frame == "UPRIGHT"
    below, above = low_and_high()
    assert below > 1.5 * above
    moved = scenes.world_points(bpy.data.objects["Ball_stylized"])[lowest]
    assert np.linalg.norm(moved - start) < 0.05
    scenes.activate(item)
    bpy.ops.arapfields.stylize(style="CONE", frame="OBJECT", **SETTINGS)
    below, above = low_and_high()
    assert below < 1.5 * above


def test_a_vertex_group_bounds_the_region():
    item = ball()
    before = scenes.world_points(item)
    top = item.vertex_groups.new(name="top")
    top.add(np.flatnonzero(before[:, 2] > 0.2).tolist(), 1.0, "REPLACE")
    item.arapfields.stylize.region = "top"
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    normals = np.array([face.normal for face in result.data.polygons])
    heights = np.array([face.center.z for face in item.data.polygons])
    agreement = np.abs(normals).max(axis=1)  # with the cube's axes
    assert agreement[heights > 0.5].mean() > agreement[heights < -0.5].mean() + 0.03


def test_the_menu_lists_the_librarys_styles():
    assert [name for name, _ in STYLES] == list(arapfields.style_names())
    assert all(style_name(style_identifier(name)) == name for name, _ in STYLES)


def test_an_objects_axes_and_its_shape_are_styles():
    """A box turned by 30°: both kinds flatten the ball along the box's axes."""
    item = ball()
    bpy.ops.mesh.primitive_cube_add(location=(5, 0, 0), rotation=(0, 0, math.radians(30)))
    box = bpy.context.object
    for kind in ("AXES", "OBJECT"):
        scenes.activate(item)
        item.arapfields.stylize.style_object = box
        bpy.ops.arapfields.stylize(style=kind, **SETTINGS)
        points = scenes.world_points(bpy.data.objects["Ball_stylized"])
        points -= points.mean(axis=0)
        reach = [np.abs(points @ [math.cos(a), math.sin(a), 0]).max() for a in np.radians([30, 75])]
        assert reach[0] < reach[1] - 0.02, kind


def test_custom_styles_that_give_no_normals_are_named():
    item = ball()
    cloud = bpy.data.meshes.new("Cloud")
    rng = np.random.default_rng(0)
    cloud.from_pydata(rng.normal(size=(300, 3)).tolist(), [], np.arange(300).reshape(-1, 3).tolist())
    for chosen, message in (
        (None, "Choose the object"),
        (bpy.data.objects.new("Cloud", cloud), "encloses no volume, and has 100 different face normals"),
        (bpy.data.objects.new("Empty Mesh", bpy.data.meshes.new("Empty Mesh")), "the mesh is empty"),
        (scenes.cube_empty((0, 0, 0), (1, 1, 1), "Axes"), "Axes is no mesh"),
    ):
        if chosen is not None and chosen.name not in bpy.context.collection.objects:
            bpy.context.collection.objects.link(chosen)
        scenes.activate(item)
        item.arapfields.stylize.style_object = chosen
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.arapfields.stylize(style="OBJECT", **SETTINGS)


def test_a_material_bounds_the_region():
    item = ball()
    for name in ("bottom", "top"):
        item.data.materials.append(bpy.data.materials.new(name))
    heights = np.array([face.center.z for face in item.data.polygons])
    item.data.polygons.foreach_set("material_index", (heights > 0.2).astype(np.int32))
    item.arapfields.stylize.region_material = bpy.data.materials["top"]
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    agreement = np.abs(np.array([face.normal for face in result.data.polygons])).max(axis=1)
    assert agreement[heights > 0.5].mean() > agreement[heights < -0.5].mean() + 0.03
    scenes.activate(item)
    item.arapfields.stylize.region_material = bpy.data.materials.new("unused")
    with pytest.raises(RuntimeError, match="does not use the material unused"):
        bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)


def test_what_is_said_of_the_handles_leaves_out_what_pins_keep_at_rest():
    item = ball()
    points = scenes.world_points(item)
    for side in (points[:, 0].argmax(), points[:, 0].argmin()):
        pin(item, points[side])
    sessions.end(bpy.context, item)
    scenes.activate(item)
    item.arapfields.stylize.use_handles = True
    jobs.board.messages.clear()
    item.arapfields.keep_rest, item.arapfields.keep_beyond = True, 1.0  # as in older files
    assert bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS) == {"FINISHED"}
    (line,) = (text for _, text in jobs.messages())
    report = json.loads(bpy.data.objects["Ball_stylized"]["arapfields_report"])
    errors = [handle["error_max"] for handle in report["handles"]]
    share = float(line.split("within ")[1].split("%")[0]) / 100
    size = np.ptp(points, axis=0).max()
    assert len(errors) == 3 and max(errors[:2]) <= share * size < errors[2]


# Live styles, and the implicit surface that follows its handles.

FEW = 600  # samples, of a ball
SINGLE = 1e-6  # single precision, of a ball of radius 1


def test_a_style_follows_its_sliders_without_handles():
    frame_solver.SAMPLES = FEW
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}

    def corners():
        points = scenes.world_points(ball)
        points = points - points.mean(axis=0)
        return np.linalg.norm(points, axis=1).max() / np.abs(points).max()

    step(refined=True)
    cube = corners()
    assert cube > 1.25
    ball.arapfields.stylize.strength = 0.0
    step(refined=True)
    assert abs(corners() - 1) < 0.05
    ball.arapfields.stylize.strength, ball.arapfields.stylize.style = 1.0, "OCTAHEDRON"
    step(refined=True)
    assert corners() < cube - 0.1


def test_handles_and_a_style_together():
    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    bar.arapfields.stylize.style, bar.arapfields.stylize.use_handles = "CYLINDER", True
    bpy.ops.arapfields.live(kind="STYLIZE")
    moving.location.z += 0.3
    step()
    shift = scenes.world_points(bar) - before
    assert np.abs(shift[before[:, 0] > 0.9].mean(axis=0) - [0, 0, 0.3]).max() < 0.12


def test_the_implicit_surface_follows_too():
    bar, _, moving = scenes.bar_with_handles()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    bar.arapfields.output, bar.arapfields.resolution = "SURFACE", 40
    bpy.ops.arapfields.live()
    result = bpy.data.objects["Bar_live"]
    before = scenes.world_points(result)
    assert len(before) != len(bar.data.vertices) and len(result.data.polygons) > 500
    moving.location.z += 0.3
    step()
    shift = scenes.world_points(result) - before
    assert abs(shift[before[:, 0] > 0.9][:, 2].mean() - 0.3) < 0.05


def test_a_live_style_follows_stiffness_rigidity_and_the_fold_barrier():
    frame_solver.SAMPLES = FEW
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    style = ball.arapfields.stylize
    style.keep_stance = 0.0  # it holds a ball so well that the barrier has nothing to do
    bpy.ops.arapfields.live(kind="STYLIZE")

    def report():
        for _ in range(2):  # the first look sets the solver up anew
            step(refined=True)
        return sessions.live[ball.session_uid].solver.report

    usual = report()
    style.rigidity = 50.0
    assert report()["stretch"] < 0.2 * usual["stretch"]
    style.rigidity, style.bending = 1.0, 500.0
    assert report()["bend"] < 0.1 * usual["bend"]
    style.bending, style.barrier = 0.1, 10.0
    report()
    with_barrier = scenes.world_points(ball)
    style.barrier = 0.0
    report()
    assert np.abs(scenes.world_points(ball) - with_barrier).max() > 1e-3


def test_live_waits_while_the_object_of_a_style_is_still_to_be_chosen():
    """What was shown stays until it is, and then follows it."""
    frame_solver.SAMPLES = FEW
    bpy.ops.mesh.primitive_cube_add(size=1, location=(5, 0, 0), rotation=(0.5, 0.3, 0))
    cube = bpy.context.object
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    bpy.ops.arapfields.live(kind="STYLIZE")
    step(refined=True)
    shown, style = scenes.world_points(ball), ball.arapfields.stylize
    for choose in (
        lambda: setattr(style, "style", "OBJECT"),
        lambda: setattr(style, "style_object", None),
        lambda: setattr(style, "strength", 0.5),
    ):
        choose()
        step(refined=True)
        assert sessions.is_live(ball, "STYLIZE") and not jobs.messages()
        assert np.array_equal(scenes.world_points(ball), shown)
    style.strength, style.style_object = 1.0, cube
    step(refined=True)
    assert sessions.is_live(ball) and np.abs(scenes.world_points(ball) - shown).max() > 0.05
    bpy.ops.arapfields.live(kind="STYLIZE")
    style.style, style.frame, style.frame_object = "CUBE", "EMPTY", None
    with pytest.raises(RuntimeError, match="Choose the object"):  # there is nothing to go on from
        bpy.ops.arapfields.live(kind="STYLIZE")
    assert not sessions.is_live(ball)


@pytest.mark.parametrize("further", [{}, {"finish": False}, {"strength": 0.5, "style": "OCTAHEDRON"}])
def test_live_rests_at_what_stylize_makes(further):
    """The same solve with the same samples: no vertex differs."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    ball.data.transform(Matrix.Diagonal((1.0, 0.7, 1.2, 1.0)))
    style = ball.arapfields.stylize
    style.samples = FEW
    for name, value in further.items():
        setattr(style, name, value)
    rest = scenes.world_points(ball)
    bpy.ops.arapfields.live(kind="STYLIZE")
    step(refined=True)
    live = scenes.world_points(ball)
    assert np.abs(live - rest).max() > 0.05
    assert bpy.ops.arapfields.stylize(result="MODIFIER") == {"FINISHED"}
    assert not sessions.is_live(ball)
    assert np.abs(scenes.world_points(ball) - live).max() < SINGLE


# Any mesh object as a style.


def test_a_ball_as_a_style_changes_nothing_and_an_open_box_is_closed():
    item = ball()
    before = scenes.world_points(item)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(5, 0, 0), radius=0.3)
    other = bpy.context.object
    scenes.activate(item)
    item.arapfields.stylize.style_object = other
    bpy.ops.arapfields.stylize(style="OBJECT", **SETTINGS)
    after = scenes.world_points(bpy.data.objects["Ball_stylized"])
    assert np.abs(after - before).max() < 1e-6
    bpy.ops.mesh.primitive_cube_add(location=(5, 0, 0))
    box = bpy.context.object
    faces = [list(face.vertices) for face in box.data.polygons][1:]
    corners = [list(vertex.co) for vertex in box.data.vertices]
    box.data.clear_geometry()
    box.data.from_pydata(corners, [], faces)
    scenes.activate(item)
    item.arapfields.stylize.style_object = box
    bpy.ops.arapfields.stylize(style="OBJECT", result="NEW", iterations=60, samples=2000)
    points = scenes.world_points(bpy.data.objects["Ball_stylized"])
    points -= points.mean(axis=0)
    assert np.linalg.norm(points, axis=1).max() / np.abs(points).max() > 1.25  # of a ball 1


def test_faces_of_a_mesh_opens_as_object():
    """Files hold a style's number; that of the style which this one took in was the last."""
    style = ball().arapfields.stylize
    items = style.bl_rna.properties["style"].enum_items
    assert items["OBJECT"].value == 15 and len(items) == 16
    box = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    style.style, style.style_object = "OBJECT", box
    assert style.style == "OBJECT"


def test_the_picture_of_a_style_object_is_a_ball():
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    of_ball = picture.picture(style_settings.style_of(bpy.context.object)[0])
    bpy.ops.mesh.primitive_cube_add()
    of_box = picture.picture(style_settings.style_of(bpy.context.object)[0])
    middle = slice(picture.SIZE // 4, -picture.SIZE // 4)
    shades = [len(np.unique(np.round(p[middle, middle, 0], 2))) for p in (of_ball, of_box)]
    assert shades[0] > 30 and np.array_equal(of_ball[..., 3], of_box[..., 3])
    assert np.median(np.abs(np.diff(of_box[middle, middle, 0], axis=0))) < 1e-6  # flat sides
    assert np.median(np.abs(np.diff(of_ball[middle, middle, 0], axis=0))) > 1e-3


# Stylize finishes on the mesh: wherever the result goes, but not where a field alone is wanted.

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
