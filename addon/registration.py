# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension registers, in order: a table of contents."""

import atexit

import bpy

from . import commands, install_check, panels, preferences
from .bridge import counting, host, jobs, loading, overlay, pictures, preview, staleness, translations
from .bridge import live as live_mode
from .operators import bake, deform, extract, fit, handles, live, presets, status, styles, stylize
from .properties import handle, item, settings

MODULES = [
    *(
        handle,
        settings,
        item,
        preferences,
        jobs,
        loading,
        counting,
        live_mode,
        overlay,
        preview,
        pictures,
        translations,
        staleness,
    ),
    *(fit, handles, deform, live, bake, stylize, styles, presets, extract, status),
    *panels.SECTIONS,
    commands,
    install_check,
]


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
