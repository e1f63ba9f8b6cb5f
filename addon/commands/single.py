# SPDX-License-Identifier: GPL-3.0-or-later
"""Verbs for one file: deform and stylize, bake, skin."""

import contextlib
import json
import math
import re
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from arapfields.cli.command_line import name_and_margin, shown_progress

from ..animation.object_bake import kind_of
from ..blender.language import about
from ..blender.object_references import is_source, settings_of
from ..contact.properties import add
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.settings.choices import style_identifier
from ..core.settings.parameters import SKIN
from ..handles import empties
from ..names import REPORT
from ..skin import writing
from . import files, parser
from .files import READ
from .parser import solve_settings

# deform and stylize of one file, with contact from flags and an outcome for each of its objects.

# Obstacles and other contact settings from flags, in addition to the objects' own settings.


def parts(text):
    """(name, margin) of "name:margin"."""
    name, margin = name_and_margin(text, lambda whole: whole in bpy.data.objects)
    if not 0.0 <= margin < math.inf:
        raise UserError(f"--obstacle: {text}: the margin is negative, or no number")
    return name, margin


def named(options):
    """The names of the obstacles, which are not solved themselves."""
    return {parts(text)[0] for text in getattr(options, "obstacle", None) or ()}


def set_contact(sources, options):
    """Applies the flags to the sources' contact settings; each obstacle file is read once."""
    obstacles = [(found(name, options), margin) for name, margin in map(parts, options.obstacle or ())]
    for source in sources:
        group = settings_of(source).contact
        for item, margin in obstacles:
            add(source, item, margin)
        if options.ground is not None:
            group.use_ground, group.ground = True, options.ground
        if options.itself is not None:
            group.itself = options.itself
        group.use |= bool(obstacles) or options.ground is not None or bool(options.itself)


def found(name, options):
    """The object of that name, or the mesh of the file."""
    item, path = bpy.data.objects.get(name), Path(name)
    if item is None:
        if path.suffix.lower() not in READ or not path.is_file():
            raise UserError(f"--obstacle: {name}: no object of {options.input}, and no mesh file")
        before = set(bpy.data.objects)
        READ[path.suffix.lower()](str(path))
        item = next(iter(set(bpy.data.objects) - before), None)
        bpy.context.view_layer.update()
    if item is None or item.type != "MESH":
        raise UserError(f"--obstacle: {name}: is no mesh")
    return item


# deform and stylize of one file, with an outcome for each of its objects.

CALLS = {"deform": bpy.ops.arapfields.deform, "stylize": bpy.ops.arapfields.stylize}
# The operator's name, which Blender puts before a message.
OPERATOR = re.compile(
    r"^Operator bpy\.ops\.\S+ |^Converting py args to operator properties: (:: )?|\b[A-Z]+_OT_\w+\."
)
UPPER = ("result", "surface", "frame", "quality")


def run_single(options, _):
    """Returns exit code 0 if all objects are solved, else 1; UserError if there are none to solve."""
    files.check(options.output)
    files.read(options.input)
    sources = objects_to_solve(options)
    if options.solve_verb == "deform" and not options.handles:
        tell_of_others(options, empties.used)
    for place in (options.output, options.report):
        if place:
            files.check_place(place)
    set_contact(sources, options)
    if options.handles:
        for source in sources:
            add_handles(source, options.handles)
    outcomes, results = [], []
    with progress(options.quiet):
        for source in sources:
            outcome, item = solve(source, options)
            outcomes.append(outcome)
            results += [item] if item else []
    if results:
        finish_names(options, results)
        files.write(options.output, [item for _, item in results])
    if options.report:
        write_json(options.report, {"input": str(options.input), "objects": outcomes})
    for outcome in outcomes:
        stream = sys.stdout if outcome["status"] == "done" else sys.stderr
        print(f"arapfields: {outcome['message']}", file=stream, flush=True)
    return 0 if len(results) == len(outcomes) else 1


def objects_to_solve(options):
    """The objects to work on."""
    meshes = [item for item in bpy.context.view_layer.objects if is_source(item)]
    obstacles = named(options)
    meshes = [item for item in meshes if not settings_of(item).made_from and item.name not in obstacles]
    if options.objects:
        by_name = {item.name: item for item in meshes}
        unknown = [name for name in options.objects if name not in by_name]
        if unknown:
            known = ", ".join(sorted(by_name)) or "none"
            raise UserError(f"{options.input}: no mesh object named {unknown[0]}; there are: {known}")
        meshes = [by_name[name] for name in options.objects]
    elif options.solve_verb == "deform" and not options.handles:
        meshes = [item for item in meshes if empties.used(item)]
        if not meshes:
            raise UserError(f"{options.input}: no object has handles; give --handles FILE")
    if not meshes:
        raise UserError(f"{options.input}: holds no mesh object")
    return meshes


