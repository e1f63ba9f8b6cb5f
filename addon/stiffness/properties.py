# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a source's painted stiffness."""

import bpy

from ..blender.property_definitions import number, tells, text

MOST = 1e4  # largest factor; single precision does not allow a larger ratio


def factor(name, description):
    return number(name, description, default=1.0, min=1 / MOST, soft_min=0.01, soft_max=1000.0, max=MOST)


class ARAPFIELDS_PG_stiffness(bpy.types.PropertyGroup):
    group: text(
        "Stiff Group", "Vertex group that is as many times as stiff as is chosen where its weight is 1"
    )
    times: factor("Multiplier", "How stiff the group is against stretching and bending; below 1 it is softer")
    bend_group: text("Bend Group", "Vertex group whose stiffness against bending alone is another")
    bend_times: factor(
        "Bend Multiplier", "How stiff that group is against bending; below 1 it folds more easily"
    )

    mask: text(
        "Influence",
        "Vertex group that says how far each point goes of the way, nowhere where its weight "
        "is 0; the modifier's mask",
        update=tells("mask"),
    )


CLASSES = [ARAPFIELDS_PG_stiffness]
