# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.section import Advanced, Section, draw_settings, note, presets, settings_column
from ..core.geometry.handles import nothing_held
from ..core.settings.parameters import DEFORM
from ..handles import empties, symmetry
from ..live.panel import playback_progress, pose_button, result_row
from ..results.placement import placement_refusal, replaced_by
from . import subdividing


class ARAPFIELDS_PT_deform(Section, bpy.types.Panel):
    bl_label = "Deform"
    bl_order = 2
    tasks = frozenset({"POSE"})

    def draw_header_preset(self, context):
        presets(self.layout, "deform")

    def fill(self, context, source, settings):
        layout = self.layout
        pose_button(layout, source, empties.require_handles(source))
        result_row(layout, source, "DEFORM")
        settings_column(layout, settings.deform, DEFORM, advanced=False)
        playback_progress(layout, source, "DEFORM")
        note(layout, symmetry.beside(source))
        note(
            layout, empties.require_handles(source), placement_refusal(source), replaced_by(source, "DEFORM")
        )
        if empties.holding_nothing(source):
            note(layout, nothing_held(empties.holding_nothing(source)))
        subdividing.draw_note(layout, source)


class ARAPFIELDS_PT_deform_settings(Advanced, bpy.types.Panel):
    bl_label = "Deform Settings"
    bl_order = 1
    tasks = frozenset({"POSE"})

    def fill(self, context, source, settings):
        entry = empties.chosen_entry(source)
        if entry is not None:
            draw_settings(self.layout, entry, "weight")
        settings_column(self.layout, settings.deform, DEFORM, advanced=True)


CLASSES = [ARAPFIELDS_PT_deform, ARAPFIELDS_PT_deform_settings]
