# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the three solves, made from the tables of core/settings."""

import bpy

from ..blender.property_definitions import flag, group_annotations, pointer, text
from ..core.settings.choices import STYLIZE
from ..core.settings.parameters import DEFORM, FIT, QUALITIES
from .choices import orientation, quality, style


def apply_quality(group, context):
    for name, value in QUALITIES[group.quality][2].items():
        setattr(group, name, value)


def group(name, parameters, **further):
    annotated = {**further, **group_annotations(parameters)}
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotated})


ARAPFIELDS_PG_fit = group("ARAPFIELDS_PG_fit", FIT, quality=quality(update=apply_quality))
ARAPFIELDS_PG_deform = group("ARAPFIELDS_PG_deform", DEFORM)
ARAPFIELDS_PG_stylize = group(
    "ARAPFIELDS_PG_stylize",
    STYLIZE,
    style=style(),
    frame=orientation(),
    frame_object=pointer(bpy.types.Object, "Axes Of", "Object along whose axes the style stands"),
    region=text("Region", "Vertex group whose weights say how strongly the style acts; empty for everywhere"),
    style_object=pointer(
        bpy.types.Object,
        "Normals Of",
        "Object whose axes or shape the surface turns towards, for styles of that kind",
    ),
    region_material=pointer(
        bpy.types.Material, "Material", "Material on whose faces the style acts; empty for everywhere"
    ),
    use_handles=flag("Follow Handles", "Handles hold and move their parts while the rest is stylized"),
)

CLASSES = [ARAPFIELDS_PG_fit, ARAPFIELDS_PG_deform, ARAPFIELDS_PG_stylize]
