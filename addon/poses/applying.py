# SPDX-License-Identifier: GPL-3.0-or-later
"""Applies a pose's field to another mesh and its carried objects."""

import numpy as np

from ..blender import modifier_stack
from ..blender.evaluation import depsgraph_of, world_matrix
from ..blender.mesh_arrays import positions
from ..blender.object_references import settings_of
from ..blender.splat_layouts import holds_splats
from ..carried.carrying import Carrying
from ..carried.transforms import array
from ..core.errors import UserError
from ..core.geometry import spaces
from ..core.geometry.spaces import Space
from ..core.poses import Pose
from ..core.runtime import native
from ..field_modifier import layers, motion
from ..live import sessions

solved = {}  # {session_uid of a source: Pose of its last solve}, cleared when another file is loaded


def solved_pose(context, source):
    """The Pose of the source's field: of its live shape at rest, or its last solve; UserError without one."""
    session = sessions.live.get(source.session_uid)
    if session is not None:
        sessions.update(context, wait=sessions.WAIT, refined=True)
        to_solve = session.reader.surface.space.local_to_solve
        return Pose(session.solver.field, session.solver.samples, to_solve)
    if source.session_uid not in solved:
        raise UserError("Deform {name} first, or make it live: its field is needed", source)
    return solved[source.session_uid]


def apply(context, source, pose, strength):
    """Moves the source's points by the pose's field, scaled by `strength`; returns warnings."""
    reason = motion.refusal(source)
    if reason is None and settings_of(source).live_kind:
        reason = UserError("{name} is live; end live mode first", source)
    if reason is None and holds_splats(source):
        reason = UserError("{name} holds splats; poses are not applied to them", source)
    if reason is not None:
        raise reason
    with modifier_stack.evaluated_mesh(context, source, in_place=True) as mesh:
        points, has_free_normals = positions(mesh), bool(modifier_stack.free_normals(mesh))
    if not len(points) or not np.isfinite(points).all():
        raise UserError("{name} has no points, or some at invalid locations", source)
    rest = pose.to_solve(points)
    try:
        posed = pose.field.apply(rest)
    except native.library().InvalidInput as error:
        raise UserError(
            "{name} lies outside of the pose's field; it was saved on another shape, or elsewhere ({error})",
            source,
            error=error,
        ) from error
    offsets, turns = strength * (pose.to_local(posed) - points), None
    if has_free_normals:
        turns = strength * spaces.turns(pose.field.jacobian(rest), pose.local_to_solve)
    carrying = Carrying(context, source)
    space = Space(pose.local_to_solve, array(world_matrix(source)) @ np.linalg.inv(pose.local_to_solve))
    carried = carrying.poses(space, depsgraph_of(context))
    shapes = carrying.moved(native.library(), pose.samples, pose.field, carried, strength)
    motion.bind(context, source)
    motion.write(source, motion.Motion(offsets, turns))
    layers.note(source, "")
    carrying.put(context, shapes)
    return carrying.take_warnings()
