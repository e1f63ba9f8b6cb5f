# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .blender import user_preferences
from .blender.language import translated
from .blender.property_definitions import annotations, flag, path_text
from .blender.section import draw_settings
from .blender.source_operator import ReportingOperator
from .core.runtime import native
from .core.settings.parameters import MACHINE
from .names import PACKAGE, Op


class ARAPFIELDS_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = PACKAGE

    __annotations__ = annotations(MACHINE) | {
        "cache_folder": path_text(
            "Fit Folder",
            "Where fitted surfaces are kept; empty for Blender's own folder for this extension",
            "DIR",
        ),
        "show_boxes": flag(
            "Show Boxes", "Draw the handles' boxes, at rest and now, in the viewport", default=True
        ),
        "show_previews": flag(
            "Show Previews",
            "Draw what a running job has so far in the viewport; off where drawing is slow",
            default=True,
        ),
        "was_welcomed": flag("Welcomed", "Whether it was said where the extension is", options={"HIDDEN"}),
    }

    def draw(self, context):
        show(self.layout, self)


def show(layout, group):
    """`group`: what has the settings."""
    layout.use_property_split = True
    machine = (parameter.name for parameter in MACHINE)
    draw_settings(layout, group, *machine, "cache_folder", "show_boxes", "show_previews")
    cache = user_preferences.fit_cache()
    layout.label(
        text=translated(
            "{size} MB of fitted surfaces in {folder}",
            size=f"{cache.size() / 1e6:.1f}",
            folder=cache.folder,
        )
    )
    layout.operator(Op.CLEAR_CACHE, icon="TRASH")
    box = layout.box()
    for line in native.report():
        box.label(text=line, icon="ERROR" if line == str(native.problem()) else "NONE")
    box.operator(Op.COPY_REPORT, icon="COPYDOWN")


class ARAPFIELDS_OT_copy_report(ReportingOperator, bpy.types.Operator):
    """Copy what is known about this installation and machine, for a bug report"""

    bl_label = "Copy Report"
    guide = "jobs"

    def change(self, context, source):
        lines = [f"Blender {bpy.app.version_string}", *native.report()]
        context.window_manager.clipboard = "\n".join(lines)


CLASSES = [ARAPFIELDS_AP_preferences, ARAPFIELDS_OT_copy_report]
