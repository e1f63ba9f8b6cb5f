# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact sheet: thumbnails of wrapped objects with their distances, the worst first."""

import json
from pathlib import Path

import bpy

from ..blender import mesh_arrays, modifier_stack
from ..blender.language import translated
from ..blender.property_definitions import path_text
from ..core.errors import UserError
from ..core.geometry.spaces import facing, transform
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..deform.solve_job import describe
from ..handles.empties import matrix_of
from ..jobs.job_operator import JobOperator
from ..names import REPORT
from . import landmarks, transfer


def report_of(source):
    """The report of the object's wrap; UserError without one."""
    report = json.loads(source.get(REPORT, "{}"))
    if transfer.not_wrapped(source) or "to_target_mean" not in report:
        raise UserError("Wrap {name} first, with Modifier as its result", source)
    return report


def upright(context, item):
    """(vertices, triangles) of an evaluated object in world space, turned to y up."""
    with modifier_stack.mesh_of(context, item, list(item.modifiers)) as mesh:
        mesh = mesh_arrays.arrays_of(item, mesh)
    world = matrix_of(item)
    return transform(world, mesh.vertices)[:, [0, 2, 1]] * [1, 1, -1], facing(mesh.triangles, world)


class ARAPFIELDS_OT_wrap_sheet(JobOperator, bpy.types.Operator):
    """Write a page of small pictures of what is wrapped, each with its figures, the worst first"""

    bl_label = "Contact Sheet"
    title = "Contact Sheet"
    guide = "wrap"

    filepath: path_text(
        "File", "Where the page goes; empty for one beside the .blend", "FILE", options={"SKIP_SAVE"}
    )

    @classmethod
    def refuses(cls, source):
        return transfer.not_wrapped(source)

    def place(self):
        """The page's path; without one given it has the .blend's name, as others may lie in the folder."""
        return self.filepath or f"//{Path(bpy.data.filepath).stem} wraps.html"

    def prepare(self, context, job):
        self.cells = []
        return (yield from super().prepare(context, job))

    def plan(self, context, source, weights):
        if self.place().startswith("//") and not bpy.data.filepath:
            raise UserError("Save the .blend first: the page lies beside it")
        report = report_of(source)
        target = landmarks.target_of(source)
        meshes = upright(context, source), upright(context, target)
        name, figures = f"{source.name}, {target.name}", describe("", report, 1.0)
        off = max(report["to_target_mean"], report["from_target_mean"])

        def work(tracker):
            native.library()
            from arapfields.cli import wrapping

            tracker.start("Drawing", 1.0)
            return wrapping.sheet_cell(name, figures, *meshes)

        def apply(cell):
            self.cells.append((off, cell))
            return figures

        return Item(source.name, work, apply)

    def conclude(self, context, job):
        result = yield from super().conclude(context, job)
        if self.cells:
            from arapfields._files import write_text
            from arapfields.cli import wrapping

            path = Path(bpy.path.abspath(self.place()))
            page = wrapping.sheet_page(cell for _, cell in sorted(self.cells, key=lambda one: -one[0]))
            try:
                write_text(path, page)
            except (ValueError, OSError) as error:
                self.add_message("ERROR", translated(error))
                return {"CANCELLED"}
            self.add_message("INFO", str(path))
        return result


CLASSES = [ARAPFIELDS_OT_wrap_sheet]
