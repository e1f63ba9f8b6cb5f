# SPDX-License-Identifier: GPL-3.0-or-later
"""What shows a live shape, its marks in the file, and the shapes that are kept for undo."""

import hashlib
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, references
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..blender.point_data import points_of
from ..core.errors import UserError
from ..field_modifier import cache_modifier, field_nodes, motion
from ..field_modifier.layers import Way
from ..names import SHAPE_OF
from ..results import placement

# Marks for the pose that a live source's shape belongs to, and a cache of shown shapes for undo.
#
# Undo does not restore a mesh that both undo steps share, even if live mode has written to it since. So a
# mark on the mesh names the pose of its shape, and the object's `held` the shape that replaces a pose's
# own.

UNSETTLED = "?"  # the mark of a shape whose solve has not ended
MOST, LARGEST = 1000, 1 << 28  # size of the cache: items, and bytes of their arrays


class Kept(dict):
    """Cache {key: item} that drops the items that were kept first.


    `arrays_of(item)` are its arrays, or None; items may share them.
    """

    def __init__(self, arrays_of):
        self._arrays_of = arrays_of

    def keep(self, key, item):
        self.pop(key, None)
        self[key] = item
        while len(self) > MOST or self._size() > LARGEST:
            del self[next(iter(self))]

    def _size(self):
        arrays = {id(one): one for item in self.values() for one in self._arrays_of(item) if one is not None}
        return sum(one.nbytes for one in arrays.values())


def arrays_of(shape):
    return () if shape is None else (shape.offsets, shape.turns, *(shape.changes or {}).values())


shapes = Kept(arrays_of)  # {mark: Motion}


def mark(source):
    """The mark of the source's motion; "" if live mode did not write it."""
    modifier = modifier_stack.find(source)
    return "" if modifier is None else motion.carrier(source, modifier).get(SHAPE_OF, "")


def is_at_rest(source):
    """Whether the source's modifier shows a live shape that was solved from rest."""
    return mark(source) not in ("", UNSETTLED)


def put_mark(source, key):
    modifier, nodes = modifier_stack.find(source), field_nodes.of(source)
    meshes = [motion.carrier(source, modifier)] if modifier is not None else []
    for mesh in [*meshes, *([nodes.data] if nodes is not None else [])]:
        if mesh.get(SHAPE_OF, "") == key:
            continue
        if key:
            mesh[SHAPE_OF] = key
        else:
            del mesh[SHAPE_OF]


def note(source, key, shape):
    """Marks the source with the digest of the request whose shape is on display; "": of none yet."""
    put_mark(source, key or UNSETTLED)
    if key:
        shapes.keep(key, motion.Motion(shape.points - shape.rest, shape.turns, shape.changes))


def hold(source, pose):
    """Makes the source's present shape that of a pose, given by its digest."""
    shape = motion.snapshot(source)
    if shape is None:
        return
    offsets = b"" if shape.offsets is None else shape.offsets.tobytes()
    key = f"{pose} {hashlib.sha1(offsets).hexdigest()}"
    settings_of(source).held = key
    put_mark(source, key)
    shapes.keep(key, shape)


def wanted(source, pose):
    """The mark of a pose's shape: of the one that is held for it, or the pose's digest."""
    held = settings_of(source).held
    return held if held.startswith(f"{pose} ") else pose


def recall(source, pose):
    """Shows a pose's shape again, bit for bit, from the mesh or the cache; False if neither has it."""
    key, nodes = wanted(source, pose), field_nodes.of(source)
    if nodes is not None and nodes.data.get(SHAPE_OF) != key:
        return False
    if mark(source) != key:
        shape, modifier = shapes.get(key), modifier_stack.find(source)
        if shape is None or modifier is None:
            return False
        count = len(points_of(motion.carrier(source, modifier)))
        if settings_of(source).carried or (shape.offsets is not None and len(shape.offsets) != count):
            return False
        motion.restore(source, shape)
        motion.written.add(source.session_uid)
        put_mark(source, key)
    return True


# What shows a live shape: the source's modifier, or an object of its own.

# A live shape that is an object of its own: a surface, or the copy that the user wants as the result.

LIVE = "LIVE"  # kind of a live result in the source's list of results


class LiveObject:
    """Made when live mode starts; hides the source in viewports and renders."""

    in_place, arrays = False, ()

    def __init__(self, context, source, surface):
        references.refuse_new(source)
        mesh = placement.shown_mesh(context, source, len(surface.local))
        active, selected = context.view_layer.objects.active, list(context.selected_objects)
        item = placement.show(context, source, LIVE, LIVE, mesh, {"output": LIVE}, select=False)
        placement.show_alone(source, item, for_now=True)
        context.view_layer.objects.active = active
        for other in selected:
            other.select_set(True)
        self.result = ObjectReference(item)

    def bind(self, context, source):
        """Gives the object the source's present vertices and faces, unless it shows an implicit surface."""
        item = self.result.get()
        if settings_of(source).output == "WARP" and item.mode != "EDIT":
            shown = modifier_stack.mesh_copy(context, source)
            try:
                if not mesh_arrays.same_topology(item.data, shown):
                    mesh_arrays.take_all(item.data, shown)
            finally:
                bpy.data.meshes.remove(shown)

    def is_there(self):
        """Whether the object is in the step that was undone to."""
        return in_scene(self.result.find())

    def require(self, source):
        """Raises UserError if the user has deleted the object."""
        self.result.get()

    def show(self, source, shape):
        """Writes a Shape to the object's mesh; False in Edit Mode, or if its topology is unknown."""
        item = self.result.get()
        if item.mode == "EDIT":
            return False
        if len(item.data.vertices) != len(shape.points):
            if shape.topology is None:
                return False
            mesh_arrays.fill(item.data, shape.points, shape.topology)
        mesh_arrays.set_positions(item.data, shape.points)
        return True

    def take_away(self, source):
        """Removes the object, even if undo has unlinked it from all scenes, and shows the source again."""
        if source is not None:
            forget(source)
        leftover = self.result.find()
        if leftover is not None:
            placement.discard(leftover)

    def keep(self, context, source, kind):
        """Replaces the live object by a result of that kind with the same mesh; returns the result."""
        item = self.result.find()
        if item is None:
            raise UserError("{name} has no live result", source)
        forget(source)
        mesh = item.data
        bpy.data.objects.remove(item)
        item = placement.show(context, source, kind, settings_of(source).output, mesh, {"output": LIVE})
        placement.show_alone(source, item)
        return item


