# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension registers, in order: a table of contents."""

import atexit
import importlib

import bpy

from .blender import host

CONTENTS = [  # modules with CLASSES, or with register() and unregister()
    # what is stored in the .blend: object.arapfields
    *("handles.properties", "properties.settings", "properties.item"),
    "preferences",
    # what goes on beside the operators
    *("jobs.job_operator", "jobs.loading", "handles.counts", "live.sessions", "surface.staleness"),
    *("viewport.handle_boxes", "viewport.previews"),
    *("blender.icons", "blender.translations"),
    # features
    *("surface.operators", "surface.panel"),
    *("handles.operators", "handles.panel"),
    *("deform.operators", "deform.panel"),
    *("stylize.operators", "stylize.panel"),
    *("live.operators", "animation.operators"),
    *("results.panel", "jobs.operators", "jobs.panel"),
    # without a window, and without a library
    *("commands", "install_check"),
]
MODULES = [importlib.import_module(f".{name}", __package__) for name in CONTENTS]


_done = []  # what is registered, in order


def register():
    try:
        for module in MODULES:
            _done.append(module)
            _register(module)
    except Exception:
        unregister()
        raise
    if host.is_module():
        # Python's own bpy shuts down as its last reference goes; classes still registered would keep it
        # alive into the process's exit handlers, where it waits for a thread of its own for ever.
        atexit.register(unregister)


def unregister():
    """Undoes register(), once: Blender calls it too when it ends and switches its add-ons off."""
    atexit.unregister(unregister)
    while _done:
        _unregister(_done.pop())


def _register(module):
    for cls in getattr(module, "CLASSES", []):
        bpy.utils.register_class(cls)
    if hasattr(module, "register"):
        module.register()


def _unregister(module):
    if hasattr(module, "unregister"):
        module.unregister()
    for cls in reversed(getattr(module, "CLASSES", [])):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
