# SPDX-License-Identifier: GPL-3.0-or-later
"""All user-visible texts of the add-on, from its classes and its source."""

import ast
import inspect
from pathlib import Path

import bpy

import addon.registration as registration
from addon.core.runtime.native import ADVICE
from addon.pin_tool.tool import ARAPFIELDS_TOOL_pin as tool

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
