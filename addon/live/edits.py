# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects edits of a live session's source, handles and carried objects; main thread."""

import time
from typing import NamedTuple

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import is_animated
from ..blender.object_references import settings_of
from ..core.geometry.spaces import SAME_STRETCH
from ..field_modifier import motion
from ..field_nodes import helper
from ..handles import empties, movers, symmetry
from ..handles.empties import matrix_of
from ..solver import secondary_motion
from ..solver.source_reader import SourceChanged, rest_frame, solve_space, uses_handles
from ..stiffness import painted

STROKE = 0.3  # seconds without new weights after which a brush stroke counts as ended


class Updates(NamedTuple):
    """Data-blocks updated by a depsgraph, and the session_uids of some of them."""

    items: list  # original data-blocks; objects only with an updated transform or geometry
    meshes: set  # with new geometry
    objects: set  # with new geometry
    data: set  # all data-blocks that are no objects

    @classmethod
    def of(cls, depsgraph):
        moved = [
            update
            for update in depsgraph.updates
            if update.is_updated_geometry
            or update.is_updated_transform
            or not isinstance(update.id, bpy.types.Object)
        ]
        items = [update.id.original for update in moved]
        shapes = [update.id.original for update in depsgraph.updates if update.is_updated_geometry]
        return cls(
            items,
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Mesh | bpy.types.PointCloud)},
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Object)},
            {item.session_uid for item in items if not isinstance(item, bpy.types.Object)},
        )


class EditWatch:
    """Records depsgraph updates; `require_unedited` then compares the source with what was read."""

    def __init__(self, reader):
        self.reader, self.may_be_edited, self.may_have_moved, self.edited_at = reader, False, False, 0.0
        self.world = None  # the source's world matrix at the last check

    def note(self, updates):
        """Records the Updates of a depsgraph."""
        self.reader.carrying.watch(updates.objects, updates.data)
        source = self.reader.reference.find()
        if source is None:
            return
        has_new_shape = source.data.session_uid in updates.meshes
        if has_new_shape:
            self.may_be_edited |= source.session_uid not in motion.written
            self.edited_at = time.monotonic()
        items = [item for item in updates.items if item != source or not has_new_shape]
        if self.reader.moves_by_itself and any(may_move(item, source) for item in items):
            self.may_have_moved = True

    def require_unedited(self, context, source):
        """Raises SourceChanged if the mesh or its non-uniform scale has changed; else reads moved points."""
        if not is_animated(source) and self.is_stretched(source):
            raise SourceChanged(source.name)
        if self.may_be_edited and not self.is_in_stroke(source):
            self.may_be_edited = False
            if self.is_edited(context, source):
                raise SourceChanged(source.name)
        if self.may_have_moved:
            self.may_have_moved = False
            self.reader.read_points(context, source)
        self.reader.refresh_carried(context)

    def is_stretched(self, source):
        """Whether the non-uniform scale differs from that at reading: exactly, if the matrix equals the last
        check's; by more than SAME_STRETCH while the source moves."""
        world = matrix_of(source)
        rests, self.world = np.array_equal(world, self.world), world
        now = solve_space(source, world, self.reader.kind)
        return not now.is_like(self.reader.surface.space, 0.0 if rests else SAME_STRETCH)

    def is_in_stroke(self, source):
        return source.mode == "WEIGHT_PAINT" and time.monotonic() - self.edited_at < STROKE

    def is_edited(self, context, source):
        surface = self.reader.surface
        if source.mode == "WEIGHT_PAINT":  # between two strokes
            return not painted.same(painted.read(context, source, surface.in_place), surface.stiffness)
        return mesh_arrays.fingerprint(source.data) != self.reader.fingerprint


def may_move(item, source):
    """Whether an update of a data-block may move the source's points before its field modifier."""
    if isinstance(item, bpy.types.Object):
        return item == source or (item.type != "EMPTY" or settings_of(item).handle_of != source)
    return isinstance(item, bpy.types.Key | bpy.types.Armature | bpy.types.Lattice | bpy.types.Curve)


def layout_of(source, kind, scene):
    """Comparable settings that a solver is set up for: handles with their rest poses, output, modifiers.

    After a change, the solver is set up anew. Energy weights are left out, as they may be animated.
    """
    settings = settings_of(source)
    held = [
        (movers.key_of(e), e.kind, movers.group_of(e), tuple(movers.user_settings(e).values()), tuple(e.rest))
        for e in empties.used(source)
    ]
    style, stiffness = settings.stylize, settings.stiffness
    further = (settings.output, settings.result, settings.surface)
    further += (stiffness.group, stiffness.times, stiffness.bend_group, stiffness.bend_times)
    if kind == "STYLIZE":
        further += (style.region, style.region_material, style.use_handles, style.samples, style.seed)
    further += tuple((e.item.session_uid if e.item else 0, e.way) for e in settings.carried)
    further += (secondary_motion.layout_of(source, scene), helper.of(source) is not None)
    further += (rest_frame(source, kind, settings.in_place),)
    if kind == "DEFORM":
        further += (symmetry.offset_of(source),)
    used = uses_handles(settings, kind)
    return (held if used else [], used and empties.kept_rest(source), further, stack_of(source))


def differ_in_handles(a, b):
    """Whether two layouts differ in handles alone, and the solver can take those of `a` as it is."""
    return a[2:] == b[2:] and bool(a[0]) and bool(b[0]) and not any(group for _, _, group, *_ in a[0])


def stack_of(source):
    """The modifiers before the field's, and whether the mesh has several users."""
    before = modifier_stack.before(source, in_place=True)
    shown = [(modifier.name, modifier.type, modifier.show_viewport) for modifier in before]
    return shown, source.data.users > 1
