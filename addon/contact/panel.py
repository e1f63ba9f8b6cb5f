# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.object_references import settings_of, source_of
from ..blender.section import Section, draw_settings, note, switched
from ..solver import contact


class ARAPFIELDS_PT_contact(Section, bpy.types.Panel):
    bl_label = "Contact"
    bl_order = 8
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(settings_of(source_of(context)).contact, "use", text="")

    def fill(self, context, source, settings):
        group, layout = settings.contact, self.layout.column()
        layout.enabled = group.use
        draw_settings(layout, group, "obstacle", "obstacles", "margin")
        switched(layout, group, "use_ground", "ground")
        draw_settings(layout, group, "itself")
        note(layout, contact.refusal(source))


CLASSES = [ARAPFIELDS_PT_contact]
