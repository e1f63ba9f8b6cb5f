# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.language import translated
from ..blender.object_references import owner_of, settings_of
from ..blender.property_definitions import choice, flag
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError, refuse
from ..core.settings.choices import CARRYING
from ..handles import bones
from ..live import sessions
from . import carried_objects, refusals

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
        for text in [*refused, *([] if error is None else [translated(error)])]:
            self.report({"WARNING"}, text)
        return translated("Objects that {name} now carries as well: {count}", name=source.name, count=added)


def candidates(context, source):
    """The selected objects to carry: no handles, and beside other objects no cameras and lights that hang on
    nothing, as after Select All."""
    others = [one for one in context.selected_objects if one != source]
    found = [one for one in others if one.type != "EMPTY" or owner_of(one) is None]
    return [one for one in found if one.type not in STUDIO or one.parent is not None] or found


def carry(source, item, way):
    """Adds an object to a source's list, or changes its way; UserError if it cannot be carried."""
    refuse(refusals.of_item(source, item))
    other = settings_of(item).carried_by
    if other is not None and other != source and carried_objects.find(other, item) is not None:
        raise UserError("{name} is carried by {other} already", item, other=other.name)
    entry = carried_objects.find(source, item)
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
            carried_objects.release(source, row)
        settings.active_carried = max(0, min(settings.active_carried, len(settings.carried) - 1))
        if sessions.is_live(source):
            sessions.live[source.session_uid].carrying.forget(settings)


CLASSES = [ARAPFIELDS_OT_carry, ARAPFIELDS_OT_release]
