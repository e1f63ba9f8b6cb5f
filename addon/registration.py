# SPDX-License-Identifier: GPL-3.0-or-later
"""What the extension registers, in order: a table of contents. lifecycle.py has what runs beside it."""

import atexit
import importlib

import bpy

from . import lifecycle, object_properties
from .blender import host, source_operator

CONTENTS = [  # modules with CLASSES
    # what is stored in the .blend: object.arapfields
    *("handles.properties", "properties.choices", "pin_tool.properties", "live.properties"),
    *("stiffness.properties", "animation.properties", "wrap.properties", "skin.properties"),
    "contact.properties",
    "object_properties",
    # features
    *("tasks.panel", "surface.operators"),
    *("handles.operators", "handles.resizing", "handles.left_behind", "handles.panel"),
    *("deform.operators", "deform.subdividing", "deform.panel"),
    *("stylize.operators", "stylize.panel"),
    *("wrap.operators", "wrap.landmark_tools", "wrap.refitting", "wrap.sheet", "wrap.panel"),
    *("skin.operators", "carried.operators", "poses.operators", "stiffness.operators"),
    "contact.operators",
    *("live.operators", "live.panel", "pin_tool.operators"),
    *("animation.operators", "animation.exporters", "animation.splat_export"),
    *("results.operators", "results.panel", "jobs.operators", "jobs.panel"),
    *("menus", "preferences"),
]
MODULES = [importlib.import_module(f".{name}", __package__) for name in CONTENTS]
CLASSES = [cls for module in MODULES for cls in module.CLASSES]


def register():
    try:
        for cls in CLASSES:
            bpy.utils.register_class(cls)
        object_properties.attach()
        source_operator.begin(CLASSES)
        lifecycle.register()
    except Exception:
        unregister()
        raise
    atexit.register(lifecycle.end_threads)
    if host.is_module():
        # Python's own bpy shuts down as its last reference goes; classes still registered would keep it
        # alive into the process's exit handlers, where it waits for a thread of its own for ever.
        atexit.register(unregister)


def unregister():
    """Undoes register(), or what it did before it failed; once: Blender calls it too when it ends."""
    atexit.unregister(unregister)
    atexit.unregister(lifecycle.end_threads)
    lifecycle.unregister()
    source_operator.end()
    object_properties.detach()
    for cls in reversed(CLASSES):
        if "bl_rna" in vars(cls):  # is registered; gizmo groups have no other way to tell
            bpy.utils.unregister_class(cls)
