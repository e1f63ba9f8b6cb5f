# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of skinning, stored with the armature."""

import bpy

from ..blender.property_definitions import annotations, choice
from ..core.settings.choices import SKIN_GROUPS
from ..core.settings.parameters import SKIN


def groups(**extra):
    return choice(SKIN_GROUPS, "Groups", "What becomes of the weights that bones have already", **extra)


class ARAPFIELDS_PG_skin(bpy.types.PropertyGroup):
    __annotations__ = {"groups": groups(), **annotations(SKIN)}


CLASSES = [ARAPFIELDS_PG_skin]
