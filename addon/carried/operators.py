# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects of a source: the list, its operators, the panel."""

import bpy

from ..blender.language import translated
from ..blender.object_references import in_scene, owner_of, settings_of
from ..blender.property_definitions import choice, flag
from ..blender.section import OfOthers, characters, note, wrapped
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError, refuse
from ..core.settings.choices import CARRYING
from ..handles import bones
from ..live import sessions
from ..names import Op
from . import carrying

STUDIO = ("CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER")


class CarriedOperator(SourceOperator):
    """Mixin: works on the list of objects that the panel's source carries."""

    bl_options = {"REGISTER", "UNDO"}
    guide = "characters"
    needs_carried = True

    @classmethod
    def refuses(cls, source):
        if cls.needs_carried and not settings_of(source).carried:
            return UserError("{name} carries nothing", source)
        return None


class ARAPFIELDS_OT_carry(CarriedOperator, bpy.types.Operator):
    """Have the active object's field move the other selected objects as well"""

    bl_label = "Carry Selected"
    needs_carried = False

    way: choice(CARRYING, "Way", "How the objects are carried")

    def change(self, context, source):
        added, refused = 0, []
        for item in candidates(context, source):
            try:
                carry(source, item, self.way)
                added += 1
            except UserError as error:
                refused.append(translated(error))
        if added:
            sessions.renew(context, source)
        else:
            nothing = translated("Select the objects to carry as well")
            raise UserError("{error}", error="\n".join(refused) or nothing)
        error = bones.unposed(context, source)
        for warning in [*refused, *([] if error is None else [translated(error)])]:
            self.report({"WARNING"}, warning)
        return translated("Objects that {name} now carries as well: {count}", name=source.name, count=added)


def candidates(context, source):
    """The selected objects to carry: no handles, and beside other objects no cameras and lights that hang on
    nothing, as after Select All."""
    others = [one for one in context.selected_objects if one != source]
    found = [one for one in others if one.type != "EMPTY" or owner_of(one) is None]
    return [one for one in found if one.type not in STUDIO or one.parent is not None] or found


def carry(source, item, way):
    """Adds an object to a source's list, or changes its way; UserError if it cannot be carried."""
    refuse(carrying.of_item(source, item))
    other = settings_of(item).carried_by
    if other is not None and other != source and carrying.find(other, item) is not None:
        raise UserError("{name} is carried by {other} already", item, other=other.name)
    entry = carrying.find(source, item)
    if entry is None:
        entry = settings_of(source).carried.add()
        settings_of(source).active_carried = len(settings_of(source).carried) - 1
    entry.name, entry.item, entry.way = item.name, item, way
    settings_of(item).carried_by = source


class ARAPFIELDS_OT_release(CarriedOperator, bpy.types.Operator):
    """Take the chosen object off the list, or all of them: each is again as it was before it was carried"""

    bl_label = "Release"

    all: flag("All", "Every object that is carried")

    def change(self, context, source):
        settings = settings_of(source)
        count = len(settings.carried)
        rows = range(count) if self.all else [min(max(settings.active_carried, 0), count - 1)]
        for row in reversed(rows):
            carrying.release(source, row)
        settings.active_carried = max(0, min(settings.active_carried, len(settings.carried) - 1))
        if sessions.is_live(source):
            sessions.live[source.session_uid].carrying.forget(settings)


ICONS = {"MESH": "OUTLINER_OB_MESH", "CURVE": "OUTLINER_OB_CURVE", "SURFACE": "OUTLINER_OB_SURFACE"}
ICONS |= {
    "CURVES": "OUTLINER_OB_CURVES",
    "POINTCLOUD": "OUTLINER_OB_POINTCLOUD",
    "EMPTY": "OUTLINER_OB_EMPTY",
}
ICONS |= {"LATTICE": "OUTLINER_OB_LATTICE", "ARMATURE": "OUTLINER_OB_ARMATURE"}
ICONS |= {"GREASEPENCIL": "OUTLINER_OB_GREASEPENCIL"}


SHARE, LEAST = 0.5, 8  # of the sidebar's characters: room for a name; and at least so many


class ARAPFIELDS_UL_carried(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        if not in_scene(item.item):
            row.label(text="(deleted)", icon="ERROR")
            return
        icon, room = ICONS.get(item.item.type, "OBJECT_DATA"), max(LEAST, int(SHARE * characters()))
        if len(item.item.name) > room:  # the ends of names tell left from right
            row.label(text="…" + item.item.name[1 - room :], icon=icon, translate=False)
        else:
            row.prop(item.item, "name", text="", emboss=False, icon=icon)
        row.prop(item, "way", text="", emboss=False)
        if carrying.of_entry(data.id_data, item) is not None:
            row.label(text="", icon="ERROR")


class ARAPFIELDS_PT_carried(OfOthers, bpy.types.Panel):
    bl_label = "Carried Objects"
    bl_order = 0
    tasks = frozenset({"POSE", "STYLE", "WRAP"})

    def fill(self, context, source, settings):
        layout = self.layout
        row = layout.row()
        row.template_list(
            "ARAPFIELDS_UL_carried", "", settings, "carried", settings, "active_carried", rows=3
        )
        column = row.column(align=True)
        column.operator(Op.CARRY, icon="ADD", text="")
        column.operator(Op.RELEASE, icon="REMOVE", text="")
        if not settings.carried:
            hint = translated(
                "Select clothes, eyes or hair, then this object, and press +: they move with it"
            )
            wrapped(layout, hint, icon="INFO")
        for entry in settings.carried:
            note(layout, carrying.of_entry(source, entry))


CLASSES = [
    ARAPFIELDS_OT_carry,
    ARAPFIELDS_OT_release,
    ARAPFIELDS_UL_carried,
    ARAPFIELDS_PT_carried,
]
