# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs, their flags and their help, also as JSON."""

import argparse
import json
import re
from functools import partial

import arapfields as af

from . import skinning, transferring, verbs, wrapping
from .animate import animate
from .command_line import EXIT_CODES, parser_with_verbs
from .flags import (
    MESH,
    SOURCE,
    SPLATS,
    add_option_flag,
    add_option_flags,
    contact_flags,
    extraction_flags,
    inverse_flag,
    report_flag,
    sdf_flag,
    shard,
    solve_flags,
    style_flags,
    up_axis_flag,
)
from .handles import AddHandle, MoveHandle

# The command line as JSON: its verbs, and their flags with types, ranges and defaults.

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


# The verbs, their flags and their help.


class CMakeDir(argparse.Action):
    """Action that prints arapfields_DIR."""

    def __call__(self, parser, namespace, values, option_string=None):
        print(af.cmake_dir())
        parser.exit()


def parse(arguments):
    """The parsed arguments; `run` is the verb's function."""
    # argparse takes a token such as -inf,0,1 for a value only with a space in front.
    return _parser().parse_args([" " + a if re.match(r"-(\d|\.\d|inf)", a) else a for a in arguments])


def _parser():
    parser, added = parser_with_verbs(
        "Neural implicit surfaces from meshes, deformed as rigidly as possible.",
        "`arapfields VERB --help` shows a verb's flags and examples.",
    )
    parser.add_argument("--version", action="version", version=f"arapfields {af.__version__}")
    parser.add_argument(
        "--describe",
        action=Describe,
        told=(af.__version__, EXIT_CODES),
        help="print all verbs and flags as JSON, and exit",
    )
    parser.add_argument(
        "--cmake-dir", action=CMakeDir, nargs=0, help="print where CMake finds the C++ package, and exit"
    )
    by_module = [partial(_by_module, module) for module in (wrapping, transferring, skinning)]
    for add in (_fit, _sample, _deform, _stylize, _extract, _warp, _grid, _animate, *by_module):
        verb = add(added)
        verb.add_argument("--quiet", action="store_true", help="no progress bar and no summary")
    return parser


def _verb(added, name, run, summary, *examples):
    shown = "examples:\n" + "\n".join(f"  arapfields {name} {example}" for example in examples)
    raw = argparse.RawDescriptionHelpFormatter
    parser = added.add_parser(name, help=summary, description=summary, epilog=shown, formatter_class=raw)
    parser.set_defaults(run=run)
    parser.examples = [f"arapfields {name} {example}" for example in examples]
    return parser


def _fit(added):
    parser = _verb(
        added,
        "fit",
        verbs.fit,
        "fit a neural signed distance function to a mesh",
        "spot.obj --output spot.safetensors",
        "scan.ply --output scan.safetensors --seed 1 --report scan.json",
    )
    parser.add_argument("input", help=MESH)
    parser.add_argument(
        "-o", "--output", required=True, metavar="FILE", help=".safetensors for the signed distance"
    )
    report_flag(parser)
    add_option_flags(parser, "fit", "fitting")
    return parser


def _sample(added):
    parser = _verb(
        added,
        "sample",
        verbs.sample,
        "points spread uniformly over a surface, with normals",
        "spot.safetensors --output points.ply --count 50000",
        "spot.obj --output points.npz --deformed-by field.safetensors",
    )
    parser.add_argument("input", help=SOURCE)
    parser.add_argument(
        "-o", "--output", required=True, metavar="FILE", help=".ply, .npz (points, normals) or .xyz"
    )
    add_option_flag(parser, "sampling", "count")
    add_option_flag(parser, "sampling", "seed")
    parser.add_argument("--deformed-by", metavar="FIELD", help="move the points and normals by a saved field")
    return parser


def _deform(added):
    parser = _verb(
        added,
        "deform",
        verbs.deform,
        "move parts of a shape; the rest follows as rigidly as possible",
        "spot.obj -o bent.obj --box -inf,-inf,-inf inf,-0.2,inf --point 0,0.9,-0.4 0.3,1.0,-0.4",
        "bunny.off -o turned.ply --save-field field.safetensors --box -inf,-inf,-inf inf,0.06,inf \\\n"
        "      --box -inf,0.14,-inf inf,inf,inf --turn 0,1,0 40 --iterations 200",
        "spot.safetensors --surface bent.ply --resolution 192 --handles pose.json --exact-handles",
    )
    solve_flags(parser)
    add_option_flags(parser, "deform", "deformation")
    return parser


