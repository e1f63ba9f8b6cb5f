# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: the modal operator, and users who edit, delete or leave what a job works on."""

import contextlib
import functools
import inspect
import tempfile
import time
from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages
    from support.blender.baking import animated, saved_animation, stepped
    from support.blender.panels import Layout
    from support.blender.scenes import delete
    from support.blender.skins import rigged_bar
    from support.blender.stages import Operator
    from support.blender.wraps import SMALL, bar_and_target

    import addon
    from addon.animation import caches, object_bake
    from addon.blender import host
    from addon.blender.object_references import source_of
    from addon.carried import operators as carried
    from addon.core.errors import UserError
    from addon.core.runtime import jobs, native
    from addon.core.runtime.jobs import JobCancelled, Pause
    from addon.deform.operators import ARAPFIELDS_OT_deform
    from addon.field_modifier import node_group
    from addon.handles import empties, operators
    from addon.jobs import display, job_operator
    from addon.jobs import operators as job_operators
    from addon.jobs.job_operator import JobOperator, ModalRun
    from addon.results import placement
    from addon.wrap.operators import ARAPFIELDS_OT_wrap

pytestmark = pytest.mark.in_blender

# The modal operator and what it shows, driven by stand-ins for a window's events, timer and status bar.


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
        self.scene, self.view_layer = host.bpy.context.scene, host.bpy.context.view_layer

    def event_timer_add(self, seconds, window):
        self.timers.append(seconds)
        return seconds

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.handlers.append(operator)

    def status_text_set(self, text):
        said = []
        display.draw(SimpleNamespace(layout=Layout(said)), self)
        self.texts.append(" ".join([*said, *([text] if text else [])]))


@contextlib.contextmanager
def window():
    """A Window that the add-on takes for Blender's own."""
    kept = display.bpy, host.bpy, job_operator.has_window
    stand_in = Window(host.bpy.app)
    display.bpy, host.bpy, job_operator.has_window = stand_in, stand_in, lambda: True
    try:
        yield stand_in
    finally:
        display.bpy, host.bpy, job_operator.has_window = kept


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

    job_operators.has_window, kept = lambda: True, job_operators.has_window
    cancel = SimpleNamespace(execute=lambda context: {"FINISHED"})
    job = jobs.Job("Bake", [jobs.Item("Bar", wait_for_cancel)], native.library().Task)
    jobs.begin(job)
    try:
        invoke = functools.partial(vars(job_operators.ARAPFIELDS_OT_cancel)["invoke"], cancel)
        context = SimpleNamespace(window_manager=Confirm())
        assert invoke(context, None) == {"FINISHED"} and not asked
        job._begin -= job_operators.ASKS_AFTER
        assert invoke(context, None) == {"RUNNING_MODAL"} and asked == ["Stop Bake at 0%?"]
    finally:
        job_operators.has_window = kept
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


# Users who edit the mesh that a job works on: results wait for the end of Edit Mode, or leave nothing.


def steps_until(coroutine, reached):
    """Steps it as a window does; what it returns, or None as soon as `reached()`."""
    for _ in range(100000):
        try:
            if next(coroutine) is Pause.WORKER:
                jobs.running().join(0.005)
        except StopIteration as ended:
            jobs.stop()
            return ended.value
        if reached():
            return None
    raise AssertionError(jobs.running().message)


def waits():
    return "is in Edit Mode; leave it first" in jobs.running().message


def edited():
    """(bar, coroutine) of a job that has its result while the bar is in Edit Mode."""
    stage = stages.Stage("job")
    bar, _ = stage.begin()
    stage.running.in_window = True
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode="EDIT")
    assert steps_until(stage.coroutine, waits) is None
    return bar, stage.coroutine


def test_a_result_waits_for_the_end_of_edit_mode():
    bar, coroutine = edited()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert steps_until(coroutine, lambda: False) == {"FINISHED"}
    assert scenes.world_points(bar)[:, 2].max() > 0.4


