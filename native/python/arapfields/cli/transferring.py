# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb transfer: data of a mesh, transferred to the mesh that it was wrapped onto, or back."""

from pathlib import Path

import arapfields as af

from .._files import existing_file, json_text, read_arrays, write_arrays
from . import files, verbs
from .command_line import Outputs, with_progress
from .flags import MESH

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
    require_pairs(args)
    with Outputs() as outputs:
        keys, arrays = output_places(args, outputs)
        shapes = files.read_surface(args.source), files.read_surface(args.target)
        meshes = shapes[0].surface, shapes[1].surface
        field = files.read_mesh(args.field)[0] if files.is_mesh(args.field) else files.read_field(args.field)
        places = with_progress(
            "transfer",
            lambda task: af.Correspondence(field, *meshes, back=args.back, task=task),
            args.quiet,
        )
        giving, receiving = reversed(shapes) if args.back else shapes
        for key, output in keys.items():
            offsets = places.displacements(shape_of(key, giving) - giving.vertices)
            write_key(outputs, output, receiver(args), receiving, offsets)
        if args.values:
            carried = {name: places.values(array) for name, array in read_values(args.values).items()}
            write_named(outputs, arrays["--values-output"], carried)
        if args.places:
            found = {name: getattr(places, name) for name in ("triangles", "shares", "distances")}
            write_named(outputs, arrays["--places"], found)
    written = [*keys.values(), *arrays.values()]
    verbs.summary(args, "wrote " + ", ".join(map(str, written)))


def require_pairs(args):
    """InvalidInput if only one of two paired flags is given, or no output."""
    for given, other, flags in (
        (args.keys, args.into, "--keys and --into"),
        (args.values, args.values_output, "--values and --values-output"),
    ):
        if bool(given) != bool(other):
            raise af.InvalidInput(f"{flags} need each other")
    if not (args.into or args.values or args.places):
        raise af.InvalidInput("no output: give --into, --values-output or --places")


def receiver(args):
    """The file of the mesh that receives the data."""
    return args.source if args.back else args.target


def output_places(args, outputs):
    """({file of a key: its output}, {flag: output} of arrays)."""
    suffix = Path(receiver(args)).suffix.lower()
    keys = {}
    for key in args.keys:
        place = Path(args.into) / f"{Path(key).stem}{suffix}"
        keys[key] = outputs.check(place, files.MESH_SUFFIXES, f"--keys {key}")
    wanted = {
        "--values-output": (args.values_output, (".npz",)),
        "--places": (args.places, (".npz", ".json")),
    }
    arrays = {flag: outputs.check(path, known, flag) for flag, (path, known) in wanted.items() if path}
    return keys, arrays


def write_key(outputs, place, path, mesh, offsets):
    """Writes the mesh of a file with its vertices moved."""
    outputs.write(
        place, lambda output: files.write_moved_mesh(output, path, mesh, lambda rest: rest + offsets)
    )


def write_named(outputs, place, arrays):
    """Writes named arrays as JSON or a NumPy archive, by the suffix."""
    if place.suffix.lower() == ".json":
        text = json_text(arrays) + "\n"
        outputs.write(place, lambda output: output.write_text(text, encoding="utf-8"))
    else:
        outputs.write(place, lambda output: write_arrays(output, **arrays))


def shape_of(path, giving):
    """(n, 3) vertices of the Mesh `giving` in another shape, from a file."""
    vertices = files.read_mesh(path)[0]
    if len(vertices) != len(giving.vertices):
        raise af.InvalidInput(f"{path}: {len(vertices)} vertices; the mesh has {len(giving.vertices)}")
    return vertices


def read_values(path):
    return read_arrays(existing_file(path, (".npz",)))
