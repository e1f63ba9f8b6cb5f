# SPDX-License-Identifier: GPL-3.0-or-later
"""One handle of a source: its Empty and where that was at rest."""

import bpy

from ..core.settings.choices import HANDLE_KINDS


def is_armature(_, item):
    return item.type == "ARMATURE"


class ARAPFIELDS_PG_handle(bpy.types.PropertyGroup):
    empty: bpy.props.PointerProperty(type=bpy.types.Object, name="Empty", description="Moves the handle")
    rig: bpy.props.PointerProperty(
        type=bpy.types.Object,
        name="Armature",
        description="The armature whose bone moves the handle, for handles of that kind",
        poll=is_armature,
    )
    bone: bpy.props.StringProperty(name="Bone", description="The bone that moves the handle")
    kind: bpy.props.EnumProperty(
        items=HANDLE_KINDS, name="Kind", description="What of the surface the handle holds"
    )
    group: bpy.props.StringProperty(
        name="Vertex Group",
        description="The group that the handle holds; a bone without one holds what lies about it",
    )
    hold_from: bpy.props.FloatProperty(
        name="Hold From",
        description="Weight of the vertex group from which the surface is held; less stays free to bend",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    weight: bpy.props.FloatProperty(
        name="Weight",
        description="How strictly this handle is followed, relative to the others",
        default=1.0,
        min=0.0,
        soft_max=10.0,
    )
    reach: bpy.props.FloatProperty(
        name="Reach",
        description="How far from what it holds the handle moves things, through the inside of the shape, "
        "in the object's own lengths; beyond, nothing moves at all. 0: as far as the shape goes",
        subtype="DISTANCE",
        default=0.0,
        min=0.0,
    )
    allow_scale: bpy.props.BoolProperty(
        name="Allow Scale",
        description="What the handle holds is scaled as it is; otherwise only the handle's move and turn "
        "count",
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
