# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of armatures for a target, and their references in drivers, modifiers and constraints."""

import bpy

from ..blender.actions import own_action
from ..blender.object_references import settings_of


def pairs(source, target):
    """{armature of the source: that of the target}, by modifiers of the same name."""
    both = [(given, target.modifiers.get(given.name)) for given in source.modifiers]
    return {
        given.object: there.object
        for given, there in both
        if there is not None and given.type == there.type == "ARMATURE" and there.object is not None
    }


def twins(source, target):
    """{object or data of the source: its counterpart of the target}."""
    own = {source: target, source.data: target.data}
    for given, there in pairs(source, target).items():
        own |= {given: there, given.data: there.data}
    return own


def copied(rig, target):
    """A copy at the same place, in the target's collections."""
    own = rig.copy()
    own.data = rig.data.copy()
    own.name = f"{rig.name} {target.name}"
    own_action(own)
    settings_of(own).rest_bones = ""  # its bones are not fitted
    for home in target.users_collection:
        home.objects.link(own)
    return own


def copy_drivers(source, target):
    """Copies the drivers of the source's keys; references to the source become those to its twin."""
    given, keys = source.data.shape_keys, target.data.shape_keys
    if given.animation_data is None:
        return
    own = {**twins(source, target), given: keys}
    for curve in given.animation_data.drivers:
        if keys.animation_data is not None and keys.animation_data.drivers.find(curve.data_path):
            keys.driver_remove(curve.data_path)
        made = keys.animation_data_create().drivers.from_existing(src_driver=curve)
        for variable in made.driver.variables:
            for read in variable.targets:
                if own.get(read.id) is not None:
                    copy_property(read.id, own[read.id], read.data_path)
                    read.id = own[read.id]


def copy_property(given, there, path):
    """Copies a custom property that a driver reads to a twin that lacks it."""
    name = bpy.utils.unescape_identifier(path[2:-2]) if path.startswith('["') else ""
    if name in given and name not in there:
        there[name] = given[name]
        there.id_properties_ui(name).update_from(given.id_properties_ui(name))
