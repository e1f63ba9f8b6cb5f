# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the three solves, made from the core's tables."""

import bpy

from ..blender.property_definitions import annotations
from ..core.settings.fitting import FIT, QUALITIES
from ..core.settings.parameters import DEFORM
from ..core.settings.styles import CUSTOM, STYLES, STYLIZE, style_identifier

QUALITY_ITEMS = tuple((key, label, tip) for key, (label, tip, _) in QUALITIES.items())
STYLE_ITEMS = tuple(
    (style_identifier(name), label, "Turns the surface towards the faces of this solid")
    for name, label in STYLES
) + tuple((key, label, tip) for key, (label, tip) in CUSTOM.items())
FRAMES = (
    ("UPRIGHT", "World Upright", "The style stands upright in the world and heads where the object does"),
    ("OBJECT", "Object", "The style stands along the object's own axes"),
    ("WORLD", "World", "The style stands along the world's axes"),
    ("EMPTY", "Empty", "The style stands along the axes of a chosen object"),
)


def quality(**extra):
    return bpy.props.EnumProperty(
        items=QUALITY_ITEMS,
        name="Quality",
        description="Sets the iterations and the network's size",
        **({"default": "GOOD"} if QUALITY_ITEMS else {}),
        **extra,
    )


def style(**extra):
    return bpy.props.EnumProperty(
        items=STYLE_ITEMS,
        name="Style",
        description="The solid whose faces the surface turns towards",
        **extra,
    )


def frame(**extra):
    return bpy.props.EnumProperty(
        items=FRAMES, name="Orientation", description="Along which axes the style stands", **extra
    )


def apply_quality(group, context):
    for name, value in QUALITIES[group.quality][2].items():
        setattr(group, name, value)


def group(name, parameters, **further):
    annotated = {**further, **annotations(parameters)}
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotated})


ARAPFIELDS_PG_fit = group("ARAPFIELDS_PG_fit", FIT, quality=quality(update=apply_quality))
ARAPFIELDS_PG_deform = group("ARAPFIELDS_PG_deform", DEFORM)
ARAPFIELDS_PG_stylize = group(
    "ARAPFIELDS_PG_stylize",
    STYLIZE,
    style=style(),
    frame=frame(),
    frame_object=bpy.props.PointerProperty(
        type=bpy.types.Object, name="Axes Of", description="Object along whose axes the style stands"
    ),
    region=bpy.props.StringProperty(
        name="Region",
        description="Vertex group whose weights say how strongly the style acts; empty for everywhere",
    ),
    style_object=bpy.props.PointerProperty(
        type=bpy.types.Object,
        name="Normals Of",
        description="Object whose axes or shape the surface turns towards, for styles of that kind",
    ),
    region_material=bpy.props.PointerProperty(
        type=bpy.types.Material,
        name="Material",
        description="Material on whose faces the style acts; empty for everywhere",
    ),
    use_handles=bpy.props.BoolProperty(
        name="Follow Handles", description="Handles hold and move their parts while the rest is stylized"
    ),
)

CLASSES = [ARAPFIELDS_PG_fit, ARAPFIELDS_PG_deform, ARAPFIELDS_PG_stylize]
