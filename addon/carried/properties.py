# SPDX-License-Identifier: GPL-3.0-or-later
"""One carried object of a source."""

import bpy

from ..core.settings.choices import CARRYING


class ARAPFIELDS_PG_carried(bpy.types.PropertyGroup):
    # `name`, which every entry has, is the object's when it was added: it tells what was deleted
    item: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Object", description="Moved by the field of the object that carries it"
    )
    way: bpy.props.EnumProperty(items=CARRYING, name="Way", description="How the object is carried")
    base: bpy.props.StringProperty(
        name="Own Place",
        description="The object's own delta transforms or pose while the field moves it, as JSON",
    )


CLASSES = [ARAPFIELDS_PG_carried]
