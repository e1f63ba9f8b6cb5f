# SPDX-License-Identifier: GPL-3.0-or-later
"""Registers the add-on's translations: each .po file in addon/translations is a language."""

import functools
import sys
from pathlib import Path

import bpy

from ..names import CONTEXT, PACKAGE

FOLDER = Path(__file__).resolve().parents[1] / "translations"
CONTEXTS = (
    "*",
    "Operator",
    CONTEXT,
)  # contexts of tooltips, and of other texts of buttons


def read_po(path):
    """{English: translated} of a .po file, including wrapped lines; OSError names an invalid line."""
    import polib

    return {entry.msgid: entry.msgstr for entry in polib.pofile(str(path)).translated_entries()}


@functools.cache
def translations():
    """{language: {(context, English): translated}}."""
    languages = {}
    for path in sorted(FOLDER.glob("*.po")):
        texts = read_po(path).items()
        languages[path.stem] = {(context, text): own for text, own in texts for context in CONTEXTS}
    return languages


def load():
    try:
        texts = translations()
    except ModuleNotFoundError:  # source code without wheels: install_check reports it
        print("ARAP Fields: polib is missing, so all texts are in English", file=sys.stderr, flush=True)
        texts = {}
    bpy.app.translations.register(PACKAGE, texts)


def clear():
    bpy.app.translations.unregister(PACKAGE)
