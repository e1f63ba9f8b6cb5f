# SPDX-License-Identifier: GPL-3.0-or-later
"""`arapfields --describe`: what it says of a flag is what the parser does with it."""

import json

import pytest
from support.programs.cli import run

import arapfields as af
from arapfields._options import options_of
from arapfields.cli.parser import parse


@pytest.fixture
def told(capsys):
    assert run("--describe") == 0
    return json.loads(capsys.readouterr().out)


def test_every_verb_and_option_is_there(told):
    assert told["program"] == "arapfields" and told["version"] == af.__version__
    assert told["exit_codes"]["2"] == "bad input or usage"
    verbs = {verb["name"]: verb for verb in told["verbs"]}
    assert {"fit", "deform", "stylize", "warp", "animate", "wrap", "transfer", "skin"} <= set(verbs)
    for verb in told["verbs"]:
        assert verb["summary"] and verb["examples"]
        assert all(one.startswith(f"arapfields {verb['name']} ") for one in verb["examples"])
        assert all(argument["help"] and "%%" not in argument["help"] for argument in verb["arguments"])
    for name, option in options_of("deform").items():
        (flag,) = (
            one for one in verbs["deform"]["arguments"] if one["name"] == f"--{name.replace('_', '-')}"
        )
        assert flag["default"] == option["default"] and flag["low"] == option["low"]
        assert flag["choices"] == (list(option["choices"]) if option["type"] == "enum" else None)
    flags = {one["name"]: one for one in verbs["stylize"]["arguments"]}
    assert flags["--style"]["one_of"] == ["--style", "--normals", "--style-object"]
    assert flags["--box"]["repeats"] and flags["--box"]["values"] == 2
    assert flags["--quiet"]["values"] == 0 and flags["input"]["flags"] == []


def values_of(flag):
    """Values that a flag takes, by its description."""
    count = 1 if flag["values"] is None else flag["values"]
    if flag["choices"]:
        return [flag["choices"][-1]] * count
    if flag["type"] in ("integer", "number"):
        return [str(flag["low"] or 1)] * count
    names = flag["metavar"] if isinstance(flag["metavar"], list) else [flag["metavar"]] * count
    return ["1/2" if flag["name"] == "--shard" else VALUES.get(name, "1,2,3") for name in names]


def test_calls_made_from_the_description_are_parsed(told):
    """Each flag alone, beside what the verb requires; what takes no value gets none."""
    checked = 0
    for verb in told["verbs"]:
        required = []
        for one in verb["arguments"]:
            if one["required"] and one["flags"]:
                required += [one["name"], *["x"] * (one["values"] or 1)]
            elif one["required"]:
                required += ["x"]
        chosen = next((one["one_of"] for one in verb["arguments"] if one["one_of"]), [])
        for one in verb["arguments"]:
            if not one["flags"] or one["name"] in ("--help", *required):
                continue
            given = ["--box", "0,0,0", "1,1,1"] if one["name"] in MOVES else []
            if chosen and one["name"] not in chosen:
                given += [chosen[0], "cube"]
            parse([verb["name"], *required, *given, one["name"], *values_of(one)])
            checked += 1
    assert checked > 200


VALUES = {"DEGREES": "30", "LENGTH": "1"}  # by their names in the description
MOVES = ("--turn", "--pivot", "--shift", "--scale", "--reach")  # of the last box
