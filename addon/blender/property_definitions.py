# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as Blender's properties, and the values that count for one call."""

import bpy

listeners = {}  # name of a property → what is called with its group where the user changes it


def tells(name):
    """The `update` of a property that only its listener understands."""
    return lambda group, _: listeners[name](group)


def _kind(definition, *arguments):
    """The same definition with these arguments, its name and its description by position."""
    names = (*arguments, "name", "description")
    return lambda *values, **extra: definition(**dict(zip(names, values, strict=True)), **extra)


text, flag = _kind(bpy.props.StringProperty), _kind(bpy.props.BoolProperty)
integer, number = _kind(bpy.props.IntProperty), _kind(bpy.props.FloatProperty)
choice = _kind(bpy.props.EnumProperty, "items")
pointer, collection = _kind(bpy.props.PointerProperty, "type"), _kind(bpy.props.CollectionProperty, "type")

# Of a path that may begin with //; before Blender 4.5 every path may.
IS_RELATIVE = "is_path_supports_blend_relative"
RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if IS_RELATIVE in bpy.types.Property.bl_rna.properties else set()


def path_text(name, description, kind, options=(), **extra):
    """A text that is the path of a FILE or a DIR."""
    return text(name, description, subtype=f"{kind}_PATH", options={*options, *RELATIVE}, **extra)


def annotations(parameters, **extra):
    """Property definitions for a class that shows these parameters."""
    return {p.name: definition(p, **extra) for p in parameters}


def definition(parameter, **extra):
    """One parameter as a bpy.props definition."""
    p = parameter
    common = {"name": p.label, "description": p.tip, **extra}
    if p.items:
        return bpy.props.EnumProperty(items=p.items, default=p.default, **common)
    if isinstance(p.default, bool):
        return bpy.props.BoolProperty(default=p.default, **common)
    limits = {"min": p.low, "max": p.high, "soft_min": p.soft_low, "soft_max": p.soft_high}
    if isinstance(p.default, int):
        return bpy.props.IntProperty(default=p.default, **limits, **common)
    precision = 4 if 0 < p.default < 0.1 else 2
    return bpy.props.FloatProperty(default=p.default, precision=precision, **limits, **common)


def effective_values(parameters, group, operator=None):
    """Values by name: the operator's arguments where given, else the object's settings."""
    return {p.name: from_single_precision(effective_value(p.name, group, operator)) for p in parameters}


def from_single_precision(value):
    """Blender keeps floats in single precision: 0.01 as 0.0099999998. The number that was meant."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


def effective_value(name, group, operator):
    """One setting: the operator's argument where given, else the object's."""
    given = operator is not None and operator.properties.is_property_set(name)
    return getattr(operator if given else group, name)
