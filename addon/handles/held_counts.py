# SPDX-License-Identifier: GPL-3.0-or-later
"""What handles hold: numbers of points, counted on a worker, and Empties that follow a wrap's surface."""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import host, mesh_arrays, modifier_stack, vertex_groups
from ..blender.evaluation import is_driven
from ..blender.host import has_window, redraw
from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.point_data import points_of
from ..core.errors import UserError
from ..core.geometry.handles import Handle, followed_box
from ..core.geometry.spaces import inverse, transform
from ..core.runtime import native
from ..core.runtime.jobs import Pause, run_to_completion, step_for
from ..core.runtime.threads import start_thread
from ..field_modifier import layers
from . import empties, movers, native_handles
from .movers import box_now, matrix_of, rest_of
from .native_handles import Holding

# Counts the surface samples that each handle holds at rest.
#
# Counts at once; for large meshes in Blender with a window, on a worker thread.

COUNTED = 4000  # number of surface samples
LARGE = 20000  # number of vertices from which a worker counts
INTERVAL = 0.03  # seconds between calls of the timer
pending = {}  # {session_uid of the source: coroutine that counts}


def count_inside(context, source, at_once=False):
    """Counts and stores `inside` of each handle."""
    coroutine = counting(context, source)
    if at_once or not has_window() or len(points_of(source.data)) < LARGE:
        run_to_completion(coroutine)
        return
    for entry in empties.used(source):
        entry.inside = -1
    pending[source.session_uid] = coroutine
    host.start(poll_counts, first=INTERVAL)


def count_for(operator, context, source, at_once=False):
    """The same at the end of an operator, whose work is done by then: what hinders the count is a warning."""
    try:
        count_inside(context, source, at_once)
    except (UserError, ValueError) as error:
        operator.report({"WARNING"}, translated(error))


def counting(context, source):
    """Coroutine that counts for all handles of a source."""
    in_place = settings_of(source).in_place
    reference, below = ObjectReference(source), layers.below_pose(source, in_place)
    with modifier_stack.mesh_of(context, source, below) as shape:
        mesh = mesh_arrays.arrays_of(source, shape)
    shown = native_handles.read_subdivided(context, source, in_place, below)
    weights = yield from vertex_groups.read_weights(context, source, empties.group_names(source), in_place)
    source = reference.get()
    regions = {movers.key_of(entry): region_of(entry, weights) for entry in empties.used(source)}
    counts, failures = {}, []

    def work():
        try:
            counts.update(points_inside(mesh, regions, shown))
        except ValueError as error:
            failures.append(error)

    worker = start_thread("counting", work, low_priority=has_window())
    try:
        while worker.is_alive():
            yield Pause.WORKER
    finally:
        worker.join()  # also if the coroutine is closed, when the extension is disabled
    if failures:
        raise failures[0]
    for entry in empties.used(reference.get()):
        entry.inside = counts.get(movers.key_of(entry), -1)


def region_of(entry, weights):
    """The Handle at rest, in the source's coordinates."""
    rest = movers.rest_of(entry)
    return Handle("", entry.kind, rest, rest, weights.get(movers.group_of(entry)), hold_from=entry.hold_from)


def points_inside(mesh, regions, shown):
    """{handle's key: number of points that it holds, -1 for a point or a pin}; on the worker.
    `shown`: result of native_handles.read_subdivided()."""
    if mesh.splats is not None:
        points = mesh.vertices
    else:
        points = native.library().sample_mesh(mesh.vertices, mesh.triangles, count=COUNTED, seed=0).points
    counts, holding = {}, Holding(mesh.vertices, points, list(regions.values()))
    for key, handle in regions.items():
        if handle.kind in ("POINT", "PIN"):  # both always hold something
            counts[key] = -1
        elif handle.kind in ("GROUP", "BONE"):
            counts[key] = len(holding.of(handle))
        else:
            counts[key] = len(native_handles.points_inside(handle, points, shown)[0])
    return counts


def poll_counts():
    """Timer callback; unregisters itself when nothing is left to count."""
    for uid, coroutine in list(pending.items()):
        try:
            ended = step_for(coroutine)
        except (UserError, ValueError, ReferenceError):  # the object was removed or has changed
            ended = True
        if ended:
            pending.pop(uid, None)
            redraw(bpy.context, "UI")
    return INTERVAL if pending else None


# Moves Empties of handles with the surface that they hold, when a wrap is applied or removed.
#
# They stay if a deformation would not act on the wrap's result (layers.py).


class Followers:
    """The handles of a source, made before its surface changes."""

    def __init__(self, context, source):
        entries = [entry for entry in empties.used(source) if entry.kind != "BONE"]
        self.before = seen(context, source) if entries else None
        self.is_wrapped = settings_of(source).moved_by == "WRAP"

    def follow(self, context, source, back=False):
        """Moves rest boxes with the surface, and their Empties by the same motion; `back`: to the rest boxes
        from before the wrap."""
        after = None if self.before is None else seen(context, source)
        if after is None or len(after) != len(self.before) or np.array_equal(after, self.before):
            return
        world, moved = matrix_of(source), []
        for entry in empties.used(source):
            if entry.kind == "BONE" or not is_free(entry.empty):
                continue
            rest, now = world @ rest_of(entry), box_now(entry)
            unwrapped = np.array(entry.unwrapped, dtype=np.float64).reshape(4, 4)
            was_taken = self.is_wrapped and unwrapped.any()
            unwrapped = unwrapped if was_taken else rest_of(entry)
            if back and was_taken:
                box = world @ unwrapped
            else:
                box = followed_box(rest, self.before, after, is_box=entry.kind == "CUBE")
            is_at_rest = np.allclose(rest, now, rtol=0, atol=1e-5 * np.abs(rest[:3, :3]).max())
            moved.append((entry, box, is_at_rest, unwrapped))
            motion = box @ inverse(rest) @ np.array(entry.empty.matrix_world, dtype=np.float64)
            entry.empty.matrix_world = Matrix(motion.tolist())
        context.view_layer.update()
        for entry, box, is_at_rest, unwrapped in moved:
            if is_at_rest:
                empties.store_rest(source, entry)
            else:
                entry.rest = (inverse(world) @ box).ravel()
            entry.unwrapped = np.zeros(16) if back else unwrapped.ravel()
        count_inside(context, source, at_once=True)


def seen(context, source):
    """(n, 3) world vertices of the shape that a deformation acts on."""
    with modifier_stack.mesh_of(context, source, layers.below_pose(source, in_place=True)) as mesh:
        return transform(matrix_of(source), mesh_arrays.positions(mesh))


def is_free(empty):
    """Whether an Empty can be moved: local and not driven."""
    return empty.library is None and empty.override_library is None and not is_driven(empty)
