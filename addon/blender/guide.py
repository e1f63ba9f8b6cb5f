# SPDX-License-Identifier: GPL-3.0-or-later
"""Links to the user's guide: in tooltips, and as Online Manual in the context menus of buttons."""

from pathlib import Path

import bpy

from ..names import CONTEXT
from .language import translated

ADDON = Path(__file__).resolve().parents[1]
FOLDERS = ((ADDON / "guide", "html"), (ADDON.parent / "docs/guide", "md"))  # in the extension; in a clone
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
pages = {}  # {RNA pattern: page}, while the extension is enabled


class Guided:
    """Mixin of operators: `guide` is the page that explains them, named in their tooltips.

    If `obstacle` gives a reason, the operator is greyed out and the tooltip shows it.
    """

    guide = ""
    bl_translation_context = CONTEXT

    def __init_subclass__(cls):
        """Sets bl_idname by the class name: ARAPFIELDS_OT_fit is arapfields.fit; names.py lists them."""
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
        """UserError that says why the operator cannot run now; else None."""
        return None

    @classmethod
    def description(cls, context, properties):
        page = translated("Guide: {page}", page=translated(LABELS[cls.guide]))
        return f"{translated(cls.__doc__)}.\n{page}"


def begin(classes):
    """Registers the manual map: pages of all registered operators and settings."""
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
    """(URL prefix of the guide, ((RNA pattern, page's file), ...)), the format of register_manual_map."""
    folder, ending = next((entry for entry in FOLDERS if entry[0].is_dir()), FOLDERS[0])
    return f"{folder.as_uri()}/", tuple((pattern, f"{page}.{ending}") for pattern, page in pages.items())
