# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack
from ..blender.language import translated
from ..blender.object_references import active_uids, settings_of, source_of
from ..blender.point_data import shape_keys_of
from ..blender.section import Section, wrapped
from ..core.runtime import jobs

ICONS = {"INFO": "CHECKMARK", "WARNING": "ERROR", "ERROR": "CANCEL"}


def remarks(source):
    """Texts about how the source is read."""
    if source is None:
        return
    shown = modifier_stack.shown_before(source, settings_of(source).in_place)
    after = [m.name for m in modifier_stack.shown_before(source, False) if m not in shown]
    if shown:
        yield translated("Works on the shape after {names}", names=", ".join(m.name for m in shown))
    if after:
        yield translated("Works before {names}", names=", ".join(after))
    if shape_keys_of(source.data):
        yield translated("Works on the shape keys as they are set now")


def messages(context):
    """The Messages about what is active, and about no object."""
    here = active_uids(context)
    return [one for one in jobs.board.messages if not one.about or one.about & here]


class ARAPFIELDS_PT_status(Section, bpy.types.Panel):
    """Remarks and messages about what is active. It is the last panel, so that none moves when it changes."""

    bl_label = "Status"
    bl_order = 12
    needs_source = False

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(messages(context) or any(remarks(source_of(context))))

    def fill(self, context, source, settings):
        layout = self.layout
        for text in remarks(source):
            wrapped(layout, text, icon="INFO")
        for message in messages(context):
            wrapped(layout, message.text, icon=ICONS[message.level])


CLASSES = [ARAPFIELDS_PT_status]