def shown_first():
    """The bar, its job's coroutine, and the preview, which shows the first shape."""
    stage = stages.Stage("window")
    bar, _ = stage.begin()
    operator = stage.operator()
    operator.in_window = True
    stage.start(operator)
    preview = jobs.running().items[0].preview
    preview.show(preview.points.astype("f4"))
    return bar, stage.coroutine, preview


@pytest.mark.parametrize("ends", ["FINISHED", "CANCELLED"])
def test_a_result_takes_the_modifier_that_a_first_shape_made(ends):
    """Its inputs may be in the user's hands: Blender crashed when it went."""
    bar, coroutine, preview = shown_first()
    node_group.put(bar.modifiers[0], "Factor", 0.5)
    if ends == "CANCELLED":
        jobs.running().cancel()
    assert steps_until(coroutine, lambda: False) == {ends}
    preview.clear()  # as the window's display does in the end
    if ends == "CANCELLED":
        assert not bar.modifiers
        return
    assert len(bar.modifiers) == 1 and node_group.get(bar.modifiers[0], "Factor") == 0.5
    node_group.put(bar.modifiers[0], "Factor", 1.0)
    bpy.context.view_layer.update()
    shown = scenes.world_points(bar)
    bpy.ops.arapfields.remove_field()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    assert (scenes.world_points(bar) == shown).all()


def test_a_first_shape_goes_where_its_result_is_refused():
    bar, coroutine, preview = shown_first()

    def refuse(*given):
        raise UserError("no")

    places, placement.place_result = placement.place_result, refuse
    try:
        assert steps_until(coroutine, lambda: False) == {"CANCELLED"}
    finally:
        placement.place_result = places
    preview.clear()
    assert not bar.modifiers and "ARAP Fields" not in bar.data.attributes


def test_one_that_waits_is_cancelled():
    bar, coroutine = edited()
    jobs.running().cancel()
    assert steps_until(coroutine, lambda: False) == {"CANCELLED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not bar.modifiers and "ARAP Fields" not in bar.data.attributes


def subdivided(bar):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")


def mirrored(bar):
    bar.modifiers.new("Mirror", "MIRROR").use_axis = (False, True, False)


def exchanged(bar):
    bar.data = bpy.data.meshes.new("Triangle")
    bar.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])


CHANGES = {"subdivided": subdivided, "mirrored": mirrored, "exchanged": exchanged} if IN_BLENDER else {}


@pytest.mark.parametrize("change", ["subdivided", "mirrored", "exchanged"])
def test_a_mesh_of_other_vertices_is_left_alone(change):
    stage = stages.Stage("job")
    bar, _ = stage.begin()
    scenes.activate(bar)
    CHANGES[change](bar)
    names = {item.name for item in bpy.data.objects}
    assert "changed while it was worked on" in stage.end()
    assert [m.type for m in bar.modifiers] == (["MIRROR"] if change == "mirrored" else [])
    assert "ARAP Fields" not in bar.data.attributes
    assert {item.name for item in bpy.data.objects} == names


# Jobs whose scene the window leaves, or whose file is saved elsewhere, or that lose what they need.

FRAMES = 30  # far more than are read ahead


