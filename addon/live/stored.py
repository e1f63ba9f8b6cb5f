# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks for the pose that a live source's shape belongs to, and a cache of shown shapes for undo.

Undo does not restore a mesh that both undo steps share, even if live mode has written to it since. So a mark
on the mesh names the pose of its shape, and the object's `held` the shape that replaces a pose's own.
"""

import hashlib

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..field_modifier import field_nodes, motion
from ..names import SHAPE_OF

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
