# SPDX-License-Identifier: GPL-3.0-or-later
"""The functions of the verbs: read, check the outputs' paths, compute, write."""

import argparse
from functools import partial
from pathlib import Path

import numpy as np

import arapfields as af

from .. import grids
from .._files import json_text
from .._streams import say
from . import files, splat_files
from .command_line import Outputs, with_progress
from .files import Source, fitted, samples
from .flags import contact_of, given, given_options
from .handles import build_handles, held_by, read_handles, rotation, triple, turn_upright


def fit(args):
    with Outputs() as outputs:
        output = outputs.check(args.output, files.STATE_SUFFIXES, "--output")
        report = report_place(outputs, args)
        options = given_options(af.FitOptions, args)
        vertices, triangles = files.read_mesh(args.input)
        sdf = fitted(vertices, triangles, options, args)
        outputs.write(output, sdf.save)
        write_report(outputs, report, sdf.report)
    summary(args, f"wrote {args.output}", sdf.report)


def sample(args):
    with Outputs() as outputs:
        output = outputs.check(args.output, files.CLOUD_SUFFIXES, "--output")
        field = files.read_field(args.deformed_by) if args.deformed_by else None
        drawn = samples(Source(args), args.count, args.seed, args)
        rows, normals = drawn.points, drawn.normals
        if field is not None:
            normals = np.linalg.solve(np.swapaxes(field.jacobian(rows), 1, 2), normals[..., None])[..., 0]
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            rows = field(rows)
        outputs.write(output, lambda path: files.write_cloud(path, rows, normals))
    summary(args, f"wrote {len(rows)} points to {args.output}")


def deform(args):
    options, contact = given_options(af.DeformOptions, args), contact_of(args)

    def solve(samples, handles, task):
        return af.deform(samples, handles, options, contact=contact, task=task)

    _solve(args, solve, options.seed, needs_handles=True)


def stylize(args):
    options = given_options(af.StylizeOptions, args)
    if args.style is not None and args.style not in af.style_names():
        raise af.InvalidInput(
            f"--style: unknown style {args.style!r}; known are {', '.join(af.style_names())}"
        )
    if args.style_object:
        normals = files.read_style_object(args.style_object)
    else:
        normals = af.preferred_normals(args.style) if args.style else files.read_normals(args.normals)
    up, orientation, contact = None, np.eye(3), contact_of(args)
    if args.up:
        try:
            up = np.array(triple(args.up))
            orientation = np.eye(3) if args.style_object else turn_upright(up)
        except (ValueError, argparse.ArgumentTypeError) as error:
            raise af.InvalidInput(f"--up: expected a direction as x,y,z ({error})") from error
    if args.style_turn:
        try:
            turn = {"axis": triple(args.style_turn[0]), "degrees": float(args.style_turn[1])}
            orientation = rotation(turn) @ orientation
        except (ValueError, argparse.ArgumentTypeError) as error:
            raise af.InvalidInput(f"--style-turn: expected AXIS as x,y,z and DEGREES ({error})") from error

    itself = contact is not None and contact.itself
    if itself and args.option_finish:
        raise af.InvalidInput("--finish: it does not see the surface's other parts; --no-finish is needed")

    def solve(samples, handles, task):
        settings = {"handles": handles, "orientation": orientation, "up": up, "contact": contact}
        return af.stylize(samples, normals, options, **settings, task=task)

    def finish(vertices, triangles, moved, handles, field):
        shares = {name: getattr(options, name) for name in ("strength", "sharpness", "rigidity", "threads")}
        held = np.where(held_by(handles, vertices), 0.0, 1.0) if handles else None
        stands = {"weights": held} if handles else {"up": (0.0, 0.0, 1.0) if up is None else up}

        def run(task):
            sharpened = af.SharpenOptions(**shares)
            alone = not handles and isinstance(field, af.RadialField)
            further = {"orientation": orientation, **stands, "contact": contact, "alone": alone, "task": task}
            return af.sharpen(vertices, triangles, moved, normals, sharpened, **further)

        return with_progress("finish", run, args.quiet)

    is_mesh = not af.GaussianSplats.is_file(args.input)
    finishes = given(args, "stylize", "finish") and not itself and is_mesh
    if finishes and args.option_centers is None:
        options.centers = af.CENTERS_BEFORE_SHARPEN
    if finishes and args.option_iterations is None:
        options.iterations = af.ITERATIONS_BEFORE_SHARPEN
    _solve(args, solve, options.seed, needs_handles=False, finish=finish if finishes else None)


def extract(args):
    with Outputs() as outputs:
        output = outputs.check(args.output, files.MESH_SUFFIXES, "--output")
        field = files.read_field(args.deformed_by) if args.deformed_by else None
        vertices, triangles = _extracted(Source(args).sdf(), args, field)
        outputs.write(output, lambda path: files.write_mesh(path, vertices, triangles))
    summary(args, f"wrote {len(vertices)} vertices and {len(triangles)} triangles to {args.output}")


