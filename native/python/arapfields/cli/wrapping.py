# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb wrap: wraps a mesh onto a target, with pairs of landmarks from flags or a file."""

import json
from pathlib import Path

import numpy as np

import arapfields as af

from .._files import existing_file, read_text
from . import files, sources, verbs, wrap_folder, wrap_sequence
from .flags import SOURCE, report_flag, sdf_flag, stiffness_flags
from .handles import triple
from .options import add_option_flags, given, given_options, shard
from .running import Outputs, with_progress
from .sources import read_numbers

NAME = "wrap"
SUMMARY = "lay a shape onto another, as rigidly as possible"
EXAMPLES = (
    "template.obj scan.ply -o wrapped.obj",
    "shirt.obj body.obj -o worn.obj --landmark 0,0,1.4 0,0.02,1.5 --landmark 0.3,0,1.3 0.35,0,1.4",
    "template.obj scans -o wrapped --shard 2/8",
    "template.obj frames -o motion.pc2 --sequence",
    "template.obj scan.ply --suggest pairs.json",
    "template.obj scan.safetensors --save-field wrap.safetensors --landmarks pairs.json",
)
LANDMARKS = (".json", ".txt", ".csv", ".npy")


def add_flags(parser):
    parser.add_argument("input", help=SOURCE)
    parser.add_argument("target", help=f"what it is laid onto; {SOURCE}; or a folder of these")
    outputs = parser.add_argument_group("outputs (one or more)")
    outputs.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="the input mesh with its vertices moved; a folder where the target is one; a point cache of a "
        "sequence, .pc2 or .mdd",
    )
    parser.add_argument(
        "--sequence", action="store_true", help="the folder's files are the frames of one motion, by number"
    )
    parser.add_argument("--shard", type=shard, metavar="I/N", help="the part I of N of a folder alone")
    outputs.add_argument("--save-field", metavar="FILE", help=".safetensors with the deformation field")
    outputs.add_argument(
        "--suggest", metavar="FILE", help="pairs of landmarks proposed by shape, as --landmarks reads them"
    )
    report_flag(outputs)
    landmarks = parser.add_argument_group("landmarks: places of both that belong together")
    landmarks.add_argument(
        "--landmark",
        nargs=2,
        type=triple,
        metavar=("REST", "ON_TARGET"),
        action="append",
        help="a pair of places as x,y,z",
    )
    landmarks.add_argument(
        "--landmarks",
        metavar="FILE",
        help="pairs, six numbers each: .json, .npy, or rows of text (.txt, .csv)",
    )
    sdf_flag(parser)
    stiffness_flags(parser)
    add_option_flags(parser, "wrap", "wrap")


def run(args):
    options = given_options(af.WrapOptions, args)
    if args.sequence:
        wrap_sequence.run(args, options, given_pairs(args))
    elif Path(args.target).is_dir():
        wrap_folder.run(args, options)
    elif args.shard:
        raise af.InvalidInput(f"--shard: {args.target} is no folder")
    else:
        run_one(args, options)


def run_one(args, options):
    """Wraps one mesh onto one target."""
    with Outputs() as outputs:
        places, report = output_places(args, outputs)
        pairs = given_pairs(args)
        source = sources.Source(args)
        if source.mesh is None and "--output" in places:
            raise af.InvalidInput(f"--output: {source.path} holds no mesh to move; use --save-field")
        target = sources.read_distance(args.target)
        samples = sources.samples(source, given(args, "wrap", "samples"), options.seed, args)
        if place := places.get("--suggest"):
            found = with_progress(
                "suggest",
                lambda task: af.suggest_landmarks(samples, target, options=options, task=task),
                args.quiet,
            )
            outputs.write(place, lambda path: write_landmarks(path, place.suffix, found))
        field = None
        if wraps(places):
            field = with_progress(
                "wrap", lambda task: af.wrap(samples, target, pairs, options, task=task), args.quiet
            )
            verbs.write_report(outputs, report, field.report)
        if place := places.get("--output"):
            outputs.write(place, lambda path: source.write_moved(path, field))
        if place := places.get("--save-field"):
            outputs.write(place, field.save)
    written = "wrote " + ", ".join(str(path) for path in places.values())
    verbs.summary(args, written, field.report if field is not None else None)


def output_places(args, outputs):
    """{flag: path} of the outputs, and the report's path; InvalidInput without an output."""
    wanted = {
        "--output": (args.output, files.MESH_SUFFIXES),
        "--save-field": (args.save_field, files.STATE_SUFFIXES),
        "--suggest": (args.suggest, LANDMARKS),
    }
    places = {
        flag: outputs.check(path, known, flag) for flag, (path, known) in wanted.items() if path is not None
    }
    if not places:
        raise af.InvalidInput("no output: give --output, --save-field or --suggest")
    report = verbs.report_place(outputs, args)
    if report is not None and not wraps(places):
        raise af.InvalidInput("--report: give --output or --save-field, of which it tells")
    return places, report


def wraps(places):
    """Whether an output needs the wrap, not only suggested landmarks."""
    return bool(places.keys() - {"--suggest"})


def given_pairs(args):
    """Pairs of landmarks from the file and the flags."""
    return (read_landmarks(args.landmarks) if args.landmarks else []) + (args.landmark or [])


def read_landmarks(path):
    """Pairs of points (3,) from rows of six numbers, or JSON [[[x, y, z], [x, y, z]], …]."""
    path = existing_file(path, LANDMARKS)
    with files.readable(path, "pairs of places"):
        if path.suffix.lower() == ".json":
            rows = np.array(json.loads(read_text(path)), float)
        else:
            rows = read_numbers(path)
    if rows.size == 0:
        return []
    if rows.shape[1:] not in ((2, 3), (6,)):
        raise af.InvalidInput(
            f"{path}: holds an array of shape {rows.shape}; pairs of places are needed, six numbers each"
        )
    return list(rows.reshape(-1, 2, 3))


def write_landmarks(path, suffix, pairs):
    """Writes pairs in a format of read_landmarks, by the suffix."""
    if suffix.lower() == ".json":
        path.write_text(json.dumps(pairs.tolist()), encoding="utf-8")
        return
    with path.open("wb") as file:
        if suffix.lower() == ".npy":
            np.save(file, pairs)
        else:
            delimiter = "," if suffix.lower() == ".csv" else " "
            np.savetxt(file, pairs.reshape(-1, 6), fmt="%.17g", delimiter=delimiter)
