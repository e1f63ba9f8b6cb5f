# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of the library's options, with their sentences as help."""

import argparse
import hashlib
import re
from pathlib import Path

import arapfields as af

from .._native import Contact, InvalidInput, Obstacle
from .._options import options_of, presets_of
from . import files, usd
from .command_line import name_and_margin
from .handles import AddHandle, MoveHandle, triple

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


# Flags that several verbs share, and the contact that they mean.

# Flags of contact, and the Contact made of them.

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def contact_flags(parser):
    group = parser.add_argument_group("contact: what the surface does not pass")
    group.add_argument(
        "--obstacle",
        action="append",
        default=[],
        metavar="FILE[:MARGIN]",
        help="a mesh, or a signed distance that fit saved, and the distance kept from it [0]; several may be "
        "given",
    )
    group.add_argument(
        "--ground", nargs=2, metavar=("AXIS", "HEIGHT"), help="a level ground, such as z 0 or y -0.7"
    )
    group.add_argument(
        "--itself",
        action="store_true",
        help="parts of the shape do not pass each other, but for what touches at rest",
    )


def contact_of(args):
    """The Contact by the flags; None without any."""
    obstacles = [_obstacle(text) for text in args.obstacle]
    ground, up = None, None
    if args.ground:
        axis, height = args.ground
        try:
            up, ground = AXES[axis.strip()], float(height)
        except (KeyError, ValueError):
            raise InvalidInput(f"--ground: {axis} {height} is not an axis, x, y or z, and a height") from None
    if not (obstacles or args.ground or args.itself):
        return None
    return Contact(obstacles, ground=ground, up=up, itself=args.itself)


def contact_key(args):
    """Values that determine the Contact, for names of solved frames."""
    read = [
        (text, hashlib.blake2b(Path(name_and_margin(text, is_file)[0]).read_bytes()).hexdigest())
        for text in args.obstacle
    ]
    return [read, args.ground, args.itself] if read or args.ground or args.itself else []


def is_file(text):
    return Path(text).exists()


def _obstacle(text):
    path, margin = name_and_margin(text, is_file)
    function = files.read_distance(path)
    try:
        return Obstacle(function, margin)
    except InvalidInput as error:
        raise InvalidInput(f"--obstacle: {text}: {error}") from None


# Flags of several verbs.

MESH = "mesh: .ply, .obj, .stl or .off"
SOURCE = f"{MESH}; or .safetensors: a signed distance that fit saved"
SPLATS = "splats: .ply, .glb, or .usd, .usda, .usdc by usd-core"


def solve_flags(parser):
    parser.add_argument("input", help=SOURCE)
    outputs = parser.add_argument_group("outputs (one or more)")
    moved = f"the input mesh with its vertices moved; {SPLATS}"
    outputs.add_argument("-o", "--output", metavar="FILE", help=moved)
    outputs.add_argument("--surface", metavar="FILE", help="the implicit surface, deformed (see --through)")
    outputs.add_argument("--save-field", metavar="FILE", help=".safetensors with the deformation field")
    report_flag(outputs)
    up_axis_flag(parser)
    extraction_flags(parser)
    inverse_flag(parser)
    sdf_flag(parser)
    stiffness_flags(parser)
    contact_flags(parser)
    handles = parser.add_argument_group(
        "handles (x, y, z in the mesh's coordinates; inf and -inf leave a side of a box open)"
    )
    handles.add_argument("--handles", metavar="FILE", help="JSON file, see docs/command-line.md")
    settings = {"dest": "flagged", "default": None}
    handles.add_argument(
        "--box",
        nargs=2,
        type=triple,
        metavar=("LOW", "HIGH"),
        action=AddHandle,
        **settings,
        help="the surface in this box is held, or moved by what follows",
    )
    handles.add_argument(
        "--turn",
        nargs=2,
        metavar=("AXIS", "DEGREES"),
        action=MoveHandle,
        **settings,
        help="turns the last box",
    )
    handles.add_argument(
        "--pivot",
        type=triple,
        metavar="POINT",
        action=MoveHandle,
        **settings,
        help="about this point [the box's centre]",
    )
    handles.add_argument(
        "--shift", type=triple, metavar="VECTOR", action=MoveHandle, **settings, help="shifts the last box"
    )
    handles.add_argument(
        "--scale",
        metavar="FACTORS",
        action=MoveHandle,
        **settings,
        help="scales the last box about its pivot: a number, or x,y,z along its edges",
    )
    handles.add_argument(
        "--reach",
        type=float,
        metavar="LENGTH",
        action=MoveHandle,
        **settings,
        help="the last box or point moves only what is this near, through the inside of the shape",
    )
    handles.add_argument(
        "--point",
        nargs=2,
        type=triple,
        metavar=("FROM", "TO"),
        action=AddHandle,
        **settings,
        help="one point of the surface goes there",
    )


def stiffness_flags(parser):
    stiffness = parser.add_argument_group(
        "stiffness: a number for each of the mesh's vertices (.txt, .csv or .npy), 1 for what is not painted"
    )
    stiffness.add_argument("--weights", metavar="FILE", help="how much it resists all change of shape")
    stiffness.add_argument("--bend-weights", metavar="FILE", help="how much it resists bending")


def extraction_flags(parser):
    for name in ("resolution", "refine_thin"):
        add_option_flag(parser, "extraction", name)


def inverse_flag(parser):
    parser.add_argument(
        "--through",
        choices=("warp", "inverse"),
        default="warp",
        help="a deformed surface's triangles: those at rest, moved (warp), or new and even ones, extracted "
        "through the field's inverse [warp]",
    )


def sdf_flag(parser):
    parser.add_argument(
        "--sdf",
        choices=("exact", "fit"),
        default="exact",
        help="a mesh's implicit surface: its own triangles, as far as they lie between inside and outside, "
        "or a smooth fit, which takes a while and closes holes [exact]",
    )


def up_axis_flag(parser):
    text = (
        "what is up in the input: USD has it in its header, and splats are turned for .glb, whose y is up [z]"
    )
    parser.add_argument("--up-axis", choices=usd.AXES, default="z", help=text)


def report_flag(parser):
    parser.add_argument("--report", metavar="FILE", help=".json with what was measured")


def style_flags(parser):
    """Adds the flags of the style and its orientation."""
    style = parser.add_mutually_exclusive_group(required=True)
    style.add_argument("--style", metavar="NAME", help=f"one of {', '.join(af.style_names())}")
    style.add_argument(
        "--normals", metavar="FILE", help="rows x y z (.txt, .csv, .npy), or the face normals of a mesh"
    )
    style.add_argument(
        "--style-object",
        metavar="FILE",
        help="a closed mesh, as upright as the input: normals turn to what it has in their direction",
    )
    parser.add_argument("--style-turn", nargs=2, metavar=("AXIS", "DEGREES"), help="turns the style")
    parser.add_argument(
        "--up",
        metavar="X,Y,Z",
        help="what is up in the file (z without it): the style's axis and the figure's stance",
    )
