# SPDX-License-Identifier: GPL-3.0-or-later
"""The parser of the command line."""

import argparse
import re
from functools import partial

import arapfields as af

from .._streams import say
from . import skinning, transferring, verbs, wrapping
from .animate import animate
from .describe import Describe
from .flags import (
    MESH,
    SOURCE,
    SPLATS,
    contact_flags,
    extraction_flags,
    inverse_flag,
    report_flag,
    sdf_flag,
    solve_flags,
    style_flags,
    up_axis_flag,
)
from .options import add_option_flag, add_option_flags, shard


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that prints errors in one line, with exit code 2, and names the verb's help."""

    def error(self, message):
        say(f"{self.prog}: {message} (see {self.prog} --help)")
        raise SystemExit(2)

    def parse_known_args(self, args=None, namespace=None):
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


# The verbs, their flags and their help.

EXIT_CODES = {0: "done", 1: "failed", 2: "bad input or usage", 130: "interrupted"}


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
    parser = OneLineParser(
        prog="arapfields",
        description="Neural implicit surfaces from meshes, deformed as rigidly as possible.",
        epilog=f"Exit codes: {', '.join(f'{code} {text}' for code, text in EXIT_CODES.items())}. "
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
    added = parser.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=OneLineParser)
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
