# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks in the viewport: placed by click, drawn with their numbers, proposed by shape."""

import blf
import bpy
import gpu
import numpy as np
from bpy_extras import view3d_utils
from gpu_extras.batch import batch_for_shader

from ..blender.language import translated
from ..blender.object_references import ObjectReference, refusal_of_linked, settings_of, source_of
from ..blender.property_definitions import effective_values, integer, options_of
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..core.geometry.spaces import transform
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..core.settings.parameters import WRAP
from ..handles.empties import free_colour
from ..jobs.job_operator import JobOperator
from ..pin_tool import screen
from ..pin_tool.drawing import CIRCLE, DARK
from ..results import placement
from ..surface.source_surface import read_surface
from . import landmarks

# Pairs of landmarks by click: a place on the object, then the same place on the target.

AROUND = np.arange(0, 2 * np.pi, np.pi / 4)
# Offsets in pixels around a click that are searched for a surface: scans have holes, and limbs are thin.
OFFSETS = [np.zeros(2), *(r * np.array([np.cos(a), np.sin(a)]) for r in (3, 6, 9, 12) for a in AROUND)]
NAVIGATION = (110, 320)  # size in pixels of the navigation gizmos in the view's upper right corner


def covers(region, spot):
    """Whether a region contains that pixel of the window."""
    return 0 <= spot[0] - region.x < region.width and 0 <= spot[1] - region.y < region.height


def is_navigation(context, region, spot):
    """Whether a pixel of the window is on the view's navigation gizmos."""
    space, scale = context.area.spaces.active, context.preferences.system.ui_scale
    if not (space.show_gizmo and space.show_gizmo_navigate):
        return False
    aside = [r.x for r in context.area.regions if r.type == "UI" and r.width > 1 and r.x > region.x]
    right, top = min([region.x + region.width, *aside]), region.y + region.height
    return spot[0] > right - scale * NAVIGATION[0] and spot[1] > top - scale * NAVIGATION[1]


class Half:
    """The half of a pair that was clicked: (3,) its place in the world; None without one."""

    place = None

    def show(self, clicked):
        """`clicked`: {which end: place}, of one end or none."""
        self.place = next(iter(clicked.values()), None)

    def clear(self):
        self.show({})

    def __bool__(self):
        return self.place is not None


half = Half()


class ARAPFIELDS_OT_click_landmarks(SourceOperator, bpy.types.Operator):
    """Click a place on the object, then where it belongs on the target, again and again"""

    bl_label = "Click Landmarks"
    bl_options = {"UNDO"}
    guide = "wrap"
    missed = False  # whether the last click met neither object

    @classmethod
    def refuses(cls, source):
        return landmarks.refusal(source)

    def change(self, context, source):
        raise UserError("A 3D view is needed")

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        source = source_of(context)
        self.ends = [ObjectReference(source), ObjectReference(landmarks.target_of(source))]
        self.clicked = {}
        placement.show_landmarks(source, True)
        self.tell(context)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RET", "NUMPAD_ENTER", "RIGHTMOUSE"} and event.value == "PRESS":
            return self.end(context)
        try:
            if event.type == "BACK_SPACE" and event.value == "PRESS":
                self.take_back()
            elif event.type == "LEFTMOUSE" and event.value == "PRESS":
                if not self.click(context, event):
                    return {"PASS_THROUGH"}
            else:
                return {"PASS_THROUGH"}
        except (UserError, ValueError) as error:
            self.report({"ERROR"}, translated(error))
            return self.end(context)
        self.tell(context)
        return {"RUNNING_MODAL"}

    def click(self, context, event):
        """Handles a click, also beside both objects; False if it belongs to another region or a gizmo."""
        spot = event.mouse_x, event.mouse_y
        whole = next(r for r in context.area.regions if r.type == "WINDOW")
        if not covers(whole, spot) or any(covers(r, spot) for r in context.area.regions if r != whole):
            return False
        which, place = self.struck(context, whole, np.subtract(spot, (whole.x, whole.y)))
        if which is None and is_navigation(context, whole, spot):
            return False
        self.missed = which is None
        if self.missed:
            self.report({"WARNING"}, self.miss())
            return True
        self.clicked[which] = np.array(place)
        if len(self.clicked) == 2:
            landmarks.place(context, *(end.get() for end in self.ends), self.clicked[0], self.clicked[1])
            self.clicked = {}
        return True

    def struck(self, context, region, pixel):
        """(index of the end, location) of the surface under a pixel or near it; else (None, None)."""
        view, graph = context.area.spaces.active.region_3d, context.evaluated_depsgraph_get()
        scale = context.preferences.system.ui_scale
        for offset in OFFSETS:
            at = pixel + scale * offset
            origin = view3d_utils.region_2d_to_origin_3d(region, view, at)
            direction = view3d_utils.region_2d_to_vector_3d(region, view, at)
            hit, place, _, _, item, _ = context.scene.ray_cast(graph, origin, direction)
            for which, end in enumerate(self.ends):
                if hit and end.find() == item.original:
                    return which, place
        return None, None

    def take_back(self):
        """Removes the clicked half of a pair, else the last pair."""
        source, self.missed = self.ends[0].get(), False
        count = len(settings_of(source).wrap.landmarks)
        if self.clicked:
            self.clicked = {}
        elif count:
            landmarks.remove(source, count - 1)

    def miss(self):
        names = [end.name for end in self.ends]
        return translated("Neither {source} nor {target} lies there", source=names[0], target=names[1])

    def tell(self, context):
        names = [end.name for end in self.ends]
        half.show(self.clicked)
        if not self.clicked:
            text = translated("Click a place on {source} or on {target}", source=names[0], target=names[1])
        else:
            missing = names[1] if 0 in self.clicked else names[0]
            text = translated("Click the same place on {name}", name=missing)
        keys = translated("Backspace takes back, Enter ends")
        if self.missed:
            text = f"{self.miss()}. {text}"
        context.area.header_text_set(f"{text}. {keys}")
        context.area.tag_redraw()

    def end(self, context):
        half.clear()
        context.area.header_text_set(None)
        context.area.tag_redraw()
        return {"FINISHED"}

    def cancel(self, context):
        """Called by Blender when the window closes or a file is loaded."""
        half.clear()


