# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.bake: an object's bake settings, and the record of its bake."""

import bpy

from ..blender.property_definitions import choice, flag, integer, path_text, text
from ..core.settings.choices import BAKE_FORMATS, BAKE_KINDS, BAKE_RANGES, SPLAT_FORMATS

FOLDER = "//cache"


def settings(**extra):
    """Properties of the object that are also operator arguments, which override them for one call."""
    return {
        "format": choice(BAKE_FORMATS, "Format", "What plays the frames", **extra),
        "splat_format": choice(SPLAT_FORMATS, "Splats", "What files the frames of splats go to", **extra),
        "kind": choice(BAKE_KINDS, "Bake", "What is baked", **extra),
        "range": choice(BAKE_RANGES, "Range", "Which frames are baked", **extra),
        "start": integer("Start", "First frame", default=1, **extra),
        "end": integer("End", "Last frame", default=250, **extra),
        "step": integer("Step", "Frames from one sample to the next", default=1, min=1, max=100, **extra),
        "subframes": integer(
            "Subframes",
            "More than one for motion blur of what moves fast: samples between the frames",
            default=1,
            min=1,
            max=100,
            **extra,
        ),
        "loop": flag(
            "Loop",
            "Secondary motion is baked so that the last frame leads to the first, as its handles do",
            **extra,
        ),
    }


def folder(**extra):
    tip = "Where the caches lie; // is the .blend's own folder"
    return path_text("Folder", tip, "DIR", default=FOLDER, **extra)


class ARAPFIELDS_PG_bake(bpy.types.PropertyGroup):
    __annotations__ = {
        **settings(),
        "folder": folder(),
        "uid": integer("Modifier", "Which modifier plays the bake; 0 for none"),
        "record": text("Record", "What the bake is of, as JSON"),
    }


CLASSES = [ARAPFIELDS_PG_bake]
