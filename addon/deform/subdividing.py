# SPDX-License-Identifier: GPL-3.0-or-later
"""Divides edges that are too long for a motion, so that the triangles beside them can bend."""

import bmesh
import bpy
import numpy as np

from ..blender import mesh_arrays
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.property_definitions import number
from ..blender.section import note
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..names import Op
from ..results import placement

MOST_VERTICES = 2_000_000
MOST_ROUNDS = 20  # halvings of the longest edge


class ARAPFIELDS_OT_subdivide(SourceOperator, bpy.types.Operator):
    """Divide long edges, whose triangles turn over; UVs, groups and keys stay. Run Deform again then"""

    bl_label = "Subdivide Long Edges"
    bl_options = {"REGISTER", "UNDO"}
    guide = "deform"

    share: number(
        "Longest Edge",
        "Edges longer than this share of the object's longest side are divided",
        default=0.02,
        min=0.001,
        max=1.0,
    )

    @classmethod
    def refuses(cls, source):
        if source.type != "MESH":
            return UserError("{name} is no mesh", source)
        if settings_of(source).live_kind:
            return UserError("{name} is live; end live mode first", source)
        return None

    def change(self, context, source):
        longest = np.ptp(mesh_arrays.positions(source.data), axis=0).max(initial=0.0)
        before = len(source.data.vertices)
        divide(source, self.share * longest)
        settings_of(source).long_triangles = 0
        count = len(source.data.vertices) - before
        return translated("{count} vertices more; run Deform again", count=f"{count:,}")


def divide(source, limit):
    """Halves the edges of a source's mesh that are longer than `limit` until none is."""
    shape = bmesh.new()
    try:
        shape.from_mesh(source.data)
        for _ in range(MOST_ROUNDS):
            long = [edge for edge in shape.edges if edge.calc_length() > limit]
            if not long:
                break
            if len(shape.verts) + len(long) > MOST_VERTICES:
                raise UserError("{name} would have too many vertices; take longer edges", source)
            wide = {face for edge in long for face in edge.link_faces if len(face.verts) > 4}
            if wide:
                bmesh.ops.triangulate(shape, faces=list(wide))
                long = [edge for edge in shape.edges if edge.calc_length() > limit]
            made = bmesh.ops.subdivide_edges(shape, edges=long, cuts=1, use_grid_fill=True)["geom"]
            wide = [one for one in made if isinstance(one, bmesh.types.BMFace) and len(one.verts) > 4]
            bmesh.ops.triangulate(shape, faces=wide)
        placement.single_user(source)
        shape.to_mesh(source.data)
    finally:
        shape.free()
    source.data.update()


def draw_note(layout, source):
    """What the last run said of triangles that are too long, beside the button that divides them."""
    count = settings_of(source).long_triangles
    if count:
        note(layout, UserError("{count} triangles are too long for this motion and turn over", count=count))
        layout.operator(Op.SUBDIVIDE, icon="MOD_SUBSURF")


CLASSES = [ARAPFIELDS_OT_subdivide]
