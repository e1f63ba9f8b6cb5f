# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import vertex_groups
from ..blender.object_references import settings_of
from ..blender.presets import preset_classes
from ..blender.settings import annotations, in_force, machine_options
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.settings.parameters import DEFORM, native_options
from ..handles import empties
from ..jobs.job_operator import JobOperator
from ..names import Op
from ..properties.item import output, resolution, surface, target
from ..surface.source_surface import known
from .solve_job import plan_move


class ARAPFIELDS_OT_deform(JobOperator, bpy.types.Operator):
    """Deform the object as rigidly as its handles allow; the result is a new object"""

    bl_idname = Op.DEFORM
    bl_label = "Deform"
    bl_options = {"UNDO"}
    title = "Deform"
    needs_handles = True

    __annotations__ = {
        **annotations(DEFORM, options={"SKIP_SAVE"}),
        "output": output(options={"SKIP_SAVE"}),
        "surface": surface(options={"SKIP_SAVE"}),
        "target": target(options={"SKIP_SAVE"}),
        "resolution": resolution(options={"SKIP_SAVE"}),
    }

    def groups_of(self, source):
        return empties.group_names(source)

    def plan(self, context, source, weights):
        context.view_layer.update()
        values = in_force(DEFORM, settings_of(source).deform, self)
        af = native.library()
        options = af.DeformOptions(**native_options(values), **known(af.DeformOptions, machine_options()))
        wanted = empties.solve_handles(source, space_of(source.matrix_world, source.name), weights)

        def solve(stages, rest, samples):
            ready = vertex_groups.native_handles(af, wanted, rest, samples)
            return af.deform(samples, ready, options, stages.start("Deforming", 0.5))

        return plan_move(context, self, source, "DEFORM", values["samples"], values["seed"], solve)


CLASSES = [ARAPFIELDS_OT_deform, *preset_classes("deform", "Deform", DEFORM)]
