# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists the extension's messages, from its code, when the site is built.

The list replaces `<!-- messages -->` in a page. Messages that the page explains are left out.
"""

import ast
import re
from pathlib import Path

ADDON = Path(__file__).resolve().parents[2] / "addon"
MARK = "<!-- messages -->"


def literal(node):
    """The text of a message, with '…' for placeholders."""
    if isinstance(node, ast.Constant):
        return re.sub(r"\{\w+\}", "…", str(node.value))
    if isinstance(node, ast.JoinedStr):
        return "".join(literal(part) if isinstance(part, ast.Constant) else "…" for part in node.values)
    return literal(node.args[0]) if isinstance(node, ast.Call) and node.args else ""


def of_the_extension():
    """The texts of UserErrors in the add-on's code, except those of other sources."""
    found = set()
    for path in sorted(ADDON.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "UserError" and node.args:
                found.add(literal(node.args[0]).strip())
    return sorted((text for text in found if parts(text)), key=lambda text: text.lstrip("…:, ").lower())


def parts(message):
    """The parts between placeholders that are long enough to identify the message."""
    return re.findall(r"[^…:,(;]{6,}", message)


def stands_in(message, page):
    return max(parts(message), key=len).strip(" .") in page


def on_page_markdown(markdown, **_):
    return filled(markdown) if MARK in markdown else markdown


def filled(markdown):
    rows = [f"- `{message}`" for message in of_the_extension() if not stands_in(message, markdown)]
    return markdown.replace(MARK, "\n".join(rows))
