# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb transfer: what a mesh has, carried over to the mesh that it was wrapped onto, or back."""

from pathlib import Path

import numpy as np

import arapfields as af

from .._files import existing_file, json_text, write_arrays
from . import files, verbs
from .flags import MESH
from .running import Outputs, with_progress

NAME = "transfer"
SUMMARY = "carry shape keys and values of a mesh over to the one that it was wrapped onto"
EXAMPLES = (
    "wrap.safetensors template.obj scan.ply --keys smile.obj frown.obj --into keys",
    "wrapped.obj template.obj scan.ply --values weights.npz --values-output scan_weights.npz",
    "wrap.safetensors template.obj scan.ply --places places.npz --back",
)


def add_flags(parser):
    parser.add_argument(
        "field", help="what wrap saved, .safetensors; or the source mesh as another tool wrapped it"
    )
    parser.add_argument("source", help=f"what was wrapped, at rest; {MESH}")
    parser.add_argument("target", help=f"what it was wrapped onto; {MESH}")
    parser.add_argument("--back", action="store_true", help="from the target to the source")
    parser.add_argument(
        "--keys", nargs="+", default=[], metavar="FILE", help="the giving mesh in other shapes, one a file"
    )
    outputs = parser.add_argument_group("outputs (one or more)")
    outputs.add_argument(
        "--into", metavar="FOLDER", help="the receiving mesh in each of these shapes, under the same name"
    )
    parser.add_argument(
        "--values", metavar="FILE", help=".npz with arrays of a row a vertex, as weights have"
    )
    outputs.add_argument("--values-output", metavar="FILE", help=".npz with the same of the receiving mesh")
    outputs.add_argument(
        "--places",
        metavar="FILE",
        help=".npz or .json: the triangle, its corners' shares, the distance of each vertex",
    )


def run(args):
    for given, other, flags in (
        (args.keys, args.into, "--keys and --into"),
        (args.values, args.values_output, "--values and --values-output"),
    ):
        if bool(given) != bool(other):
            raise af.InvalidInput(f"{flags} need each other")
    if not (args.into or args.values or args.places):
        raise af.InvalidInput("no output: give --into, --values-output or --places")
    with Outputs() as outputs:
        receiver = args.source if args.back else args.target
        suffix = Path(receiver).suffix.lower()
        keys = [
            (
                key,
                outputs.check(
                    Path(args.into) / f"{Path(key).stem}{suffix}", files.MESH_SUFFIXES, f"--keys {key}"
                ),
            )
            for key in args.keys
        ]
        arrays = {
            flag: outputs.check(path, suffixes, flag)
            for flag, path, suffixes in (
                ("--values-output", args.values_output, (".npz",)),
                ("--places", args.places, (".npz", ".json")),
            )
            if path
        }
        source, target = files.read_mesh(args.source), files.read_mesh(args.target)
        field = files.read_mesh(args.field)[0] if files.is_mesh(args.field) else files.read_field(args.field)
        places = with_progress(
            "transfer",
            lambda task: af.Correspondence(field, source, target, back=args.back, task=task),
            args.quiet,
        )
        giving, receiving = (target, source) if args.back else (source, target)
        for key, output in keys:
            offsets = places.displacements(shape_of(key, giving) - giving[0])
            outputs.write(
                output,
                lambda path, moved=offsets: files.write_moved_mesh(
                    path, receiver, receiving, lambda rest: moved_rows(rest, receiving[0], moved)
                ),
            )
        if args.values:
            carried = {name: places.values(array) for name, array in read_values(args.values).items()}
            outputs.write(arrays["--values-output"], lambda path: write_arrays(path, **carried))
        if args.places:
            found = {name: getattr(places, name) for name in ("triangles", "shares", "distances")}
            as_json = arrays["--places"].suffix.lower() == ".json"
            outputs.write(
                arrays["--places"],
                lambda path: (
                    path.write_text(json_text(found) + "\n", encoding="utf-8")
                    if as_json
                    else write_arrays(path, **found)
                ),
            )
    written = [str(output) for _, output in keys] + [str(path) for path in arrays.values()]
    verbs.summary(args, "wrote " + ", ".join(written))


def shape_of(path, giving):
    """Vertices (n, 3) of the giving mesh in another shape."""
    vertices = files.read_mesh(path)[0]
    if len(vertices) != len(giving[0]):
        raise af.InvalidInput(f"{path}: {len(vertices)} vertices; the mesh has {len(giving[0])}")
    return vertices


def moved_rows(rest, vertices, offsets):
    if len(rest) != len(vertices):
        raise af.InvalidInput(f"{len(rest)} vertices are to be written, and {len(vertices)} were read")
    return rest + offsets


def read_values(path):
    path = existing_file(path, (".npz",))
    with files.readable(path, "arrays"), np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
