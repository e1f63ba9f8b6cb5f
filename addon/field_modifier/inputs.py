# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of a Geometry Nodes modifier by name, in all versions of Blender, and the Mask among them."""

from ..blender import modifier_stack, property_definitions
from ..blender.object_references import settings_of
from ..names import PLAYED_GROUP, WARP_KEY

# Inputs of a Geometry Nodes modifier by name, in all supported versions of Blender.


def identifier(modifier, name):
    sockets = modifier.node_group.interface.items_tree
    return next(s.identifier for s in sockets if getattr(s, "in_out", "") == "INPUT" and s.name == name)


def slot(modifier, name):
    """Blender 5.2's property group of an input; None in versions that store inputs as ID properties."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    return None if inputs is None else getattr(inputs, identifier(modifier, name))


def get(modifier, name):
    socket = slot(modifier, name)
    return socket.value if socket is not None else modifier[identifier(modifier, name)]


def put(modifier, name, value):
    socket = slot(modifier, name)
    if socket is not None:
        socket.value = value
    else:
        modifier[identifier(modifier, name)] = value
    modifier.id_data.update_tag()


def get_attribute(modifier, name):
    """Name of the attribute or vertex group that an input reads; "" if it is a single value."""
    socket = slot(modifier, name)
    if socket is not None:
        return socket.attribute_name if socket.type == "ATTRIBUTE" else ""
    key = identifier(modifier, name)
    return modifier[f"{key}_attribute_name"] if modifier.get(f"{key}_use_attribute") else ""


def put_attribute(modifier, name, attribute):
    """Sets an input to an attribute or vertex group, or with "" to its single value."""
    socket = slot(modifier, name)
    if socket is not None:
        socket.type = "ATTRIBUTE" if attribute else "VALUE"
        socket.attribute_name = attribute
    else:
        key = identifier(modifier, name)
        modifier[f"{key}_use_attribute"] = bool(attribute)
        modifier[f"{key}_attribute_name"] = attribute
    modifier.id_data.update_tag()


# The Mask of a source's modifiers: a vertex group that scales the motion of each point.


def mask_of(source):
    """Name of the source's mask: the one chosen in the panel, else the one of its field's modifier; or ""."""
    return settings_of(source).stiffness.mask or mask_of_field(source) or ""


def take_mask(source):
    """Sets the mask chosen in the panel, if any, on a new or reused modifier."""
    chosen = settings_of(source).stiffness.mask
    if chosen and mask_of_field(source) != chosen:
        put_mask(source, chosen)


def mask_of_field(source):
    modifier = modifier_stack.find(source)
    return None if modifier is None else get_attribute(modifier, "Mask")


def put_mask(source, group):
    """Sets this group, or with "" none, on the modifiers of the field and of the bake."""
    field, cache = modifier_stack.find(source), modifier_stack.find_cache(source)
    if field is not None:
        put_attribute(field, "Mask", group)
    if cache is not None:
        cache.vertex_group = group if group in source.vertex_groups else ""


def lend_mask(source, item):
    """Sets a carried object's own group with the name of the source's mask as its mask, if it has one."""
    group = mask_of(source)
    if group:
        put_carried_mask(item, group)


def put_carried_mask(item, group):
    """Sets this group, or none, as the mask of a carried object, unless it has a chosen one."""
    if settings_of(item).stiffness.mask:
        return
    group = group if has_mask(item, group) else ""
    if item.type in ("MESH", "CURVES", "POINTCLOUD", "GREASEPENCIL"):
        put_mask(item, group)
    for modifier in item.modifiers:
        if modifier.type == "NODES" and PLAYED_GROUP in (modifier.node_group or ()):
            put_attribute(modifier, "Mask", group)
    keys = item.data.shape_keys if item.type == "LATTICE" else None
    if keys is not None and WARP_KEY in keys.key_blocks:
        keys.key_blocks[WARP_KEY].vertex_group = group


def has_mask(item, group):
    """Whether an object has weights of that name: a vertex group, or a float attribute on hair points."""
    if item.type in ("CURVES", "POINTCLOUD"):
        attribute = item.data.attributes.get(group)
        return attribute is not None and (attribute.domain, attribute.data_type) == ("POINT", "FLOAT")
    return group in item.vertex_groups


def mask_chosen(settings):
    """Update callback of the chosen mask."""
    source = settings.id_data
    put_mask(source, settings.mask)
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            put_carried_mask(entry.item, settings.mask)


property_definitions.listeners["mask"] = mask_chosen
