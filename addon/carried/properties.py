# SPDX-License-Identifier: GPL-3.0-or-later
"""One carried object of a source."""

import bpy

from ..core.settings.choices import CARRYING

BASE_KINDS = (
    ("NONE", "None", "The field moves the object's points, or nothing yet"),
    ("TRANSFORM", "Delta Transforms", "The field moves the object as a whole"),
    ("BONES", "Bones", "The field poses the armature's bones"),
)


class ARAPFIELDS_PG_carried(bpy.types.PropertyGroup):
    # `name`, which every entry has, is the object's when it was added: it tells what was deleted
    item: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Object", description="Moved by the field of the object that carries it"
    )
    way: bpy.props.EnumProperty(items=CARRYING, name="Way", description="How the object is carried")
    base: bpy.props.StringProperty(
        name="Own Pose",
        description="The object's own delta transforms or pose while the field moves it, as JSON",
    )
    base_kind: bpy.props.EnumProperty(
        items=BASE_KINDS, name="Kind of Own Pose", description="What the object's own pose consists of"
    )


CLASSES = [ARAPFIELDS_PG_carried]
