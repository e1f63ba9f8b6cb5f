# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.secondary: settings of secondary motion."""

import bpy

from ..blender.property_definitions import annotations, flag, integer, number, text
from ..core.settings.parameters import parameters

SECONDARY = parameters("secondary")


class ARAPFIELDS_PG_secondary(bpy.types.PropertyGroup):
    __annotations__ = {
        "use": flag(
            "Secondary Motion",
            "In live mode and in bakes, the surface lags behind its handles, overshoots and settles",
        ),
        **annotations(SECONDARY),
        "group": text(
            "Soft Group",
            "Vertex group that says how much of the motion each part has: 0 follows its handles "
            "at once; empty for all",
        ),
        "start": integer("Start Frame", "Frame at which, and before which, everything rests", default=1),
        "use_ground": flag("Ground", "A level ground that the surface cannot pass"),
        "ground": number("Ground Height", "Height of the ground in the world", subtype="DISTANCE"),
    }


CLASSES = [ARAPFIELDS_PG_secondary]
