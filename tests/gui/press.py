# SPDX-License-Identifier: GPL-3.0-or-later
"""Time from the press of Deform or Stylize to the result, for 50,000 vertices; previews leave nothing."""

import time

import bpy
import numpy as np
import stage
from mouse import until, until_idle
from support.blender import scenes

from addon.core.runtime import jobs
from addon.field_modifier import motion

LIMIT = 60.0  # seconds without progress before a result is given up
ROUNDS = 2


def checks(figures, folder):
    for name in ("deform", "stylize"):
        figures[f"press_{name}"] = rounds = []
        for number in range(ROUNDS):
            yield from one(rounds, name, folder if number == 0 else None)
        figures[f"cancel_{name}"] = yield from cancelled(name, folder)
    yield from with_steps_between(figures)


def round_off(bar):
    """Makes the bar an ellipsoid, which every style changes."""
    flat = np.empty(3 * len(bar.data.vertices), dtype=np.float32)
    bar.data.vertices.foreach_get("co", flat)
    half = np.array([1.0, 0.25, 0.25], dtype=np.float32)
    way = flat.reshape(-1, 3) / half
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    bar.data.vertices.foreach_set("co", (1.2 * half * way).ravel())
    bar.data.update()


def set_stage():
    """An ellipsoid of about 50,000 vertices with a moved handle."""
    stage.empty_file()
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        stage.dense_bar()
        round_off(bar)
        moving.location.z += 0.6
        bpy.context.view_layer.update()
        bpy.ops.view3d.view_all()
        scenes.activate(bar)
        bpy.ops.ed.undo_push(message="stage")
    return bar


def press(name):
    with stage.override():
        getattr(bpy.ops.arapfields, name)("INVOKE_DEFAULT")


def shape(bar):
    return scenes.world_points(bar)


def one(rounds, name, folder):
    """Seconds to the first and to the last picture of a moved mesh, and their difference."""
    bar = set_stage()
    yield 2.0
    before, rest, written = stage.everything(), shape(bar), []
    original, motion.write = (
        motion.write,
        lambda *given: (written.append(time.perf_counter()), original(*given)),
    )
    drawn, stop = stage.draws()
    begin = time.perf_counter()
    press(name)
    said = time.perf_counter() - begin
    first = None
    yield from until_job(lambda: written and any(at > written[0] for at in drawn))
    if jobs.running() is not None:
        first = shape(bar)
        if folder is not None:
            stage.picture(folder, f"press-{name}-first")
    yield from until_idle(LIMIT)
    yield 1.0
    stop()
    motion.write = original
    last = shape(bar)
    size = np.ptp(rest, axis=0).max()
    rounds.append(
        {
            "press_s": round(said, 3),
            "first_shape_s": round(written[0] - begin, 3) if written else None,
            "first_picture_s": seconds_to(drawn, written[:1], begin),
            "last_picture_s": seconds_to(drawn, written[-1:], begin),
            "shapes": len(written),
            "first_off_by": None if first is None else round(float(np.abs(last - first).max() / size), 4),
            "moved_by": round(float(np.abs(last - rest).max() / size), 4),
        }
    )
    if folder is not None:
        stage.picture(folder, f"press-{name}-last")
    with stage.override():
        bpy.ops.ed.undo()
    yield 0.5
    rounds[-1]["one_undo_step"] = stage.everything() == before
    print(name, rounds[-1], flush=True)


def seconds_to(drawn, written, begin):
    """Seconds to the first drawing that began after the shape was written."""
    after = [at - begin for at in drawn if written and at > written[0]]
    return round(after[0], 3) if after else None


def until_job(reached):
    """Waits until the running job has reached a state, or has ended."""
    yield from until(lambda: jobs.running() is None or reached(), LIMIT, jobs.progress)


def until_shown(bar, rest):
    yield from until_job(lambda: not np.array_equal(shape(bar), rest))


def cancelled(name, folder):
    """Cancels a job after its first result, without and with an earlier result."""
    exact = []
    for earlier in (False, True):
        bar = set_stage()
        if earlier:
            with stage.override():
                bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.QUICK)
        yield 1.0
        before, rest = stage.everything(), shape(bar)
        press(name)
        yield from until_shown(bar, rest)
        was_shown = jobs.running() is not None
        bpy.ops.arapfields.cancel()
        yield from until_idle()
        yield 0.3
        exact.append(was_shown and stage.everything() == before and np.array_equal(shape(bar), rest))
    return exact


def with_steps_between(figures):
    """An undo step pushed while the first result is shown does not contain it."""
    bar = set_stage()
    yield 1.0
    before, rest = stage.everything(), shape(bar)
    press("deform")
    yield from until_shown(bar, rest)
    bpy.ops.ed.undo_push(message="between")
    yield from until_idle()
    yield 0.3
    moved = not np.array_equal(shape(bar), rest)
    with stage.override():
        bpy.ops.ed.undo()
    yield 0.5
    bar = bpy.data.objects["Bar"]
    figures["step_between_holds_nothing"] = moved and stage.everything() == before
    figures["step_between_shape"] = np.array_equal(shape(bar), rest)
