# SPDX-License-Identifier: GPL-3.0-or-later
"""One handle of a source: its Empty or bone, and the rest box."""

import bpy

from ..blender.property_definitions import choice, colour, flag, integer, listeners, number, pointer, text
from ..core.settings.choices import HANDLE_KINDS

UNKNOWN_FRAME = -1048575  # below Blender's lowest frame


def is_armature(_, item):
    return item.type == "ARMATURE"


class ARAPFIELDS_PG_handle(bpy.types.PropertyGroup):
    empty: pointer(bpy.types.Object, "Empty", "Moves the handle")
    rig: pointer(
        bpy.types.Object,
        "Armature",
        "The armature whose bone moves the handle, for handles of that kind",
        poll=is_armature,
    )
    bone: text("Bone", "The bone that moves the handle")
    number: integer("Bone's Number", "What tells the bone from others when it is renamed; 0 for its name")
    kind: choice(HANDLE_KINDS, "Kind", "What of the surface the handle holds")
    group: text(
        "Vertex Group", "The group that the handle holds; a bone without one holds what lies about it"
    )
    hold_from: number(
        "Hold From",
        "Weight of the vertex group from which the surface is held; less stays free to bend",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    weight: number(
        "Weight",
        "How strictly this handle is followed, relative to the others",
        default=1.0,
        min=0.0,
        soft_max=10.0,
    )
    reach: number(
        "Reach",
        "How far from what it holds the handle moves things, through the inside of the shape, "
        "in the object's own lengths; beyond, nothing moves at all. 0: as far as the shape goes",
        subtype="DISTANCE",
        default=0.0,
        min=0.0,
    )
    allow_scale: flag(
        "Allow Scale",
        "What the handle holds is scaled as it is; otherwise only the handle's move and turn count",
    )
    anchor: flag("Anchor", "Stays where it is: the pin tool does not drag it")
    hold_turn: flag(
        "Hold Turn",
        "The pin holds how the surface is turned, too; otherwise its place alone, and a lifted hoof hangs",
        get=lambda entry: entry.kind != "POINT",
        set=lambda entry, holds: listeners["hold_turn"](entry, holds),
    )
    in_world: flag(
        "World",
        "Stays where it is when the object is moved, like a foot on the ground; otherwise it moves with it",
        get=lambda entry: (
            entry.kind != "BONE" and (entry.empty is None or entry.empty.parent != entry.id_data)
        ),
        set=lambda entry, is_held: listeners["in_world"](entry, is_held),
    )
    colour: colour("Color of the handle's boxes in the viewport")
    rest: bpy.props.FloatVectorProperty(
        size=16,
        name="Rest Box",
        description="The cube [-1, 1]³ → the object's coordinates, at rest (row by row)",
    )
    frame: integer(
        "Rest Frame",
        "The scene's frame when the rest pose was stored; -1048575 where it is not known",
        default=UNKNOWN_FRAME,
    )
    unwrapped: bpy.props.FloatVectorProperty(
        size=16,
        name="Rest Box before the Wrap",
        description="Where the rest box was before a wrap took it along; zeros where none did",
    )
    inside: integer(
        "Points Inside",
        "How many of 4000 points of the surface the handle held when its rest pose was stored; "
        "-1 when not counted",
        default=-1,
    )


CLASSES = [ARAPFIELDS_PG_handle]
