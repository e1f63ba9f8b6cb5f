# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb `wrap`: onto one target, a folder of them, or the frames of a scanned motion."""

import base64
import html
import json
import re
import struct
import zlib
from pathlib import Path

import numpy as np

import arapfields as af

from .._files import existing_file, json_text, read_text
from .._native import sample_mesh
from .._streams import say
from ..point_cache import SUFFIXES as CACHES
from ..point_cache import PointCacheWriter
from . import files, verbs
from .command_line import Outputs, with_progress
from .files import read_numbers
from .flags import (
    SOURCE,
    add_option_flags,
    given,
    given_options,
    report_flag,
    sdf_flag,
    shard,
    stiffness_flags,
)
from .frames import FrameStore, HeldFrames, WrappedFrames, made_of
from .handles import triple

# An HTML page with a picture and figures of each wrap, the worst first.

SIDE, POINTS = 160, 150_000  # width and height of pictures in pixels; number of points drawn per surface
VIEW = np.array([[0.8, 0.0, -0.6], [-0.21, 0.94, -0.28], [0.56, 0.35, 0.75]])  # right, up, towards the viewer
LIGHT = np.array([-0.4, 0.5, 0.77])  # direction of light in the camera's axes
WRAPPED, TARGET = (217, 140, 77), (140, 153, 166)  # colours


def sheet_cell(name, figures, wrapped, target):
    """HTML of one wrap: pictures of its target, if that is a mesh, and of the wrapped mesh; y is up."""
    middle = (wrapped[0].max(axis=0) + wrapped[0].min(axis=0)) / 2
    half = 0.55 * float(np.linalg.norm(np.ptp(wrapped[0], axis=0)))
    both = (target, TARGET), (wrapped, WRAPPED)
    shown = [picture(mesh, colour, middle, half) for mesh, colour in both if mesh is not None]
    data = base64.b64encode(png(np.concatenate(shown, axis=1))).decode()
    text = html.escape(name), html.escape(figures)
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{text[0]}: target, wrapped">'
        f"<figcaption><b>{text[0]}</b><br>{text[1]}</figcaption></figure>"
    )


def sheet_page(cells):
    """HTML of these cells, in this order."""
    style = "figure{display:inline-block;margin:8px;font:14px sans-serif;max-width:320px;vertical-align:top}"
    return (
        f"<!doctype html><meta charset=utf-8><title>Wraps</title><style>{style}</style>\n"
        + "\n".join(cells)
        + "\n"
    )


def picture(mesh, colour, middle, half):
    """(SIDE, SIDE, 3) uint8 picture of a surface in the axes VIEW, within `half` around `middle`."""
    samples = sample_mesh(*mesh, POINTS)
    points = (samples.points - middle) @ VIEW.T / half
    shade = np.clip(samples.normals @ VIEW.T @ LIGHT, 0, 1) * 0.75 + 0.25
    at = np.round((points[:, :2] * [1, -1] + 1) * (SIDE - 1) / 2).astype(int)
    inside = ((at >= 0) & (at < SIDE)).all(axis=1)
    order = np.flatnonzero(inside)[np.argsort(points[inside, 2])]  # from back to front
    image = np.full((SIDE, SIDE, 3), 255.0)
    image[at[order, 1], at[order, 0]] = shade[order, None] * colour
    return image.astype(np.uint8)


def png(pixels):
    """The content of a PNG file; `pixels`: (height, width, 3 or 4) uint8, RGB or RGBA."""
    height, width, channels = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows, 9))
        + chunk(b"IEND", b"")
    )


# wrap with a folder as its target: one template onto each mesh; existing results are skipped.

ONE_TARGET = ("landmark", "landmarks", "save_field", "suggest")  # flags for a single target


