# SPDX-License-Identifier: GPL-3.0-or-later
"""One carried object for one run, and what takes the field off it again."""

import json
from dataclasses import dataclass

import numpy as np

from ..blender import modifier_stack
from ..blender.object_references import ObjectReference, settings_of
from .carriers import MeshCarrier
from .points import AttributeCarrier, KeyCarrier
from .transforms import BonesCarrier, TransformCarrier

KINDS = {"MESH": MeshCarrier, "ARMATURE": BonesCarrier}
KINDS |= dict.fromkeys(("CURVES", "POINTCLOUD", "GREASEPENCIL"), AttributeCarrier)
KINDS |= dict.fromkeys(("CURVE", "SURFACE", "LATTICE"), KeyCarrier)


class Passenger:
    """One carried object that the field moves."""

    def __init__(self, context, entry):
        item, self.way = entry.item, entry.way
        self.reference = ObjectReference(item)
        self.carrier = carrier_class(item, self.way)(context, item)
        if isinstance(self.carrier, BonesCarrier):
            self.carrier.take_base(item, entry)
        self.may_be_edited = False
        self.attached = None  # (points, rest, Attachment); the worker's

    def moves_by_itself(self, item):
        """Whether its points move without an edit of its data."""
        if isinstance(self.carrier, MeshCarrier):
            return bool(modifier_stack.shown_before(item, in_place=True)) or item.data.shape_keys is not None
        return isinstance(self.carrier, KeyCarrier) and item.data.shape_keys is not None


@dataclass(frozen=True)
class Frame:
    """A passenger's points, and (4, 4) matrices to solve space: of it at rest and now, and of its parent."""

    passenger: Passenger
    points: np.ndarray
    rest: np.ndarray
    now: np.ndarray
    parent: np.ndarray

    def same(self, other):
        pairs = (self.rest, other.rest), (self.now, other.now), (self.parent, other.parent)
        return self.points is other.points and all(np.array_equal(a, b) for a, b in pairs)


def find(source, item):
    """The entry of an object in a source's list, or None."""
    return next((e for e in settings_of(source).carried if item is not None and e.item == item), None)


def carrier_class(item, way):
    return TransformCarrier if way == "RIGID" else KINDS.get(item.type, TransformCarrier)


def release(source, index):
    """Takes an object off a source's list; it looks as it did before it was carried."""
    entry = settings_of(source).carried[index]
    item = entry.item
    if item is not None:
        settings_of(item).carried_by = None
        if item.library is None:
            give_back(item, entry)
    settings_of(source).carried.remove(index)


def give_back(item, entry):
    """Takes off an object whatever the field put there, in any of the ways to carry it."""
    kind = KINDS.get(item.type)
    if kind is not None and kind is not BonesCarrier:
        kind.release(item, entry)
    if entry.base:
        is_pose = item.type == "ARMATURE" and "delta_location" not in json.loads(entry.base)
        (BonesCarrier if is_pose else TransformCarrier).release(item, entry)


def is_carried_otherwise(item, entry, carrier):
    """Whether the field still moves an object in another way than this carrier's."""
    if isinstance(carrier, TransformCarrier):
        return item.type != "ARMATURE" and item.type in KINDS and KINDS[item.type].is_on(item)
    return bool(entry.base) and (not isinstance(carrier, BonesCarrier) or "delta_location" in entry.base)


def give_back_all(source):
    """Takes the field off all that a source carries."""
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            give_back(entry.item, entry)
