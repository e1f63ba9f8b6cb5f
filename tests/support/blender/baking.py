# SPDX-License-Identifier: GPL-3.0-or-later
"""Animated bars, and bake operators whose coroutine a test steps."""

import re
import tempfile
import types
from pathlib import Path

import bpy
from support.blender import scenes
from support.blender.stacks import local_points

from addon.animation import operators
from addon.core.runtime import jobs
from addon.core.runtime.jobs import Pause, run_to_completion
from addon.solver.frame_solver import FrameSolver, sampled
from addon.solver.source_reader import SourceReader

EXACT = 1e-6  # single precision of positions of size one
RUN = {"field": "radial", "samples": 1000, "iterations": 15}


def animated(name="Bar"):
    """A bar whose right end rises from frame 1 to frame 5."""
    bar, _, moving = scenes.bar_with_handles(name)
    for frame, height in ((1, 0.0), (5, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    return bar


def stepped(kind=operators.ARAPFIELDS_OT_bake, **given):
    """A stand-in for a bake operator in a window, as a plain object; tests step its coroutine."""

    class Operator(operators.CacheOperator):
        title, in_window, scope, filepath = kind.title, False, "ACTIVE", given.pop("filepath", "")
        kind_of, bake_of, choose, used = kind.kind_of, kind.bake_of, kind.choose, kind.used
        part = (0, 0)
        properties = types.SimpleNamespace(is_property_set=lambda name: name in given)

        def add_message(self, level, text):
            self.said = text

    for name, value in given.items():
        setattr(Operator, name, value)
    return Operator()


def reached(stage, message):
    """Whether a message contains a stage, or a later frame than a stage "… frame 3" names."""
    words = re.fullmatch(r"(.*frame )(\d+)", stage)
    if words is None:
        return stage in message
    now = re.search(re.escape(words[1]) + r"(\d+)", message)
    return now is not None and int(now[1]) >= int(words[2])


def cancelled_at(operator, stage):
    """Runs an operator's coroutine, cancels the job when it has reached `stage`; returns the result.

    On a busy machine a quick worker is past a frame before the job is looked at again.
    """
    coroutine = operator.coroutine(bpy.context)
    try:
        while True:
            if next(coroutine) is Pause.WORKER:
                jobs.running().join(0.001)
            if reached(stage, jobs.running().message):
                jobs.running().cancel()
    except StopIteration as ended:
        return ended.value
    finally:
        jobs.stop()


def changed_at_work(operator, change):
    """Runs an operator's coroutine to its end, and calls `change` while the worker runs."""
    coroutine = operator.coroutine(bpy.context)
    while next(coroutine) is not Pause.WORKER:
        pass
    change()
    bpy.context.view_layer.update()
    run_to_completion(coroutine, wait=lambda: jobs.running().join(0.05))
    jobs.stop()


def saved_animation(name="Bar", folder=None):
    """A bar whose right end rises from frame 1 to frame 5, in a saved file; (bar, its folder)."""
    animated(name)
    folder = folder or Path(tempfile.mkdtemp())
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    return bpy.data.objects[name], folder


def at(item, frame):
    """(n, 3) local points of an object as shown at a frame."""
    whole = int(frame // 1)
    bpy.context.scene.frame_set(whole, subframe=frame - whole)
    return local_points(item)


def solved(source, frame, kind="DEFORM"):
    """(n, 3) local points of a frame, directly from the solver."""
    reader = SourceReader(bpy.context, source, kind, in_place=True)
    run_to_completion(reader.read_setup(bpy.context))
    whole = int(frame // 1)
    bpy.context.scene.frame_set(whole, subframe=frame - whole)
    if reader.moves_by_itself:
        reader.read_points(bpy.context, source)
    solver = FrameSolver(sampled(reader.setup), reader.carrying)
    return solver.solve_from_rest(reader.request(bpy.context)).points


def cache_file():
    return str(Path(tempfile.mkdtemp()) / "bar.pc2")