def wrap_folder(args, options):
    """Wraps onto each mesh; InvalidInput at the end if some failed."""
    output, template = output_folder(args), existing_file(args.input, files.MESH_SUFFIXES)
    everything = meshes_in(args.target)
    output.mkdir(parents=True, exist_ok=True)
    source = files.Source(args)
    samples = files.samples(source, given(args, "wrap", "samples"), options.seed, args)
    common = made_of(samples, options, template.read_bytes())
    done, failed = {}, []
    number, parts = args.shard or (1, 1)
    for path in everything[number - 1 :: parts]:
        place = output / f"{path.stem}{template.suffix.lower()}"
        mark = common.copy()
        try:
            mark.update(files.content(path))
            done[path.name] = read_done(place, mark) or wrap_one(
                place, mark, lambda path=path: files.read_distance(path), source, samples, options, args
            )
        except (af.InvalidInput, af.Diverged) as error:
            failed.append(f"{path.name}: {error}")
    if not args.quiet:
        for name in sorted(done, key=lambda name: -distance_off(done[name])):
            notes = "; ".join(done[name]["notes"])
            say(
                f"{name}: {distance_off(done[name]):.2%} of the target's size off{notes and '; ' + notes}",
                "stdout",
            )
    if done:
        write_sheet(output, everything, template.suffix.lower())
    refuse(failed, len(done) + len(failed))


def output_folder(args):
    """The folder of the wrapped meshes; InvalidInput for flags of single targets."""
    for name in ONE_TARGET:
        if getattr(args, name):
            raise af.InvalidInput(f"--{name.replace('_', '-')}: {args.target} is a folder; wrap one by one")
    output = Path(args.output or "")
    is_file = output.suffix or output.is_file()
    if not args.output or is_file or (output.is_dir() and output.samefile(args.target)):
        raise af.InvalidInput("--output: another folder is needed where the target is one")
    return output


def meshes_in(folder):
    """The mesh files of a folder; InvalidInput if two have the same stem."""
    everything = sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in files.SOURCES)
    if not everything:
        raise af.InvalidInput(f"{folder}: holds no mesh")
    names = [path.stem for path in everything]
    if twins := sorted({name for name in names if names.count(name) > 1}):
        raise af.InvalidInput(f"{folder}: {twins[0]} is there twice, with different extensions")
    return everything


def refuse(failed, count):
    """InvalidInput with the reasons if some of `count` failed."""
    if failed:
        raise af.InvalidInput(f"{len(failed)} of {count} failed: {'; '.join(failed)}")


def write_sheet(output, everything, suffix):
    """Writes sheet.html with all finished wraps, also of other shards, the worst first."""
    rows = []
    for path in everything:
        place = output / f"{path.stem}{suffix}"
        try:
            report = json.loads(place.with_suffix(".json").read_text(encoding="utf-8"))
            target = files.read_mesh(path) if files.is_mesh(path) else None
            figures = f"{distance_off(report):.2%} of the target's size off; {'; '.join(report['notes'])}"
            wrapped = files.read_mesh(place)
            rows.append((distance_off(report), sheet_cell(path.name, figures.rstrip("; "), wrapped, target)))
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue  # not finished, or of another program
    rows.sort(key=lambda row: -row[0])
    page, place = sheet_page([row for _, row in rows]), output / "sheet.html"
    if place.is_file() and place.read_bytes() == page.encode():
        return
    with Outputs() as outputs:
        outputs.check(place, (".html",), "--output")
        outputs.write(place, lambda path: path.write_bytes(page.encode()))


def distance_off(report):
    return max(report["to_target_mean"], report["from_target_mean"])


