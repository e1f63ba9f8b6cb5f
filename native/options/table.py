# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads, checks and resolves options.toml: the options of each operation, with its overrides."""

import tomllib
from pathlib import Path

TABLE = Path(__file__).with_name("options.toml")
KINDS = {"int": int, "float": float, "bool": bool, "seed": int, "enum": str, "device": str}
BLOCK_KEYS = {
    *("struct", "python", "about", "members", "checks", "options", "override"),
    *("panel", "advanced", "preset"),
}
OPTION_KEYS = {
    *("type", "default", "automatic", "range", "soft", "unit", "label", "sentence"),
    *("choices", "enum", "call", "alias", "zero", "methods", "needs"),
}


class TableError(Exception):
    """An error in the table, with its place."""


def read(path=TABLE):
    """The parsed table; TableError if it is invalid."""
    with open(path, "rb") as file:
        table = tomllib.load(file)
    for name, block in table.items():
        _known(name, block, BLOCK_KEYS)
        for option, declared in block.get("options", {}).items():
            _check_option(f"{name}.options.{option}", declared)
        for option, changed in block.get("override", {}).items():
            _known(f"{name}.override.{option}", changed, OPTION_KEYS - {"type", "enum"})
    return table


def resolved(path=TABLE):
    """{name: description} of every block that is a struct, in the table's order.

    A description is a dict with `struct`, `python`, `about`, `checks`, `groups`, `options`, `panel`,
    `advanced`, `presets`, and `further`: settings of the panel that are no options of the struct. An option
    is a dict with `name`, `group` (of the nested struct, or ""), `type`, `default`, `low`, `high`,
    `soft_low`, `soft_high`, `unit`, `label`, `sentence` (with the meaning of 0; `plain` without), `zero`,
    `choices`, `enum`, `automatic`, `alias`, `methods`, `needs`.
    """
    table = read(path)
    return {name: _resolve(table, name) for name, block in table.items() if "struct" in block}


def _resolve(table, name):
    block = table[name]
    overrides = dict(block.get("override", {}))
    result = {key: block.get(key, "") for key in ("struct", "python", "about", "checks")}
    result["groups"], result["options"] = [], []

    def add(owner, option, group):
        declared = table[owner]["options"][option]
        changed = overrides.pop(option, {})
        for key, value in changed.items():
            if declared.get(key) == value:
                raise TableError(f"{name}.override.{option}.{key}: the same as declared; leave it out")
        result["options"].append(_option(option, {**declared, **changed}, group))

    for member in block["members"]:
        if member in block.get("options", {}):
            add(name, member, "")
        elif member in table:
            result["groups"].append(member)
            for option in table[member]["members"]:
                add(member, option, member)
        else:
            owner, _, option = member.partition(".")
            if option not in table.get(owner, {}).get("options", {}):
                raise TableError(f"{name}.members: no option, group or group.option named {member!r}")
            add(owner, option, "")
    if overrides:
        raise TableError(f"{name}.override: {next(iter(overrides))!r} is no member")
    names = [option["name"] for option in result["options"]]
    if len(set(names)) != len(names):
        raise TableError(f"{name}.members: {max(names, key=names.count)!r} twice")
    result["panel"], result["advanced"] = block.get("panel", []), block.get("advanced", [])
    beside = [shown for shown in (*result["panel"], *result["advanced"]) if shown not in names]
    result["further"] = [_option(shown, _pool(table, name, shown), "") for shown in beside]
    result["presets"] = _presets(block.get("preset", {}), result["options"])
    return result


def _pool(table, name, option):
    try:
        return table["shared"]["options"][option]
    except KeyError:
        raise TableError(f"{name}.panel: {option!r} is neither a member nor shared") from None


def _presets(given, options):
    """The presets; each sets all options that any preset names."""
    named = {option for preset in given.values() for option in preset["values"]}
    defaults = {o["name"]: o["default"] for o in options if o["name"] in named}
    if set(defaults) != named:
        raise TableError(f"preset: {sorted(named - set(defaults))} are no options")
    return {key: {**preset, "values": {**defaults, **preset["values"]}} for key, preset in given.items()}


def _option(key, declared, group):
    kind = KINDS[declared["type"]]
    low, high = declared.get("range", (None, None))
    soft_low, soft_high = declared.get("soft", (low, high))
    option = {
        "name": declared.get("call", key),
        "group": group,
        "type": declared["type"],
        "default": declared["default"],
        "low": low,
        "high": high,
        "soft_low": soft_low,
        "soft_high": soft_high,
    }
    for further in ("unit", "label", "sentence", "enum", "alias", "needs"):
        option[further] = declared.get(further, "")
    for further in ("zero", "methods"):
        option[further] = declared.get(further, [])
    option["plain"] = option["sentence"]
    if option["zero"]:
        option["sentence"] += f"; 0 for {option['zero'][1]}"
    for further in ("choices", "automatic"):
        option[further] = declared.get(further, {})
    if type(option["default"]) is not kind:
        raise TableError(f"{key}: the default {option['default']!r} is no {declared['type']}")
    if low is not None and not low <= option["default"] <= high:
        raise TableError(f"{key}: the default {option['default']} is not within {low} to {high}")
    if option["choices"] and option["default"] not in option["choices"]:
        raise TableError(f"{key}: the default {option['default']!r} is no choice")
    return option


def _check_option(where, declared):
    _known(where, declared, OPTION_KEYS)
    missing = {"type", "default", "label", "sentence"} - set(declared)
    if missing:
        raise TableError(f"{where}: no {', '.join(sorted(missing))}")
    if declared["type"] not in KINDS:
        raise TableError(f"{where}: unknown type {declared['type']!r}; known are {', '.join(KINDS)}")
    if declared["type"] in ("int", "float", "seed") and "range" not in declared:
        raise TableError(f"{where}: no range")
    if declared["type"] in ("enum", "device") and "choices" not in declared:
        raise TableError(f"{where}: no choices")
    if declared["sentence"].endswith("."):
        raise TableError(f"{where}: the sentence ends in a full stop; readers add their own")


def _known(where, given, keys):
    if set(given) - keys:
        raise TableError(
            f"{where}: unknown key {min(set(given) - keys)!r}; known are {', '.join(sorted(keys))}"
        )