def tell_of_others(options, is_meant):
    """Names the meshes for which `is_meant` holds that are in no view of the scene, and so are left out."""
    shown = set(bpy.context.view_layer.objects)
    others = [item for item in bpy.data.objects if item not in shown and item.users > 0 and is_source(item)]
    names = sorted(item.name for item in others if not settings_of(item).made_from and is_meant(item))
    if names and not options.objects:
        named = ", ".join(names)
        print(
            f"arapfields: left out, in another scene or a collection that is excluded: {named}",
            file=sys.stderr,
            flush=True,
        )


def add_handles(source, path):
    """Adds the handles of a JSON file, and moves their Empties to the targets."""
    from arapfields.cli.handles import build_handles, read_handles

    af = native.library()
    descriptions = read_handles(path)
    corners = np.array(
        [source.matrix_world @ Matrix.Translation(c).to_translation() for c in source.bound_box]
    )
    handles = build_handles(descriptions, np.array([corners.min(axis=0), corners.max(axis=0)]))
    for handle, (name, item) in zip(handles, descriptions, strict=True):
        point = isinstance(handle, af.Point)
        rest, target = (np.eye(4), np.eye(4)) if point else (np.array(handle.rest), np.array(handle.target))
        if point:
            rest[:3, :3] *= max(np.ptp(corners, axis=0).max(), 1e-6) / 100
            target[:3, :3] = rest[:3, :3]
            rest[:3, 3], target[:3, 3] = handle.rest, handle.target
        kind = "POINT" if point else "CUBE"
        handle_name = empties.name_for(source, rest[:3, 3], kind)
        empty = empties.make_empty(bpy.context, source, Matrix(rest.tolist()), 1.0, handle_name)
        if not np.allclose(empty.matrix_world, rest, rtol=1e-4, atol=1e-6 * np.abs(rest).max()):
            raise UserError(f"{name}: its box is sheared; an Empty cannot be")
        entry = empties.add(source, empty, kind)
        entry.weight = item.get("weight", 1.0)
        empty.matrix_world = Matrix(target.tolist())
    bpy.context.view_layer.update()


def solve(source, options):
    """Solves one object; returns ({"object", "status", "message", …}, (source, result) or None)."""
    call = CALLS[options.solve_verb]
    given = solve_settings(options)
    for name in ("handles", *parser.NAMES):
        given.pop(name, None)
    given |= {name: given[name].upper() for name in UPPER if name in given}
    if "style" in given:
        given["style"] = style_identifier(given["style"])
    if "result" in given:  # the flag determines the output
        given["output"] = given["result"]
    given["result"] = "NEW"
    if "quality" in given:
        settings_of(source).fit.quality = given.pop("quality")
    begin = time.perf_counter()
    outcome = {"object": source.name, "status": "failed"}
    bpy.context.view_layer.objects.active = source
    reason = failure(call, **given)
    if reason:
        return {**outcome, "message": about(source.name, reason)}, None
    item = settings_of(source).results[-1].item
    seconds = time.perf_counter() - begin
    figures = json.loads(item[REPORT])
    message = "; ".join(text for _, text in jobs.messages()) or source.name
    outcome |= {"status": "done", "message": message, "seconds": seconds, "figures": figures}
    return outcome, (source, item)


def failure(call, **given):
    """The message of an operator that failed, in one line, else ""; KeyboardInterrupt after an interrupt."""
    try:
        if call("EXEC_DEFAULT", **given) == {"CANCELLED"}:
            raise KeyboardInterrupt
    except (RuntimeError, TypeError) as error:
        lines = (line.removeprefix("Error: ") for line in str(error).splitlines() if line.strip())
        return " ".join(OPERATOR.sub("", line) for line in lines)
    return ""


def finish_names(options, results):
    """Gives results in a mesh file their sources' names."""
    if options.output.suffix.lower() == ".blend":
        return
    for source, item in results:
        name, mesh = source.name, source.data.name
        source.name, source.data.name = f"{name}.source", f"{mesh}.source"
        item.name, item.data.name = name, mesh


def write_json(path, content):
    from arapfields._files import json_text, write_text

    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json_text(content, indent=1))


def progress(quiet):
    """Context manager that reports progress: a bar on a terminal, else a line now and then."""
    return shown_progress(jobs.progress, quiet=quiet, apart=15.0)


# bake: the animation of a .blend, to point caches or an exported file; whole, or one part of the frames.

EXPORTS = {".abc": "ABC", ".usdc": "USD", ".glb": "GLTF"}


