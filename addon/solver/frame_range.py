# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames the animation of a source's handles, style or target spans."""

from ..blender.actions import bags_of
from ..blender.object_references import settings_of
from ..handles import empties, movers


def animation_range(source, kind):
    """(first, last) frame of all that moves the handles, the style, the target or the source; None where
    nothing does."""
    ranges = [span for item in involved(source, kind) for span in ranges_of(item)]
    return (min(first for first, _ in ranges), max(last for _, last in ranges)) if ranges else None


def scene_range(scene):
    """(first, last) frame of the scene, or of its preview where that is on."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def involved(source, kind):
    """The objects, and what they hang on, whose animation a source's shape follows; each once."""
    style = settings_of(source).stylize
    used, onto = [source], settings_of(source).wrap.onto
    if kind == "WRAP" and onto is not None:
        used.append(onto)
    if kind == "DEFORM" or (kind == "STYLIZE" and style.use_handles):
        used += [movers.mover_of(entry) for entry in empties.used(source)]
    if kind == "STYLIZE":
        used += [item for item in (style.frame_object, style.style_object) if item is not None]
    objects = {}
    while used:
        item = used.pop()
        if item.name_full in objects:
            continue
        objects[item.name_full] = item
        used += [] if item.parent is None else [item.parent]
        targets = [getattr(constraint, "target", None) for constraint in item.constraints]
        targets += [getattr(modifier, "object", None) for modifier in item.modifiers]
        used += [target for target in targets if target is not None]
        used += drivers(item)
    return list(objects.values())


def drivers(item):
    """The objects from which drivers of this one read."""
    data = item.animation_data
    targets = [
        target.id
        for curve in (data.drivers if data else ())
        for variable in curve.driver.variables
        for target in variable.targets
    ]
    return [target for target in targets if hasattr(target, "matrix_world")]


def ranges_of(item):
    """(first, last) of each action and strip that moves an object."""
    for data in [one.animation_data for one in (item, getattr(item.data, "shape_keys", None)) if one]:
        if data is None:
            continue
        if data.action is not None:
            yield tuple(data.action.frame_range)
        for track in data.nla_tracks:
            for strip in track.strips:
                if not track.mute and not strip.mute:
                    yield strip.frame_start, strip.frame_end


def has_keys(item, path):
    """Whether an object's own action moves properties whose path begins like that."""
    data = item.animation_data
    action = data.action if data is not None else None
    return action is not None and any(curve.data_path.startswith(path) for curve in curves_of(action))


def curves_of(action):
    """An action's curves."""
    for bag in bags_of(action):
        yield from bag.fcurves
