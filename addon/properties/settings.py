# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the three solves, made from the core's tables."""

import bpy

from ..bridge.settings import annotations
from ..core.parameters import DEFORM, FIT, STYLIZE


def group(name, parameters):
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations(parameters)})


ARAPFIELDS_PG_fit = group("ARAPFIELDS_PG_fit", FIT)
ARAPFIELDS_PG_deform = group("ARAPFIELDS_PG_deform", DEFORM)
ARAPFIELDS_PG_stylize = group("ARAPFIELDS_PG_stylize", STYLIZE)

CLASSES = [ARAPFIELDS_PG_fit, ARAPFIELDS_PG_deform, ARAPFIELDS_PG_stylize]
