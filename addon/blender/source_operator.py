# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixins of operators: on the panel's source, greyed out with a reason, with a page of the guide."""

from pathlib import Path

import bpy
import numpy as np

from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from ..names import CONTEXT
from .evaluation import world_matrix
from .language import translated
from .object_references import refusal, refusal_of_linked, source_of

# Links to the user's guide: in tooltips, and as Online Manual in the context menus of buttons.

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
        return with_page(translated(cls.__doc__), cls.guide)


def with_page(text, guide):
    """A tooltip that names the page of the guide."""
    page = translated("Guide: {page}", page=translated(LABELS[guide]))
    return f"{text}.\n{page}"


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


# Mixins of operators on the panel's source that are greyed out with a reason when they cannot run.


class ReportingOperator(Guided):
    """Mixin: `change(context, source)` does the work and returns the line to report, if any.

    Errors become reports. `source`: the panel's, or None.
    """

    def execute(self, context):
        context.view_layer.update()
        source = source_of(context)
        try:
            line = self.change(context, source)
        except np.linalg.LinAlgError as error:
            return self.refuse(flat(source) or error)
        except (UserError, ValueError, OSError) as error:
            return self.refuse(error)
        if line:
            self.report({"INFO"}, line)
        self.warn(context)
        return {"FINISHED"}

    def warn(self, context):
        """Reports warnings after the work is done."""

    def refuse(self, error):
        self.report({"ERROR"}, translated(error))
        return {"CANCELLED"}


def flat(source):
    """UserError if a source's scale flattens it; None otherwise, or without a source."""
    try:
        if source is not None:
            space_of(world_matrix(source), source.name)
    except UserError as error:
        return error
    return None


class SourceOperator(ReportingOperator):
    """Mixin: needs a source for which `refuses` gives no reason."""

    in_edit_mode = False  # whether it also accepts a source in Edit Mode
    of_linked = False  # whether it also accepts a linked source, which it does not change

    @classmethod
    def obstacle(cls, context):
        source = source_of(context)
        reason = refusal(source, cls.in_edit_mode)
        if reason is None and not cls.of_linked:
            reason = refusal_of_linked(source)
        return reason or cls.refuses(source)

    @classmethod
    def refuses(cls, source):
        """UserError that says why the operator does not apply to a source; else None."""
        return None
