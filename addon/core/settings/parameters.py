# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings that artists see, from the table of the native options (native/options/options.toml)."""

import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

LARGEST = 2**31 - 1  # that Blender's integers hold


@dataclass(frozen=True)
class Parameter:
    """One setting. `name` is the native option's; `default` decides the type (bool, int, float, str)."""

    name: str
    default: object
    label: str
    tip: str
    low: float | None = None
    high: float | None = None
    soft_low: float | None = None
    soft_high: float | None = None
    items: tuple = ()  # (identifier, label, tip) of a choice
    advanced: bool = False
    plain: str = ""  # the tip without what 0 stands for
    zero: tuple = ()  # (label of a switch, what 0 stands for, value instead)
    methods: tuple = ()  # the fields on which it acts; none: all
    needs: str = ""  # the switch without which it does nothing

    @property
    def switch(self):
        """Name of the switch in the place of 0."""
        return f"{self.name}_is_zero"

    @property
    def number(self):
        """Name of the setting as a number that is never 0."""
        return f"{self.name}_above_zero"


def read_table():
    """Name → operation: the snapshot that ships with the extension, else the table of the clone.

    Empty where neither is at hand, in an installation of the source code alone: there is then nothing to set,
    and core/runtime/native.py says what to install.
    """
    path = Path(__file__).resolve()
    shipped = path.with_name("options.json")
    if shipped.exists():
        return json.loads(shipped.read_text(encoding="utf-8"))
    clone = path.parents[3] / "native" / "options" / "table.py"
    if not clone.exists():
        return {}
    spec = importlib.util.spec_from_file_location("arapfields_options_table", clone)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.resolved()


TABLE = read_table()


def parameter(option, advanced=False):
    """An option of the table as a setting."""
    choices = option["choices"].items()
    return Parameter(
        option["name"],
        option["default"],
        option["label"],
        option["sentence"],
        option["low"],
        min(option["high"], LARGEST) if option["type"] == "seed" else option["high"],
        option["soft_low"],
        option["soft_high"],
        tuple((name, label, tip) for name, (label, tip) in choices),
        advanced,
        option["plain"],
        tuple(option["zero"]),
        tuple(option["methods"]),
        option["needs"],
    )


def parameters(operation):
    """What the panel shows of an operation, in order; of a group without a panel, everything."""
    block = TABLE.get(operation)
    if block is None:
        return []
    options = {option["name"]: option for option in (*block["options"], *block["further"])}
    plain = block["panel"] or (() if block["advanced"] else options)
    return [parameter(options[name]) for name in plain] + [
        parameter(options[name], advanced=True) for name in block["advanced"]
    ]


def method_of(group, parameters):
    """The field that an operation's settings ask for; Automatic is neural where a network's option is set."""
    field = getattr(group, "field", "neural")
    if field != "auto":
        return field
    of_networks = [p for p in parameters if "neural" in p.methods]
    return "neural" if any(getattr(group, p.name) != p.default for p in of_networks) else "radial"


def is_fast(values, parameters):
    """Whether an operation with these values solves by radial functions, with handles that pull."""
    return method_of(SimpleNamespace(**values), parameters) == "radial" and not values.get("exact_handles")


def counts(parameter, group, method):
    """Whether a setting does anything beside the others."""
    is_on = not parameter.needs or getattr(group, parameter.needs)
    return is_on and (not parameter.methods or method in parameter.methods)


def presets(operation):
    """Identifier → label, tip, what it sets."""
    given = TABLE.get(operation, {}).get("presets", {})
    return {key.upper(): (p["label"], p["sentence"], p["values"]) for key, p in given.items()}


OPERATIONS = ("fit", "deform", "wrap", "skin", "extraction", "machine")
FIT, DEFORM, WRAP, SKIN, EXTRACTION, MACHINE = map(parameters, OPERATIONS)
QUALITIES = presets("fit")  # identifier → label, tip, what it sets


def native_options(operation, values):
    """The settings that the operation's native options know, as keyword arguments."""
    known = {option["name"] for option in TABLE.get(operation, {"options": ()})["options"]}
    return {name: value for name, value in values.items() if name in known}
