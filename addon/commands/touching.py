# SPDX-License-Identifier: GPL-3.0-or-later
"""Obstacles and other contact settings from flags, in addition to the objects' own settings."""

import math
from pathlib import Path

import bpy

from arapfields.cli.command_line import name_and_margin

from ..blender.object_references import settings_of
from ..contact.obstacles import add
from ..core.errors import UserError
from .files import READ


def parts(text):
    """(name, margin) of "name:margin"."""
    name, margin = name_and_margin(text, lambda whole: whole in bpy.data.objects)
    if not 0.0 <= margin < math.inf:
        raise UserError(f"--obstacle: {text}: the margin is negative, or no number")
    return name, margin


def named(options):
    """The names of the obstacles, which are not solved themselves."""
    return {parts(text)[0] for text in getattr(options, "obstacle", None) or ()}


def set_contact(sources, options):
    """Applies the flags to the sources' contact settings; each obstacle file is read once."""
    obstacles = [(found(name, options), margin) for name, margin in map(parts, options.obstacle or ())]
    for source in sources:
        group = settings_of(source).contact
        for item, margin in obstacles:
            add(source, item, margin)
        if options.ground is not None:
            group.use_ground, group.ground = True, options.ground
        if options.itself is not None:
            group.itself = options.itself
        group.use |= bool(obstacles) or options.ground is not None or bool(options.itself)


def found(name, options):
    """The object of that name, or the mesh of the file."""
    item, path = bpy.data.objects.get(name), Path(name)
    if item is None:
        if path.suffix.lower() not in READ or not path.is_file():
            raise UserError(f"--obstacle: {name}: no object of {options.input}, and no mesh file")
        before = set(bpy.data.objects)
        READ[path.suffix.lower()](str(path))
        item = next(iter(set(bpy.data.objects) - before), None)
        bpy.context.view_layer.update()
    if item is None or item.type != "MESH":
        raise UserError(f"--obstacle: {name}: is no mesh")
    return item