def read_done(place, mark):
    """The report of an output if it was made with the same input and settings; else None."""
    try:
        found = json.loads(place.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    made = place.is_file() and isinstance(found, dict) and found.get("made_with") == mark.hexdigest()
    return found if made else None


def wrap_one(place, mark, target, source, samples, options, args):
    with Outputs() as outputs:
        outputs.check(place, files.MESH_SUFFIXES, "--output")
        function = target()
        field = with_progress(
            place.stem, lambda task: af.wrap(samples, function, [], options, task=task), args.quiet
        )
        outputs.write(place, lambda path: source.write_moved(path, field))
        report = {**field.report.to_dict(), "made_with": mark.hexdigest()}
        outputs.write(
            place.with_suffix(".json"),
            lambda path: path.write_text(json_text(report, indent=2) + "\n", encoding="utf-8"),
        )
    return report


# wrap with --sequence: a template onto each frame of a scanned motion, as a point cache.

NOT_OF_FRAMES = ("shard", "save_field", "suggest", "report")


def frames_of(folder):
    """The meshes of a folder, sorted by the numbers in their names."""
    paths = [path for path in Path(folder).iterdir() if path.suffix.lower() in files.SOURCES]
    if not paths:
        raise af.InvalidInput(f"{folder}: holds no mesh")
    return sorted(paths, key=lambda path: by_numbers(path.stem))


def by_numbers(name):
    """Sort key of names by their numbers: scan 2 before scan 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def wrap_sequence(args, options, pairs):
    """Wraps onto each frame from the last good one; `pairs`: landmarks of the first.

    InvalidInput at the end names all bad frames.
    """
    for name in NOT_OF_FRAMES:
        if getattr(args, name):
            raise af.InvalidInput(f"--{name.replace('_', '-')}: has no meaning with --sequence")
    if not Path(args.target).is_dir():
        raise af.InvalidInput(f"--sequence: {args.target} is no folder of frames")
    if not args.output:
        raise af.InvalidInput("no output: give --output")
    with Outputs() as outputs:
        output = outputs.check(args.output, CACHES, "--output")
    paths, source = frames_of(args.target), files.Source(args)
    if source.mesh is None:
        raise af.InvalidInput(f"{source.path}: holds no mesh to move")
    vertices = source.mesh.vertices
    files.tell_loss(output, vertices)
    samples = files.samples(source, given(args, "wrap", "samples"), options.seed, args)
    store = FrameStore(output, len(vertices), made_of(samples, options).digest())
    with store.only_run("sequence", [store.place(0, [])]) as first:
        if not first:
            raise af.InvalidInput(f"{output}: another wrap is at work on the same frames")
        frames = WrappedFrames(store.folder, samples, options)
        failed = write_frames(output, frames, paths, pairs, vertices, args.quiet)
    refuse(failed, len(paths))


def write_frames(output, frames, paths, pairs, vertices, quiet):
    """Writes the cache if any frame is good; returns the errors of bad frames."""
    worst, failed = (-1.0, ""), []
    with PointCacheWriter(output, points=len(vertices), frames=len(paths), start=1) as cache:
        held = HeldFrames(cache.write)
        for path in paths:
            shape = None
            try:
                field, report = frames.follow(
                    files.content(path),
                    lambda path=path: files.read_distance(path),
                    pairs,
                    lambda call, path=path: with_progress(path.stem, call, quiet),
                )
                shape, worst = field(vertices), max(worst, (distance_off(report.to_dict()), path.name))
            except (af.InvalidInput, af.Diverged) as error:
                failed.append(f"{path.name}: {error}")
            held.add(shape)
        if not frames.good:
            refuse(failed, len(paths))
    frames.forget_others()
    if not quiet:
        there = f", {frames.found} there already" if frames.found else ""
        off, name = worst
        text = (
            f"wrote {output}: {len(paths)} frames{there}, {off:.2%} of the target's size off at most ({name})"
        )
        say(text, "stdout")
    return failed


# The verb wrap: wraps a mesh onto a target, with pairs of landmarks from flags or a file.

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
        wrap_sequence(args, options, given_pairs(args))
    elif Path(args.target).is_dir():
        wrap_folder(args, options)
    elif args.shard:
        raise af.InvalidInput(f"--shard: {args.target} is no folder")
    else:
        run_one(args, options)


def run_one(args, options):
    """Wraps one mesh onto one target."""
    with Outputs() as outputs:
        places, report = output_places(args, outputs)
        pairs = given_pairs(args)
        source = files.Source(args)
        if source.mesh is None and "--output" in places:
            raise af.InvalidInput(f"--output: {source.path} holds no mesh to move; use --save-field")
        target = files.read_distance(args.target)
        samples = files.samples(source, given(args, "wrap", "samples"), options.seed, args)
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
