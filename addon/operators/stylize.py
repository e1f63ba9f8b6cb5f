# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import groups, handles, styling
from ..bridge.jobs import JobOperator
from ..bridge.lookup import settings_of
from ..bridge.moving import plan_move
from ..bridge.settings import annotations, in_force, machine_options
from ..bridge.work import known
from ..core import native
from ..core.parameters import native_options
from ..core.spaces import space_of
from ..core.styles import STYLIZE
from ..names import Op
from ..properties.item import output, resolution, surface, target
from ..properties.settings import frame, style


class ARAPFIELDS_OT_stylize(JobOperator, bpy.types.Operator):
    """Turn the surface towards the faces of a solid, as rigidly as possible; the result is a new object"""

    bl_idname = Op.STYLIZE
    bl_label = "Stylize"
    bl_options = {"UNDO"}
    title = "Stylize"

    __annotations__ = {
        **annotations(STYLIZE, options={"SKIP_SAVE"}),
        "style": style(options={"SKIP_SAVE"}),
        "frame": frame(options={"SKIP_SAVE"}),
        "output": output(options={"SKIP_SAVE"}),
        "surface": surface(options={"SKIP_SAVE"}),
        "target": target(options={"SKIP_SAVE"}),
        "resolution": resolution(options={"SKIP_SAVE"}),
    }

    def groups_of(self, source):
        return styling.group_names(source, settings_of(source).stylize)

    def plan(self, context, source, of_groups):
        context.view_layer.update()
        ours = settings_of(source).stylize
        values = in_force(STYLIZE, ours, self)
        af = native.library()
        options = af.StylizeOptions(**native_options(values), **known(af.StylizeOptions, machine_options()))
        space = space_of(source.matrix_world, source.name)
        style = styling.wanted_style(ours, space, self)
        wanted = handles.solve_handles(source, space, of_groups) if ours.use_handles else []
        weights = styling.region_weights(context, source, ours, of_groups)

        def solve(stages, rest, samples):
            blend = None if weights is None else groups.at_points(rest.vertices, weights, samples.points)
            return af.stylize(
                samples,
                style.directions(af),
                options,
                stages.start("Stylizing", 0.5),
                weights=blend,
                handles=groups.native_handles(af, wanted, rest, samples),
            )

        return plan_move(context, self, source, "STYLIZE", values["samples"], values["seed"], solve)


CLASSES = [ARAPFIELDS_OT_stylize]
