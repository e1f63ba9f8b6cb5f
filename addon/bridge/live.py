# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: while handles move, by hand, script or animation, a result follows them."""

import contextlib

import bpy
import numpy as np

from ..core import jobs, native
from ..core.errors import UserError
from ..core.follower import Follower
from ..core.spaces import space_of
from . import arrays, groups, handles, results
from .lookup import ObjectId, settings_of
from .settings import plain
from .work import read_surface

TICK = 1 / 60  # seconds between looks at the handles
SAMPLES = 4000
_sessions = {}  # session_uid of the source → Session


class Session:
    """One source that is live, its solver and its result."""

    def __init__(self, context, source, output="LIVE"):
        af = native.library()
        surface = read_surface(context, source)
        wanted = handles.solve_handles(context, source, surface.space)
        samples = af.sample_mesh(surface.vertices, surface.triangles, count=SAMPLES, seed=0)
        settings = settings_of(source).deform
        options = af.LiveOptions(bending=plain(settings.bending), handle_weight=plain(settings.handle_weight))
        self.source, self.layout = ObjectId(source), layout_of(source)
        self.surface = surface
        self.solver = af.LiveDeformer(samples, groups.native_handles(af, wanted, surface, samples), options)
        mesh = results.shown_mesh(context, source, len(surface.local))
        self.result = ObjectId(results.show(context, source, "DEFORM", output, mesh, {"output": output}))
        self.goal = None
        self.follower = Follower(self.moved)

    def moved(self, targets):
        """(n, 3) vertices in local coordinates, for these targets of the handles."""
        field = self.solver.solve(targets)
        moved = self.surface.space.to_local(field(self.surface.vertices))
        if not np.isfinite(moved).all():
            raise UserError("the shape has left the finite numbers")
        return moved

    def look(self, context):
        """Sends the handles' poses to the worker when they changed."""
        source = self.source.get()
        if layout_of(source) != self.layout:
            raise Changed
        goal = targets_of(context, source)
        if self.goal is None or any(not np.array_equal(a, b) for a, b in zip(goal, self.goal, strict=True)):
            self.goal = goal
            self.follower.follow(goal)

    def show(self):
        """Puts the newest shape on the result; True when there was one."""
        moved, error = self.follower.take()
        if error:
            raise UserError(error)
        if moved is None:
            return False
        item = self.result.get()
        if item.mode == "EDIT" or len(item.data.vertices) != len(moved):
            return False
        arrays.set_positions(item.data, moved)
        return True


class Changed(Exception):
    """Handles were added, removed or given another rest pose."""


def layout_of(source):
    """What the solver was set up for: the handles and their rest regions."""
    return [(e.empty.session_uid, e.kind, e.group, tuple(e.rest)) for e in handles.used(source)]


def targets_of(context, source):
    space = space_of(source.matrix_world, source.name)
    found = handles.solve_handles(context, source, space)
    return [h.target[:3, 3] if h.kind == "POINT" else h.target for h in found]


def is_live(source):
    return source is not None and source.session_uid in _sessions


def begin(context, source):
    end(source)
    _sessions[source.session_uid] = Session(context, source)
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, persistent=True)


def end(source):
    session = _sessions.pop(source.session_uid, None)
    if session is not None:
        session.follower.stop()


def end_all(*_):
    for session in list(_sessions.values()):
        session.follower.stop()
    _sessions.clear()


def update(context, wait=0.0):
    """Looks at every live source once, waiting at most so many seconds for the shapes to follow."""
    for uid, session in list(_sessions.items()):
        try:
            session.look(context)
            if wait:
                session.follower.wait(wait)
            session.show()
        except Changed:
            source = session.source.get()
            end(source)
            with contextlib.suppress(UserError):  # the last handle was removed
                begin(context, source)
        except (UserError, ValueError, ReferenceError) as error:
            _sessions.pop(uid, None)
            session.follower.stop()
            jobs.note("ERROR", f"{session.source.name}: {error}; live mode ended")


def tick():
    """Blender calls it between redraws; ends when nothing is live."""
    if not _sessions:
        return None
    update(bpy.context)
    return TICK


@bpy.app.handlers.persistent
def before_load(*_):
    end_all()


def register():
    bpy.app.handlers.load_pre.append(before_load)


def unregister():
    end_all()
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    with contextlib.suppress(ValueError):
        bpy.app.handlers.load_pre.remove(before_load)
