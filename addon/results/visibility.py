# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a source and what was made of it, only the newest is seen in one place: the others are set aside."""

import contextlib
import json

import numpy as np

from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of


def family(source):
    """The source, and its results that are in a scene."""
    results = [entry.item for entry in settings_of(source).results if in_scene(entry.item)]
    return [source, *(item for item in results if item != source)]


def show_alone(source, shown, for_now=False):
    """Hides what else of the family lies in the place of `shown`, from viewport and renders, and shows that
    again where it had been set aside itself; `for_now`: until `give_back`. Returns names of what is hidden.

    Where the user hides `shown`, by its collection maybe, all else stays as it is.
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
    """That these are hidden now, to be put behind the name of a result; empty where none is."""
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
    """Shows and hides the family as it was before what was `for_now`."""
    for item in family(source):
        settings = settings_of(item)
        if settings.live_hidden:
            hidden, hidden_in_renders, settings.set_aside = json.loads(settings.live_hidden)
            put(item, hidden, hidden_in_renders)
            settings.live_hidden = ""


def forget(source):
    """What was `for_now` stays."""
    for item in family(source):
        settings_of(item).live_hidden = ""
