# SPDX-License-Identifier: GPL-3.0-or-later
"""An object while it is idle, live, or in a job or bake, and actions of users meanwhile."""

import contextlib
import tempfile

import bpy
from support.blender import scenes
from support.blender.live import WAIT

from addon import lifecycle
from addon.animation.operators import ARAPFIELDS_OT_bake
from addon.core.runtime import jobs
from addon.core.runtime.jobs import Pause, run_to_completion
from addon.deform.operators import ARAPFIELDS_OT_deform
from addon.live import sessions
from addon.solver import frame_solver

LIFT = 0.4  # motion of the moving handle along the world's z
ENDS_WORK = {"undone", "redone", "reloaded"}  # stop jobs and bakes, by before_undo and before_load
CANCELLED = {"job": "Deform cancelled", "bake": "Bake cancelled"}  # message after an undo


@contextlib.contextmanager
def watched():
    """Context manager: a list of exceptions of the add-on's handlers, which Blender only prints."""
    errors, kept = [], {}

    def noting(function):
        def called(*given):
            try:
                function(*given)
            except Exception as error:
                errors.append(error)

        return bpy.app.handlers.persistent(called)

    for name, function in lifecycle.HANDLERS.items():
        functions = getattr(bpy.app.handlers, name)
        kept[name] = noting(function)
        functions[functions.index(function)] = kept[name]
    try:
        yield errors
    finally:
        for name, function in lifecycle.HANDLERS.items():
            functions = getattr(bpy.app.handlers, name)
            functions[functions.index(kept[name])] = function


class Operator:
    """Stand-in for a job's operator in a window; tests step its coroutine; `said`: its reports."""

    def __init__(self, cls, **values):
        self.__dict__.update(vars(type("Values", (), values)))
        self.__dict__.update(values, said=[], in_window=False, scope="ACTIVE")
        self.cls = cls
        self.properties = type("Given", (), {"is_property_set": staticmethod(values.__contains__)})

    def __getattr__(self, name):
        member = getattr(self.cls, name)
        return member.__get__(self) if hasattr(member, "__get__") else member

    def add_message(self, level, text):
        self.said.append(text)


class Stage:
    """A stage of the bar's use: `begin` enters it, `end` completes it and returns the messages."""

    def __init__(self, name):
        self.name = name

    def begin(self):
        frame_solver.SAMPLES = 500
        bar, _, moving = scenes.bar_with_handles()
        for name, value in scenes.QUICK.items():
            setattr(bar.arapfields.deform, name, value)
        moving.location.z += LIFT
        if self.name == "bake":
            moving.keyframe_insert("location", frame=1)
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="before")
        if self.name == "live":
            bpy.ops.arapfields.live()
            bpy.ops.ed.undo_push(message="live")
        bar["mark"] = 1
        bpy.ops.ed.undo_push(message="mark")
        if self.name in ("job", "bake"):
            self.start(self.operator())
        return bpy.data.objects["Bar"], bpy.data.objects["Moving"]

    def operator(self):
        if self.name == "bake":
            given = {"format": "KEYS", "filepath": "", "part": (0, 0)}
            return Operator(ARAPFIELDS_OT_bake, start=1, end=3, step=1, **given)
        return Operator(ARAPFIELDS_OT_deform, **scenes.QUICK)

    def start(self, operator):
        """Runs the job until its worker has started."""
        self.running, self.coroutine = operator, operator.coroutine(bpy.context)
        while next(self.coroutine) is not Pause.WORKER:
            pass

    def end(self):
        """Completes the stage; returns all messages as one text."""
        bpy.context.view_layer.update()
        if self.name == "live":
            for _ in range(3):
                sessions.update(bpy.context, wait=WAIT)
            return all_said()
        if self.name == "idle":
            return ""
        if jobs.running() is None:  # stopped, as the operator in a window notices
            self.coroutine.close()
            return all_said()
        try:
            run_to_completion(self.coroutine, wait=lambda: jobs.running().join(0.05))
        finally:
            jobs.stop()
        return " ".join(self.running.said)


