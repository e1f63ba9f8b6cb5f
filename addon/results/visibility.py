# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows only the newest of a source and its result objects in one place, and hides the others."""

import contextlib
import json

import numpy as np

from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of


def family(source):
    """The source, and its result objects that are in a scene."""
    results = [entry.item for entry in settings_of(source).results if in_scene(entry.item)]
    return [source, *(item for item in results if item != source)]


def show_alone(source, shown, for_now=False):
    """Hides the rest of the family in the same place as `shown` in viewports and renders, and unhides `shown`
    if it was set aside; `for_now`: until `give_back`. Returns the names of hidden objects.

    If the user hides `shown`, or its collection, nothing else changes.
    """
    if settings_of(shown).set_aside:
        change(shown, False, for_now)
    if shown != source and not shown.visible_get():
        return [shown.name]
    names = []
    for item in family(source):
        seen = not (item.hide_render and item.hide_get())
        if item != shown and seen and (item == source or is_where(shown, item)):
            names.append(item.name)
            change(item, True, for_now)
    return names


def hidden_note(names):
    """Text that names hidden objects, to append to a result's name; empty without any."""
    if not names:
        return ""
    one = translated("{name} is hidden", name=names[0])
    return f" ({translated('{names} are hidden', names=', '.join(names)) if names[1:] else one})"


def is_where(shown, item):
    return np.allclose(item.matrix_world, shown.matrix_world, rtol=1e-5, atol=1e-5)


def change(item, aside, for_now):
    settings = settings_of(item)
    if for_now and not settings.live_hidden:
        settings.live_hidden = json.dumps([item.hide_get(), item.hide_render, settings.set_aside])
    settings.set_aside = aside
    put(item, aside, aside)


def put(item, hidden, hidden_in_renders):
    item.hide_render = hidden_in_renders
    with contextlib.suppress(RuntimeError):  # in a collection that the view layer leaves out
        item.hide_set(hidden)


def give_back(source):
    """Restores the family's visibility from before `for_now`."""
    for item in family(source):
        settings = settings_of(item)
        if settings.live_hidden:
            hidden, hidden_in_renders, settings.set_aside = json.loads(settings.live_hidden)
            put(item, hidden, hidden_in_renders)
            settings.live_hidden = ""


def show_landmarks(source, shown):
    """Shows or hides the landmarks of a source's wrap in viewports; those elsewhere stay as they are."""
    for entry in settings_of(source).wrap.landmarks:
        for item in (entry.rest, entry.on_target):
            if item is not None:
                with contextlib.suppress(RuntimeError):  # in a collection that the view layer leaves out
                    item.hide_set(not shown)


def forget(source):
    """Makes visibility set `for_now` permanent."""
    for item in family(source):
        settings_of(item).live_hidden = ""