# Draws each pair of landmarks in the viewport: its number on a disc of its colour, at both ends.

RADIUS, SIZE = 9, 11  # of a disc, and of its number, in pixels


def draw():
    context = bpy.context
    source = source_of(context) if context.region_data is not None else None
    if source is None or not context.space_data.overlay.show_overlays:
        return
    used, size = landmarks.used(source), (context.region.width, context.region.height)
    perspective, entries = (
        np.array(context.region_data.perspective_matrix),
        settings_of(source).wrap.landmarks,
    )
    gpu.state.blend_set("ALPHA")
    if half:
        spot = screen.project(perspective, size, half.place)[0]
        if np.isfinite(spot).all():
            disc(context, spot, free_colour(entries), str(len(entries) + 1))
    for number, entry in enumerate(entries, 1):
        for item in (entry.rest, entry.on_target) if entry in used else ():
            place = item.matrix_world.translation
            if item == entry.rest:
                place = landmarks.shown_place(source, place)
            spot = screen.project(perspective, size, place)[0]
            if item.visible_get() and np.isfinite(spot).all():
                disc(context, spot, tuple(entry.colour), str(number))
    gpu.state.blend_set("NONE")


def disc(context, spot, colour, text):
    """Draws a number on a disc around a pixel, dark or bright by the colour's luminance."""
    scale, shader = context.preferences.system.ui_scale, gpu.shader.from_builtin("UNIFORM_COLOR")
    for shade, radius in ((DARK, RADIUS + 1.5), ((*colour, 1.0), RADIUS)):
        rim = spot + radius * scale * CIRCLE
        shader.uniform_float("color", shade)
        fan = [(*rim[i], 0.0) for k in range(1, len(rim) - 1) for i in (0, k, k + 1)]
        batch_for_shader(shader, "TRIS", {"pos": fan}).draw(shader)
    dark = np.dot(colour, (0.3, 0.59, 0.11)) > 0.45
    blf.size(0, SIZE * scale)
    width, height = blf.dimensions(0, text)
    blf.position(0, spot[0] - width / 2, spot[1] - height / 2, 0)
    blf.color(0, *((0, 0, 0, 1) if dark else (1, 1, 1, 1)))
    blf.draw(0, text)


# Proposes pairs of landmarks by shape, for the user to check and move.


class ARAPFIELDS_OT_suggest_landmarks(JobOperator, bpy.types.Operator):
    """Propose pairs of landmarks: ends of the object, and where they belong on the target by shape"""

    bl_label = "Suggest Landmarks"
    bl_options = {"UNDO"}
    title = "Suggest Landmarks"
    guide = "wrap"

    count: integer("Count", "How many pairs at most", default=8, min=1, soft_max=20, options={"SKIP_SAVE"})

    @classmethod
    def refuses(cls, source):
        return refusal_of_linked(source) or landmarks.refusal(source)

    def plan(self, context, source, weights):
        values, af = effective_values(WRAP, settings_of(source).wrap, None), native.library()
        options, count = options_of("wrap", values), self.count
        surface = read_surface(context, source, exact=True)
        target = landmarks.target_of(source)
        vertices, triangles = landmarks.read_target(context, target, surface.space)
        ends = ObjectReference(source), ObjectReference(target)

        def work(tracker):
            samples = surface.samples(tracker, values["samples"], values["seed"], own_triangles=True)
            task = tracker.start("Comparing", 1.0)
            return af.suggest_landmarks(samples, af.MeshSdf(vertices, triangles), count, options, task=task)

        def apply(pairs):
            item, onto = (end.get() for end in ends)
            size = landmarks.SIZE * np.linalg.norm(np.ptp(surface.vertices, axis=0))
            known = [pair[0] for pair in landmarks.read(item, surface.space)]
            made = [pair for pair in pairs if all(np.linalg.norm(pair[0] - one) > size for one in known)]
            for pair in made:
                landmarks.add(bpy.context, item, onto, transform(surface.space.solve_to_world, pair))
            return translated("Pairs of landmarks added: {count}", count=len(made))

        return Item(source.name, work, apply)


CLASSES = [
    ARAPFIELDS_OT_click_landmarks,
    ARAPFIELDS_OT_suggest_landmarks,
]
