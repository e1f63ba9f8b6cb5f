# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs with flags and help; the flags of solves are made from the tables of parameters."""

import argparse
import math
import re
from pathlib import Path, PurePath

from arapfields.cli.command_line import parser_with_verbs
from arapfields.cli.flags import shard

from ..core.settings.choices import (
    BAKE_FORMATS,
    LIVE_KINDS,
    ORIENTATIONS,
    OUTPUTS,
    SKIN_GROUPS,
    STYLES,
    STYLIZE,
    SURFACES,
)
from ..core.settings.parameters import DEFORM, EXTRACTION, QUALITIES, SKIN

# Flags of contact: obstacles, ground and self-contact.

NAMES = ("obstacle", "ground", "itself")


def add_contact_flags(one):
    group = one.add_argument_group("contact: what the surface does not pass [the object's own]")
    group.add_argument(
        "--obstacle",
        action="append",
        metavar="NAME[:MARGIN]",
        help="an object of the .blend, or a mesh file, and the distance kept from it [0]; may be repeated",
    )
    group.add_argument("--ground", type=height, metavar="HEIGHT", help="a level ground, along z")
    text = "parts of the shape do not pass each other"
    group.add_argument("--itself", action=argparse.BooleanOptionalAction, default=None, help=text)


def height(text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is no height")
    return value


# The verbs.

FORMATS = ("ply", "obj", "stl", "blend")
PARAMETERS = {"deform": DEFORM, "stylize": STYLIZE}
FLAGS = {"deform": ("handles",), "stylize": ("style", "frame")}  # further flags of each verb
SHARED = ("result", "surface", "resolution", "refine_thin", "quality")
LONGEST = 1e7  # seconds; the system's waits have such a limit
FILE = "file: .ply, .obj, .stl, or a .blend, in which each object's own settings and handles count"


def parse(arguments):
    """The parsed arguments; `solve` contains the settings of a solve that were given."""
    root = parser()
    options = root.parse_args(arguments)
    options.solve_verb = options.verb
    if options.verb == "batch":
        verbs = [name for name, given in (("stylize", options.style), ("deform", options.deform)) if given]
        if len(verbs) != 1:
            root.error("batch: say what to do, either --style NAME or --deform")
        (options.solve_verb,) = verbs
        refuse_foreign(options, root.error)
    if options.handles and options.solve_verb != "deform":
        root.error("--handles belongs to --deform")
    return options


def refuse_foreign(options, error):
    """Calls `error` if a flag belongs to the verb that this batch does not run."""
    other = "deform" if options.solve_verb == "stylize" else "stylize"
    known = {p.name for p in PARAMETERS[options.solve_verb]}
    foreign = [p.name for p in PARAMETERS[other] if p.name not in known]
    for name in [*foreign, *FLAGS[other]]:
        if getattr(options, name, None) is not None:
            error(f"--{name.replace('_', '-')} has no meaning for {options.solve_verb}")


def solve_settings(options):
    """{name: value} of the given settings that determine a solve's result."""
    names = [*(p.name for p in PARAMETERS[options.solve_verb]), *FLAGS[options.solve_verb], *SHARED, *NAMES]
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def parser():
    root, verbs = parser_with_verbs("Deform and stylize meshes in a Blender without a window.")
    for name, text in (
        ("deform", "deform the meshes of one file under handles"),
        ("stylize", "turn the meshes of one file towards a style"),
    ):
        one = verbs.add_parser(name, help=text, description=text)
        one.add_argument("-i", "--input", type=Path, required=True, metavar="FILE", help=FILE)
        one.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="same formats")
        add_solve_flags(one, [name])
        one.add_argument("--objects", nargs="+", metavar="NAME", help="only these objects of a .blend")
        one.add_argument("--report", type=Path, metavar="FILE", help="figures for each object, as JSON")
        one.add_argument("--quiet", action="store_true", help="no progress")
    add_batch(verbs)
    add_bake(verbs)
    add_skin(verbs)
    text = "say in one report what this is running on, and whether the library works here"
    verbs.add_parser("check", help=text, description=text)
    root.set_defaults(handles=None)
    return root


def add_bake(verbs):
    text = "bake the animation of a .blend, as it is, into caches beside it or another program's file"
    bake = verbs.add_parser("bake", help=text, description=text)
    bake.add_argument("-i", "--input", type=Path, required=True, metavar="FILE", help="a .blend")
    bake.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="a .blend that plays the caches; .abc, .usdc or .glb",
    )
    bake.add_argument("--folder", type=Path, help="of the caches [cache, beside the .blend]")
    bake.add_argument("--format", choices=lower(BAKE_FORMATS[:2]), default="pc2", help="of the caches [pc2]")
    bake.add_argument(
        "--objects", nargs="+", metavar="NAME", help="only these [all with handles or keyed styles]"
    )
    bake.add_argument("--kind", choices=lower(LIVE_KINDS), help="what is baked [each object's own]")
    bake.add_argument("--frames", type=frames, metavar="A-B", help="from frame A to B [the scene's]")
    bake.add_argument("--step", type=count, metavar="N", help="frames from one sample to the next")
    bake.add_argument("--subframes", type=count, metavar="N", help="samples a step, for motion blur")
    bake.add_argument(
        "--shard", type=shard, metavar="I/N", help="solve the part I of N; the last makes the cache"
    )
    bake.add_argument("--quiet", action="store_true", help="no progress")


