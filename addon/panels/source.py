# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import lookup
from ..bridge.language import translated
from ..core import jobs, native
from .section import Section, wrapped
from .status import draw_progress


class ARAPFIELDS_PT_source(Section, bpy.types.Panel):
    bl_label = "Source"
    bl_idname = "ARAPFIELDS_PT_source"
    bl_order = 0
    needs_source = False

    @classmethod
    def poll(cls, context):
        return True

    def fill(self, context, source, ours):
        layout = self.layout
        if native.problem():
            wrapped(layout, translated(native.problem()), icon="ERROR")
            return
        if jobs.running() is not None:
            draw_progress(layout, jobs.running())
        if source is None:
            layout.label(text="Select a mesh object", icon="INFO")
            return
        layout.label(text=source.name, icon="MESH_DATA", translate=False)
        mesh = source.data
        counts = {"vertices": f"{len(mesh.vertices):,}", "faces": f"{len(mesh.polygons):,}"}
        layout.label(text=translated("{vertices} vertices, {faces} faces", **counts), icon="BLANK1")
        if lookup.refusal(source):
            wrapped(layout, translated(lookup.refusal(source)), icon="ERROR")
        for text in remarks(source):
            wrapped(layout, text, icon="INFO")


def remarks(source):
    """What the user should know about how the source is read."""
    shown = [modifier for modifier in source.modifiers if modifier.show_viewport]
    if shown:
        yield translated("Read with its modifiers applied ({count})", count=len(shown))
    if source.data.shape_keys:
        yield translated("Read with its shape keys as they are set")
    if not len(source.data.polygons) and not shown:
        yield translated("The mesh has no faces")


CLASSES = [ARAPFIELDS_PT_source]
