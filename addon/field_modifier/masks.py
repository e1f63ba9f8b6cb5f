# SPDX-License-Identifier: GPL-3.0-or-later
"""The vertex group that says how far each point of a source goes of the way: the Mask of its modifiers."""

from ..blender import modifier_stack, property_definitions
from ..blender.object_references import settings_of
from . import inputs


def group_of(source):
    """Name of the source's mask: the one chosen in the panel, else the one of its field's modifier; or ""."""
    chosen, modifier = settings_of(source).stiffness.mask, modifier_stack.find(source)
    return chosen or ("" if modifier is None else inputs.get_attribute(modifier, "Mask"))


def take(source):
    """Has a new modifier, or one that is used again, take the mask that is chosen in the panel, if any."""
    chosen = settings_of(source).stiffness.mask
    if chosen and group_of_field(source) != chosen:
        put(source, chosen)


def group_of_field(source):
    modifier = modifier_stack.find(source)
    return None if modifier is None else inputs.get_attribute(modifier, "Mask")


def put(source, group):
    """Gives the field's modifier, and that of a bake, this group, or with "" none."""
    field, cache = modifier_stack.find(source), modifier_stack.find_cache(source)
    if field is not None:
        inputs.put_attribute(field, "Mask", group)
    if cache is not None:
        cache.vertex_group = group if group in source.vertex_groups else ""


def chosen(settings):
    """The user has chosen another group."""
    put(settings.id_data, settings.mask)


property_definitions.listeners["mask"] = chosen
