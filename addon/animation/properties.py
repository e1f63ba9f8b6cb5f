# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.bake: what is baked of an object, and what its bake is."""

import bpy

from ..core.settings.choices import BAKE_FORMATS, BAKE_KINDS, BAKE_RANGES

FOLDER = "//cache"


def settings(**extra):
    """Properties that the object has and that an operator's arguments replace for one call."""
    return {
        "format": bpy.props.EnumProperty(
            items=BAKE_FORMATS, name="Format", description="What plays the frames", **extra
        ),
        "kind": bpy.props.EnumProperty(items=BAKE_KINDS, name="Bake", description="What is baked", **extra),
        "range": bpy.props.EnumProperty(
            items=BAKE_RANGES, name="Range", description="Which frames are baked", **extra
        ),
        "start": bpy.props.IntProperty(name="Start", description="First frame", default=1, **extra),
        "end": bpy.props.IntProperty(name="End", description="Last frame", default=250, **extra),
        "step": bpy.props.IntProperty(
            name="Step", description="Frames from one sample to the next", default=1, min=1, max=100, **extra
        ),
        "subframes": bpy.props.IntProperty(
            name="Samples per Step",
            description="More than one for motion blur of what moves fast: samples between the frames",
            default=1,
            min=1,
            max=100,
            **extra,
        ),
    }


def folder(**extra):
    return bpy.props.StringProperty(
        name="Folder",
        description="Where the caches lie; // is the .blend's own folder",
        subtype="DIR_PATH",
        default=FOLDER,
        **extra,
    )


class ARAPFIELDS_PG_bake(bpy.types.PropertyGroup):
    __annotations__ = {
        **settings(),
        "folder": folder(),
        "uid": bpy.props.IntProperty(
            name="Modifier", description="Which modifier plays the bake; 0 for none"
        ),
        "record": bpy.props.StringProperty(name="Record", description="What the bake is of, as JSON"),
    }


CLASSES = [ARAPFIELDS_PG_bake]
