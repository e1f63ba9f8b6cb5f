# SPDX-License-Identifier: GPL-3.0-or-later
"""Every section and menu draws in every state, naming only properties, operators and menus that exist."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.panels import drawn, each_task, prepared

    import addon.registration as registration
    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

STATES = [
    "nothing",
    "a camera",
    "a mesh",
    "modifiers and keys",
    "edit mode",
    "handles",
    "a handle active",
    "a deleted handle",
    "a group's handle",
    "fitted",
    "fit cleared",
    "custom style",
    "live",
    "running",
    "a failure",
    "library missing",
]


EXPECTED = {
    "nothing": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a camera": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a mesh": ("ARAPFIELDS_PT_surface", "Not fitted yet"),
    "modifiers and keys": ("ARAPFIELDS_PT_status", "Works before S"),
    "edit mode": ("ARAPFIELDS_PT_source", "Bar is in Edit Mode; leave it first"),
    "a handle active": ("ARAPFIELDS_PT_tasks", "Bar"),
    "a deleted handle": ("ARAPFIELDS_PT_handles", "(deleted)"),
    "fitted": ("ARAPFIELDS_PT_surface", "Fit in the cache"),
    "fit cleared": ("ARAPFIELDS_PT_surface", "Fit was cleared"),
    "custom style": ("ARAPFIELDS_PT_stylize", "Normals Of"),
    "live": ("ARAPFIELDS_PT_deform", "Finish Pose"),
    "running": ("ARAPFIELDS_PT_deform", "Cancel Deform"),
    "a failure": ("ARAPFIELDS_PT_status", "Bar: the mesh has no faces"),
    "library missing": ("ARAPFIELDS_PT_source", "The native library is not part of this"),
}


@pytest.mark.parametrize("state", STATES)
def test_the_panel_draws(state):
    jobs.board.messages.clear()
    undo = prepared(state)
    try:
        texts_of = drawn()
    finally:
        undo()
    shown = [name for name in texts_of if "_PT_" in name]
    if state == "library missing" or state in ("nothing", "a camera"):
        assert shown == ["ARAPFIELDS_PT_source"]
    else:
        said = "ARAPFIELDS_PT_status" in shown
        hinders = "ARAPFIELDS_PT_source" in shown
        assert len(shown) == 18 + said + hinders and hinders == (state == "edit mode")
        assert said == (state in ("modifiers and keys", "fitted", "fit cleared", "a failure"))
    if state in EXPECTED:
        section, text = EXPECTED[state]
        assert text in " ".join(texts_of[section]), texts_of[section]  # long texts take several labels


def test_each_task_shows_its_few_sections():
    scenes.bar_with_handles()
    shown = {}
    for task in each_task():
        classes = [cls for module in registration.MODULES for cls in module.CLASSES]
        panels = [c for c in classes if issubclass(c, bpy.types.Panel) and not hasattr(c, "bl_parent_id")]
        shown[task] = {c.bl_label for c in panels if c.poll(bpy.context)}
    always = {"Tasks", "Bake and Export", "Advanced"}
    assert {task: names - always for task, names in shown.items()} == {
        "POSE": {"Handles", "Deform", "Carried Objects", "Contact"},
        "STYLE": {"Stylize", "Carried Objects", "Contact"},
        "WRAP": {"Wrap", "Carried Objects"},
        "RIG": {"Skin", "Poses"},
    }
    assert all(always <= names for names in shown.values())


def test_every_grey_button_says_why():
    """Each operator's poll either holds or gives a reason, in states where it does not hold."""
    polled = [
        cls
        for module in registration.MODULES
        for cls in getattr(module, "CLASSES", [])
        if issubclass(cls, bpy.types.Operator) and "poll" in dir(cls)
    ]
    assert len(polled) > 10
    for state in ("nothing", "edit mode", "running", "library missing", "a mesh"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        undo = prepared(state)
        refused = 0
        try:
            for cls in polled:
                group, name = cls.bl_idname.split(".")
                operator = getattr(getattr(bpy.ops, group), name)
                if operator.poll():
                    continue
                refused += 1
                try:
                    operator()
                except RuntimeError as error:
                    reason = str(error).split("poll()")[-1].strip()
                    assert not reason.startswith("failed, context is incorrect"), (cls.__name__, state)
        finally:
            undo()
        assert refused > 0, state
