# SPDX-License-Identifier: GPL-3.0-or-later
"""The Mesh Cache modifier that plays a bake, at the field modifier's place in the stack.

While it plays, the field's modifier is disabled; a new motion of the object enables it again.
"""

import bpy

from ..blender import modifier_stack
from ..blender.evaluation import pace
from ..blender.object_references import settings_of
from ..names import CACHE_MODIFIER
from . import node_group


def play(source, path, start, step):
    """Plays a cache (PC2 or MDD by its suffix) on the object; sample i is frame start + i · step.

    An existing modifier keeps its place, its name and the user's settings. `path` may be relative to the
    .blend. Returns the modifier.
    """
    modifier = modifier_stack.find_cache(source)
    if modifier is None:
        modifier = add(source)
    modifier.cache_format = "MDD" if path.lower().endswith(".mdd") else "PC2"
    modifier.filepath = path
    modifier.time_mode, modifier.play_mode = "FRAME", "SCENE"  # counted in samples
    modifier.frame_scale, modifier.frame_start = 1.0 / (step * pace(bpy.context.scene)), start / step
    set_playing(source, True)
    return modifier


def add(source):
    """Adds the modifier, with the field modifier's Factor and vertex group, if any."""
    field, index = modifier_stack.find(source), modifier_stack.place(source)
    modifier = source.modifiers.new(CACHE_MODIFIER, "MESH_CACHE")
    settings_of(source).bake.uid = modifier.persistent_uid
    if field is not None:
        index += 1
        modifier.factor = node_group.get(field, "Factor")
    group = node_group.mask_of(source)
    modifier.vertex_group = group if group in source.vertex_groups else ""
    source.modifiers.move(source.modifiers.find(modifier.name), index)
    return source.modifiers[index]


def is_playing(source):
    """Whether the object shows its bake."""
    modifier = modifier_stack.find_cache(source)
    return modifier is not None and modifier.show_viewport


def set_playing(source, on, played=None):
    """Shows the bake's modifier, `played` or the point cache's, and hides the field's; or the reverse."""
    played = played or modifier_stack.find_cache(source)
    for modifier, shown in ((played, on), (modifier_stack.find(source), not on)):
        if modifier is not None:
            modifier.show_viewport = modifier.show_render = shown


def suspend(source):
    """Shows the field instead of the bake, before its motion changes; returns whether the bake was shown."""
    playing = is_playing(source)
    if playing:
        set_playing(source, False)
    return playing


MEMBERS = ("cache_format", "filepath", "frame_scale", "frame_start", "show_viewport", "show_render")


def snapshot(source):
    """The state of both modifiers, for restore()."""
    cache, field = modifier_stack.find_cache(source), modifier_stack.find(source)
    return (
        None if cache is None else [getattr(cache, name) for name in MEMBERS],
        None if field is None else (field.show_viewport, field.show_render),
    )


def restore(source, shown):
    """Undoes a play() since the snapshot."""
    of_cache, of_field = shown
    cache, field = modifier_stack.find_cache(source), modifier_stack.find(source)
    if of_cache is None:
        remove(source)
    elif cache is not None:
        for name, value in zip(MEMBERS, of_cache, strict=True):
            setattr(cache, name, value)
    if of_field is not None and field is not None:
        field.show_viewport, field.show_render = of_field


def remove(source):
    """Removes the modifier and shows the field again; the cache file stays."""
    set_playing(source, False)
    modifier = modifier_stack.find_cache(source)
    if modifier is not None:
        source.modifiers.remove(modifier)
    settings_of(source).bake.uid = 0
