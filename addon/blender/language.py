# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages in the user's language: templates are translated first and filled in then."""

import bpy

from ..core.errors import UserError, as_user_error
from ..names import CONTEXT

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
