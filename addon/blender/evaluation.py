# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender has evaluated of the scene.

`context.evaluated_depsgraph_get()` crashes where a script's temp_override() is in force: up to Python 3.11 it
reads that without Python's lock while a worker has it. The window's own events are never in one.
"""


def depsgraph_of(context):
    """What Blender has evaluated last; nothing is evaluated for it."""
    return context.view_layer.depsgraph or updated(context.view_layer)


def updated(layer):
    """A view layer's depsgraph, evaluated anew where anything has changed."""
    layer.update()
    return layer.depsgraph
