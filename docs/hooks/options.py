# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of options, written while the site is built from the one table that everything else comes from.

A page says where: `<!-- settings: deform -->` for what Blender's panel shows of an operation,
`<!-- flags: fit -->` for the command line's flags.
"""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MARK = re.compile(r"<!-- (settings|flags): (\w+) -->")


def resolved(path=None):
    """The table native/options/options.toml, or another like it."""
    place = ROOT / "native" / "options" / "table.py"
    spec = importlib.util.spec_from_file_location("arapfields_options_table", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.resolved(path or module.TABLE)


def on_page_markdown(markdown, **_):
    return filled(markdown, resolved()) if MARK.search(markdown) else markdown


def filled(markdown, table):
    makers = {"settings": settings, "flags": flags}
    return MARK.sub(lambda found: makers[found[1]](table[found[2]]), markdown)


def settings(block):
    """What the panel shows: the everyday settings, then the advanced ones."""
    options = {option["name"]: option for option in (*block["options"], *block["further"])}
    rows = ["| setting | in scripts | default | range | effect |", "|---|---|---|---|---|"]
    for name in (*block["panel"], *block["advanced"]):
        option = options[name]
        shown = f"*{option['label']}*" if name in block["advanced"] else option["label"]
        rows.append(row(shown, f"`{name}`", *facts(option)))
    return "\n".join(rows)


def flags(block):
    """Every option as a flag."""
    rows = ["| flag | default | range | |", "|---|---|---|---|"]
    for option in (*block["options"], *block["further"]):
        rows.append(row(f"`--{option['name'].replace('_', '-')}`", *facts(option)))
    return "\n".join(rows)


def facts(option):
    """Default, range and effect of an option, as text."""
    text = option["sentence"]
    for name, (label, sentence) in option["choices"].items():
        text += (
            f"{':' if name == next(iter(option['choices'])) else ';'} *{label}* (`{name}`), {lower(sentence)}"
        )
    unit = f" {option['unit']}" if option["unit"] else ""
    return f"`{option['default']}`{unit}", range_of(option), f"{text}."


def range_of(option):
    if option["type"] == "bool":
        return "on, off"
    if option["low"] is None:
        return ", ".join(f"`{name}`" for name in option["choices"])
    shown = "," if option["type"] in ("int", "seed") else "g"
    return f"{option['low']:{shown}} to {option['high']:{shown}}"


def lower(text):
    """A sentence within another: a capital that begins no name becomes small."""
    return text if text[1:2].isupper() else text[0].lower() + text[1:]


def row(*cells):
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
