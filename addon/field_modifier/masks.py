# SPDX-License-Identifier: GPL-3.0-or-later
"""The Mask of a source's modifiers: a vertex group that scales the motion of each point."""

from ..blender import modifier_stack, property_definitions
from ..blender.object_references import settings_of
from ..names import PLAYED_GROUP, WARP_KEY
from . import inputs


def group_of(source):
    """Name of the source's mask: the one chosen in the panel, else the one of its field's modifier; or ""."""
    return settings_of(source).stiffness.mask or group_of_field(source) or ""


def take(source):
    """Sets the mask chosen in the panel, if any, on a new or reused modifier."""
    chosen = settings_of(source).stiffness.mask
    if chosen and group_of_field(source) != chosen:
        put(source, chosen)


def group_of_field(source):
    modifier = modifier_stack.find(source)
    return None if modifier is None else inputs.get_attribute(modifier, "Mask")


def put(source, group):
    """Sets this group, or with "" none, on the modifiers of the field and of the bake."""
    field, cache = modifier_stack.find(source), modifier_stack.find_cache(source)
    if field is not None:
        inputs.put_attribute(field, "Mask", group)
    if cache is not None:
        cache.vertex_group = group if group in source.vertex_groups else ""


def lend(source, item):
    """Sets a carried object's own group with the name of the source's mask as its mask, if it has one."""
    group = group_of(source)
    if group:
        put_carried(item, group)


def put_carried(item, group):
    """Sets this group, or none, as the mask of a carried object, unless it has a chosen one."""
    if settings_of(item).stiffness.mask:
        return
    group = group if has(item, group) else ""
    if item.type in ("MESH", "CURVES", "POINTCLOUD", "GREASEPENCIL"):
        put(item, group)
    for modifier in item.modifiers:
        if modifier.type == "NODES" and PLAYED_GROUP in (modifier.node_group or ()):
            inputs.put_attribute(modifier, "Mask", group)
    keys = item.data.shape_keys if item.type == "LATTICE" else None
    if keys is not None and WARP_KEY in keys.key_blocks:
        keys.key_blocks[WARP_KEY].vertex_group = group


def has(item, group):
    """Whether an object has weights of that name: a vertex group, or a float attribute on hair points."""
    if item.type in ("CURVES", "POINTCLOUD"):
        attribute = item.data.attributes.get(group)
        return attribute is not None and (attribute.domain, attribute.data_type) == ("POINT", "FLOAT")
    return group in item.vertex_groups


def chosen(settings):
    """Update callback of the chosen mask."""
    source = settings.id_data
    put(source, settings.mask)
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            put_carried(entry.item, settings.mask)


property_definitions.listeners["mask"] = chosen