def swelling_bar():
    """A bar that swells by itself while a handle lifts it: each frame is read when its turn comes."""
    bar, folder = saved_animation()
    bar.shape_key_add(name="Basis")
    key = bar.shape_key_add(name="Swell")
    for point in key.data:
        point.co = point.co * 1.3
    for frame, value in ((1, 0.0), (FRAMES, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(1)
    return bar, folder / "cache/scene~Scene~Bar.pc2"


def begun(operator):
    """The operator, which runs as in a window."""
    operator.show_progress = lambda *_: None
    operator.set_out(bpy.context)
    return operator


def advanced(operator, until=lambda: False):
    """Advances it until it ends, or that holds; what `advance` returns at last."""
    result = {"RUNNING_MODAL"}
    while result == {"RUNNING_MODAL"} and not until():
        result = operator.advance(bpy.context)
        if jobs.running() is not None:
            jobs.running().join(0.001)
    return result


def bake():
    return begun(stepped(format="PC2", start=1, end=FRAMES, folder="//cache"))


def at_frame(number):
    return lambda: bpy.context.scene.frame_current >= number


@contextlib.contextmanager
def elsewhere():
    """The window shows another scene."""
    window, scene = bpy.context.window, bpy.context.scene
    window.scene = bpy.data.scenes.new("Other")
    assert bpy.context.scene != scene
    try:
        yield
    finally:
        with contextlib.suppress(ReferenceError):  # it was deleted
            window.scene = scene


def only_waits(operator, name="Scene"):
    """Whether an operator says that it waits for that, and does nothing."""
    before = [(scene.frame_current, len(scene.objects)) for scene in bpy.data.scenes]
    results = [operator.advance(bpy.context) for _ in range(20)]
    assert jobs.running().message == f"Waits until the window shows {name}"
    assert [(scene.frame_current, len(scene.objects)) for scene in bpy.data.scenes] == before
    return all(result == {"RUNNING_MODAL"} for result in results)


def test_a_bake_waits_until_its_own_scene_is_shown_again():
    _, path = swelling_bar()
    assert advanced(bake()) == {"FINISHED"}
    expected = path.read_bytes()
    bpy.ops.arapfields.remove_bake()
    running = bake()
    advanced(running, at_frame(4))
    with elsewhere():
        assert only_waits(running)
    assert advanced(running) == {"FINISHED"}, running.said
    assert path.read_bytes() == expected and bpy.context.scene.frame_current == 1


def test_another_view_layer_is_waited_for_as_well():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    window, layer = bpy.context.window, bpy.context.view_layer
    window.view_layer = bpy.context.scene.view_layers.new("Other")
    assert only_waits(running, layer.name)
    window.view_layer = layer
    assert advanced(running) == {"FINISHED"} and path.exists()


def test_what_is_cancelled_elsewhere_ends_there():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    with elsewhere():
        jobs.running().cancel()
        assert advanced(running) == {"CANCELLED"} and running.said == "Bake cancelled"
    assert jobs.running() is None and not path.parent.exists()
    assert bpy.context.scene.frame_current == 1


def test_a_new_object_comes_into_its_sources_scene():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    running = begun(Operator(ARAPFIELDS_OT_deform, **scenes.NEW))
    assert advanced(running, lambda: jobs.running() and jobs.running().items) == {"RUNNING_MODAL"}
    with elsewhere():
        jobs.running().join()
        assert only_waits(running)
    assert advanced(running) == {"FINISHED"}, running.said
    assert "Bar_deformed" in bpy.context.scene.objects and not bar.visible_get()


def test_a_bake_says_that_its_scene_was_deleted():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    scene = bpy.context.scene
    with elsewhere():
        bpy.data.scenes.remove(scene)
        assert advanced(running) == {"CANCELLED"}
    assert running.said == "Scene was deleted while it was worked on"
    assert jobs.running() is None and not path.parent.exists()


def test_a_cache_is_found_from_where_the_file_was_saved_meanwhile():
    bar, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    (path.parents[1] / "later").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(path.parents[1] / "later/scene.blend"))
    assert advanced(running) == {"FINISHED"}
    assert bar.modifiers[0].filepath == f"//../cache/{path.name}" and caches.problem(bar) is None


def test_a_bake_says_that_it_lost_a_handle():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    scenes.delete(bpy.data.objects["Moving"])
    assert advanced(running) == {"CANCELLED"}
    assert running.said == "Bar changed while it was worked on; run again"
    assert not path.parent.exists()


class Waiting(JobOperator if IN_BLENDER else object):
    """A job that has no end of its own."""

    title = "Wait"

    def plan(self, context, source, weights):
        return jobs.Item(source.name, wait_for_cancel)


@pytest.mark.parametrize("hidden", [False, True])
def test_a_job_whose_object_is_deleted_ends_at_once(hidden):
    bar, _, _ = scenes.bar_with_handles()
    scenes.activate(bar)
    running = begun(Operator(Waiting))
    advanced(running, lambda: jobs.running() and jobs.running().items)
    bar.hide_set(hidden)
    results = [running.advance(bpy.context) for _ in range(5)]
    assert results == 5 * [{"RUNNING_MODAL"}] and not jobs.running().cancelled
    scenes.delete(bar)
    assert advanced(running) == {"CANCELLED"}
    assert running.said == ["Bar was deleted while it was worked on"] and jobs.running() is None


def test_a_job_of_two_objects_goes_on_for_the_one_that_is_left():
    bar, other = scenes.bar(), scenes.bar("Other")
    scenes.activate(other, bar)
    running = begun(Operator(Waiting))
    running.scope = "SELECTED"
    advanced(running, lambda: jobs.running() and jobs.running().items)
    scenes.delete(bar)
    results = [running.advance(bpy.context) for _ in range(5)]
    assert results == 5 * [{"RUNNING_MODAL"}] and not jobs.running().cancelled
    jobs.running().cancel()
    assert advanced(running) == {"CANCELLED"} and running.said == ["Wait cancelled"]


def test_a_bake_whose_object_is_deleted_ends_and_loses_nothing():
    """It solved all frames before it said so."""
    bar, folder = saved_animation()
    path = folder / "cache/scene~Scene~Bar.pc2"
    assert advanced(begun(stepped(format="PC2", start=1, end=5, folder="//cache"))) == {"FINISHED"}
    kept = path.read_bytes()
    solve, solved = object_bake.ObjectBake.add, []

    def add(self, frame, request, is_baked=True, task=None):
        solved.append(frame)
        end = time.monotonic() + 60
        while frame == 3 and not task.cancelled and time.monotonic() < end:
            time.sleep(0.001)
        solve(self, frame, request, is_baked, task)

    object_bake.ObjectBake.add = add
    try:
        running = begun(stepped(format="PC2", start=1, end=5, folder="//cache"))
        advanced(running, lambda: 3 in solved)
        scenes.delete(bar)
        assert advanced(running) == {"CANCELLED"}
    finally:
        object_bake.ObjectBake.add = solve
    assert running.said == "Bar was deleted while it was worked on" and solved == [1, 2, 3]
    assert path.read_bytes() == kept and [one.name for one in path.parent.iterdir()] == [path.name]


def swelling_bar_over_a_cube():
    bar, path = swelling_bar()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -5))
    cube = bpy.context.object
    scenes.activate(cube, bar)
    assert bpy.ops.arapfields.add_obstacle() == {"FINISHED"}
    bar.arapfields.contact.use = True
    return cube, path


