# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws all panels without a window."""

import bpy
from support.blender import scenes

import addon.registration as registration
from addon.blender.section import TASKS
from addon.core.errors import UserError
from addon.core.runtime import jobs, native


class Layout:
    """Replaces Blender's layout: checks the arguments of calls, and collects the texts."""

    def __init__(self, texts):
        self.__dict__["texts"] = texts

    def __setattr__(self, name, value):
        assert name in (
            *("use_property_split", "use_property_decorate", "ui_units_x", "alignment", "emboss", "enabled"),
            *("active", "alert", "scale_y"),
        ), name

    def prop(self, data, name, **options):
        own = name.startswith('["') and data.get(name[2:-2]) is not None  # an input of a node group
        assert own or name in data.bl_rna.properties, (data, name)
        self.texts.append(options["text"] if own else options.get("text", data.bl_rna.properties[name].name))

    def prop_search(self, data, name, source, collection, **options):
        self.prop(data, name, **options)
        assert collection in source.bl_rna.properties

    def operator(self, name, **options):
        group, operator = name.split(".")
        rna = getattr(getattr(bpy.ops, group), operator).get_rna_type()
        self.texts.append(options.get("text", rna.name))
        return type("Arguments", (), dict.fromkeys(rna.properties.keys()))()

    def operator_menu_enum(self, name, prop, **options):
        assert prop in self.operator(name, **options).__class__.__dict__

    def menu(self, name, **options):
        assert hasattr(bpy.types, name), name

    def template_list(self, kind, _, data, name, active_data, active, **options):
        for row, item in enumerate(getattr(data, name)):
            getattr(bpy.types, kind).draw_item(None, bpy.context, self, data, item, 0, data, active, row)

    def label(self, text="", **options):
        self.texts.append(text)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.texts.append(text)

    def template_icon(self, icon_value, scale):
        assert icon_value > 0

    def separator(self):
        pass

    def panel(self, name, default_closed):
        return self, self

    def row(self, **options):
        return self

    column = box = grid_flow = row


def each_task():
    """Shows the panel with each of its tasks in turn, and then as before."""
    settings = bpy.context.scene.arapfields
    before = settings.task
    for task in TASKS:
        settings.task = task
        yield task
    settings.task = before


def shown():
    """The panels that are shown for one of the tasks."""
    classes = [cls for module in registration.MODULES for cls in getattr(module, "CLASSES", [])]
    panels = [cls for cls in classes if issubclass(cls, bpy.types.Panel)]
    found = {cls for _ in each_task() for cls in panels if cls.poll(bpy.context)}
    return [cls for cls in panels if cls in found]


def drawn():
    """{panel: texts} of all panels shown for one of the tasks; menus are drawn as well."""
    sections, panels = {}, set(shown())
    for module in registration.MODULES:
        for cls in getattr(module, "CLASSES", []):
            if not issubclass(cls, (bpy.types.Panel, bpy.types.Menu)) or "preset" in cls.__name__:
                continue
            if issubclass(cls, bpy.types.Panel) and cls not in panels:
                continue
            texts = sections[cls.__name__] = []
            stand_in = type("Section", (), {"layout": Layout(texts), "fill": getattr(cls, "fill", None)})()
            for name in ("draw_header", "draw_header_preset"):
                if hasattr(cls, name):
                    getattr(cls, name)(stand_in, bpy.context)
            cls.draw(stand_in, bpy.context)
    return sections


def prepared(state):
    """Puts Blender into a state; returns a function that restores it."""
    if state == "a camera":
        bpy.ops.object.camera_add()
    if state in ("nothing", "a camera"):
        return lambda: None
    bar, fixed, _ = scenes.bar_with_handles() if state != "a mesh" else (scenes.bar(), None, None)
    ours, undo = bar.arapfields, lambda: None
    if state == "modifiers and keys":
        bar.modifiers.new("S", "SUBSURF")
        bar.shape_key_add(name="Basis")
    elif state == "edit mode":
        bpy.ops.object.mode_set(mode="EDIT")
        return lambda: bpy.ops.object.mode_set(mode="OBJECT")
    elif state == "a handle active":
        scenes.activate(fixed)
    elif state == "a deleted handle":
        bpy.data.objects.remove(fixed)
    elif state == "a group's handle":
        bar.vertex_groups.new(name="G").add([0, 1, 2], 1.0, "REPLACE")
        bpy.ops.arapfields.add_handle(kind="GROUP", place="CURSOR")
    elif state == "a mesh":
        ours.surface = "FIT"
    elif state in ("fitted", "fit cleared"):
        ours.surface = "FIT"
        for name, value in {"iterations": 5, "width": 16, "layers": 2, "near_points": 2000}.items():
            setattr(ours.fit, name, value)
        bpy.ops.arapfields.fit()
        if state == "fit cleared":
            bpy.ops.arapfields.clear_cache()
    elif state == "custom style":
        ours.stylize.style = "OBJECT"
    elif state == "live":
        bpy.ops.arapfields.live()
    elif state == "running":
        gate = __import__("threading").Event()
        jobs.begin(
            jobs.Job("Deform", [jobs.Item("Bar", lambda tracker: gate.wait(60))], native.library().Task)
        )
        return lambda: (gate.set(), jobs.stop())
    elif state == "a failure":
        jobs.add_message("ERROR", "Bar: the mesh has no faces")
    elif state == "library missing":
        native._state.problem = UserError("The native library is not part of this installation.")
        return native.forget
    return undo
