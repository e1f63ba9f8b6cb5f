# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame range of the animation of a source's handles, style or target."""

import bpy

from ..blender.object_references import settings_of
from ..blender.references import parts_of, references
from ..handles import empties, movers
from .contact import listed


def animation_range(source, kind):
    """(first, last) frame of the animation of the source, its handles, style or target; None without
    animation."""
    ranges = [span for item in involved(source, kind) for span in ranges_of(item)]
    return (min(first for first, _ in ranges), max(last for _, last in ranges)) if ranges else None


def scene_range(scene):
    """(first, last) frame of the scene, or of its preview range if that is on."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def involved(source, kind):
    """The data-blocks whose animation a source's shape follows, with their dependencies; each once."""
    settings = settings_of(source)
    used, style = [source], settings.stylize
    if kind == "WRAP":
        used.append(settings.wrap.onto)
    if kind == "DEFORM" or (kind == "STYLIZE" and style.use_handles):
        used += [movers.mover_of(entry) for entry in empties.used(source)]
    if kind == "STYLIZE":
        used += [style.frame_object, style.style_object]
    if kind != "WRAP" and settings.contact.use:
        used += [item for entry in settings.contact.obstacle_list for item in listed(entry)]
    found = {}
    while used:
        one = used.pop()
        if one is None or one in found:
            continue
        found[one] = None
        used += [getattr(one, name, None) for name in ("parent", "data", "shape_keys")]
        used += [item for part in parts_of(one) for item in read_by(part)]
    return list(found)


def read_by(part):
    """The objects that a modifier or constraint reads, or the data-block that a driver's variable reads."""
    kind = bpy.types.ID if isinstance(part, bpy.types.DriverTarget) else bpy.types.Object
    return [value for _, value in references(part) if isinstance(value, kind)]


def ranges_of(item):
    """(first, last) frame of each action and unmuted NLA strip of a data-block."""
    data = getattr(item, "animation_data", None)
    if data is None:
        return
    if data.action is not None:
        yield tuple(data.action.frame_range)
    for track in data.nla_tracks:
        for strip in track.strips:
            if not track.mute and not strip.mute:
                yield strip.frame_start, strip.frame_end
