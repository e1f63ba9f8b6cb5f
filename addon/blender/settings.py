# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as Blender properties, and the settings in force for one call."""

import os
import tempfile
from pathlib import Path

import bpy

from ..core.runtime.fit_cache import FitCache
from ..names import PACKAGE


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
    limits = {"min": p.low, "max": p.high, "soft_max": p.high if p.soft_high is None else p.soft_high}
    if isinstance(p.default, int):
        return bpy.props.IntProperty(default=p.default, **limits, **common)
    precision = 4 if 0 < p.default < 0.1 else 2
    return bpy.props.FloatProperty(default=p.default, precision=precision, **limits, **common)


def in_force(parameters, group, operator):
    """Values by name: the operator's arguments where given, else the object's settings."""
    return {p.name: plain(chosen(p.name, group, operator)) for p in parameters}


def plain(value):
    """Blender keeps floats in single precision: 0.01 as 0.0099999998. The number that was meant."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


def chosen(name, group, operator):
    """One setting: the operator's argument where given, else the object's."""
    return getattr(operator if operator.properties.is_property_set(name) else group, name)


def preferences():
    """The add-on's preferences; None where it runs from its source folder."""
    entry = bpy.context.preferences.addons.get(PACKAGE)
    return entry.preferences if entry else None


def machine_options():
    """Options that depend on the machine alone."""
    ours = preferences()
    return {"threads": ours.threads, "device": ours.device} if ours else {}


def show_boxes():
    """Whether the handles' boxes are drawn in the viewport."""
    ours = preferences()
    return ours is None or ours.show_boxes


def show_previews():
    """Whether what a running job has so far is drawn in the viewport."""
    ours = preferences()
    return ours is None or ours.show_previews


def cache_folder():
    """Where fits are kept: the user's choice, Blender's folder for extensions, or a temporary one."""
    ours = preferences()
    if ours and ours.cache_folder:
        return Path(bpy.path.abspath(ours.cache_folder))
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, path="fits", create=False))
    except ValueError:  # not run as an extension
        return (
            Path(tempfile.gettempdir())
            / f"arapfields-fits-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        )


def fit_cache():
    return FitCache(cache_folder())
