# SPDX-License-Identifier: GPL-3.0-or-later
"""Enum properties that an operator's arguments can override; records of carried objects and of poses."""

from functools import partial

import bpy

from ..blender.property_definitions import annotations, choice, pointer, text
from ..core.settings.choices import (
    CARRYING,
    CUSTOM,
    ORIENTATIONS,
    OUTPUTS,
    PLACEMENT_NUMBERS,
    PLACEMENTS,
    STYLES,
    SURFACES,
    style_identifier,
)
from ..core.settings.parameters import EXTRACTION, QUALITIES

# Enum properties of an object's settings that an operator's arguments can override.

QUALITY_ITEMS = tuple((key, label, tip) for key, (label, tip, _) in QUALITIES.items())
STYLE_ITEMS = tuple(
    (style_identifier(name), label, "Turns the surface towards the faces of this solid")
    for name, label in STYLES
) + tuple((key, label, tip) for key, (label, tip) in CUSTOM.items())
RESULT_ITEMS = tuple((*placement, "NONE", PLACEMENT_NUMBERS[placement[0]]) for placement in PLACEMENTS)


quality = partial(
    choice,
    QUALITY_ITEMS,
    "Quality",
    "Sets the iterations and the network's size",
    **({"default": "GOOD"} if QUALITY_ITEMS else {}),
)
style = partial(choice, STYLE_ITEMS, "Style", "The solid whose faces the surface turns towards")
orientation = partial(choice, ORIENTATIONS, "Orientation", "Along which axes the style stands")
output = partial(choice, OUTPUTS, "Geometry", "What the result is made of")
surface = partial(
    choice,
    SURFACES,
    "Surface",
    "What the implicit surface is made of, which solves sample and new meshes show",
)
result = partial(choice, RESULT_ITEMS, "Store As", "Where the result goes", default="MODIFIER")


def extraction(**extra):
    return annotations(EXTRACTION, **extra)


def result_properties():
    """The output and its place, as arguments of an operator that override the settings."""
    extra = {"options": {"SKIP_SAVE"}}
    return {
        "output": output(**extra),
        "surface": surface(**extra),
        "result": result(**extra),
        "target": result(options={"SKIP_SAVE", "HIDDEN"}),  # the former name of `result`
        **extraction(**extra),
    }


# Records of carried objects and of poses, stored in the file.

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


CLASSES = [
    ARAPFIELDS_PG_carried,
    ARAPFIELDS_PG_pose,
]
