# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.object_references import settings_of
from ..blender.property_definitions import annotations, effective_values
from ..blender.source_operator import SourceOperator
from ..blender.user_preferences import preset_classes
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.settings.choices import STYLIZE
from ..core.settings.parameters import is_fast
from ..deform.solve_job import SolveOperator, plan_solve_job
from ..handles import empties
from ..properties.choices import orientation, result_properties, style
from ..solver import style_settings
from ..solver.contact import for_job
from ..solver.frame_solver import stylization


class ARAPFIELDS_OT_stylize(SolveOperator, bpy.types.Operator):
    """Turn the surface towards the faces of a solid, as rigidly as possible"""

    bl_label = "Stylize"
    bl_options = {"UNDO"}
    title = "Stylize"
    guide = "stylize"

    __annotations__ = {
        **annotations(STYLIZE, options={"SKIP_SAVE"}),
        "style": style(options={"SKIP_SAVE"}),
        "frame": orientation(options={"SKIP_SAVE"}),
        **result_properties(),
    }

    @classmethod
    def refuses(cls, source):
        """Checks the settings' style only in the user interface: a script may choose another one."""
        return super().refuses(source) or (style_settings.refusal(source) if has_window() else None)

    def groups_of(self, source):
        return style_settings.group_names(source, settings_of(source).stylize)

    def plan(self, context, source, of_groups):
        context.view_layer.update()
        settings = settings_of(source).stylize
        values = effective_values(STYLIZE, settings, self)
        af = native.library()
        space = space_of(world_matrix(source), source.name)
        style = style_settings.requested_style(settings, space, self)
        handles = empties.solve_handles(source, space, of_groups) if settings.use_handles else []
        weights = style_settings.region_weights(context, source, settings, of_groups, self.in_place(source))
        contact = for_job(context, source, is_fast(values, STYLIZE), space)
        styled = stylization(values, style.directions(af), style.up, handles, weights, contact)

        distances = {}  # to obstacles, of the field for the finish

        def solve(tracker, rest, samples, weight):
            return styled.field(rest, samples, tracker.start("Stylizing", weight), distances)

        def finish(tracker, *of_mesh):
            return styled.finished(*of_mesh, tracker.start("Finishing", 1.0), distances)

        counted = values["samples"], values["seed"]
        further = {} if styled.finish is None else {"finish": finish}
        return plan_solve_job(context, self, source, "STYLIZE", *counted, solve, **further)


class ARAPFIELDS_OT_set_style(SourceOperator, bpy.types.Operator):
    """Choose this style for the object"""

    bl_label = "Choose Style"
    guide = "stylize"
    bl_options = {"INTERNAL", "UNDO"}

    style: style()

    def change(self, context, source):
        settings_of(source).stylize.style = self.style


CLASSES = [
    ARAPFIELDS_OT_stylize,
    ARAPFIELDS_OT_set_style,
    *preset_classes("stylize", "Stylize", STYLIZE, ("style", "frame")),
]
