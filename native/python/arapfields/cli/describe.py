# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as JSON: its verbs, and their flags with types, ranges and defaults."""

import argparse
import json

from .handles import AddHandle, MoveHandle

NAMED = {int: "integer", float: "number", str: "text"}
REPEATING = (argparse._AppendAction, AddHandle, MoveHandle)  # may be given several times
OPTION_TYPES = {"int": "integer", "seed": "integer", "float": "number", "bool": "switch", "enum": "choice"}


def description(parser, version, exit_codes):
    """A dict of numbers, texts, lists and dicts, for programs that make calls of the command line."""
    (added,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {
        "program": parser.prog,
        "version": version,
        "summary": parser.description,
        "exit_codes": exit_codes,
        "flags": arguments_of(parser),
        "verbs": [verb(name, one) for name, one in added.choices.items()],
    }


def verb(name, parser):
    """A verb's summary, examples and arguments."""
    examples = [" ".join(one.replace("\\\n", " ").split()) for one in parser.examples]
    return {
        "name": name,
        "summary": parser.description,
        "examples": examples,
        "arguments": arguments_of(parser),
    }


def arguments_of(parser):
    groups = {action: group.title for group in parser._action_groups for action in group._group_actions}
    chosen = [group for group in parser._mutually_exclusive_groups if group.required]
    listed = [action for action in parser._actions if not isinstance(action, argparse._SubParsersAction)]
    result = []
    for action in listed:
        one = argument(action)
        one["group"] = groups[action]
        others = [
            action_of
            for group in chosen
            if action in group._group_actions
            for action_of in group._group_actions
        ]
        one["one_of"] = [main_name(other) for other in others]
        result.append(one)
    return result


def argument(action):
    """One positional argument or flag. A flag with `values` 0 takes none, with null any number."""
    option = getattr(action, "option", None)
    kind = "switch" if action.nargs == 0 else NAMED.get(action.type, "text")
    kind = "choice" if action.choices and kind == "text" else kind
    values = {None: 1, "?": 1, "*": None, "+": None}.get(action.nargs, action.nargs)
    told = {
        "name": main_name(action),
        "flags": list(action.option_strings),
        "help": (action.help or "").replace("%%", "%"),
        "type": OPTION_TYPES.get(option["type"], "text") if option else kind,
        "values": values,
        "metavar": list(action.metavar) if isinstance(action.metavar, tuple) else action.metavar,
        "required": action.required,
        "repeats": isinstance(action, REPEATING),
        "choices": list(action.choices) if action.choices else None,
        "default": option["default"] if option else plain(action.default),
    }
    return told | {name: option[name] if option else None for name in ("low", "high", "unit")}


def main_name(action):
    return next((one for one in action.option_strings if one.startswith("--")), action.dest)


def plain(default):
    """A default as JSON has it; None where a flag has none."""
    return default if isinstance(default, bool | int | float | str) and default != argparse.SUPPRESS else None


class Describe(argparse.Action):
    """Action that prints the description."""

    def __init__(self, *arguments, told, **settings):
        super().__init__(*arguments, nargs=0, **settings)
        self.told = told

    def __call__(self, parser, namespace, values, option_string=None):
        print(json.dumps(description(parser, *self.told), indent=1, ensure_ascii=False))
        parser.exit()
