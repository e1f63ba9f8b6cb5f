# SPDX-License-Identifier: GPL-3.0-or-later
"""Option structs of the library as flags: one for each field, its docstring as help, its default kept."""

import argparse

from .._native import InvalidInput


def add_option_flags(parser, structure, title, skip=()):
    """A group of flags, `learning_rate` → `--learning-rate`."""
    group = parser.add_argument_group(title)
    defaults = structure()
    for name in structure.fields:
        if name in skip:
            continue
        value = getattr(defaults, name)
        text = (getattr(structure, name).__doc__ or "").strip().replace("%", "%%")
        settings = {"dest": f"option_{name}", "default": None, "help": f"{text} [{_shown(value)}]"}
        flag = "--" + name.replace("_", "-")
        if isinstance(value, bool):
            group.add_argument(flag, action=argparse.BooleanOptionalAction, **settings)
        elif isinstance(value, (int, float)):
            group.add_argument(
                flag, type=type(value), metavar="N" if isinstance(value, int) else "X", **settings
            )
        elif isinstance(value, str):
            group.add_argument(flag, metavar="NAME", **settings)


def given_options(structure, arguments):
    """The struct with the values that were given."""
    options = structure()
    for name in structure.fields:
        value = getattr(arguments, f"option_{name}", None)
        if value is not None:
            try:
                setattr(options, name, value)
            except InvalidInput as error:
                raise InvalidInput(f"--{name.replace('_', '-')}: {error}") from error
    return options


def _shown(value):
    if isinstance(value, bool):
        return "on" if value else "off"
    return value if value != "" else "none"
