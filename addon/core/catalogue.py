# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations as files in gettext's .po form, of which single lines of msgid and msgstr are read."""

import ast


def read_catalogue(text):
    """{English: translated}; ValueError names a line that does not belong."""
    found, message = {}, None
    for number, line in enumerate(text.splitlines(), 1):
        kind, _, value = line.strip().partition(" ")
        if not kind or kind.startswith("#"):
            continue
        if kind == "msgid":
            message = ast.literal_eval(value)
        elif kind == "msgstr" and message is not None:
            found[message], message = ast.literal_eval(value), None
        else:
            raise ValueError(f"line {number} of the catalogue: {line!r}")
    return found
