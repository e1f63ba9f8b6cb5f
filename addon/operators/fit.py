# SPDX-License-Identifier: GPL-3.0-or-later
import json

import bpy

from ..bridge import staleness
from ..bridge.jobs import JobOperator
from ..bridge.language import translated
from ..bridge.lookup import settings_of
from ..bridge.settings import annotations
from ..bridge.work import read_surface
from ..core.fitting import FIT
from ..core.jobs import Item
from ..names import Op
from ..properties.settings import quality


class ARAPFIELDS_OT_fit(JobOperator, bpy.types.Operator):
    """Fit a smooth implicit surface to the active mesh; kept until the mesh or the settings change"""

    bl_idname = Op.FIT
    bl_label = "Fit Surface"
    bl_options = {"UNDO"}
    title = "Fit"

    __annotations__ = {
        **annotations(FIT, options={"SKIP_SAVE"}),
        "quality": quality(options={"SKIP_SAVE"}),
        "again": bpy.props.BoolProperty(
            name="Again", description="Fit anew even where a fit is in the cache", options={"SKIP_SAVE"}
        ),
    }

    def plan(self, context, source, _):
        surface = read_surface(context, source, self)
        again = self.again

        def work(stages):
            return surface.fit(stages, 1.0, again)

        def apply(sdf):
            source = surface.who.get()
            staleness.fitted(source, surface)
            ours = settings_of(source)
            ours.fit_key = surface.key
            ours.fit_report = json.dumps(sdf.report)
            return translated("surface fitted")

        return Item(source.name, work, apply)


CLASSES = [ARAPFIELDS_OT_fit]
