# SPDX-License-Identifier: GPL-3.0-or-later
"""After the deletion of a source: asks whether to delete the Empties of its handles."""

import functools

import bpy

from ..blender import host
from ..blender.host import has_window
from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of
from ..blender.property_definitions import text
from ..blender.references import takes_references
from ..blender.source_operator import ReportingOperator
from ..names import Op
from . import empties

seen = {}  # "count": number of objects in the view layer at the last check


def of_deleted():
    """{source in no scene: Empties of its handles that are in a scene}."""
    gone = [item for item in bpy.data.objects if settings_of(item).handles and not in_scene(item)]
    left = {source: [e.empty for e in empties.used(source) if is_ours(e)] for source in gone}
    return {source: items for source, items in left.items() if items}


def is_ours(entry):
    """Whether a handle has an Empty of this file."""
    return entry.kind != "BONE" and takes_references(entry.empty)


def follow(context):
    """Checks whether objects were deleted; called after depsgraph updates."""
    count = len(context.view_layer.objects) if getattr(context, "view_layer", None) else 0
    if count < seen.get("count", 0) and has_window() and of_deleted():
        host.start(ask)
    seen["count"] = count


def ask():
    """Timer callback: opens a popup menu under the mouse."""
    for source, items in of_deleted().items():
        title = translated("{name} was deleted", name=source.name)
        offer = functools.partial(draw, source.name, len(items))
        bpy.context.window_manager.popup_menu(offer, title=title, icon="QUESTION")


def draw(name, count, menu, context):
    label = translated("Delete its handles as well ({count})", count=count)
    menu.layout.operator(Op.DELETE_LEFT, text=label, icon="TRASH").source = name


class ARAPFIELDS_OT_delete_left(ReportingOperator, bpy.types.Operator):
    """Delete the Empties of handles whose object was deleted"""

    bl_label = "Delete Handles Left Behind"
    bl_options = {"INTERNAL", "UNDO"}
    guide = "handles"

    source: text("Object", "The object that was deleted")

    def change(self, context, source):
        left = {one.name: items for one, items in of_deleted().items()}
        for empty in left.get(self.source, ()):
            empties.delete(empty)


CLASSES = [ARAPFIELDS_OT_delete_left]
