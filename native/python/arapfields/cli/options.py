# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of the library's options, with their sentences as help."""

import argparse
import re

from .._native import InvalidInput
from .._options import options_of, presets_of

NUMBERS = {"int": int, "seed": int, "float": float}


def add_option_flags(parser, operation, title):
    """Adds a group with a flag for each option of the operation, `learning_rate` → `--learning-rate`."""
    group = parser.add_argument_group(title)
    presets = presets_of(operation)
    if presets:
        said = "; ".join(f"{name}: {preset['sentence']}" for name, preset in presets.items())
        group.add_argument(
            "--preset",
            choices=list(presets),
            help=f"options that go together, which other flags change. {said}",
        )
    for option in options_of(operation).values():
        add_flag(group, option, dest=f"option_{option['name']}", default=None)


def add_option_flag(parser, operation, name):
    """Adds the flag of a single option, with the option's default."""
    option = options_of(operation)[name]
    add_flag(parser, option, dest=name, default=option["default"])


def add_flag(group, option, **settings):
    name, kind = option["name"].replace("_", "-"), option["type"]
    text = f"{option['sentence']} [{_shown(option['default'])}]"
    settings["help"] = text.replace("%", "%%")
    if kind == "bool":
        added = group.add_argument(f"--{name}", action=argparse.BooleanOptionalAction, **settings)
    elif kind in NUMBERS:
        added = group.add_argument(
            f"--{name}", type=NUMBERS[kind], metavar="X" if kind == "float" else "N", **settings
        )
    else:
        choices = list(option["choices"]) if kind == "enum" else None
        added = group.add_argument(
            f"--{name}", choices=choices, metavar=None if choices else "NAME", **settings
        )
    added.option = option  # for --describe


def result_options(options):
    """{name: value} of the options that affect results."""
    return {name: value for name, value in options.to_dict().items() if name != "threads"}


def integer(low, high=2**31 - 1):
    """Argument type: an integer from `low` to `high`."""

    def number(text):
        try:
            value = int(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text[:40]!r} is not an integer from {low} to {high}")
        return value

    return number


def shard(text):
    """Argument type "i/n": the i-th of n parts, 1 ≤ i ≤ n."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not I/N, the part I of N, such as 1/4")
    return int(found[1]), int(found[2])


def given_options(structure, arguments):
    """The options struct with the given flags."""
    chosen = getattr(arguments, "preset", None)
    options = structure.preset(chosen) if chosen else structure()
    for name in structure.fields:
        value = getattr(arguments, f"option_{name}", None)
        if value is not None:
            try:
                setattr(options, name, value)
            except InvalidInput as error:
                raise InvalidInput(f"--{name.replace('_', '-')}: {error}") from error
    return options


def given(arguments, operation, name):
    """The value of an option: the given flag, else the default."""
    value = getattr(arguments, f"option_{name}")
    return options_of(operation)[name]["default"] if value is None else value


def _shown(value):
    if isinstance(value, bool):
        return "on" if value else "off"
    return value
