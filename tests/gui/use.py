# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen is what a click hits: in the viewport, on faces of boxes, in search and status bar."""

import bpy
import numpy as np
import scenes
import stage
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_origin_3d
from mathutils import Vector

PICKS = 10
CANCEL = (45, 12)  # pixels from the window's lower right corner to the middle of the status bar's button
BESIDE = 20.0  # pixels from an Empty's line at which a click can only mean what is behind it
CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
EDGES = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]


def checks(found, folder):
    for target in ("MODIFIER", "NEW"):
        yield from picks(found, folder, target)
    yield from face(found, folder)
    yield from search(found, folder)
    yield from cancel(found, folder)


def pixel(point):
    """Where a point of the world is on the screen, from its top left."""
    window, _, region = stage.view()
    seen = location_3d_to_region_2d(region, stage.view()[1].spaces.active.region_3d, Vector(point))
    return round(region.x + seen.x), round(window.height - region.y - seen.y)


def corners(empty):
    """(8, 2) pixels of the corners of the Empty's cube, in the order of CORNERS."""
    return np.array([pixel(empty.matrix_world @ Vector(corner)) for corner in CORNERS], dtype=float)


def is_clear(point, empties):
    """Whether a point of the world is seen well beside every edge of these Empties' cubes."""
    at = np.array(pixel(point), dtype=float)
    for empty in empties:
        ends = corners(empty)
        for a, b in EDGES:
            way = ends[b] - ends[a]
            share = np.clip((at - ends[a]) @ way / max(way @ way, 1.0), 0.0, 1.0)
            if np.linalg.norm(ends[a] + share * way - at) < BESIDE:
                return False
    return True


def visible_vertices(item, count, empties):
    """Vertices of what is shown of an object that nothing hides from the viewer, far from one another."""
    _, area, region = stage.view()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    eye = area.spaces.active.region_3d
    found = []
    for point in scenes.world_points(item):
        flat = location_3d_to_region_2d(region, eye, Vector(point))
        if flat is None or not 90 < flat.x < region.width - 330 or not 60 < flat.y < region.height - 60:
            continue
        origin = region_2d_to_origin_3d(region, eye, flat)
        way = Vector(point) - origin
        if not is_clear(point, empties):
            continue
        hit, where, *_ = bpy.context.scene.ray_cast(depsgraph, origin, way.normalized())
        if hit and (where - Vector(point)).length < 0.02:
            found.append(point)
    return [found[index] for index in np.linspace(0, len(found) - 1, count + 2).astype(int)[1:-1]]


def edge_points(empty, count):
    """Points on edges of the Empty's cube."""
    ends = [((-1, -1, -1), (1, -1, -1)), ((-1, -1, 1), (1, -1, 1)), ((-1, -1, -1), (-1, -1, 1))]
    for a, b in ends[:count]:
        yield empty.matrix_world @ (0.7 * Vector(a) + 0.3 * Vector(b))


def picks(found, folder, target):
    """Ten clicks on what is seen: the mesh that was deformed and both handles."""
    stage.empty_file()
    with stage.override():
        bar, fixed, moving = scenes.bar_with_handles()
        moving.location.z += 0.6
        bpy.context.view_layer.update()
        scenes.activate(bar)
        bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.QUICK, target=target)
        bpy.ops.view3d.view_all()
    yield 1.0
    meshes = [o for o in bpy.context.scene.objects if o.type == "MESH" and o.visible_get()]
    found[f"overlapping_{target}"] = len(meshes) - 1
    wanted = [(meshes[0], point) for point in visible_vertices(meshes[0], PICKS - 6, (fixed, moving))]
    wanted += [(empty, point) for empty in (fixed, moving) for point in edge_points(empty, 3)]
    hits, missed = 0, []
    for item, point in wanted:
        with stage.override():
            for other in bpy.context.selected_objects:
                other.select_set(False)
            bpy.context.view_layer.objects.active = None
        yield 0.3
        stage.tool("mousemove", *pixel(point), "click", 1)
        for _ in range(20):  # a busy machine takes its time
            yield 0.2
            active = bpy.context.view_layer.objects.active
            if active is not None:
                break
        hits += active == item
        if active != item:
            missed.append((item.name, active.name if active else None, pixel(point)))
    found[f"picks_{target}"] = f"{hits} of {len(wanted)}"
    found[f"missed_{target}"] = missed
    stage.picture(folder, f"picks-{target.lower()}")
    print(found, flush=True)


def face(found, folder):
    """A face of the active box is dragged outwards: one undo step, and the handle holds more."""
    stage.empty_file()
    with stage.override():
        bar, fixed, _ = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
        scenes.activate(fixed)
        bpy.ops.ed.undo_push(message="before")
    yield 1.5
    before, held = fixed.scale.x, bar.arapfields.handles[0].inside
    at = fixed.matrix_world @ Vector((1, 0, 0))
    x, y = pixel(at)
    x2, y2 = pixel(at + Vector((0.3, 0, 0)))
    stage.tool("mousemove", x - 3, y - 3)
    yield 0.5
    stage.tool("mousemove", x, y)
    yield 0.8
    stage.picture(folder, "face")
    stage.tool("mousedown", 1)
    yield 0.5
    for share in (0.25, 0.5, 0.75, 1.0):
        stage.tool("mousemove", round(x + share * (x2 - x)), round(y + share * (y2 - y)))
        yield 0.3
    stage.tool("mouseup", 1)
    yield 1.0
    stage.picture(folder, "face-dragged")
    found["face_dragged"] = round(bpy.data.objects["Fixed"].scale.x / before, 3)
    found["face_holds_more"] = bpy.data.objects["Bar"].arapfields.handles[0].inside > held
    with stage.override():
        bpy.ops.ed.undo()
    yield 0.5
    found["face_is_one_undo_step"] = abs(bpy.data.objects["Fixed"].scale.x - before) < 1e-6


def search(found, folder):
    """Blender's search finds us by our name and by what we do."""
    for words in ("arap", "deform", "stylize"):
        stage.tool("mousemove", 400, 600)
        yield 0.5
        with stage.override():
            bpy.ops.wm.search_menu("INVOKE_DEFAULT")
        yield 4.0
        stage.tool("type", words)
        yield 3.0
        stage.picture(folder, f"search-{words}")
        stage.tool("key", "Escape")
        yield 0.7
    found["searched"] = True


def cancel(found, folder):
    """The status bar's button ends a job, whatever the sidebar shows."""
    import jobs as window_jobs

    from addon.core.runtime import jobs

    window, area, _ = stage.view()
    area.spaces.active.show_region_ui = False
    window_jobs.invoke(window_jobs.LONG)
    yield 4.0
    stage.picture(folder, "status-bar")
    running = jobs.running() is not None
    stage.tool("mousemove", window.width - CANCEL[0], window.height - CANCEL[1], "click", 1)
    yield from window_jobs.until_idle(20)
    found["cancelled_in_the_status_bar"] = running and jobs.running() is None
    area.spaces.active.show_region_ui = True
    yield 1.0
