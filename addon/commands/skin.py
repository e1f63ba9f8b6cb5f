# SPDX-License-Identifier: GPL-3.0-or-later
"""skin: skins the meshes of a .blend to its armature."""

import sys

import bpy

from ..core.errors import UserError
from ..core.runtime import jobs
from ..core.settings.parameters import SKIN
from ..skin import rig as rigs
from . import files
from .bake import chosen
from .single import failure, objects_to_solve, progress


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
        meshes = [item for item in meshes if rigs.refusal_of(armature, item) is None]
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
