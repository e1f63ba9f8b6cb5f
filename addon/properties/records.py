# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of carried objects and of poses, stored in the file."""

import bpy

from ..blender.property_definitions import choice, pointer, text
from ..core.settings.choices import CARRYING

BASE_KINDS = (
    ("NONE", "None", "The field moves the object's points, or nothing yet"),
    ("TRANSFORM", "Delta Transforms", "The field moves the object as a whole"),
    ("BONES", "Bones", "The field poses the armature's bones"),
)


class ARAPFIELDS_PG_carried(bpy.types.PropertyGroup):
    # `name`, which every PropertyGroup has, keeps the object's name for messages after its deletion
    item: pointer(bpy.types.Object, "Object", "Moved by the field of the object that carries it")
    way: choice(CARRYING, "Way", "How the object is carried")
    base: text("Own Pose", "The object's own delta transforms or pose while the field moves it, as JSON")
    base_kind: choice(BASE_KINDS, "Kind of Own Pose", "What the object's own pose consists of")


class ARAPFIELDS_PG_pose(bpy.types.PropertyGroup):
    data: text("Field", "The field, with samples of the shape that it was solved on")


CLASSES = [ARAPFIELDS_PG_carried, ARAPFIELDS_PG_pose]