def run_bake(options, _):
    """Returns exit code 0 if all frames, or this part of them, are done for every object; else 1."""
    suffix = required_suffix(options)
    target = options.output.resolve() if options.output else None
    folder = options.folder.resolve() if options.folder else None
    files.read(options.input)
    for place in (target, folder / "cache" if folder and folder.parent.is_dir() else None):
        if place:
            files.check_place(place)
    sources = objects_to_solve(options) if options.objects else animated(options)
    tell_of_others(options, moves)
    with progress(options.quiet), chosen(sources):
        if suffix in EXPORTS:
            reason = failure(
                bpy.ops.arapfields.export_animation,
                **frames(options),
                filepath=str(target),
                format=EXPORTS[suffix],
            )
        else:
            caches = {"format": options.format.upper(), "part": options.shard or (1, 1)}
            caches |= {"folder": str(folder)} if folder else {}
            reason = failure(bpy.ops.arapfields.bake, **frames(options), **caches)
    if reason and not jobs.messages():
        raise UserError(reason)
    for level, text in jobs.messages():
        print(f"arapfields: {text}", file=sys.stdout if level == "INFO" else sys.stderr, flush=True)
    if not reason and suffix == ".blend":
        files.write(target, [])
    failed = any(level != "INFO" for level, _ in jobs.messages())
    return 1 if reason or failed else 0


def required_suffix(options):
    """The output's suffix, "" without an output; UserError if it is unknown or the input is not a .blend."""
    if options.input.suffix.lower() != ".blend":
        raise UserError(f"{options.input}: is no .blend; a scene is baked as it is")
    suffix = options.output.suffix.lower() if options.output else ""
    if suffix not in ("", ".blend", *EXPORTS):
        known = ", ".join((".blend", *EXPORTS))
        raise UserError(f"{options.output}: unknown extension; known are {known}")
    if suffix in EXPORTS and options.shard:
        raise UserError("--shard: an exported file has no parts; bake the parts first, then export")
    return suffix


def frames(options):
    """Scope, kind and frame range as arguments of the bake operators."""
    given = {"scope": "SELECTED"}
    if options.kind:
        given["kind"] = options.kind.upper()
    if options.frames:
        given["start"], given["end"] = options.frames
    return given | {name: value for name in ("step", "subframes") if (value := getattr(options, name))}


def animated(options):
    """The objects with handles or with an animated style."""
    meshes = [item for item in bpy.context.view_layer.objects if is_source(item)]
    meshes = [item for item in meshes if moves(item)]
    if not meshes:
        raise UserError(f"{options.input}: no object has handles, or a style with keyframes")
    return meshes


def moves(item):
    """Whether an object has handles, or an animated style."""
    return bool(empties.used(item)) or kind_of(item, "AUTO") == "STYLIZE"


@contextlib.contextmanager
def chosen(sources):
    """Context manager: selects these objects for operators; shows those that are hidden or disabled."""
    home, disabled, brought = bpy.context.scene.collection, [], []
    for item in bpy.context.selected_objects:
        item.select_set(False)
    for item in sources:
        item.hide_set(False)
        if item.hide_viewport:
            disabled.append(item)
            item.hide_viewport = False
        if not item.visible_get():
            brought.append(item)
            home.objects.link(item)
        item.select_set(True)
    bpy.context.view_layer.objects.active = sources[0]
    try:
        yield
    finally:
        for item in disabled:
            item.hide_viewport = True
        for item in brought:
            home.objects.unlink(item)


# skin: skins the meshes of a .blend to its armature.


def run_skin(options, _):
    """Returns exit code 0 if the meshes are skinned, 1 if that failed."""
    for path in (options.input, options.output):
        if path.suffix.lower() != ".blend":
            raise UserError(f"{path}: is no .blend, which has meshes with an armature")
    files.read(options.input)
    files.check_place(options.output)
    armature = rig_named(options)
    meshes = objects_to_solve(options)
    if not options.objects:
        meshes = [item for item in meshes if writing.refusal_of(armature, item) is None]
    given = {p.name: getattr(options, p.name) for p in SKIN if getattr(options, p.name) is not None}
    given |= {"groups": options.groups.upper()} if options.groups else {}
    with progress(options.quiet), chosen([armature, *meshes]):
        reason = failure(bpy.ops.arapfields.skin, **given)
    for level, text in jobs.messages():
        print(f"arapfields: {text}", file=sys.stdout if level == "INFO" else sys.stderr, flush=True)
    if reason and not jobs.messages():
        raise UserError(reason)
    if not reason:
        files.write(options.output, [])
    return 1 if reason else 0


def rig_named(options):
    """The armature of that name; without a name the only one."""
    found = [item for item in bpy.context.view_layer.objects if item.type == "ARMATURE"]
    names = [item.name for item in found]
    wanted = [item for item in found if options.armature in (None, item.name)]
    if not found:
        raise UserError(f"{options.input}: holds no armature")
    if len(wanted) != 1:
        raise UserError(f"{options.input}: --armature names one of: {', '.join(sorted(names))}")
    return wanted[0]
