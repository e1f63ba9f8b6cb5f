# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a source's armatures and carried objects for a target, and their references."""

from ..blender import modifier_stack, references
from ..blender.actions import own_action
from ..blender.object_references import settings_of


def pairs(source, target):
    """{armature of the source: that of the target}, by modifiers of the same name."""
    both = [(given, target.modifiers.get(given.name)) for given in source.modifiers]
    rigs = [[one and modifier_stack.rig_of(one) for one in pair] for pair in both]
    return {own: other for own, other in rigs if own is not None and other is not None}


def counterparts(source, target):
    """{data-block of the source: the target's}: of both objects and of the armatures that pose them."""
    found = blocks(source, target)
    for given, there in pairs(source, target).items():
        found |= blocks(given, there)
    return found


def blocks(given, there):
    """{data-block: its counterpart} of two objects, their data and their shape keys, if both have any."""
    both = [(given, there), (given.data, there.data)]
    both.append([getattr(item.data, "shape_keys", None) for item in (given, there)])
    return {one: other for one, other in both if one is not None and other is not None}


def copied(item, target):
    """A copy with data and actions of its own at the same place, in the target's collections."""
    own = item.copy()
    if item.data is not None:
        own.data = item.data.copy()
    own.name = f"{item.name} {target.name}"
    for block in blocks(item, own).values():
        own_action(block)
    settings_of(own).rest_bones = ""  # its bones are not fitted
    for home in target.users_collection:
        home.objects.link(own)
    return own


def remap_copies(made, twins):
    """Replaces references of copies, {object: its copy}, to one another and by `twins`, {data-block: its
    counterpart}."""
    copies = {}
    for given, there in made.items():
        copies |= blocks(given, there)
    for block in copies.values():
        references.remap(references.parts_of(block), twins | copies)


def copy_drivers(source, target):
    """Copies the drivers of the source's keys; references to the source become those to its counterpart."""
    given, keys = source.data.shape_keys, target.data.shape_keys
    if given.animation_data is None:
        return
    twins = counterparts(source, target)
    for curve in given.animation_data.drivers:
        if keys.animation_data is not None and keys.animation_data.drivers.find(curve.data_path):
            keys.driver_remove(curve.data_path)
        made = keys.animation_data_create().drivers.from_existing(src_driver=curve)
        references.remap(references.read_by(made), twins)
