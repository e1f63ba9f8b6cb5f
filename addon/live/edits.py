# SPDX-License-Identifier: GPL-3.0-or-later
"""How a live session notices that its source, or what that carries, is edited; on the main thread."""

import time
from typing import NamedTuple

import bpy

from ..blender import mesh_arrays
from ..blender.object_references import settings_of
from ..field_modifier import motion
from ..solver.source_reader import SourceChanged
from ..stiffness import painted

STROKE = 0.3  # seconds without a touch of the brush after which a stroke has ended


class Updates(NamedTuple):
    """What Blender has just updated: data-blocks, and the session_uids of some of them."""

    items: list
    meshes: set  # with new geometry
    objects: set  # with new geometry
    data: set  # all that are no objects

    @classmethod
    def of(cls, depsgraph):
        items = [update.id.original for update in depsgraph.updates]
        shapes = [update.id.original for update in depsgraph.updates if update.is_updated_geometry]
        return cls(
            items,
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Mesh)},
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Object)},
            {item.session_uid for item in items if not isinstance(item, bpy.types.Object)},
        )


class EditWatch:
    """Notes what Blender has updated; the source is compared with what was read when the session looks."""

    def __init__(self, reader):
        self.reader, self.may_be_edited, self.may_have_moved, self.edited_at = reader, False, False, 0.0

    def note(self, updates):
        """Takes what Blender has just updated."""
        self.reader.carrying.watch(updates.objects, updates.data)
        source = self.reader.reference.find()
        if source is None:
            return
        if source.data.session_uid in updates.meshes:
            self.may_be_edited |= source.session_uid not in motion.written
            self.edited_at = time.monotonic()
        elif self.reader.moves_by_itself and any(may_move(item, source) for item in updates.items):
            self.may_have_moved = True

    def require_unedited(self, context, source):
        """SourceChanged where the mesh is another than when it was read; else reads what has only moved."""
        if self.may_be_edited and not self.is_in_stroke(source):
            self.may_be_edited = False
            if self.is_edited(context, source):
                raise SourceChanged(source.name)
        if self.may_have_moved:
            self.may_have_moved = False
            self.reader.read_points(context, source)
        self.reader.refresh_carried(context)

    def is_in_stroke(self, source):
        return source.mode == "WEIGHT_PAINT" and time.monotonic() - self.edited_at < STROKE

    def is_edited(self, context, source):
        surface = self.reader.surface
        if source.mode == "WEIGHT_PAINT":  # between two strokes
            return not painted.same(painted.read(context, source, surface.in_place), surface.stiffness)
        return mesh_arrays.fingerprint(source.data) != self.reader.fingerprint


def may_move(item, source):
    """Whether an update of this may move the points of the source before its field does."""
    if isinstance(item, bpy.types.Object):
        return item == source or (item.type != "EMPTY" or settings_of(item).handle_of != source)
    return isinstance(item, bpy.types.Key | bpy.types.Armature | bpy.types.Lattice | bpy.types.Curve)