@pytest.mark.parametrize("kind", ["deleted", "taken out", "hidden", "switched off"])
def test_a_bake_says_that_it_lost_an_obstacle(kind):
    cube, path = swelling_bar_over_a_cube()
    running = bake()
    advanced(running, at_frame(4))
    if kind == "deleted":
        scenes.delete(cube)
    elif kind == "hidden":
        cube.hide_set(True)
    elif kind == "switched off":
        cube.hide_viewport = True
    else:
        bpy.ops.arapfields.remove_obstacle()
    assert advanced(running) == {"CANCELLED"}
    assert running.said == "Bar changed while it was worked on; run again"
    assert not path.parent.exists()


@pytest.mark.parametrize("kind", ["keys", "strips", "drivers"])
def test_an_obstacle_may_come_and_go_by_its_animation(kind):
    cube, path = swelling_bar_over_a_cube()
    if kind == "drivers":
        cube.driver_add("hide_viewport").driver.expression = "frame < 10"
    else:
        for frame, hidden in ((1, True), (10, False)):
            cube.hide_viewport = hidden
            cube.keyframe_insert("hide_viewport", frame=frame)
    if kind == "strips":
        data = cube.animation_data
        data.nla_tracks.new().strips.new("Strip", 1, data.action)
        data.action = None
    for frame in (12, 1):
        bpy.context.scene.frame_set(frame)
        assert cube.hide_viewport == (frame == 1)
    running = bake()
    assert advanced(running) == {"FINISHED"} and path.exists(), running.said