def _stylize(added):
    parser = _verb(
        added,
        "stylize",
        verbs.stylize,
        "turn a shape's normals to those of a style",
        "spot.obj -o cubic.obj --style cube --strength 0.8",
        "spot.safetensors --surface crystal.ply --normals gem.stl",
        "spot.obj -o rocky.obj --style-object rock.obj --up 0,1,0",
    )
    solve_flags(parser)
    style_flags(parser)
    add_option_flags(parser, "stylize", "stylization")
    return parser


def _by_module(module, added):
    """The function of a verb, from a module that is imported when it runs."""
    parser = _verb(added, module.NAME, module.run, module.SUMMARY, *module.EXAMPLES)
    module.add_flags(parser)
    return parser


def _extract(added):
    parser = _verb(
        added,
        "extract",
        verbs.extract,
        "triangles of an implicit surface",
        "spot.safetensors -o spot.ply --resolution 256",
        "spot.safetensors -o bent.stl --deformed-by field.safetensors",
        "spot.safetensors -o even.ply --deformed-by field.safetensors --through inverse",
        "scan.obj -o even.ply --sdf exact",
    )
    parser.add_argument("input", help=SOURCE)
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=MESH)
    parser.add_argument("--deformed-by", metavar="FIELD", help="move the surface by a saved field")
    inverse_flag(parser)
    sdf_flag(parser)
    extraction_flags(parser)
    return parser


def _warp(added):
    parser = _verb(
        added,
        "warp",
        verbs.warp,
        "move any mesh, splats, point set or curves by a saved field",
        "field.safetensors teeth.obj -o moved.obj",
        "field.safetensors fine.ply -o fine_posed.ply --share 0.5",
        "field.safetensors hair.obj -o hair_moved.obj --body spot.obj",
        "field.safetensors cloud.xyz -o moved.npy",
    )
    parser.add_argument("field", help=".safetensors that deform or stylize saved")
    parser.add_argument(
        "input",
        help=f"{MESH}; splats: .ply; curves: .obj; points: .ply, .xyz, .txt, .csv, .npy or .npz (points)",
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help=f"a mesh, curves or points, as the input; {SPLATS}",
    )
    up_axis_flag(parser)
    parser.add_argument("--share", type=float, default=1.0, metavar="NUMBER", help="so much of the way [1]")
    parser.add_argument(
        "--body",
        metavar="FILE",
        help="the mesh that the field was solved on, at rest: what is not near it goes along with it, rather "
        "than be refused",
    )
    return parser


def _grid(added):
    parser = _verb(
        added,
        "grid",
        verbs.grid,
        "signed distances on a regular grid",
        "spot.safetensors -o spot_grid.npz --resolution 128",
        "spot.safetensors -o spot.vdb --resolution 256",
    )
    parser.add_argument("input", help=SOURCE + " (a mesh's distances are exact)")
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help=".npz (values, origin, spacing), or .vdb where Blender's openvdb module is found",
    )
    add_option_flag(parser, "grid", "resolution")
    return parser


def _animate(added):
    parser = _verb(
        added,
        "animate",
        animate,
        "a mesh or splats under handles that move from frame to frame",
        "spot.obj --tracks walk.json -o walk.pc2",
        "spot.obj --tracks walk.npz -o walk.usdc --frames 1 48 --up-axis y",
        "spot.obj --tracks walk.json -o walk.pc2 --shard 2/8",
        "spot.obj --tracks walk.json -o walk.pc2 --secondary --damping 2",
        "scan.ply --tracks walk.json -o walk.ply",
        "scan.ply --tracks walk.json -o walk.usdc",
    )
    parser.add_argument("input", help=f"{MESH}; or splats")
    parser.add_argument("--tracks", required=True, metavar="FILE", help=".json or .npz, see docs/animate.md")
    kinds = ".pc2, .mdd, or .usd, .usda, .usdc by usd-core; for splats .ply or .glb, one a frame, or USD"
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=kinds)
    parser.add_argument("--frames", nargs=2, type=int, metavar=("FIRST", "LAST"), help="these alone [all]")
    parser.add_argument(
        "--shard", type=shard, metavar="I/N", help="solve the part I of N; the last part writes the output"
    )
    up_axis_flag(parser)
    contact_flags(parser)
    parser.add_argument("--secondary", action="store_true", help="lag behind the handles, and settle")
    add_option_flags(parser, "secondary", "secondary motion (--secondary)")
    add_option_flags(
        parser, "live", "solve of a frame (300 steps and a tolerance of 1e-6 without these flags)"
    )
    return parser
