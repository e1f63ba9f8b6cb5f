# SPDX-License-Identifier: GPL-3.0-or-later
"""What a press would do, beside the cursor, and the keys, in the status bar."""

import bpy

from ..blender import host
from ..blender.language import translated
from ..jobs.display import show_status
from . import pins
from .drawing import is_active
from .hover import hover

INTERVAL = 0.3  # seconds between checks whether the tool is still in use


def label(target):
    """What a press on a Target does."""
    source = target.source.find()
    if source is None:
        return ""
    if target.kind == "REFUSED":
        reason = pins.refusal(source)
        return "" if reason is None else translated(reason)
    if target.kind == "OTHER":
        return translated("Alt-click to pin {name}", name=source.name)
    if target.kind == "SURFACE":
        return translated("Pin {name}", name=source.name)
    empty = target.empty.find()
    entry = None if empty is None else pins.entry_of(empty)
    if entry is None:
        return ""
    if target.kind == "RING":
        return translated("Turn {name}", name=empty.name)
    if entry.anchor:
        return translated("Choose {name}, an anchor", name=empty.name)
    return translated("Drag {name}", name=empty.name)


def keys(target, drag):
    """What keys and buttons do for a Target under the cursor, or in a drag; "" without both."""
    if drag is not None:
        return translated("Release: keep   Esc or right button: cancel   Ctrl and wheel: reach")
    if target is None:
        return ""
    return {
        "SURFACE": translated("Drag: pin and move   Shift-click: anchor   F: radius of new pins"),
        "HANDLE": translated("Drag: move   Shift-click: anchor or pin   Ctrl-click or X: delete   R: turn"),
        "RING": translated("Drag: turn   R: turn about an axis   Esc: cancel"),
        "OTHER": translated("Alt-click: pin this object instead"),
    }.get(target.kind, "")


class Status:
    """The text that the tool has put into the status bar; "" where it has Blender's own."""

    text = ""

    def show(self, text):
        if text == self.text:
            return
        self.text = text
        show_status(text)
        if text:
            host.start(watch, first=INTERVAL, persistent=True)

    def clear(self):
        self.show("")

    def __bool__(self):
        return bool(self.text)


status = Status()


def refresh():
    """Shows the keys for what is under the cursor or dragged."""
    status.show(keys(hover.target, hover.drag))


def watch():
    """Timer callback: once another tool is taken, the status bar is Blender's again."""
    if not is_active(bpy.context):
        hover.clear()
        status.clear()
    return INTERVAL if status.text else None