@pytest.mark.parametrize("result", ["MODIFIER", "NEW"])
def test_a_wrap_whose_object_is_moved_meanwhile_lies_on_its_target(result):
    """It was said to be near the target, and lay beside it."""
    item, target = bar_and_target()
    item.scale = (1, 1.2, 0.9)
    bpy.context.view_layer.update()
    scenes.activate(item)
    running = begun(Operator(ARAPFIELDS_OT_wrap, onto="", result=result, **SMALL))
    advanced(running, lambda: jobs.running() and jobs.running().items)
    item.location, item.rotation_euler = (0, 0, 2), (0, 0, 1)
    bpy.context.view_layer.update()
    assert advanced(running) == {"FINISHED"}, running.said
    shown = bpy.data.objects["Bar_wrapped"] if result == "NEW" else item
    corners = [
        np.array([points.min(axis=0), points.max(axis=0)])
        for points in map(scenes.world_points, (shown, target))
    ]
    assert np.abs(corners[0] - corners[1]).max() < 0.1


# Objects that users delete, duplicate, override or edit at the wrong moment.


def test_a_deleted_empty_is_no_handle_though_a_pointer_keeps_it():
    bar, fixed, moving = scenes.bar_with_handles()
    delete(moving)
    assert [entry.empty for entry in empties.used(bar)] == [fixed]
    delete(fixed)
    with pytest.raises(RuntimeError, match="Drag a pin or add a handle first"):
        bpy.ops.arapfields.deform(**scenes.NEW)


def test_a_deleted_source_is_worked_on_no_more():
    bar, fixed, _ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    delete(bar)
    scenes.activate(fixed)
    assert source_of(bpy.context) is None and not bpy.ops.arapfields.deform.poll()
    assert fixed.arapfields.owner == fixed.arapfields
    scenes.activate(result)
    assert source_of(bpy.context) == result  # an object like any other


def test_a_copy_of_a_handle_takes_no_other_handle_away():
    bar, fixed, moving = scenes.bar_with_handles()
    copied = moving.copy()
    bpy.context.collection.objects.link(copied)
    bpy.context.view_layer.update()
    scenes.activate(copied)
    with pytest.raises(RuntimeError, match=r"Moving\.001 is a copy of a handle and is none itself"):
        bpy.ops.arapfields.remove_handle()
    assert len(bar.arapfields.handles) == 2
    other = scenes.bar("Other")
    scenes.activate(copied, other)
    bpy.ops.arapfields.add_handle()
    assert [entry.empty for entry in other.arapfields.handles] == [copied]
    assert [entry.empty for entry in bar.arapfields.handles] == [fixed, moving]


def test_taking_a_handle_from_another_mesh_is_said():
    bar, _, moving = scenes.bar_with_handles()
    other = scenes.bar("Other")
    scenes.activate(moving, other)
    said = reports(operators.ARAPFIELDS_OT_add_handle, kind="CUBE", place="AUTO", group="")
    assert said["WARNING"][0] == "Handles of Bar were taken over by Other"
    assert len(bar.arapfields.handles) == 1 and len(other.arapfields.handles) == 1


def test_a_handle_that_holds_nothing_is_said():
    bar = scenes.bar()
    far = scenes.cube_empty((30, 0, 0), (1, 1, 1), "Far")
    scenes.activate(far, bar)
    said = reports(operators.ARAPFIELDS_OT_add_handle, kind="CUBE", place="AUTO", group="")
    assert said["WARNING"] == ["No part of the surface lies in the rest region of Far"]


