# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.evaluation import world_matrix
from ..blender.language import about
from ..blender.object_references import settings_of
from ..blender.property_definitions import annotations, effective_values, options_of
from ..blender.user_preferences import preset_classes
from ..core.errors import UserError
from ..core.runtime import native
from ..core.settings.parameters import DEFORM, is_fast
from ..handles import empties, symmetry
from ..handles.native_handles import native_handles
from ..properties.choices import result_properties
from ..solver.contact import for_job, native_contact, notes_on
from .solve_job import SolveOperator, plan_solve_job


class ARAPFIELDS_OT_deform(SolveOperator, bpy.types.Operator):
    """Solve the pose of the handles finely, as rigidly as they allow; a live shape stays, improved"""

    bl_label = "Deform"
    bl_options = {"UNDO"}
    title = "Deform"
    guide = "deform"

    __annotations__ = {
        **annotations(DEFORM, options={"SKIP_SAVE"}),
        **result_properties(),
    }

    @classmethod
    def refuses(cls, source):
        return empties.require_handles(source) or super().refuses(source)

    def groups_of(self, source):
        return empties.group_names(source)

    def plan(self, context, source, weights):
        context.view_layer.update()
        values = effective_values(DEFORM, settings_of(source).deform, self)
        af = native.library()
        options = options_of("deform", values)
        space = symmetry.space_for(source, world_matrix(source), values["symmetry"])
        handles = empties.solve_handles(source, space, weights)
        beside = symmetry.beside(source, values["symmetry"])
        if beside is not None:
            self.warnings.append(about(source.name, beside))

        fast = is_fast(values, DEFORM)
        contact = for_job(context, source, fast, space)
        if not fast:
            require_no_reach(handles)
        scaled = empties.ignored_scale(source)
        if scaled is not None:
            self.warnings.append(about(source.name, scaled))

        def solve(tracker, rest, samples, weight):
            natives = native_handles(af, handles, rest, samples)
            task, limits = tracker.start("Deforming", weight), native_contact(contact)
            field = af.deform(samples, natives, options, contact=limits, task=task)
            tracker.warnings += notes_on(contact, handles, field.report)
            return field

        further = {"solve": solve, "space": space}
        return plan_solve_job(context, self, source, "DEFORM", values["samples"], values["seed"], **further)


def require_no_reach(handles):
    for handle in handles:
        if handle.reach > 0:
            raise UserError("{name} has a reach; take the method Fast, without Exact Handles", handle)


CLASSES = [ARAPFIELDS_OT_deform, *preset_classes("deform", "Deform", DEFORM)]
