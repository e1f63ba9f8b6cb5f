# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb skin: bone weights and correctives of a mesh, for bones from a file."""

import json
import sys

import numpy as np

import arapfields as af

from .._files import existing_file, read_text, write_arrays
from . import files, verbs
from .command_line import Outputs, with_progress
from .files import read_weights
from .flags import MESH, add_option_flags, given_options, stiffness_flags

NAME = "skin"
SUMMARY = "weights of a mesh for the bones of an armature, and correctives"
EXAMPLES = (
    "body.obj --bones rig.json -o weights.npz",
    "body.obj --bones rig.json -o weights.npz --influences 8 --correctives 8",
)
KEYS = {"name", "head", "tail", "parent", "roll", "deform", "limits"}


def add_flags(parser):
    parser.add_argument("input", help=f"the mesh at rest; {MESH}")
    parser.add_argument(
        "--bones",
        required=True,
        metavar="FILE",
        help=".json: a list of bones with name, head, tail; if wanted parent (a name), roll, deform, limits",
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE",
        help=".npz: weights, bones (their names); of correctives the bone, coefficients and offsets",
    )
    stiffness_flags(parser)
    add_option_flags(parser, "skin", "skin")


def run(args):
    options = given_options(af.SkinOptions, args)
    with Outputs() as outputs:
        place = outputs.check(args.output, (".npz",), "--output")
        bones = read_bones(args.bones)
        vertices, triangles = files.read_mesh(args.input)
        stiff, bend = (
            read_weights(path, len(vertices)) if path else None for path in (args.weights, args.bend_weights)
        )

        def weigh(task):
            return af.skin_weights(
                (vertices, triangles), bones, options, weights=stiff, bend_weights=bend, task=task
            )

        def correct(task):
            shape = vertices, triangles, bones, weights, options
            return af.skin_correctives(*shape, stiffness=stiff, bend_weights=bend, task=task)

        weights = with_progress("skin", weigh, args.quiet)
        arrays = {"weights": weights, "bones": np.array([bone.name for bone in bones])}
        if options.correctives:
            keys = with_progress("correctives", correct, args.quiet)
            arrays |= {
                "corrective_bones": np.array([key.bone for key in keys]),
                "corrective_coefficients": np.array([key.coefficients for key in keys]),
                "corrective_offsets": np.array([key.offsets for key in keys]),
            }
        outputs.write(place, lambda path: write_arrays(path, **arrays))
    for bone, other in () if args.quiet else af.coincident_bones(bones):
        print(f"note: {bones[bone].name} lies where {bones[other].name} does: passed over", file=sys.stderr)
    verbs.summary(args, f"wrote weights of {len(weights)} vertices for {len(bones)} bones to {args.output}")


def read_bones(path):
    """The bones of a .json file, with parents by name."""
    path = existing_file(path, (".json",))
    with files.readable(path, "bones"):
        rows = json.loads(read_text(path))
        if not isinstance(rows, list) or not all(isinstance(row, dict) and "name" in row for row in rows):
            raise af.InvalidInput(f"{path}: a list of bones with names is needed")
        numbers = {row["name"]: index for index, row in enumerate(rows)}
        found = []
        for row in rows:
            unknown = sorted({*row} - KEYS) or [row.get("parent")] * (
                row.get("parent") not in (None, *numbers)
            )
            if unknown:
                raise af.InvalidInput(f"{path}: bone {row['name']}: {unknown[0]} is not known")
            for key in ("head", "tail"):
                if key not in row:
                    raise af.InvalidInput(f"{path}: bone {row['name']}: {key}: is missing")
            given = {key: value for key, value in row.items() if key != "parent"}
            try:
                found.append(af.Bone(parent=numbers.get(row.get("parent")), **given))
            except af.InvalidInput as error:
                raise af.InvalidInput(f"{path}: bone {row['name']}: {error}") from None
    return found
