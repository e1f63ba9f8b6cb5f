# SPDX-License-Identifier: GPL-3.0-or-later
"""Choices that an object's settings hold and that a call of an operator may make otherwise."""

import bpy

from ..blender.property_definitions import annotations
from ..core.settings.choices import FRAMES, OUTPUTS, PLACEMENT_NUMBERS, PLACEMENTS, SURFACES
from ..core.settings.fitting import QUALITIES
from ..core.settings.parameters import EXTRACTION
from ..core.settings.styles import CUSTOM, STYLES, style_identifier

QUALITY_ITEMS = tuple((key, label, tip) for key, (label, tip, _) in QUALITIES.items())
STYLE_ITEMS = tuple(
    (style_identifier(name), label, "Turns the surface towards the faces of this solid")
    for name, label in STYLES
) + tuple((key, label, tip) for key, (label, tip) in CUSTOM.items())
RESULT_ITEMS = tuple((*placement, "NONE", PLACEMENT_NUMBERS[placement[0]]) for placement in PLACEMENTS)


def choice(items, name, description, **default):
    """What makes the definition of a property, with what else a class says of it."""
    return lambda **extra: bpy.props.EnumProperty(
        items=items, name=name, description=description, **default, **extra
    )


quality = choice(
    QUALITY_ITEMS,
    "Quality",
    "Sets the iterations and the network's size",
    **({"default": "GOOD"} if QUALITY_ITEMS else {}),
)
style = choice(STYLE_ITEMS, "Style", "The solid whose faces the surface turns towards")
frame = choice(FRAMES, "Orientation", "Along which axes the style stands")
output = choice(OUTPUTS, "Output", "What the result is made of")
surface = choice(
    SURFACES, "Surface", "What the implicit surface is made of, which solves sample and new meshes show"
)
result = choice(RESULT_ITEMS, "Result", "Where the result goes", default="MODIFIER")


def extraction(**extra):
    return annotations(EXTRACTION, **extra)


def result_properties():
    """What is made and where it goes, as a call of an operator may say it otherwise than the settings."""
    extra = {"options": {"SKIP_SAVE"}}
    return {
        "output": output(**extra),
        "surface": surface(**extra),
        "result": result(**extra),
        "target": result(options={"SKIP_SAVE", "HIDDEN"}),  # the earlier name of `result`
        **extraction(**extra),
    }
