# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pin tool draws in the viewport, and its hints in the status bar."""

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender import host
from ..blender.language import translated
from ..core.geometry.spaces import transform
from ..handles import empties, movers, symmetry
from ..jobs.display import show_status
from ..names import TOOL
from . import pins, screen
from .hover import RING, hover

# What a press would do, beside the cursor, and the keys, in the status bar.

INTERVAL = 0.3  # seconds between checks whether the tool is still in use


def label(target):
    """What a press on a Target does."""
    source = target.source.find()
    if source is None:
        return ""
    if target.kind == "REFUSED":
        reason = pins.refusal(source)
        return "" if reason is None else translated(reason)
    if target.kind == "OTHER":
        return translated("Alt-click to pin {name}", name=source.name)
    if target.kind == "SURFACE":
        return translated("Pin {name}", name=source.name)
    empty = target.empty.find()
    entry = None if empty is None else pins.entry_of(empty)
    if entry is None:
        return ""
    if target.kind == "RING":
        return translated("Turn {name}", name=empty.name)
    if entry.anchor:
        return translated("Choose {name}, an anchor", name=empty.name)
    return translated("Drag {name}", name=empty.name)


def keys(target, drag):
    """What keys and buttons do for a Target under the cursor, or in a drag; "" without both."""
    if drag is not None:
        return translated("Release: keep   Esc or right button: cancel   Ctrl and wheel: reach")
    if target is None:
        return ""
    return {
        "SURFACE": translated("Drag: pin and move   Shift-click: anchor   F: radius of new pins"),
        "HANDLE": translated("Drag: move   Shift-click: anchor or pin   Ctrl-click or X: delete   R: turn"),
        "RING": translated("Drag: turn   R: turn about an axis   Esc: cancel"),
        "OTHER": translated("Alt-click: pin this object instead"),
    }.get(target.kind, "")


class Status:
    """The text that the tool has put into the status bar; "" where it has Blender's own."""

    text = ""

    def show(self, text):
        if text == self.text:
            return
        self.text = text
        show_status(text)
        if text:
            host.start(watch, first=INTERVAL, persistent=True)

    def clear(self):
        self.show("")

    def __bool__(self):
        return bool(self.text)


status = Status()


def refresh():
    """Shows the keys for what is under the cursor or dragged."""
    status.show("" if is_press_taken(bpy.context) else keys(hover.target, hover.held))


def watch():
    """Timer callback: once another tool is taken, the status bar is Blender's again."""
    if not is_active(bpy.context):
        hover.clear()
        status.clear()
    return INTERVAL if status.text else None


# Drawing of the pin tool: pins, the active one's ring, and the surface under the cursor.
#
# With symmetry, also faint discs at the mirrored pins.

LIGHT = (1.0, 0.85, 0.4)
DARK = (0.05, 0.05, 0.05, 0.9)
KEPT = (0.85, 0.85, 0.85, 0.35)
PIN, ANCHOR, CORNERS = (
    7,
    9,
    24,
)  # radius of a pin's disc in pixels, of an anchor's square; corners of a circle
ANGLES = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.9
CIRCLE = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
ROUND = np.stack([np.cos(np.arange(0, 6.28, 0.08)), np.sin(np.arange(0, 6.28, 0.08))], axis=1)
ARMS = np.linspace(np.pi, 2 * np.pi, 9)
ANCHOR_STROKES = (  # of a square from -1 to 1
    np.array([(0, 0.45), (0, -0.65)]),
    np.array([(-0.35, 0.2), (0.35, 0.2)]),
    np.stack([0.6 * np.cos(ARMS), 0.55 * np.sin(ARMS) - 0.1], axis=1),
    0.17 * np.concatenate([CIRCLE, CIRCLE[:1]]) + (0, 0.6),
)
ENOUGH = 8  # least number of highlighted triangles; with fewer, a disc is drawn
SIZE, OFFSET, MARGIN = 12, 16, 5  # of the label, its distance from the cursor, and around its text, in pixels
BEHIND = (0.1, 0.1, 0.1, 0.75)  # the colour behind the label, which may lie on a bright surface
GHOST = 0.35  # opacity of mirrored discs
LIFT = 1.5  # offset of the highlight towards the viewer, in pixels


def is_active(context):
    """Whether the pin tool is the one in use in this window's Object Mode."""
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool is not None and tool.idname == TOOL and context.mode == "OBJECT"


OTHERS = "TRANSFORM_OT_", "ARAPFIELDS_OT_click_landmarks"  # operators that take presses while they run


def is_press_taken(context):
    """Whether a press belongs to another operator: to Blender's Move, Rotate or Scale, or to landmarks."""
    running = getattr(context.window, "modal_operators", ())
    return any(operator.bl_idname.startswith(OTHERS) for operator in running)


class Brush:
    """Draws flat shapes that face the viewer."""

    def __init__(self, context):
        region, view = context.region, context.region_data
        self.size = region.width, region.height
        self.perspective = np.array(view.perspective_matrix)
        turn = np.array(view.view_rotation.to_matrix())
        self.right, self.up, self.towards = turn.T
        self.scale = context.preferences.system.ui_scale
        self.fill = gpu.shader.from_builtin("UNIFORM_COLOR")
        self.line = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")

    def pixel(self, location):
        return screen.pixel_size(self.perspective, self.size, location)

    def outline(self, location, shape, pixels):
        """(n, 3) world corners of a shape, (n, 2), with a radius of `pixels`."""
        length = pixels * self.scale * self.pixel(location)
        return location + length * (shape[:, :1] * self.right + shape[:, 1:] * self.up)

    def area(self, colour, corners):
        fan = [corners[i] for k in range(1, len(corners) - 1) for i in (0, k, k + 1)]
        self.triangles(colour, np.array(fan))

    def triangles(self, colour, points):
        self.fill.uniform_float("color", colour)
        batch_for_shader(self.fill, "TRIS", {"pos": points.astype(np.float32).tolist()}).draw(self.fill)

    def loop(self, colour, corners, width):
        self.strip(colour, np.concatenate([corners, corners[:1]]), width)

    def strip(self, colour, points, width):
        self.line.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        self.line.uniform_float("lineWidth", width * self.scale)
        self.line.uniform_float("color", colour)
        batch_for_shader(self.line, "LINE_STRIP", {"pos": points.tolist()}).draw(self.line)


