# SPDX-License-Identifier: GPL-3.0-or-later
import json

import bpy

from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.presets import preset_classes
from ..blender.property_definitions import annotations, flag
from ..blender.source_operator import ReportingOperator
from ..blender.user_preferences import fit_cache
from ..core.runtime.jobs import Item
from ..core.settings.parameters import FIT
from ..jobs.job_operator import JobOperator, busy
from ..properties.choices import quality
from . import staleness
from .source_surface import read_surface


class ARAPFIELDS_OT_fit(JobOperator, bpy.types.Operator):
    """Fit a smooth implicit surface to the active mesh; kept until the mesh or the settings change"""

    bl_label = "Fit Surface"
    bl_options = {"UNDO"}
    title = "Fit"
    guide = "surface"

    __annotations__ = {
        **annotations(FIT, options={"SKIP_SAVE"}),
        "quality": quality(options={"SKIP_SAVE"}),
        "again": flag("Again", "Fit anew even where a fit is in the cache", options={"SKIP_SAVE"}),
    }

    def plan(self, context, source, _):
        surface = read_surface(context, source, settings_of(source).in_place, fit_operator=self)
        again = self.again

        def work(tracker):
            return surface.fit.surface(tracker, 1.0, again)

        def apply(sdf):
            source = surface.reference.get()
            if surface.fit.is_cached:
                staleness.mark_fitted(source, surface)
                settings = settings_of(source)
                settings.fit_key = surface.fit.key
                settings.fit_report = json.dumps(sdf.report.to_dict())
            return translated("surface fitted")

        return Item(source.name, work, apply)


class ARAPFIELDS_OT_clear_cache(ReportingOperator, bpy.types.Operator):
    """Delete every fitted surface from disk; they are fitted again when needed"""

    bl_label = "Clear Fits"
    guide = "jobs"

    @classmethod
    def obstacle(cls, context):
        return busy()

    def change(self, context, source):
        return translated("Fitted surfaces deleted: {count}", count=fit_cache().clear())


CLASSES = [
    ARAPFIELDS_OT_fit,
    ARAPFIELDS_OT_clear_cache,
    *preset_classes("fit", "Fit", FIT, given=False),
]
