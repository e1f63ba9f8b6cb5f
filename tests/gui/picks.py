# SPDX-License-Identifier: GPL-3.0-or-later
"""Clicks select what is visible, and only one mesh is visible: source, live shape and results in each stage.

Ten clicks per stage: four on the visible mesh, four on edges of handles, and two where the mesh was at rest
and nothing is now, which select nothing.
"""

import bpy
import numpy as np
import stage
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector
from mouse import pixel, until, until_live_rests
from support.blender import scenes
from use import edge_points

from addon.live import sessions

ON_MESH, ON_HANDLE, ON_NOTHING = 4, 2, 2  # numbers of clicks; ON_HANDLE for each of the two handles
BESIDE = 20.0  # least distance in pixels from an Empty's lines of clicks on other things
CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
EDGES = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
STAGES = {  # in order, with the visible object of each
    "source": "Bar",
    "live": "Bar_live",
    "kept": "Bar_deformed",
    "deformed": "Bar_deformed",
    "live again": "Bar_live",
    "stylized": "Bar_stylized",
    "in place": "Bar",
    "live in place": "Bar",
}
IN_PLACE = ("deformed", "in place", "live in place")


def checks(figures, folder, in_place=False):
    stage.empty_file()
    with stage.override():
        bar, fixed, moving = scenes.bar_with_handles()
        bar.arapfields.result = "NEW"
        moving.location.z += 0.6
        bpy.context.view_layer.update()
        scenes.activate(bar)
        bpy.ops.view3d.view_all()
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
    yield 1.0
    rest, cells = scenes.world_points(bar), {}
    for name in IN_PLACE if in_place else STAGES:
        with stage.override():
            choose(bar)
        yield from enter(name, bar)
        meshes = [item for item in bpy.context.scene.objects if item.type == "MESH"]
        seen = [item.name for item in meshes if item.visible_get()]
        rendered = [item.name for item in meshes if not item.hide_render]
        cell = {"seen": seen, "alone": seen == rendered == [STAGES[name]]}
        yield from clicks(cell, bpy.data.objects[seen[0]], (fixed, moving), rest)
        stage.picture(folder, f"picks-{name.replace(' ', '-')}")
        cells[name] = cell
        print(name, cell, flush=True)
    figures["picks"] = cells
    figures["picks_right"] = all(cell["alone"] and cell["hits"] == cell["of"] for cell in cells.values())


def choose(bar):
    """Selects as a click in the outliner does, also a hidden object."""
    for other in bpy.context.selected_objects:
        other.select_set(False)
    bpy.context.view_layer.objects.active = bar


def enter(name, bar):
    with stage.override():
        if name.startswith("live"):
            bpy.ops.arapfields.live("INVOKE_DEFAULT")
        elif name == "kept":
            bpy.ops.arapfields.live_keep()
        elif name == "deformed":
            bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.QUICK)
        elif name == "stylized":
            bpy.ops.arapfields.stylize("EXEC_DEFAULT", style="CUBE", **scenes.QUICK)
        elif name == "in place":
            bar.arapfields.result = "MODIFIER"
            bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.QUICK)
    yield 0.5
    if name.startswith("live"):
        assert sessions.is_live(bar), name
        yield from until_live_rests(60.0)
    yield 0.5


def clicks(cell, mesh, empties, rest):
    targets = [(mesh, point) for point in visible_vertices(mesh, ON_MESH, empties)]
    targets += [(empty, point) for empty in empties for point in edge_points(empty, ON_HANDLE)]
    targets += [(None, point) for point in left_behind(rest, empties, ON_NOTHING)]
    hits, missed = 0, []
    for item, point in targets:
        with stage.override():
            for other in bpy.context.selected_objects:
                other.select_set(False)
            bpy.context.view_layer.objects.active = None
        yield 0.2
        stage.tool("mousemove", *pixel(point), "click", 1)
        yield from until(lambda: bpy.context.view_layer.objects.active is not None, 4.0 if item else 1.0)
        active = bpy.context.view_layer.objects.active
        hits += active == item
        if active != item:
            missed.append((item and item.name, active and active.name, pixel(point)))
    cell |= {"hits": hits, "of": len(targets), "missed": missed}


def corners(empty):
    """(8, 2) pixel coordinates of the corners of the Empty's cube, in the order of CORNERS."""
    return np.array([pixel(empty.matrix_world @ Vector(corner)) for corner in CORNERS], dtype=float)


def is_clear(point, empties):
    """Whether a point is at a distance from all edges of these Empties' cubes, in pixels."""
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
    """Visible evaluated vertices of an object, far from each other."""
    _, area, region = stage.view()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    eye = area.spaces.active.region_3d
    points = []
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
            points.append(point)
    return [points[index] for index in np.linspace(0, len(points) - 1, count + 2).astype(int)[1:-1]]


def left_behind(rest, empties, count):
    """Points of the mesh at rest at which nothing is visible now."""
    _, area, region = stage.view()
    depsgraph, eye, points = bpy.context.evaluated_depsgraph_get(), area.spaces.active.region_3d, []
    for point in rest:
        flat = location_3d_to_region_2d(region, eye, Vector(point))
        if flat is None or not is_clear(point, empties):
            continue
        origin = region_2d_to_origin_3d(region, eye, flat)
        around = [Vector((x, y)) for x in (-BESIDE, 0, BESIDE) for y in (-BESIDE, 0, BESIDE)]
        ways = [region_2d_to_vector_3d(region, eye, flat + step) for step in around]
        if not any(bpy.context.scene.ray_cast(depsgraph, origin, way)[0] for way in ways):
            points.append(point)
    return points[:: max(1, len(points) // count)][:count]