def draw():
    context = bpy.context
    if context.region_data is None or not is_active(context):
        return
    brush = Brush(context)
    gpu.state.blend_set("ALPHA")
    target = hover.target if hover.held is None and not is_press_taken(context) else None
    if target is not None and target.kind == "SURFACE":
        draw_surface(brush, target)
    gpu.state.depth_test_set("NONE")
    handles = pins.handles_in_view(context)
    for colour, shape, location in ghosts(handles):
        brush.area((*colour, GHOST), brush.outline(location, shape, PIN))
    for source in {source for source, _ in handles}:
        draw_kept(brush, source)
    for _, entry in handles:
        draw_handle(brush, entry, target, entry.empty == pins.chosen(context))
    gpu.state.blend_set("NONE")


def draw_label():
    """What a press does, or that it has missed, beside the cursor."""
    context, spot = bpy.context, hover.missed or hover.pixel
    if context.region_data is None or spot is None or hover.held is not None or not is_active(context):
        return
    if is_press_taken(context):
        return
    text = translated("Nothing to pin here") if hover.missed else hover.label
    if not text or hover.region != context.region.as_pointer():
        return
    scale = context.preferences.system.ui_scale
    blf.size(0, SIZE * scale)
    (width, height), left, low = blf.dimensions(0, text), *(np.array(spot) + OFFSET * scale)
    margin, shader = MARGIN * scale, gpu.shader.from_builtin("UNIFORM_COLOR")
    x, y = (left - margin, left + width + margin), (low - margin, low + height + margin)
    corners = [(x[i], y[j], 0.0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))]
    gpu.state.blend_set("ALPHA")
    shader.uniform_float("color", BEHIND)
    batch_for_shader(shader, "TRIS", {"pos": corners}).draw(shader)
    gpu.state.blend_set("NONE")
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, left, low, 0)
    blf.draw(0, text)


def ghosts(handles):
    """((r, g, b), shape, (3,) location) of the mirror images of these [(source, entry)] by Symmetry."""
    mirrored = []
    for source, entry in handles:
        mirror, now = symmetry.mirror_of(source), movers.box_now(entry)
        if mirror is not None and not symmetry.is_on_plane(mirror, now):
            shape = SQUARE if entry.anchor else CIRCLE
            mirrored.append((tuple(entry.colour), shape, (mirror @ now)[:3, 3]))
    return mirrored


def draw_surface(brush, target):
    """The part of the surface that a pin would hold, and its rim."""
    gpu.state.depth_test_set("LESS_EQUAL")
    lift = LIFT * brush.pixel(target.location)
    across = np.linalg.svd(target.normal[None])[2][1:]
    rim = target.location + target.radius * (CIRCLE @ across)
    if len(target.lit) >= ENOUGH:
        brush.triangles((*LIGHT, 0.35), target.lit.reshape(-1, 3) + lift * brush.towards)
    else:
        brush.area((*LIGHT, 0.35), rim + lift * brush.towards)
    gpu.state.depth_test_set("NONE")
    brush.loop((*LIGHT, 0.9), rim, 2.0)


def draw_kept(brush, source):
    """Draws a circle around the rest location of each pin that is no anchor: points beyond all stay."""
    places, beyond = empties.kept_rest(source)
    world = movers.matrix_of(source)
    radius = beyond * np.cbrt(abs(np.linalg.det(world[:3, :3])))
    for place in transform(world, np.array(places).reshape(-1, 3)) if radius else ():
        brush.loop(KEPT, place + radius * (ROUND @ np.stack([brush.right, brush.up])), 1.5)


def draw_handle(brush, entry, target, is_chosen):
    """Draws a disc, with a hole if it holds its location only; a square with an anchor symbol for an anchor.

    It is larger under the cursor; the active one has a ring to rotate it.
    """
    location = np.array(entry.empty.matrix_world.translation)
    meant = target is not None and target.empty is not None and target.empty.uid == entry.empty.session_uid
    shape = SQUARE if entry.anchor else CIRCLE
    size = (ANCHOR if entry.anchor else PIN) * (1.35 if meant and target.kind == "HANDLE" else 1.0)
    brush.area(DARK, brush.outline(location, shape, size + 2))
    brush.area((*entry.colour, 1.0), brush.outline(location, shape, size))
    if entry.anchor:
        for stroke in ANCHOR_STROKES:
            brush.strip(DARK, brush.outline(location, stroke, size), 1.5)
    elif not entry.hold_turn:
        brush.area(DARK, brush.outline(location, CIRCLE, size * 0.4))
    if is_chosen:
        brush.loop((1.0, 1.0, 1.0, 0.95), brush.outline(location, shape, size + 2), 2.0)
        if not entry.anchor:
            bright = 0.95 if meant and target.kind == "RING" else 0.45
            brush.loop((*entry.colour, bright), brush.outline(location, CIRCLE, RING), 2.5)
