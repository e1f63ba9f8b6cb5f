# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of options, made from native/options/options.toml when the site is built.

In pages: `<!-- settings: deform -->` for an operation's settings in Blender's panel,
`<!-- shown: contact/properties.py -->` for settings of the add-on in that file, `<!-- flags: fit -->` for
flags of the command line, `<!-- buttons: addon -->` for all operators.
"""

import ast
import importlib.util
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "addon"
sys.path.append(str(ROOT))
MARK = re.compile(r"<!-- (settings|flags|shown|buttons): ([\w/]+)(?:\.py)? -->")


def resolved(path=None):
    """The resolved table of native/options/options.toml, or of another such file."""
    module = loaded(ROOT / "native" / "options" / "table.py")
    return module.resolved(path or module.TABLE)


def loaded(place):
    spec = importlib.util.spec_from_file_location(f"arapfields_{place.stem}", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def on_page_markdown(markdown, **_):
    return filled(markdown, resolved()) if MARK.search(markdown) else markdown


def filled(markdown, table):
    makers = {
        "settings": lambda name: settings(table[name]),
        "flags": lambda name: flags(table[name]),
        "shown": shown,
        "buttons": lambda _: buttons(),
    }
    return MARK.sub(lambda found: makers[found[1]](found[2]), markdown)


def settings(block):
    """The table of the panel's settings, the advanced ones last."""
    options = {option["name"]: option for option in (*block["options"], *block["further"])}
    rows = ["| setting | in scripts | default | range | effect |", "|---|---|---|---|---|"]
    for name in (*block["panel"], *block["advanced"]):
        option = options[name]
        shown = f"*{option['label']}*" if name in block["advanced"] else option["label"]
        default, allowed, effect = facts(option)
        effect += f" *{option['zero'][0]}* stands for 0." if option["zero"] else ""
        rows.append(row(shown, f"`{name}`", default, allowed, effect))
    return "\n".join(rows)


def flags(block):
    """The table of flags."""
    rows = ["| flag | default | range | |", "|---|---|---|---|"]
    for option in (*block["options"], *block["further"]):
        rows.append(row(f"`--{option['name'].replace('_', '-')}`", *facts(option)))
    return "\n".join(rows)


def shown(file):
    """The table of the settings that a file of the add-on declares."""
    tree = ast.parse((ADDON / f"{file}.py").read_text(encoding="utf-8"))
    drawn = "".join(
        path.read_text(encoding="utf-8")
        for kind in ("panel", "operators", "tool", "preferences")
        for path in ADDON.rglob(f"{kind}.py")
    )
    choices, names, rows = importlib.import_module("addon.core.settings.choices"), {}, {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and isinstance(node.body[-1], ast.Return):
            names[node.name] = node.body[-1].value
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            names[node.targets[0].id] = node.value
    for name, call in declarations(tree):
        label, effect = words(call, names, choices)
        if (
            effect
            and f'"{name}"' in drawn
            and not name.startswith("active_")
            and "HIDDEN" not in ast.dump(call)
        ):
            rows.setdefault(name, row(label, f"`{name}`", f"{effect}."))
    return "\n".join(["| setting | in scripts | effect |", "|---|---|---|", *rows.values()])


def buttons():
    """The table of the add-on's operators: labels and tooltips."""
    rows = []
    for path in ADDON.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.ClassDef) or not node.name.startswith("ARAPFIELDS_OT_"):
                continue
            named = {
                ast.unparse(each.targets[0]): each.value for each in node.body if isinstance(each, ast.Assign)
            }
            label, tip = getattr(named.get("bl_label"), "value", ""), ast.get_docstring(node) or ""
            call = f"`{node.name.removeprefix('ARAPFIELDS_OT_')}`"
            if label and "INTERNAL" not in ast.dump(node):
                rows.append(row(label, call, " ".join(tip.split()) + "."))
    return "\n".join(["| button | in scripts | effect |", "|---|---|---|", *sorted(rows)])


def declarations(tree):
    """Yields (name, call) of possible property declarations: annotations, dicts, arguments, assignments."""
    for node in ast.walk(tree):
        pairs = []
        if isinstance(node, ast.AnnAssign):
            pairs = [(getattr(node.target, "id", None), node.annotation)]
        elif isinstance(node, ast.Assign):
            pairs = [(getattr(node.targets[0], "id", None), node.value)]
        elif isinstance(node, ast.Dict):
            pairs = [
                (getattr(key, "value", None), value)
                for key, value in zip(node.keys, node.values, strict=True)
            ]
        elif isinstance(node, ast.keyword):
            pairs = [(node.arg, node.value)]
        yield from ((name, call) for name, call in pairs if name and isinstance(call, ast.Call))


def words(call, names, choices):
    """(label, effect) of a property's declaration, with its choices; empty for other calls."""
    if len(call.args) < 2 and isinstance(names.get(getattr(call.func, "id", "")), ast.Call):
        call = names[call.func.id]  # a function of the same file that makes the property
    if not call.args or getattr(call.args[0], "id", "").startswith("ARAPFIELDS"):
        return "", ""
    given = [names.get(getattr(each, "id", ""), each) for each in call.args]
    texts = [each.value for each in given if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    label, effect = texts[:2] if len(texts) > 1 else ("", "")
    used = [getattr(choices, getattr(part, "id", ""), ()) for each in given for part in ast.walk(each)]
    items = [item for table in used if isinstance(table, tuple) for item in table]
    for number, (key, *rest) in enumerate(items):
        effect += f"{';' if number else ':'} *{rest[0]}* (`{key}`), {lower(rest[1])}"
    return label, effect


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
    """A sentence with its first letter in lower case, unless it begins with a name."""
    return text if text[1:2].isupper() else text[0].lower() + text[1:]


def row(*cells):
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
