# SPDX-License-Identifier: GPL-3.0-or-later
"""One kept pose of a scene."""

import bpy


class ARAPFIELDS_PG_pose(bpy.types.PropertyGroup):
    data: bpy.props.StringProperty(
        name="Field", description="The field, with samples of the shape that it was solved on"
    )


CLASSES = [ARAPFIELDS_PG_pose]
