# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts the surface samples that each handle holds at rest.

Counts at once; for large meshes in Blender with a window, on a worker thread.
"""

import bpy

from ..blender import host, mesh_arrays, modifier_stack, vertex_groups
from ..blender.host import has_window, redraw
from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.point_data import points_of
from ..core.errors import UserError
from ..core.geometry.handles import Handle
from ..core.runtime import native
from ..core.runtime.jobs import Pause, run_to_completion, step_for
from ..core.runtime.threads import start_thread
from ..field_modifier import layers
from . import empties, movers, native_handles
from .native_handles import Holding

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
