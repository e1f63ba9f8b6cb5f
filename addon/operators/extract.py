# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import results
from ..bridge.jobs import JobOperator
from ..bridge.language import translated
from ..bridge.lookup import settings_of
from ..bridge.settings import chosen
from ..bridge.work import read_surface
from ..core.jobs import Item
from ..names import Op
from ..properties.item import resolution


class ARAPFIELDS_OT_extract(JobOperator, bpy.types.Operator):
    """Make a mesh of the fitted surface itself, undeformed (fits first where needed)"""

    bl_idname = Op.EXTRACT
    bl_label = "Extract Surface"
    bl_options = {"UNDO"}
    title = "Extract"

    resolution: resolution(options={"SKIP_SAVE"})

    def plan(self, context, source, _):
        surface = read_surface(context, source)
        cells = chosen("resolution", settings_of(source), self)

        def work(stages):
            vertices, topology = surface.extract(stages, cells, 0.8)
            return surface.space.to_local(vertices), topology

        def apply(made):
            owner = surface.who.get()
            report = {"resolution": cells, "vertices": len(made[0]), "triangles": len(made[1])}
            item = results.show(
                bpy.context, owner, "EXTRACT", "SURFACE", results.surface_mesh(owner, *made), report
            )
            return translated("{name} with {count} triangles", name=item.name, count=f"{len(made[1]):,}")

        return Item(source.name, work, apply)


CLASSES = [ARAPFIELDS_OT_extract]
