# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool knows its object, the active one; others are pinned by Alt. A label says what a press does."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.pins import from_above, pin

    from addon.live import sessions
    from addon.pin_tool import drag, hints, hover, pins

pytestmark = pytest.mark.in_blender


def stacked():
    """A bar, active, and another one above the half of it."""
    bar, above = scenes.bar(), scenes.bar("Above")
    above.location = (1.0, 0.0, 1.0)
    scenes.activate(bar)
    bpy.context.view_layer.update()
    return bar, above


def under(x, **given):
    target = hover.under(bpy.context, from_above(x), **given)
    return target and (target.kind, target.source.name)


def test_a_press_pins_the_active_object_alone():
    _, above = stacked()
    assert under(-0.5) == ("SURFACE", "Bar")
    assert under(0.5) == ("OTHER", "Above")
    assert under(0.5, other=True) == ("SURFACE", "Above")
    scenes.activate(above)
    assert under(0.5) == ("SURFACE", "Above") and under(-0.5) == ("OTHER", "Bar")
    bpy.context.view_layer.objects.active = None
    assert under(0.5) == ("SURFACE", "Above") and under(-0.5) == ("SURFACE", "Bar")


def test_what_is_pinned_by_the_key_is_the_object_from_then_on():
    _, above = stacked()
    target = hover.under(bpy.context, from_above(0.5), other=True)
    dragged = drag.of_new_pin(bpy.context, target.source.get(), target.location, 0.1)
    dragged.end(bpy.context)
    assert bpy.context.view_layer.objects.active == above and under(0.6) == ("SURFACE", "Above")


def test_what_active_objects_carry_is_pinned_by_them():
    bar, above = stacked()
    scenes.activate(above, bar)
    bpy.ops.arapfields.carry()
    assert under(0.5) == ("SURFACE", "Bar")
    scenes.activate(above)
    assert under(0.5) == ("SURFACE", "Bar")


def test_the_label_says_what_a_press_does():
    bar, _ = stacked()
    empty = pin(bar, (-0.5, 0.0, 0.25))
    handle = hover.Target("HANDLE", hover.ObjectReference(bar), hover.ObjectReference(empty))
    ring = hover.Target("RING", hover.ObjectReference(bar), hover.ObjectReference(empty))
    said = [hints.label(hover.under(bpy.context, from_above(x))) for x in (-0.9, 0.5)]
    assert said == ["Pin Bar", "Alt-click to pin Above"]
    assert [hints.label(one) for one in (handle, ring)] == ["Drag Pin 1", "Turn Pin 1"]
    pins.entry_of(empty).anchor = True
    assert hints.label(handle) == "Choose Pin 1, an anchor"
    sessions.end(bpy.context, bar)
    bar.arapfields.result = "NEW"
    assert hints.label(hover.under(bpy.context, from_above(-0.9))).startswith("Pins move Bar itself")
    texts = {hints.keys(one, None) for one in (handle, ring, None)} | {hints.keys(None, object())}
    assert len(texts) == 4 and "" in texts
