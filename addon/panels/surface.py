# SPDX-License-Identifier: GPL-3.0-or-later
import json

import bpy

from ..bridge import staleness
from ..bridge.settings import fit_cache
from ..core.fitting import FIT
from ..names import Op
from .section import Section, job_button, presets, settings_column


class ARAPFIELDS_PT_surface(Section, bpy.types.Panel):
    bl_label = "Implicit Surface"
    bl_idname = "ARAPFIELDS_PT_surface"
    bl_order = 1

    def draw_header_preset(self, context):
        presets(self.layout, "fit")

    def fill(self, context, source, ours):
        layout = self.layout
        layout.prop(ours.fit, "quality")
        settings_column(layout, ours.fit, FIT)
        job_button(layout, Op.FIT, "MOD_REMESH")
        if not ours.fit_key:
            layout.label(text="Not fitted yet", icon="INFO")
            return
        kept = fit_cache().path(ours.fit_key).exists()
        stale = staleness.reason(source)
        layout.label(
            text=(stale or "Fit in the cache") if kept else "Fit was cleared",
            icon="CHECKMARK" if kept and not stale else "ERROR",
        )
        for name, value in json.loads(ours.fit_report or "{}").items():
            if isinstance(value, float) and "error" in name:
                layout.label(text=f"{name.replace('_', ' ')}: {value:.3g}")


CLASSES = [ARAPFIELDS_PT_surface]
