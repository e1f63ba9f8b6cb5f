# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of the panels, from the table of native options (native/options/options.toml)."""

import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

LARGEST = 2**31 - 1  # largest integer of a Blender property


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
    items: tuple = ()  # enum items (identifier, label, tip)
    advanced: bool = False
    plain: str = ""  # the tip without the meaning of 0
    zero: tuple = ()  # (label of the switch, meaning of 0, value if switched off)
    methods: tuple = ()  # fields that use it; none: all
    needs: str = ""  # name of the switch that enables it

    @property
    def switch(self):
        """Name of the switch that stands for 0."""
        return f"{self.name}_is_zero"

    @property
    def number(self):
        """Name of the setting as a number that is never 0."""
        return f"{self.name}_above_zero"


def read_table():
    """{name: operation}: the snapshot that ships with the extension, else the clone's table.

    Empty without either, if only the source code is installed; core/runtime/native.py then says what to
    install.
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
    """An option of the table as a Parameter."""
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
    """The Parameters of an operation's panel, in order; without a panel in the table, all."""
    block = TABLE.get(operation)
    if block is None:
        return []
    options = {option["name"]: option for option in (*block["options"], *block["further"])}
    plain = block["panel"] or (() if block["advanced"] else options)
    return [parameter(options[name]) for name in plain] + [
        parameter(options[name], advanced=True) for name in block["advanced"]
    ]


def method_of(group, parameters):
    """The field type of an operation's settings; "auto" is neural if an option of networks is changed."""
    field = getattr(group, "field", "neural")
    if field != "auto":
        return field
    of_networks = [p for p in parameters if "neural" in p.methods]
    return "neural" if any(getattr(group, p.name) != p.default for p in of_networks) else "radial"


def is_fast(values, parameters):
    """Whether an operation with these values uses radial basis functions and soft handles."""
    return method_of(SimpleNamespace(**values), parameters) == "radial" and not values.get("exact_handles")


def counts(parameter, group, method):
    """Whether a setting has an effect, given the others."""
    is_on = not parameter.needs or getattr(group, parameter.needs)
    return is_on and (not parameter.methods or method in parameter.methods)


def presets(operation):
    """{identifier: (label, tip, values)} of an operation's presets."""
    given = TABLE.get(operation, {}).get("presets", {})
    return {key.upper(): (p["label"], p["sentence"], p["values"]) for key, p in given.items()}


OPERATIONS = ("fit", "deform", "wrap", "skin", "extraction", "machine")
FIT, DEFORM, WRAP, SKIN, EXTRACTION, MACHINE = map(parameters, OPERATIONS)
QUALITIES = presets("fit")  # {identifier: (label, tip, values)}


def native_options(operation, values):
    """The settings that the operation's native options know, as keyword arguments."""
    known = {option["name"] for option in TABLE.get(operation, {"options": ()})["options"]}
    return {name: value for name, value in values.items() if name in known}
