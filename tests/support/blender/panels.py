# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws all panels without a window, and finds all texts that users see."""

import ast
import inspect
from pathlib import Path

import bpy
from support.blender import scenes

import addon.registration as registration
from addon.blender.section import TASKS
from addon.core.errors import UserError
from addon.core.runtime import jobs, native
from addon.core.runtime.native import ADVICE
from addon.pin_tool.tool import ARAPFIELDS_TOOL_pin as tool

# Draws all panels without a window.


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

    def prop_enum(self, data, name, value):
        self.texts.append(data.bl_rna.properties[name].enum_items[value].name)

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
        for row, item in listed(kind, data, name):
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


def listed(kind, data, name):
    """[(row, item)] of the items that a list of that kind shows."""
    drawer, items = getattr(bpy.types, kind), list(enumerate(getattr(data, name)))
    if "filter_items" not in vars(drawer):
        return items
    stand_in = type("List", (), {"bitflag_filter_item": 1 << 30})()
    shown, order = drawer.filter_items(stand_in, bpy.context, data, name)
    assert len(shown) == len(items) and not order
    return [one for one, is_shown in zip(items, shown, strict=True) if is_shown]


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


# All user-visible texts of the add-on, from its classes and its source.

ADDON = Path(__file__).resolve().parents[3] / "addon"
UNTRANSLATED = {"", " ", "X", "Y", "Z", "ARAP Fields", "{error}", "CUDA", "JSON", "Seed"}
SAYS = {"translated", "UserError", "wrapped"}  # calls whose first argument is visible to users
MENU_ROWS = 2  # index of the text in the rows of menus


def of_classes(modules):
    """Labels and tooltips of operators, panels, menus and properties."""
    for module in modules:
        for cls in getattr(module, "CLASSES", []):
            rna = cls.bl_rna
            if issubclass(cls, bpy.types.Operator):
                group, name = cls.bl_idname.split(".")
                rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
                yield rna.description
            elif issubclass(cls, bpy.types.Menu):
                yield cls.__doc__ or ""
            yield getattr(cls, "bl_label", "")
            theirs = {
                p for base in cls.__mro__[1:] if "addon" not in base.__module__ for p in annotated(base)
            }
            for prop in rna.properties:
                if prop.identifier in annotated(*cls.__mro__) - theirs:
                    yield prop.name
                    yield prop.description
                    for item in prop.enum_items_static if prop.type == "ENUM" else []:
                        yield item.name
                        yield item.description


def annotated(*classes):
    return {name for cls in classes for name in inspect.get_annotations(cls)}


def of_source():
    """Literal texts of messages, buttons and labels."""
    for path in sorted(ADDON.rglob("*.py")):
        if "commands" in path.parts:  # texts of the terminal are not translated
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if name in SAYS and node.args:
                yield from literal(node.args[0] if name != "wrapped" else ast.Constant(""))
            if name == "start" and node.args:
                yield from literal(node.args[0])
            for keyword in node.keywords:
                if keyword.arg == "text":
                    yield from literal(keyword.value)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            targets = getattr(node, "targets", [])
            if isinstance(node, ast.Assign) and getattr(targets[0], "id", "") == "title":
                yield from literal(node.value)
            if isinstance(node, ast.Return) and path.name == "source_surface.py" and node.value is not None:
                yield from (text for text in literal(node.value) if " the fit" in text)
            if isinstance(node, ast.For) and path.name == "panel.py" and isinstance(node.iter, ast.Tuple):
                for row in node.iter.elts:
                    yield from literal(row.elts[MENU_ROWS])


def literal(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from literal(node.body)
        yield from literal(node.orelse)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from literal(value)
    elif isinstance(node, ast.JoinedStr):  # only f-strings of the module's constants
        parts = [v.value if isinstance(v, ast.Constant) else "\0" for v in node.values]
        if "\0" in parts and ADVICE and "ADVICE" in ast.unparse(node):
            yield "".join(part.replace("\0", ADVICE) for part in parts)


def every():
    texts = {*of_classes(registration.MODULES), *of_source(), tool.bl_label, tool.bl_description}
    return sorted(texts - UNTRANSLATED)
