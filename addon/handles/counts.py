# SPDX-License-Identifier: GPL-3.0-or-later
"""How many points of the surface each handle holds at rest.

Counted at once; for large meshes in a window by a worker, while the window goes on.
"""

import threading

import bpy
import numpy as np

from ..blender import mesh_arrays, vertex_groups
from ..blender.object_references import ObjectId
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.coroutines import advanced, finished
from ..core.runtime.threads import stand_back
from ..jobs.modal import BUDGET, TICK, redraw
from . import empties

COUNTED = 4000  # samples of the surface of which a handle's share is told
LARGE = 20000  # vertices from which a window does not wait
_courses = {}  # session_uid of the source → its count, while that runs


def count_inside(context, source):
    """Stores each handle's count with it."""
    course = counting(context, source)
    if bpy.app.background or len(source.data.vertices) < LARGE:
        finished(course)
        return
    for entry in empties.used(source):
        entry.inside = -1
    _courses[source.session_uid] = course
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=TICK)


def counting(context, source):
    who, mesh = ObjectId(source), mesh_arrays.read(context, source)
    weights = yield from vertex_groups.read_weights(context, source, empties.group_names(source))
    wanted = [
        (entry.empty.session_uid, entry.kind, entry.group, np.array(entry.rest, dtype=np.float64))
        for entry in empties.used(who.get())
    ]
    found, failures = {}, []
    window = not bpy.app.background

    def work():
        if window:
            stand_back()
        try:
            found.update(inside(mesh, wanted, weights))
        except ValueError as error:
            failures.append(error)

    worker = threading.Thread(target=work, name="arapfields counting", daemon=True)
    worker.start()
    while worker.is_alive():
        yield True
    if failures:
        raise failures[0]
    for entry in empties.used(who.get()):
        entry.inside = found.get(entry.empty.session_uid, -1)


def inside(mesh, wanted, weights):
    """{session_uid of the Empty: points that the handle holds, -1 where it is a point}; on the worker."""
    points = native.library().sample_mesh(mesh.vertices, mesh.triangles, count=COUNTED, seed=0).points
    found = {}
    for uid, kind, group, rest in wanted:
        if kind == "GROUP":
            held = vertex_groups.at_points(mesh.vertices, weights[group], points) >= vertex_groups.HELD
        else:
            box = rest.reshape(4, 4)
            held = (np.abs((points - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T) <= 1).all(axis=1)
        found[uid] = -1 if kind == "POINT" else int(held.sum())
    return found


def tick():
    """Blender calls it between events; ends when nothing is left to count."""
    for uid, course in list(_courses.items()):
        try:
            ended = advanced(course, BUDGET)
        except (UserError, ValueError, ReferenceError):  # the object went, or changed: nothing to tell
            ended = True
        if ended:
            _courses.pop(uid, None)
            redraw(bpy.context, "UI")
    return TICK if _courses else None


@bpy.app.handlers.persistent
def forget(*_):
    _courses.clear()


def register():
    bpy.app.handlers.load_pre.append(forget)


def unregister():
    forget()
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    if forget in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(forget)