def add_skin(verbs):
    text = "weights of an armature's bones for the meshes of a .blend"
    skin = verbs.add_parser("skin", help=text, description=text)
    skin.add_argument("-i", "--input", type=Path, required=True, metavar="FILE", help="a .blend")
    skin.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="a .blend")
    skin.add_argument("--armature", metavar="NAME", help="whose bones [the only one]")
    skin.add_argument("--objects", nargs="+", metavar="NAME", help="only these meshes [all]")
    skin.add_argument("--groups", choices=lower(SKIN_GROUPS), help="what becomes of the bones' groups")
    for parameter in SKIN:
        add_parameter(skin, parameter)
    skin.add_argument("--quiet", action="store_true", help="no progress")


def frames(text):
    """Argument type "a-b": first and last frame, which may be negative."""
    match = re.fullmatch(r"(-?\d{1,7})-(-?\d{1,7})", text.strip())
    if not match or int(match[2]) < int(match[1]):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not A-B, from frame A to B, such as 1-250")
    return int(match[1]), int(match[2])


def add_batch(verbs):
    text = "do the same to every file of a folder, several at once; what is done already is skipped"
    batch = verbs.add_parser("batch", help=text, description=text)
    batch.add_argument("-i", "--input", type=Path, required=True, metavar="FOLDER")
    batch.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    batch.add_argument("--deform", action="store_true", help="deform, under --handles or a .blend's own")
    add_solve_flags(batch, ["stylize", "deform"])
    batch.add_argument("-j", "--jobs", type=count, default=1, metavar="N", help="files at a time [1]")
    batch.add_argument("--format", choices=FORMATS, help="of the results [each input's own]")
    batch.add_argument(
        "--pattern", type=pattern, default="*", metavar="GLOB", help="which files, such as 'chair*.ply'"
    )
    batch.add_argument("--recursive", action="store_true", help="folders within the folder too")
    batch.add_argument("--again", action="store_true", help="also what is done already")
    batch.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")
    batch.add_argument("--shard", type=shard, metavar="I/N", help="the part I of N of the files alone")
    batch.add_argument("--limit", type=seconds, metavar="SECONDS", help="give up a file after so long")


def add_solve_flags(one, verbs):
    """Adds the flags of solves; their default None is the object's setting."""
    add_contact_flags(one)
    group = one.add_argument_group("solve")
    if "stylize" in verbs:
        names = ", ".join(name for name, _ in STYLES)
        group.add_argument("--style", type=style, metavar="NAME", help=names)
        group.add_argument(
            "--frame", choices=lower(ORIENTATIONS[:3]), help="whose axes the style stands along"
        )
    if "deform" in verbs:
        text = "handles as JSON, in the file's space"
        group.add_argument("--handles", type=Path, metavar="FILE", help=text)
    if "stylize" not in verbs:
        one.set_defaults(style=None, frame=None)
    group.add_argument("--result", choices=lower(OUTPUTS), help="the mesh itself moved, or a new one")
    group.add_argument("--surface", choices=lower(SURFACES), help="the triangles, or a fit of them")
    for parameter in EXTRACTION:
        add_parameter(group, parameter)
    group.add_argument("--quality", choices=lower(QUALITIES), help="of a fit")
    done = set()
    for verb in verbs:
        for parameter in PARAMETERS[verb]:
            if parameter.name not in done:
                add_parameter(group, parameter)
                done.add(parameter.name)


def lower(choices):
    """The values of a flag, the identifiers in lower case."""
    return [(choice if isinstance(choice, str) else choice[0]).lower() for choice in choices]


def add_parameter(group, p):
    flag = "--" + p.name.replace("_", "-")
    text = {"dest": p.name, "default": None, "help": p.tip.replace("%", "%%")}
    if p.items:
        group.add_argument(flag, choices=[item[0] for item in p.items], **text)
    elif isinstance(p.default, bool):
        group.add_argument(flag, action=argparse.BooleanOptionalAction, **text)
    else:
        kind = int if isinstance(p.default, int) else float
        group.add_argument(flag, type=within(p, kind), metavar="N" if kind is int else "X", **text)


def within(p, kind):
    def number(text):
        try:
            value = kind(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
        if not p.low <= value <= p.high:
            raise argparse.ArgumentTypeError(f"{text} is not within {p.low} to {p.high}")
        return value

    return number


def count(text):
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of at least 1")
    return int(text)


def seconds(text):
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= LONGEST:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds above 0")
    return value


def pattern(text):
    """Argument type: a pattern of names in the folder."""
    path = PurePath(text)
    if not path.parts or path.anchor or ".." in path.parts:
        raise argparse.ArgumentTypeError(f"{text!r} is not a pattern of names within the folder")
    return text


def style(text):
    """Argument type: a style's name, with hyphens or underscores for spaces."""
    name = text.lower().replace("-", " ").replace("_", " ")
    if name not in {known for known, _ in STYLES}:
        known = ", ".join(known for known, _ in STYLES)
        raise argparse.ArgumentTypeError(f"{text!r} is no style; there are {known}")
    return name
