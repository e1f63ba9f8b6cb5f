# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's guide: its pages in tooltips, and by a right click on a button or a setting."""

from pathlib import Path

import bpy

from ..names import CONTEXT
from .language import translated

ADDON = Path(__file__).resolve().parents[1]
FOLDERS = ((ADDON / "guide", "html"), (ADDON.parent / "docs/guide", "md"))  # as shipped; in a clone
SETTINGS = {  # class of properties → page
    "ARAPFIELDS_PG_fit": "surface",
    "ARAPFIELDS_PG_deform": "deform",
    "ARAPFIELDS_PG_stylize": "stylize",
    "ARAPFIELDS_PG_wrap": "wrap",
    "ARAPFIELDS_PG_landmark": "wrap",
    "ARAPFIELDS_PG_handle": "handles",
    "ARAPFIELDS_PG_scene": "pins",
    "ARAPFIELDS_PG_skin": "characters",
    "ARAPFIELDS_PG_carried": "characters",
    "ARAPFIELDS_PG_stiffness": "characters",
    "ARAPFIELDS_PG_secondary": "motion",
    "ARAPFIELDS_PG_contact": "motion",
    "ARAPFIELDS_PG_obstacle": "motion",
    "ARAPFIELDS_PG_bake": "animation",
    "ARAPFIELDS_PG_object": "results",
}
LABELS = {
    "surface": "Implicit Surface",
    "handles": "Handles",
    "pins": "Pins",
    "characters": "Characters",
    "deform": "Deform",
    "stylize": "Stylize",
    "wrap": "Wrap",
    "results": "Result",
    "animation": "Animation",
    "motion": "Secondary Motion",
    "jobs": "Status",
}
pages = {}  # pattern of Blender's names → page, while the extension is on


class Guided:
    """Mixin of operators: `guide` is the page that explains them, which their tooltips name.

    Where `obstacle` has a reason they are greyed out, and the tooltip says it.
    """

    guide = ""
    bl_translation_context = CONTEXT

    def __init_subclass__(cls):
        """ARAPFIELDS_OT_fit is arapfields.fit, which names.py lists."""
        super().__init_subclass__()
        if cls.__name__.startswith("ARAPFIELDS_OT_"):
            cls.bl_idname = cls.__name__.replace("ARAPFIELDS_OT_", "arapfields.")

    @classmethod
    def poll(cls, context):
        reason = cls.obstacle(context)
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    @classmethod
    def obstacle(cls, context):
        """Why the operator cannot run now, as a UserError; None where it can."""
        return None

    @classmethod
    def description(cls, context, properties):
        page = translated("Guide: {page}", page=translated(LABELS[cls.guide]))
        return f"{translated(cls.__doc__)}.\n{page}"


def begin(classes):
    """Tells Blender the pages of all registered operators and settings."""
    for cls in classes:
        if getattr(cls, "guide", ""):
            pages[f"bpy.ops.{cls.bl_idname}"] = cls.guide
    pages.update((f"bpy.types.{name.lower()}.*", page) for name, page in SETTINGS.items())
    bpy.utils.register_manual_map(manual_map)


def end():
    if pages:
        bpy.utils.unregister_manual_map(manual_map)
    pages.clear()


def manual_map():
    """(address of the guide, (pattern, page's file) each), as Blender asks for it."""
    folder, ending = next((entry for entry in FOLDERS if entry[0].is_dir()), FOLDERS[0])
    return f"{folder.as_uri()}/", tuple((pattern, f"{page}.{ending}") for pattern, page in pages.items())
