# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes and drawing helpers of the sidebar's panels."""

import bpy

from ..core.runtime import jobs, native
from ..core.settings.parameters import counts, method_of
from ..names import CATEGORY, CONTEXT, Op
from . import object_references
from .language import translated

TASKS = ("POSE", "STYLE", "WRAP", "RIG", "ANIMATE")


def tasks_of(context):
    """The tasks that the active object is for: all for a source, RIG for an armature alone."""
    if object_references.source_of(context) is not None:
        return TASKS
    active = object_references.active_of(context)
    return ("RIG",) if active is not None and active.type == "ARMATURE" else ()


def tasks_now(context):
    """The task that the panel shows, if the active object is for any."""
    possible, chosen = tasks_of(context), context.scene.arapfields.task
    return [chosen] if chosen in possible else list(possible)


class Section:
    """Mixin of the sections: where they are, and that a broken library or a missing source hides them."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_translation_context = CONTEXT
    needs_source = True
    tasks = frozenset(TASKS)  # the tasks in whose midst the section is shown

    @classmethod
    def poll(cls, context):
        if native.problem() or not (cls.tasks == frozenset(TASKS) or cls.tasks & set(tasks_now(context))):
            return False
        return not cls.needs_source or object_references.source_of(context) is not None

    def draw(self, context):
        source = object_references.source_of(context)
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.fill(context, source, object_references.settings_of(source) if source else None)


class Advanced(Section):
    """Mixin of the sections within Advanced, closed at first."""

    bl_parent_id = "ARAPFIELDS_PT_advanced"
    bl_options = {"DEFAULT_CLOSED"}


class OfOthers(Section):
    """Mixin of the sections within Other Objects, which is closed at first."""

    bl_parent_id = "ARAPFIELDS_PT_others"


def settings_column(layout, group, parameters, advanced):
    """Draws the everyday parameters, greyed out if without effect, or the advanced ones with an effect."""
    column, method = layout.column(), method_of(group, parameters)
    for p in parameters:
        is_used = counts(p, group, method)
        if p.advanced != advanced or (advanced and not is_used):
            continue
        row = column.column()
        row.enabled = is_used
        if p.zero:
            with_zero(row, group, p)
        else:
            draw_settings(row, group, p.name)


def with_zero(layout, group, parameter):
    """Draws the switch that stands for 0, and below it the number, greyed out while the switch is on."""
    column = layout.column(align=True)
    column.row(heading=parameter.label).prop(group, parameter.switch)
    row = column.row()
    row.enabled = not getattr(group, parameter.switch)
    row.prop(group, parameter.number, text=" ")


def draw_settings(layout, group, *names):
    for name in names:
        column, named = with_room(layout, group, name)
        column.prop(group, name, **named)


def with_room(layout, group, name):
    """(column, arguments of prop()) for a property: switches in a narrow sidebar, and long ones, get the full
    width; long names, and names of enums with long items, a line above."""
    column, prop = layout.column(align=True), group.bl_rna.properties[name]
    if prop.type == "BOOLEAN":
        column.use_property_split = characters() >= NARROW and not is_long(prop.name, VALUE)
        return column, {}
    choices = prop.enum_items if prop.type == "ENUM" else ()
    share = FLAG if choices and prop.is_enum_flag else VALUE
    if not is_long(prop.name, NAME) and not any(is_long(one.name, share) for one in choices):
        return column, {}
    column.label(text=prop.name, text_ctxt=CONTEXT)
    if share is VALUE:
        return column, {"text": ""}
    column.use_property_split = False  # flags without a text would have no names
    return column, {}


def switched(layout, group, switch, number):
    """Draws a switch, and beside it the number that it enables."""
    column, name = layout.column(align=True), group.bl_rna.properties[switch].name
    above = is_long(name, NAME)
    if above:
        column.label(text=name, text_ctxt=CONTEXT)
    row = column.row(heading="" if above else name)
    row.prop(group, switch, text="")
    beside = row.row()
    beside.enabled = getattr(group, switch)
    beside.prop(group, number, text="")


def is_long(text, share):
    """Whether a text is wider than that share of the sidebar."""
    return len(bpy.app.translations.pgettext_iface(text, CONTEXT)) > share * characters()


def modifier_row(layout, modifier, icon, remove):
    """Draws a modifier of the add-on: name, visibility, and the operator that removes it."""
    row = layout.row(align=True)
    row.label(text=modifier.name, icon=icon, translate=False)
    for name in ("show_viewport", "show_render"):
        row.prop(modifier, name, text="")
    row.operator(remove, text="", icon="X")


def group_row(layout, group, name, source, further=""):
    """Draws the choice of a vertex group, and below it a setting that is enabled once one is chosen."""
    column, named = with_room(layout, group, name)
    column.prop_search(group, name, source, "vertex_groups", **named)
    if further:
        row = layout.column()
        row.enabled = bool(getattr(group, name))
        draw_settings(row, group, further)


def note(layout, *reasons):
    """Draws the first of these errors that is not None: the reason why a button would refuse."""
    reason = next(filter(None, reasons), None)
    if reason is not None:
        wrapped(layout, translated(reason), icon="INFO")


def job_button(layout, operator, icon):
    """Draws a job's button and its menu of scopes; while it runs, the one that cancels it. The status bar has
    the progress."""
    row = layout.row(align=True)
    if cancel_button(row, operator):
        return
    row.operator(operator, icon=icon if characters() >= NARROW else "NONE")
    row.operator_menu_enum(operator, "scope", text="", icon="DOWNARROW_HLT")


def cancel_button(row, operator):
    """Draws the button that cancels the running job, if that is of this operator; returns whether it is."""
    group, name = operator.split(".")
    job = jobs.running()
    if job is None or job.title != getattr(bpy.types, f"{group.upper()}_OT_{name}").title:
        return False
    row.operator(Op.CANCEL, text=translated("Cancel {job}", job=translated(job.title)), icon="X")
    return True


def presets(layout, name):
    """Draws a section's presets in its header."""
    row = layout.row(align=True)
    row.emboss = "NONE"
    row.menu(f"ARAPFIELDS_MT_{name}_presets", text="", icon="PRESET")
    row.operator(f"arapfields.{name}_preset", text="", icon="ADD")
    row.operator(f"arapfields.{name}_preset", text="", icon="REMOVE").remove_active = True


MARGIN, CHARACTER = 80, 5.6  # pixels beside a label, and per character, at UI scale 1
NARROW = 30  # characters
NAME, VALUE = 0.385, 0.48  # shares of the sidebar's characters: for a name beside a value, and for a value
FLAG = 0.56  # the same for a value without an arrow


def characters():
    """Number of characters of a label that fit into the region; Blender truncates longer ones."""
    region = bpy.context.region
    if region is None or region.width < 2:
        return 32
    scale = bpy.context.preferences.system.ui_scale
    return max(16, int((region.width / scale - MARGIN) / CHARACTER))


def wrapped(layout, text, icon="NONE"):
    """Draws a long text as several labels, wrapped at the sidebar's width."""
    import textwrap

    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, characters())):
        column.label(text=line, icon=icon if number == 0 else "BLANK1")
