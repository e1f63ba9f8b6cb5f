# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.secondary: how a live source lags behind its handles, overshoots and settles."""

import bpy

from ..blender.property_definitions import annotations
from ..core.settings.parameters import parameters

SECONDARY = parameters("secondary")


class ARAPFIELDS_PG_secondary(bpy.types.PropertyGroup):
    __annotations__ = {
        "use": bpy.props.BoolProperty(
            name="Secondary Motion",
            description="In live mode and in bakes, the surface lags behind its handles, overshoots and "
            "settles",
        ),
        **annotations(SECONDARY),
        "group": bpy.props.StringProperty(
            name="Soft Part",
            description="Vertex group that says how much of the motion each part has: 0 follows its handles "
            "at once; empty for all",
        ),
        "start": bpy.props.IntProperty(
            name="Start Frame", description="Frame at which, and before which, everything rests", default=1
        ),
        "use_ground": bpy.props.BoolProperty(
            name="Ground", description="A level ground that the surface cannot pass"
        ),
        "ground": bpy.props.FloatProperty(
            name="Ground Height", description="Height of the ground in the world", subtype="DISTANCE"
        ),
    }


CLASSES = [ARAPFIELDS_PG_secondary]
