# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import lookup
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
            wrapped(layout, native.problem(), icon="ERROR")
            return
        if jobs.running() is not None:
            draw_progress(layout, jobs.running())
        if source is None:
            layout.label(text="Select a mesh object", icon="INFO")
            return
        layout.label(text=source.name, icon="MESH_DATA")
        if lookup.refusal(source):
            wrapped(layout, lookup.refusal(source), icon="ERROR")
        for text in remarks(source):
            wrapped(layout, text, icon="INFO")


def remarks(source):
    """What the user should know about how the source is read."""
    shown = [modifier for modifier in source.modifiers if modifier.show_viewport]
    if shown:
        yield f"Read with its {len(shown)} modifier{'s' if len(shown) > 1 else ''} applied"
    if source.data.shape_keys:
        yield "Read with its shape keys as they are set"
    if not len(source.data.polygons) and not shown:
        yield "The mesh has no faces"


CLASSES = [ARAPFIELDS_PT_source]
