# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.object_references import settings_of, source_of
from ..blender.section import Advanced, Section, draw_settings, job_button, note, settings_column
from ..core.settings.parameters import SKIN
from ..names import Op
from . import rig as rigs


class ARAPFIELDS_PT_skin(Section, bpy.types.Panel):
    bl_label = "Skin"
    bl_order = 5
    tasks = frozenset({"RIG"})
    needs_source = False

    @classmethod
    def poll(cls, context):
        wanted = rigs.rig_of(context) is not None or source_of(context) is not None
        return super().poll(context) and wanted

    def fill(self, context, source, settings):
        layout, rig = self.layout, rigs.rig_of(context)
        meshes = rigs.meshes_of(context, rig, "SELECTED") if rig else []
        if rig is not None:
            group = settings_of(rig).skin
            settings_column(layout, group, SKIN, advanced=False)
            draw_settings(layout, group, "groups")
        job_button(layout, Op.SKIN, "MOD_ARMATURE")
        note(layout, rigs.refusal(rig, meshes))


class ARAPFIELDS_PT_skin_settings(Advanced, bpy.types.Panel):
    bl_label = "Skin Settings"
    bl_order = 4
    tasks = frozenset({"RIG"})
    needs_source = False

    @classmethod
    def poll(cls, context):
        return super().poll(context) and rigs.rig_of(context) is not None

    def fill(self, context, source, settings):
        settings_column(self.layout, settings_of(rigs.rig_of(context)).skin, SKIN, advanced=True)


CLASSES = [ARAPFIELDS_PT_skin, ARAPFIELDS_PT_skin_settings]
