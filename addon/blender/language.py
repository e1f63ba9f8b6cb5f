# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages in the user's language: templates are translated first and filled in then."""

import bpy

from ..core.errors import UserError
from ..names import CONTEXT

_lookup = getattr(bpy.app.translations, "pgettext_rpt", bpy.app.translations.pgettext_iface)


def translated(message, **values):
    """A template with its values, or an error, as the user should read it; other text as it is."""
    if isinstance(message, UserError):
        message, values = message.template, message.values
    elif isinstance(message, Exception):
        return str(message)
    text = _lookup(message, CONTEXT)
    return text.format(**values) if values else text
