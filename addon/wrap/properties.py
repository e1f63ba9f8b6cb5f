# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.wrap: a source's target, pairs of landmarks, settings."""

import bpy

from ..blender.object_references import select_alone
from ..blender.property_definitions import (
    annotations,
    choice,
    collection,
    colour,
    flag,
    integer,
    number,
    pointer,
    text,
)
from ..core.settings.choices import TRANSFERRED
from ..core.settings.parameters import WRAP


def is_target(group, item):
    return item.type == "MESH" and item != group.id_data


def row_chosen(wrap, context):
    """Update callback: selects both Empties of the pair."""
    if wrap.active_landmark < len(wrap.landmarks):
        pair = wrap.landmarks[wrap.active_landmark]
        for item in (pair.on_target, pair.rest):
            if item is not None:
                select_alone(context, item, extend=item == pair.rest)


def forget_target(wrap, context):
    """Update callback: drops the mark of the last target."""
    wrap.target_mark = ""


def fit_rig(**extra):
    return flag(
        "Fit Armature",
        "Wrap the shape at rest and move the bones of its armature along, so that it poses the wrapped shape",
        default=True,
        **extra,
    )


def move_object(**extra):
    return flag(
        "Move Object",
        "The object itself goes to the target, and the modifier has its change of shape alone; not where "
        "an armature, handles, keys, constraints or what it carries hold its place",
        default=True,
        **extra,
    )


def carried_kinds(options=()):
    return choice(
        [(*kind, "NONE", 1 << index) for index, kind in enumerate(TRANSFERRED)],
        "Transfer",
        "What the target receives",
        default={kind for kind, _, _ in TRANSFERRED} - {"UV_MAPS"},
        options={"ENUM_FLAG", *options},
    )


def onto():
    """An operator's argument."""
    tip = "Name of the mesh object to wrap onto; empty for the one in the settings"
    return text("Onto", tip, options={"SKIP_SAVE"})


def groups(**extra):
    tip = "Names of the vertex groups to transfer, with commas between; empty for all"
    return text("Groups", tip, **extra)


def mix(**extra):
    tip = "How much of the object's weights the target takes; the rest of each stays its own"
    return number("Mix", tip, default=1.0, min=0.0, max=1.0, subtype="FACTOR", **extra)


class ARAPFIELDS_PG_landmark(bpy.types.PropertyGroup):
    rest: pointer(bpy.types.Object, "Landmark", "Empty on the object at rest")
    on_target: pointer(bpy.types.Object, "On the Target", "Empty where it belongs on the target")
    colour: colour("Color of the landmark in the viewport")
    left_out: flag("Left Out", "The last wrap left this pair out, as it contradicts the others")


class ARAPFIELDS_PG_wrap(bpy.types.PropertyGroup):
    __annotations__ = {
        "onto": pointer(
            bpy.types.Object,
            "Onto",
            "Mesh object that this one is wrapped onto; it may be open and broken, as scans are",
            poll=is_target,
            update=forget_target,
        ),
        "frames": pointer(
            bpy.types.Collection,
            "Frames",
            "Collection of scans for Wrap Sequence, one a frame, in the order of their names; empty where "
            "the target moves",
        ),
        "landmarks": collection(ARAPFIELDS_PG_landmark, "Landmarks", "Pairs of places that belong together"),
        "active_landmark": integer(
            "Active Landmark", "Row chosen in the list of landmarks", update=row_chosen
        ),
        "fit_rig": fit_rig(),
        "move_object": move_object(),
        "transfer": carried_kinds(),
        "groups": groups(),
        "mix": mix(),
        "beside_target": bpy.props.FloatVectorProperty(
            size=16,
            name="Place beside the Target",
            description="From the object's coordinates to the target's at the wrap; zeros: not known",
        ),
        "target_mark": text("Target's Mark", "What tells whether the target is as it was wrapped onto"),
        "shown_keys": text("Shown Keys", "Values of the shape keys that the wrap was made with, as JSON"),
        **annotations(WRAP),
    }


CLASSES = [ARAPFIELDS_PG_landmark, ARAPFIELDS_PG_wrap]
