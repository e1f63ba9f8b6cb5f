# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages in the user's language, from the .po files in addon/translations."""

import functools
import sys
from pathlib import Path

import bpy

from ..core.errors import UserError, as_user_error
from ..names import CONTEXT, PACKAGE

# Messages in the user's language: templates are translated first and filled in then.

_lookup = getattr(bpy.app.translations, "pgettext_rpt", bpy.app.translations.pgettext_iface)


def translated(message, **values):
    """A template with its values, or an error, in the user's language; other text unchanged."""
    if isinstance(message, UserError):
        message, values = message.template, message.values
    elif isinstance(message, Exception):
        return str(as_user_error(message))
    text = _lookup(message, CONTEXT)
    quoted = {key: translated(each) for key, each in values.items() if isinstance(each, Exception)}
    return text.format(**values | quoted) if values else text


def about(name, message):
    """The translated message with its object's name in front, unless it contains the name already."""
    text = translated(message)
    is_said = text.startswith((f"{name}: ", f"{name} "))
    if is_said or (isinstance(message, UserError) and message.says(name)):
        return text
    return f"{name}: {text}"


# Registers the add-on's translations: each .po file in addon/translations is a language.

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
    except ModuleNotFoundError:  # source code without wheels: first_run reports it
        print("ARAP Fields: polib is missing, so all texts are in English", file=sys.stderr, flush=True)
        texts = {}
    bpy.app.translations.register(PACKAGE, texts)


def clear():
    bpy.app.translations.unregister(PACKAGE)
