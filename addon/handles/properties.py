# SPDX-License-Identifier: GPL-3.0-or-later
"""One handle of a source: its Empty and where that was at rest."""

import bpy

from ..core.settings.choices import HANDLE_KINDS


class ARAPFIELDS_PG_handle(bpy.types.PropertyGroup):
    empty: bpy.props.PointerProperty(type=bpy.types.Object, name="Empty", description="Moves the handle")
    kind: bpy.props.EnumProperty(
        items=HANDLE_KINDS, name="Kind", description="What of the surface the handle holds"
    )
    group: bpy.props.StringProperty(
        name="Vertex Group", description="The group that the handle holds, for handles of that kind"
    )
    weight: bpy.props.FloatProperty(
        name="Weight",
        description="How strictly this handle is followed, relative to the others",
        default=1.0,
        min=0.0,
        soft_max=10.0,
    )
    anchor: bpy.props.BoolProperty(
        name="Anchor",
        description="The pin tool does not drag it; while there is one, nothing else is held by itself",
    )
    colour: bpy.props.FloatVectorProperty(
        name="Colour",
        description="Colour of the handle's boxes in the viewport",
        subtype="COLOR_GAMMA",
        default=(0.27, 0.55, 1.0),
        min=0.0,
        max=1.0,
    )
    rest: bpy.props.FloatVectorProperty(
        size=16,
        name="Rest Box",
        description="The cube [-1, 1]³ → the object's coordinates, at rest (row by row)",
    )
    inside: bpy.props.IntProperty(
        name="Points Inside",
        description="How many of 4000 points of the surface the handle held when its rest pose was stored; "
        "-1 when not counted",
        default=-1,
    )


CLASSES = [ARAPFIELDS_PG_handle]
