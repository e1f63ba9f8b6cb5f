# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives Blender the add-on's translations: each file in addon/translations is a language."""

from pathlib import Path

import bpy

from ..core.catalogue import read_catalogue
from ..names import PACKAGE

FOLDER = Path(__file__).resolve().parents[1] / "translations"
CONTEXTS = ("*", "Operator")  # Blender looks texts of buttons up in the second


def catalogues():
    """{language: {(context, English): translated}}."""
    found = {}
    for path in sorted(FOLDER.glob("*.po")):
        texts = read_catalogue(path.read_text(encoding="utf-8"))
        found[path.stem] = {(context, text): told for text, told in texts.items() for context in CONTEXTS}
    return found


def register():
    bpy.app.translations.register(PACKAGE, catalogues())


def unregister():
    bpy.app.translations.unregister(PACKAGE)