def all_said():
    return " ".join(text for _, text in jobs.messages())


def deleted(item):
    """Deletes the object as a user does: unlinks it, while pointers may keep the data-block."""
    for home in item.users_collection:
        home.objects.unlink(item)


def duplicated(item):
    copied = item.copy()
    copied.data = item.data.copy() if item.data else None
    bpy.context.collection.objects.link(copied)


def renamed(item):
    item.name = "Other Name"


def hidden(item):
    item.hide_set(True)
    item.hide_render = True


def linked(item):
    """Links the object's data to a second object, and the object to a second scene."""
    bpy.context.collection.objects.link(bpy.data.objects.new("Second", item.data))
    bpy.data.scenes.new("Another").collection.objects.link(item)


def overridden(item):
    """Replaces the object by a library override of it from another file."""
    path, name = tempfile.mktemp(suffix=".blend"), item.name
    bpy.data.libraries.write(path, {item}, fake_user=True)
    deleted(item)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = [name]
    bpy.context.collection.objects.link(into.objects[0])
    into.objects[0].override_create(remap_local_usages=False)


def undone(_):
    bpy.ops.ed.undo()


def redone(_):
    bpy.ops.ed.undo()
    bpy.ops.ed.redo()


def saved(_):
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


def reloaded(item):
    path = saved(item)
    bpy.ops.wm.open_mainfile(filepath=path)


ACTIONS = {
    function.__name__: function
    for function in (
        *(deleted, duplicated, renamed, hidden, linked),
        *(overridden, undone, redone, saved, reloaded),
    )
}


def source():
    """The source in the scene, not its copy; or None."""
    names = ("Other Name", "Bar")
    return next((bpy.context.scene.objects[name] for name in names if is_source(name)), None)


def is_source(name):
    item = bpy.context.scene.objects.get(name)
    if item is None or item.type != "MESH" or item.override_library is not None or item.library:
        return False
    return bool(item.arapfields.handles)  # a result of that name has none


def after(action, stage, which, said):
    """Asserts the expected state after an action at a stage."""
    item, gone = source(), which == "source" and action in ("deleted", "overridden")
    if stage == "idle":
        return
    if stage == "live":
        if gone:
            assert not sessions.live and "live mode ended" in said
        elif action != "reloaded":
            assert sessions.is_live(item), said
        else:
            assert not sessions.live and not item.arapfields.live_kind
        if item is not None and sessions.is_live(item) and action not in ("deleted", "overridden"):
            assert scenes.world_points(item)[:, 2].max() > 0.4, said  # it still follows the handle
        return
    if action in ENDS_WORK:
        assert said == (CANCELLED[stage] if action == "undone" else ""), said
        assert "Bar_baked" not in bpy.data.objects
    elif gone:
        assert "was deleted while it was worked on" in said and "Bar_baked" not in bpy.data.objects
    elif stage == "job":
        assert item.modifiers and scenes.world_points(item)[:, 2].max() > 0.4, said
    else:
        assert any(one.name.endswith("_baked") for one in bpy.data.objects), said


def again():
    """Ends live mode, and deforms the source if it is still there."""
    for uid in list(sessions.live):
        sessions.end(bpy.context, sessions.live[uid].source.get())
    item = source()
    if item is None:
        return
    item.hide_set(False)
    scenes.activate(item)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}


def stray():
    """Names of left-over live objects, temporary scenes, unused node groups and live sessions."""
    strays = [item.name for item in bpy.data.objects if item.name.endswith("_live")]
    strays += [scene.name for scene in bpy.data.scenes if scene.name.startswith("ARAP")]
    used = {group.name for group in bpy.data.node_groups if group.users == 0 and "ARAP" in group.name}
    return [*strays, *used, *(str(uid) for uid in sessions.live)]
