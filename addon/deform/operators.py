# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np

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
from ..live import sessions
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
        live = None if self.is_given() or not fast else shown_field(context, source, space)
        if not fast:
            require_no_reach(handles)
        scaled = empties.ignored_scale(source)
        if scaled is not None:
            self.warnings.append(about(source.name, scaled))

        kept = UserError("{name} keeps its live pose: a finer solve would end in another", source)

        def solve(tracker, rest, samples, weight):
            natives = native_handles(af, handles, rest, samples)
            task, limits = tracker.start("Deforming", weight), native_contact(contact)
            field = af.deform(samples, natives, options, contact=limits, task=task)
            if live is not None and leaps(field, live, rest):
                tracker.warnings.append(kept)
                return live
            tracker.warnings += notes_on(contact, handles, field.report)
            return field

        further = {"solve": solve, "space": space}
        return plan_solve_job(context, self, source, "DEFORM", values["samples"], values["seed"], **further)

    def is_given(self):
        """Whether the call has settings of its own, which the live shape does not follow."""
        return any(self.properties.is_property_set(parameter.name) for parameter in DEFORM)


SETTLING = 1.0  # seconds to wait at most for a live shape to be at rest
LOOKED_AT = 2000  # places at which two poses are compared
LEAP = 0.05  # mean distance of two poses, of the object's size, from which they are not the same one


def shown_field(context, source, space):
    """The field of the live pose that is shown at rest, in this solve space; None without one."""
    session = sessions.live.get(source.session_uid)
    if session is None or session.kind != "DEFORM" or settings_of(source).secondary.use:
        return None
    sessions.update(context, wait=SETTLING, refined=True)
    session = sessions.live.get(source.session_uid)
    if session is None or not session.is_current(context) or not session.worker.is_settled:
        return None
    same = np.allclose(session.reader.surface.space.local_to_solve, space.local_to_solve)
    return session.solver.field if same else None


def leaps(field, live, surface):
    """Whether a field, solved from rest, has found another pose than the live one."""
    points = surface.vertices[:: max(1, len(surface.vertices) // LOOKED_AT)]
    away = np.linalg.norm(field(points) - live(points), axis=1).mean()
    return away > LEAP * np.ptp(points, axis=0).max()


def require_no_reach(handles):
    for handle in handles:
        if handle.reach > 0:
            raise UserError("{name} has a reach; take the method Fast, without Exact Handles", handle)


CLASSES = [ARAPFIELDS_OT_deform, *preset_classes("deform", "Deform", DEFORM)]
