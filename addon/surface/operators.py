# SPDX-License-Identifier: GPL-3.0-or-later
"""The source and its implicit surface: operators and panels."""

import json

import bpy

from ..blender import mesh_arrays, object_references
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.property_definitions import annotations, flag
from ..blender.section import (
    Advanced,
    Section,
    draw_settings,
    job_button,
    presets,
    settings_column,
    tasks_of,
    wrapped,
)
from ..blender.source_operator import ReportingOperator
from ..blender.user_preferences import fit_cache, preset_classes
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..core.settings.parameters import FIT
from ..jobs.job_operator import JobOperator, busy
from ..names import Op
from ..properties.choices import quality
from . import source_surface
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
                source_surface.mark_fitted(source, surface)
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


class ARAPFIELDS_PT_source(Section, bpy.types.Panel):
    bl_label = "Source"
    bl_order = 0
    needs_source = False

    @classmethod
    def poll(cls, context):
        return bool(cls.reason(context))

    @staticmethod
    def reason(context):
        """Why nothing can be done with what is active; "" if something can."""
        if native.problem():
            return translated(native.problem())
        source = object_references.source_of(context)
        if source is None:
            return "" if tasks_of(context) else translated("Select a mesh object")
        error = object_references.refusal(source) or mesh_arrays.refusal(source)
        return "" if error is None else translated(error)

    def fill(self, context, source, settings):
        icon = "INFO" if source is None and not native.problem() else "ERROR"
        wrapped(self.layout, ARAPFIELDS_PT_source.reason(context), icon=icon)


class ARAPFIELDS_PT_advanced(Section, bpy.types.Panel):
    bl_label = "Advanced"
    bl_order = 11
    bl_options = {"DEFAULT_CLOSED"}
    needs_source = False

    @classmethod
    def poll(cls, context):
        active, source = (
            find(context) for find in (object_references.active_of, object_references.source_of)
        )
        is_rig = active is not None and active.type == "ARMATURE"  # with several meshes, to be skinned
        return super().poll(context) and (source is not None or is_rig)

    def fill(self, context, source, settings):
        pass


class ARAPFIELDS_PT_surface(Advanced, bpy.types.Panel):
    bl_label = "Implicit Surface"
    bl_order = 0

    def draw_header_preset(self, context):
        presets(self.layout, "fit")

    def fill(self, context, source, settings):
        layout = self.layout
        layout.prop(settings, "surface", expand=True)
        if settings.surface == "EXACT":
            return
        draw_settings(layout, settings.fit, "quality")
        job_button(layout, Op.FIT, "MOD_REMESH")
        settings_column(layout, settings.fit, FIT, advanced=True)
        if not settings.fit_key:
            layout.label(text="Not fitted yet", icon="INFO")
            return
        kept = fit_cache().path(settings.fit_key).exists()
        stale = source_surface.outdated(source)
        layout.label(
            text=(stale or "Fit in the cache") if kept else "Fit was cleared",
            icon="CHECKMARK" if kept and not stale else "ERROR",
        )
        for text in errors(json.loads(settings.fit_report or "{}")):
            layout.label(text=text, icon="BLANK1", translate=False)


def errors(report):
    """Yields texts with the errors of a fit's report."""
    if "near_mean" in report:
        yield translated("Mean error at the surface: {value}", value=f"{report['near_mean']:.2g}")
    if "near_max" in report:
        yield translated("Largest error at the surface: {value}", value=f"{report['near_max']:.2g}")


CLASSES = [
    ARAPFIELDS_OT_fit,
    ARAPFIELDS_OT_clear_cache,
    *preset_classes("fit", "Fit", FIT, given=False),
    ARAPFIELDS_PT_source,
    ARAPFIELDS_PT_advanced,
    ARAPFIELDS_PT_surface,
]
