# SPDX-License-Identifier: GPL-3.0-or-later
"""Enum properties of an object's settings that an operator's arguments can override."""

from functools import partial

from ..blender.property_definitions import annotations, choice
from ..core.settings.choices import (
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
    "How finely the surface is fitted, and how long that takes",
    **({"default": "GOOD"} if QUALITY_ITEMS else {}),
)
style = partial(choice, STYLE_ITEMS, "Style", "The solid whose faces the surface turns towards")
orientation = partial(choice, ORIENTATIONS, "Orientation", "Along which axes the style stands")
output = partial(choice, OUTPUTS, "Geometry", "What the result is made of")
surface = partial(
    choice,
    SURFACES,
    "Surface",
    "What the implicit surface is made of, which new meshes show",
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
