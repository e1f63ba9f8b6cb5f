# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack
from ..blender.language import translated
from ..blender.point_data import points_of
from ..blender.section import Section, draw_settings, job_button, modifier_row, note, wrapped
from ..blender.splat_layouts import holds_splats
from ..handles import empties
from ..names import Op
from ..solver import frame_range
from . import caches
from .bake_job import effective_kind, refusal_of


class ARAPFIELDS_PT_animation(Section, bpy.types.Panel):
    bl_label = "Bake and Export"
    bl_order = 9
    tasks = frozenset({"ANIMATE"})

    def fill(self, context, source, settings):
        layout, bake = self.layout, settings.bake
        is_scan = holds_splats(source)
        keyframe_button(layout, source)
        draw_settings(layout, bake, "splat_format" if is_scan else "format", "kind", "range")
        if bake.range == "CUSTOM":
            column = layout.column(align=True)
            column.prop(bake, "start")
            column.prop(bake, "end")
        loops = ["loop"] if settings.secondary.use else []
        folders = ["folder"] if is_scan or bake.format != "KEYS" else []
        draw_settings(layout, bake, "step", "subframes", *loops, *folders)
        if not is_scan:
            wrapped(layout, weight(context, source, bake))
        job_button(layout, Op.BAKE, "REC")
        note(
            layout,
            refusal_of(source, effective_kind(source)),
            caches.unsaved(bake.folder) if folders else None,
        )
        if is_scan:
            layout.operator(Op.EXPORT_SPLATS, icon="EXPORT")
            return
        modifier = modifier_stack.find_cache(source)
        if modifier is not None:
            modifier_row(layout, modifier, "MOD_MESHDEFORM", Op.REMOVE_BAKE)
            layout.prop(modifier, "filepath", text="")
            note(layout, caches.problem(source))
        layout.menu("ARAPFIELDS_MT_export", icon="EXPORT")


def keyframe_button(layout, source):
    """Draws the button that keys the pose, and how a pose is animated, until there are two frames of it."""
    if not empties.used(source):
        return
    layout.operator(Op.KEY_HANDLE, text="Insert Keyframe", icon="KEY_HLT")
    first, last = frame_range.animation_range(source, "DEFORM") or (0, 0)
    if first == last:
        hint = translated("Insert a keyframe, go to another frame, move the handles and insert the next")
        wrapped(layout, hint, icon="INFO")


def weight(context, source, bake):
    """Text with the estimated size of the frames."""
    first, last = (bake.start, bake.end) if bake.range == "CUSTOM" else frame_range.scene_range(context.scene)
    count = max(0, (last - first) * bake.subframes // bake.step + 1)
    size = caches.size_text(caches.keys_weight(len(points_of(source.data)), count - 1))
    if bake.range == "HANDLES":
        return translated("{size} for the scene's frames", size=size)
    return translated("{count} shapes, {size}", count=count, size=size)


CLASSES = [ARAPFIELDS_PT_animation]