def forget(source):
    """Ends the source's live state, restores its visibility; returns its live result's object, or None."""
    settings_of(source).live_kind = ""
    placement.give_back(source)
    return forget_result(source)


def forget_result(source):
    """Removes the live result from the source's list of results; returns its object, or None."""
    settings, item = settings_of(source), None
    for index in reversed(range(len(settings.results))):
        if settings.results[index].kind == LIVE:
            item = settings.results[index].item
            settings.results.remove(index)
    return item


# What shows a live shape: the source's field modifier, or an object of its own.

# A live shape on the source itself: its field modifier moves, nothing is added or hidden.


class LiveModifier:
    """Made when live mode starts; keeps a snapshot of the source's earlier motion."""

    in_place = True

    def __init__(self, context, source, _):
        self.before, self.shown = motion.snapshot(source), None
        self.moved_by = settings_of(source).moved_by  # the earlier motion's
        self.first = self.before  # motion of the undo steps before live mode
        self.was_silent = bool(settings_of(source).silenced)
        self.was_playing = cache_modifier.is_playing(source)
        self.bind(context, source)
        placement.show_alone(source, source, for_now=True)

    def bind(self, context, source):
        """Binds the modifier, also after an edit of the source; `before` stays as it is."""
        self.uid = motion.bind(context, source, live=True).persistent_uid

    def is_there(self):
        return True

    @property
    def arrays(self):
        return (*arrays_of(self.before), *arrays_of(self.first))

    def require(self, source):
        """Raises UserError if the user has removed or applied the modifier."""
        if modifier_stack.find(source) is None:
            raise UserError("The modifier of {name} was removed", source)

    def show(self, source, shape):
        """Writes a Shape as the source's motion; False in Edit and Sculpt Mode."""
        if source.mode in PAUSING:
            return False
        motion.write(source, motion.Motion(shape.points - shape.rest, shape.turns, shape.changes))
        self.shown = shape
        return True

    def keep_shown(self, source):
        """Makes the motion on display the earlier one."""
        self.before, self.moved_by = motion.snapshot(source), settings_of(source).moved_by

    def take_away(self, source):
        """Restores the motion from before live mode, if any."""
        if source is not None:
            settings_of(source).live_kind = ""
            put_mark(source, "")
            placement.give_back(source)
            if source.mode != "EDIT":
                motion.restore(source, self.before)
                motion.drop_unused_helpers(source)
                settings_of(source).moved_by = self.moved_by
                if not self.was_silent:
                    motion.restore_armatures(source)
                if self.was_playing:
                    cache_modifier.set_playing(source, True)

    def keep(self, context, source, kind):
        """Keeps the motion in the modifier, or moves it to the mesh or a shape key, by the setting `result`;
        returns the source."""
        settings = settings_of(source)
        settings.live_kind = ""
        put_mark(source, "")
        motion.drop_unused_helpers(source)
        placement.keep_visibility(source)
        result, shape = settings.result, self.shown
        is_placed = result in ("REPLACE", "KEY") and shape is not None
        if is_placed and not placement.refusal(source, "WARP", result):
            solved = placement.SolvedMesh(shape.points.astype(np.float64), None, {"output": LIVE})
            placement.place_result(context, source, kind, "WARP", result, solved, shape.rest)
        return source

    def leave(self, source):
        """After undo to a step without live mode: restores `first` if the mesh still has a live shape.

        Copies of a live mesh have its mark, too: another modifier of that step stays as it is.
        """
        modifier = modifier_stack.find(source)
        if modifier is not None and modifier.persistent_uid == self.uid and mark(source):
            motion.restore(source, self.first)
            put_mark(source, "")


PAUSING = ("EDIT", "SCULPT")  # modes in which the user changes the mesh


# The display of a live session: the source's field modifier, or an object of its own.


class Former(NamedTuple):
    """What a session that has ended hands over to the one that replaces it."""

    uid: int  # session_uid of its source
    display: Any
    carried: dict  # what carried objects had before
    keeps_shape: bool
    way: Way  # what layers.make_way() has changed


def display_of(context, source, surface, earlier):
    """The display of a new session: the earlier session's if both are in the same place, else a new one."""
    display = earlier.display if earlier else None
    if display is not None and display.in_place == surface.in_place:
        display.bind(context, source)
        return display
    if display is not None:
        display.take_away(source)
    return (LiveModifier if surface.in_place else LiveObject)(context, source, surface)