def warp(args):
    with Outputs() as outputs:
        if af.GaussianSplats.is_file(args.input):
            _warp_splats(args, outputs)
            return
        output = outputs.check(args.output, files.WARPED, "--output")
        field = files.read_field(args.field)
        write = files.warped(args.input)
        body = af.sample_mesh(*files.read_mesh(args.body)) if args.body else None

        def move(rest):
            if body is None:
                return field.apply(rest, strength=args.share)
            return rest + args.share * (af.Attachment(body, rest).positions(field) - rest)

        outputs.write(output, lambda path: write(path, move))
    summary(args, f"wrote {args.output}")


def _warp_splats(args, outputs):
    output = outputs.check(args.output, splat_files.SUFFIXES, "--output")
    splat_files.require_writable(output)
    field = files.read_field(args.field)
    for flag, used in (("--body", args.body is not None), ("--share", args.share != 1.0)):
        if used:
            raise af.InvalidInput(f"{flag}: splats follow the field itself; a mesh or points are needed")
    splats = af.GaussianSplats.load(args.input)
    moved = with_progress("warp", lambda task: field.apply_to(splats, task=task), args.quiet)
    written = {"up": args.up_axis, "name": Path(args.input).stem}
    outputs.write(output, lambda path: splat_files.write(path, moved, **written))
    summary(args, f"wrote {args.output}")


def grid(args):
    with Outputs() as outputs:
        output = outputs.check(args.output, grids.SUFFIXES, "--output")
        if output.suffix.lower() == ".vdb":
            grids.openvdb_module()
        function = Source(args).distances()
        made = with_progress(
            "grid", lambda task: grids.sdf_grid(function, args.resolution, task=task), args.quiet
        )
        outputs.write(output, lambda path: grids.save_grid(path, *made))
    shape = " × ".join(map(str, made[0].shape))
    summary(args, f"wrote {shape} distances, {made[2]:.4g} apart, to {args.output}")


def _extracted(sdf, args, field=None, finish=None):
    """The surface at rest, or deformed by a field, by the method of --through.

    `finish(vertices, triangles, moved)` gives the positions of one that a field has moved.
    """
    through = field is not None and args.through == "inverse"
    settings = {"resolution": args.resolution, "refine_thin": args.refine_thin}

    def extract(task):
        if through:
            return af.extract_deformed(sdf, field, **settings, task=task)
        return af.extract_surface(sdf, **settings, task=task)

    extraction = with_progress("extract", extract, args.quiet)
    _print_notes(args, extraction.report)
    vertices, triangles = extraction
    if through or field is None:
        return vertices, triangles
    moved = field(vertices)
    return (moved if finish is None else finish(vertices, triangles, moved)), triangles


def _solve(args, solve, seed, needs_handles, finish=None):
    """Common part of deform and stylize.

    `finish(vertices, triangles, moved, handles, field)` gives final positions of a mesh moved by the field.
    """
    is_scan = af.GaussianSplats.is_file(args.input)
    with Outputs() as outputs:
        places = {
            flag: outputs.check(path, suffixes, flag)
            for flag, path, suffixes in (
                ("--output", args.output, splat_files.SUFFIXES if is_scan else files.MESH_SUFFIXES),
                ("--surface", args.surface, files.MESH_SUFFIXES),
                ("--save-field", args.save_field, files.STATE_SUFFIXES),
            )
            if path is not None
        }
        if not places:
            raise af.InvalidInput("no output: give --output, --surface or --save-field")
        report = report_place(outputs, args)
        described = (read_handles(args.handles) if args.handles else []) + (args.flagged or [])
        source = Source(args)
        if not (source.mesh or source.splats) and "--output" in places:
            raise af.InvalidInput(f"--output: {source.path} holds no mesh to move; use --surface")
        if source.splats and "--output" in places:
            splat_files.require_writable(places["--output"])
        points_on = samples(source, given(args, args.verb, "samples"), seed, args)
        bounds = np.array([points_on.points.min(0), points_on.points.max(0)])
        handles = build_handles(described, bounds) if described or needs_handles else []
        field = with_progress(args.verb, lambda task: solve(points_on, handles, task), args.quiet)
        of_mesh = None if finish is None else partial(finish, handles=handles, field=field)
        if "--output" in places:
            outputs.write(places["--output"], lambda path: source.write_moved(path, field, of_mesh))
        if "--surface" in places:
            surface = _extracted(source.sdf(), args, field, of_mesh)
            outputs.write(places["--surface"], lambda path: files.write_mesh(path, *surface))
        if "--save-field" in places:
            outputs.write(places["--save-field"], field.save)
        write_report(outputs, report, field.report)
    summary(args, "wrote " + ", ".join(str(path) for path in places.values()), field.report)


def report_place(outputs, args):
    return outputs.check(args.report, (".json",), "--report") if args.report else None


def write_report(outputs, place, report):
    if place is not None:
        outputs.write(
            place,
            lambda path: path.write_text(json_text(report.to_dict(), indent=2) + "\n", encoding="utf-8"),
        )


def _print_notes(args, report):
    for note in () if args.quiet else getattr(report, "notes", ()):
        say(f"note: {note}")


def summary(args, text, report=None):
    if args.quiet:
        return
    _print_notes(args, report)
    numbers = {
        k: v
        for k, v in (report.to_dict() if report else {}).items()
        if isinstance(v, (int, float)) and not isinstance(v, bool)
    }
    if numbers:
        text += "; " + ", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in numbers.items())
    say(text, "stdout")