def test_meshes_with_bones_of_their_own_are_said():
    """A figure of several objects: the body alone has handles, and a sleeve's bone moves nothing."""
    bar, rig = rigged_bar()
    bar.vertex_groups.remove(bar.vertex_groups["Second"])
    shirt, sleeve = scenes.bar("Shirt"), scenes.bar("Sleeve")
    for item, bone in ((shirt, "Bone"), (sleeve, "Second")):
        item.vertex_groups.new(name=bone).add(range(len(item.data.vertices)), 1.0, "REPLACE")
        item.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(shirt, sleeve, bar)
    said = reports(carried.ARAPFIELDS_OT_carry, way="FOLLOW")
    assert not said["WARNING"]
    scenes.activate(rig, bar)
    line = "Bones that Bar has no vertex groups of do not pose Sleeve; join these with it first (Ctrl J)"
    for name in ("AUTO", "DEFORMING"):
        assert reports(operators.ARAPFIELDS_OT_add_bones, bones=name)["WARNING"] == [line]
    scenes.activate(sleeve, bar)
    assert reports(carried.ARAPFIELDS_OT_carry, way="TOGETHER")["WARNING"] == [line]
    assert not reports(carried.ARAPFIELDS_OT_carry, way="RIGID")["WARNING"]


def reports(operator, **properties):
    """{level: texts} that an operator reports when it is executed with these properties."""
    said = {"INFO": [], "WARNING": [], "ERROR": []}
    stand_in = type("Operator", (), {**vars(operator), **properties})
    for base in reversed([base for base in operator.__mro__[1:] if base.__module__.startswith("addon")]):
        for name, value in vars(base).items():
            if not name.startswith("__") and name not in vars(operator):
                setattr(stand_in, name, value)
    stand_in.report = lambda self, levels, text: said[next(iter(levels))].append(text)
    stand_in().execute(bpy.context)
    return said


def test_nothing_is_changed_on_a_linked_object():
    """Where Blender would show it until the file is opened again."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.wrap.onto = scenes.bar("Scan")
    scenes.activate(bar)
    bpy.ops.arapfields.add_landmark(rest=(1, 0, 0), on_target=(1, 0, 0))
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(**scenes.QUICK)
    bar.name = "Linked"
    linked = scenes.from_another_file(bar)[0]
    scenes.activate(linked)
    ours = bpy.ops.arapfields
    for operator in (
        ours.add_handle,
        ours.set_rest,
        ours.remove_handle,
        ours.add_landmark,
        ours.mirror_landmarks,
        ours.remove_landmark,
        ours.suggest_landmarks,
        ours.add_obstacle,
        ours.remove_field,
        ours.apply_as_shape_key,
        ours.field_as_nodes,
    ):
        with pytest.raises(RuntimeError, match="Linked is linked from another file; make it local first"):
            operator()


def test_a_library_override_is_refused_before_pressing():
    scenes.bar_with_handles("Linked")
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Linked"]
    bpy.context.collection.objects.link(into.objects[0])
    override = into.objects[0].override_create(remap_local_usages=True)
    bpy.context.view_layer.update()
    scenes.activate(override)
    ours = bpy.ops.arapfields
    for operator in (
        ours.deform,
        ours.stylize,
        ours.extract,
        ours.bake,
        ours.live,
        ours.add_handle,
        ours.fit,
    ):
        with pytest.raises(RuntimeError, match="Linked is a library override; make it local first"):
            operator()


def test_after_a_bake_the_present_frame_is_shown():
    bar = animated()
    bpy.context.scene.frame_set(1)
    bpy.ops.arapfields.bake(format="KEYS", start=1, end=5, step=2)
    keys = bpy.data.objects["Bar_baked"].data.shape_keys.key_blocks
    assert [round(key.value, 3) for key in keys[1:]] == [1.0, 0.0, 0.0]
    shift = scenes.world_points(bpy.data.objects["Bar_baked"]) - scenes.world_points(bar)
    assert np.abs(shift).max() < 0.05
