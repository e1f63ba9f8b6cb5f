# SPDX-License-Identifier: GPL-3.0-or-later
"""The modal operator and what it shows, driven by stand-ins for a window's events, timer and status bar."""

import contextlib
import functools
import inspect
import time
from types import SimpleNamespace

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    from support.blender.panels import Layout

    import addon
    from addon.blender import timers
    from addon.core.runtime import jobs, native
    from addon.core.runtime.coroutines import Pause
    from addon.core.runtime.progress import JobCancelled
    from addon.jobs import display, modal, operators, status_bar
    from addon.jobs.modal import ModalRun

pytestmark = pytest.mark.in_blender


class Window:
    """Stands for a context with a window: notes timers, status texts and modal handlers."""

    def __init__(self, app):
        self.app = app
        self.timers, self.texts, self.handlers = [], [], []
        regions = [SimpleNamespace(type="WINDOW", x=0, y=0, width=1000, height=900)]
        regions.append(SimpleNamespace(type="UI", x=800, y=0, width=200, height=900))
        areas = [SimpleNamespace(type="VIEW_3D", regions=regions)]
        self.window = SimpleNamespace(screen=SimpleNamespace(areas=areas))
        self.window_manager = self.workspace = self
        self.windows, self.data, self.context = [], self, self
        self.workspaces = [self]
        self.scene, self.view_layer = timers.bpy.context.scene, timers.bpy.context.view_layer

    def event_timer_add(self, seconds, window):
        self.timers.append(seconds)
        return seconds

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.handlers.append(operator)

    def status_text_set(self, text):
        said = []
        status_bar.draw(SimpleNamespace(layout=Layout(said)), self)
        self.texts.append(" ".join([*said, *([text] if text else [])]))


@contextlib.contextmanager
def window():
    """A Window that the add-on takes for Blender's own."""
    kept = display.bpy, timers.bpy, modal.has_window
    stand_in = Window(timers.bpy.app)
    display.bpy, timers.bpy, modal.has_window = stand_in, stand_in, lambda: True
    try:
        yield stand_in
    finally:
        display.bpy, timers.bpy, modal.has_window = kept


def operator(work):
    """A modal operator whose one job is `work(tracker)`."""

    class Operator(ModalRun):
        def coroutine(self, context):
            job = jobs.Job("Test", [jobs.Item("Bar", work)], native.library().Task)
            jobs.begin(job)
            while not job.done:
                yield Pause.WORKER
            yield Pause.REDRAW
            return {"CANCELLED"} if job.take_outcomes()[0].cancelled else {"FINISHED"}

    return Operator()


def event(kind, value="NOTHING", x=400, y=400):
    return SimpleNamespace(type=kind, value=value, mouse_x=x, mouse_y=y)


def until_ended(running, context):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        time.sleep(0.005)
        result = running.modal(context, event("TIMER"))
        if result != {"RUNNING_MODAL"}:
            return result
    raise AssertionError("the job hangs")


def wait_for_cancel(tracker):
    task = tracker.start("Waiting", 1.0)
    while not task.cancelled:
        pass
    raise JobCancelled


def test_a_job_runs_beside_events_and_leaves_nothing_in_the_window():
    with window() as context:
        running = operator(lambda tracker: (tracker.start("Working", 1.0), time.sleep(0.5)))
        assert running.invoke(context, None) == {"RUNNING_MODAL"}
        assert context.handlers == [running] and len(context.timers) == 1
        assert running.modal(context, event("MOUSEMOVE")) == {"PASS_THROUGH"}
        assert until_ended(running, context) == {"FINISHED"}
        assert "Bar · Working" in " ".join(context.texts)
        assert context.texts[-1] == "" and not context.timers


def test_escape_cancels_over_a_view():
    with window() as context:
        running = operator(wait_for_cancel)
        running.invoke(context, None)
        for x, y in ((900, 400), (400, 950)):  # the sidebar, another area
            assert running.modal(context, event("ESC", "PRESS", x, y)) == {"PASS_THROUGH"}
        assert not jobs.running().cancelled
        assert running.modal(context, event("ESC", "PRESS")) == {"RUNNING_MODAL"}
        assert until_ended(running, context) == {"CANCELLED"}
        assert context.texts[-1] == "" and not context.timers


def test_a_job_of_long_standing_asks_before_it_is_thrown_away():
    asked = []

    class Confirm:
        def invoke_confirm(self, operator, event, **texts):
            asked.append(texts["title"])
            return {"RUNNING_MODAL"}

    operators.has_window, kept = lambda: True, operators.has_window
    cancel = SimpleNamespace(execute=lambda context: {"FINISHED"})
    job = jobs.Job("Bake", [jobs.Item("Bar", wait_for_cancel)], native.library().Task)
    jobs.begin(job)
    try:
        invoke = functools.partial(vars(operators.ARAPFIELDS_OT_cancel)["invoke"], cancel)
        context = SimpleNamespace(window_manager=Confirm())
        assert invoke(context, None) == {"FINISHED"} and not asked
        job._begin -= operators.ASKS_AFTER
        assert invoke(context, None) == {"RUNNING_MODAL"} and asked == ["Cancel Bake at 0%?"]
    finally:
        operators.has_window = kept
        jobs.stop()


def test_the_status_bar_is_cleared_when_the_extension_is_disabled():
    with window() as context:
        running = operator(wait_for_cancel)
        running.invoke(context, None)
        assert "Bar" in context.texts[-1]
        addon.unregister()
        assert context.texts[-1] == "" and not context.timers and jobs.running() is None
        assert inspect.getgeneratorstate(running._coroutine) == inspect.GEN_CLOSED  # not without its operator
        assert running.modal(context, event("TIMER")) == {"CANCELLED"}
        addon.register()


def test_what_ends_at_once_leaves_no_handler():
    """Blender frees an operator that does not go on; a handler of it would be asked all the same."""

    class Operator(ModalRun):
        def coroutine(self, context):
            yield Pause.REDRAW
            return {"CANCELLED"}

    with window() as context:
        assert Operator().invoke(context, event("NONE")) == {"CANCELLED"}
        assert not context.handlers and not context.timers
