# SPDX-License-Identifier: GPL-3.0-or-later
"""A carried object during a session or job, and its release."""

from dataclasses import dataclass

import numpy as np

from ..blender import modifier_stack
from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from .carriers import MeshCarrier
from .points import AttributeCarrier, KeyCarrier
from .transforms import BonesCarrier, TransformCarrier, base_kind_of

KINDS = {"MESH": MeshCarrier, "ARMATURE": BonesCarrier}
KINDS |= dict.fromkeys(("CURVES", "POINTCLOUD", "GREASEPENCIL"), AttributeCarrier)
KINDS |= dict.fromkeys(("CURVE", "SURFACE", "LATTICE"), KeyCarrier)


class CarriedObject:
    """One object that the field moves as well."""

    def __init__(self, context, entry):
        item, self.way = entry.item, entry.way
        self.reference = ObjectReference(item)
        self.carrier = carrier_class(item, self.way)(context, item)
        if isinstance(self.carrier, BonesCarrier):
            self.carrier.take_base(item, entry)
        self.may_be_edited = False
        self.attached = None  # (points, PointsBefore, rest, PointsBeside, Attachment); worker only

    def moves_by_itself(self, item):
        """Whether its points move without an edit of its data."""
        if isinstance(self.carrier, MeshCarrier):
            return bool(modifier_stack.shown_before(item, in_place=True)) or item.data.shape_keys is not None
        return isinstance(self.carrier, KeyCarrier) and item.data.shape_keys is not None

    def item_and_entry(self, source):
        """The object and its entry in the source's list; UserError if either was removed."""
        item = self.reference.get()
        entry = find(source, item)
        if entry is None:
            raise UserError("{name} is no longer carried", self.reference)
        return item, entry


@dataclass(frozen=True)
class CarriedPose:
    """A carried object's points, and (4, 4) matrices to solve space: at rest, now, and of its parent now."""

    carried: CarriedObject
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
    """Removes an object from a source's list and restores its shape from before it was carried."""
    entry = settings_of(source).carried[index]
    item = entry.item
    if item is not None:
        settings_of(item).carried_by = None
        if item.library is None:
            give_back(item, entry)
    settings_of(source).carried.remove(index)


def give_back(item, entry):
    """Removes the field's modifier, keys and transforms from an object, whichever carrier wrote them."""
    for carrier in dict.fromkeys((KINDS.get(item.type, TransformCarrier), TransformCarrier)):
        carrier.release(item, entry)


def is_carried_otherwise(item, entry, carrier):
    """Whether an object still has the motion of another carrier."""
    if base_kind_of(entry) not in ("NONE", carrier.base_kind):
        return True
    return isinstance(carrier, TransformCarrier) and KINDS.get(item.type, TransformCarrier).is_on(item)


def give_back_all(source):
    """Removes the field's motion from all carried objects of a source."""
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            give_back(entry.item, entry)
