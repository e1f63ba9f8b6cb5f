# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the panel's sections, one open at a time, and of the handles in the viewport."""

import bpy
import stage

SECTIONS = ("source", "surface", "handles", "deform", "stylize", "result", "status")


def checks(found, folder):
    bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
    bar.modifiers.new("Subdivision", "SUBSURF")
    moving.location.z, moving.rotation_euler.y = 0.45, -0.5
    yield 1.0
    stage.picture(folder, "handles")
    for name in SECTIONS:
        alone(name)
        yield 1.5
        stage.picture(folder, f"panel-{name}")
    alone(*SECTIONS)
    bar.modifiers.clear()
    found["sections"] = len(SECTIONS)


def alone(*names):
    """Only these sections are open: registered anew, since a panel's state cannot be set."""
    import addon.panels as panels

    for section in panels.SECTIONS:
        cls = next(c for c in section.CLASSES if issubclass(c, bpy.types.Panel))
        bpy.utils.unregister_class(cls)
        options = set(getattr(cls, "bl_options", set())) - {"DEFAULT_CLOSED"}
        closed = cls.__name__.rsplit("_", 1)[1] not in names
        cls.bl_options = options | ({"DEFAULT_CLOSED"} if closed else set())
        bpy.utils.register_class(cls)
    stage.show_sidebar()
