# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as Blender properties, as options of the library, and with the defaults of older files."""

import bpy

from ..core.runtime import native
from ..core.settings.parameters import TABLE, native_options
from ..names import CONTEXT
from .user_preferences import machine_options

# Parameters as Blender properties, and the effective values of an operator call.

listeners = {}  # {name of a property: function called with its group after a change}


def tells(name):
    """The `update` callback of a property, which calls its listener."""
    return lambda group, _: listeners[name](group)


def colour(description):
    """A colour property for the viewport."""
    return bpy.props.FloatVectorProperty(
        name="Color",
        description=description,
        subtype="COLOR_GAMMA",
        default=(0.27, 0.55, 1.0),
        min=0.0,
        max=1.0,
    )


def _kind(definition, *arguments):
    """The bpy.props function with positional `arguments`, name and description."""
    names = (*arguments, "name", "description")
    own = {"translation_context": CONTEXT}
    return lambda *values, **extra: definition(**dict(zip(names, values, strict=True)), **own, **extra)


text, flag = _kind(bpy.props.StringProperty), _kind(bpy.props.BoolProperty)
integer, number = _kind(bpy.props.IntProperty), _kind(bpy.props.FloatProperty)
choice = _kind(bpy.props.EnumProperty, "items")
pointer, collection = _kind(bpy.props.PointerProperty, "type"), _kind(bpy.props.CollectionProperty, "type")

# Option of paths that may start with //; before Blender 4.5 every path may.
IS_RELATIVE = "is_path_supports_blend_relative"
RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if IS_RELATIVE in bpy.types.Property.bl_rna.properties else set()


def path_text(name, description, kind, options=(), **extra):
    """A string property for the path of a FILE or a DIR."""
    return text(name, description, subtype=f"{kind}_PATH", options={*options, *RELATIVE}, **extra)


def annotations(parameters, **extra):
    """{name: property definition} of these parameters."""
    return {p.name: definition(p, **extra) for p in parameters}


def group_annotations(parameters):
    """The same for a PropertyGroup: if 0 has a special meaning, also a switch and a number above 0.

    Files, F-curves and scripts use the one value.
    """
    annotated = annotations(parameters)
    for p in parameters:
        if p.zero:
            annotated |= {p.switch: switch(p), p.number: number_above_zero(p)}
    return annotated


def switch(p):
    """Boolean that is true if the value is 0; switching it off sets the value offered instead."""
    label, meaning, instead = p.zero

    def put(group, is_on):
        if is_on != (getattr(group, p.name) == 0):
            setattr(group, p.name, 0.0 if is_on else instead)

    return flag(label, f"{p.label}: {meaning}", get=lambda group: getattr(group, p.name) == 0, set=put)


def number_above_zero(p):
    """The value, or the one offered instead of 0."""
    least = p.zero[2] / 1000
    return number(
        p.label,
        p.plain,
        get=lambda group: getattr(group, p.name) or p.zero[2],
        set=lambda group, value: setattr(group, p.name, max(value, least)),
        **{**limits(p), "min": least, "soft_min": least},
    )


def limits(p):
    found = {"min": p.low, "max": p.high, "soft_min": p.soft_low, "soft_max": p.soft_high}
    if isinstance(p.default, float):
        found["precision"] = 4 if 0 < (p.default or (p.zero and p.zero[2]) or 1.0) < 0.1 else 2
        if p.soft_low <= 0.01 and p.soft_high == 1.0:
            found["subtype"] = "FACTOR"
    return found


def definition(parameter, **extra):
    """One parameter as a bpy.props definition."""
    p = parameter
    common = {"name": p.label, "description": p.tip, "translation_context": CONTEXT, **extra}
    if p.items:
        return bpy.props.EnumProperty(items=p.items, default=p.default, **common)
    if isinstance(p.default, bool):
        return bpy.props.BoolProperty(default=p.default, **common)
    kind = bpy.props.IntProperty if isinstance(p.default, int) else bpy.props.FloatProperty
    return kind(default=p.default, **limits(p), **common)


def effective_values(parameters, group, operator=None):
    """{name: value}: the operator's arguments if given, else the object's settings."""
    return {p.name: from_single_precision(effective_value(p.name, group, operator)) for p in parameters}


def from_single_precision(value):
    """The decimal number that a single-precision float stands for: 0.01 for 0.0099999998."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


def effective_value(name, group, operator):
    """One setting: the operator's argument if given, else the object's."""
    given = operator is not None and operator.properties.is_property_set(name)
    return getattr(operator if given else group, name)


# Converts settings by name to the native library's options structs.


def options_of(operation, values, machine=None):
    """The native options of an operation of the table, from its settings and those of the machine.

    Settings that the options struct lacks are left out. `machine`: machine_options() read earlier; None
    reads the preferences, on the main thread only.
    """
    machine = machine_options() if machine is None else machine
    options = getattr(native.library(), TABLE[operation]["struct"])
    return options(**native_options(operation, {**values, **machine}))
