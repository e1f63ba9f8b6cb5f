# SPDX-License-Identifier: GPL-3.0-or-later
"""bake: the animation of a .blend, to point caches or an exported file; whole, or one part of the frames."""

import contextlib
import sys

import bpy

from ..animation.object_bake import kind_of
from ..blender.object_references import is_source
from ..core.errors import UserError
from ..core.runtime import jobs
from ..handles import empties
from . import files
from .single import failure, objects_to_solve, progress, tell_of_others

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
