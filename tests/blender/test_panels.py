# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels, what they lead to, where users look for them, and their language."""

import fnmatch
import json
import string
import tempfile
import time
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import panels, scenes
    from support.blender.panels import Layout, drawn, each_task, prepared

    import addon.registration as registration
    from addon import first_run, menus
    from addon.blender import language, source_operator
    from addon.blender.language import about, read_po, translated, translations
    from addon.core.errors import UserError
    from addon.core.runtime import jobs
    from addon.handles import empties
    from addon.jobs import display
    from addon.live import sessions
    from addon.names import Op

pytestmark = pytest.mark.in_blender

# Every section and menu draws in every state, naming only properties, operators and menus that exist.

STATES = [
    "nothing",
    "a camera",
    "a mesh",
    "modifiers and keys",
    "edit mode",
    "handles",
    "a handle active",
    "a deleted handle",
    "a group's handle",
    "fitted",
    "fit cleared",
    "custom style",
    "live",
    "running",
    "a failure",
    "library missing",
]


EXPECTED = {
    "nothing": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a camera": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a mesh": ("ARAPFIELDS_PT_surface", "Not fitted yet"),
    "modifiers and keys": ("ARAPFIELDS_PT_status", "Works before S"),
    "edit mode": ("ARAPFIELDS_PT_source", "Bar is in Edit Mode; leave it first"),
    "a handle active": ("ARAPFIELDS_PT_tasks", "Bar"),
    "a deleted handle": ("ARAPFIELDS_PT_handles", "(deleted)"),
    "fitted": ("ARAPFIELDS_PT_surface", "Fit in the cache"),
    "fit cleared": ("ARAPFIELDS_PT_surface", "Fit was cleared"),
    "custom style": ("ARAPFIELDS_PT_stylize", "Normals Of"),
    "live": ("ARAPFIELDS_PT_deform", "Finish Pose"),
    "running": ("ARAPFIELDS_PT_deform", "Cancel Deform"),
    "a failure": ("ARAPFIELDS_PT_status", "Bar: the mesh has no faces"),
    "library missing": ("ARAPFIELDS_PT_source", "The native library is not part of this"),
}


@pytest.mark.parametrize("state", STATES)
def test_the_panel_draws(state):
    jobs.board.messages.clear()
    undo = prepared(state)
    try:
        texts_of = drawn()
    finally:
        undo()
    shown = [name for name in texts_of if "_PT_" in name]
    if state == "library missing" or state in ("nothing", "a camera"):
        assert shown == ["ARAPFIELDS_PT_source"]
    else:
        said = "ARAPFIELDS_PT_status" in shown
        hinders = "ARAPFIELDS_PT_source" in shown
        assert len(shown) == 19 + said + hinders and hinders == (state == "edit mode")
        assert said == (state in ("modifiers and keys", "fitted", "fit cleared", "a failure"))
    if state in EXPECTED:
        section, text = EXPECTED[state]
        assert text in " ".join(texts_of[section]), texts_of[section]  # long texts take several labels


def test_each_task_shows_its_few_sections():
    scenes.bar_with_handles()
    shown = {}
    for task in each_task():
        classes = [cls for module in registration.MODULES for cls in module.CLASSES]
        panels = [c for c in classes if issubclass(c, bpy.types.Panel) and not hasattr(c, "bl_parent_id")]
        shown[task] = {c.bl_label for c in panels if c.poll(bpy.context)}
    always = {"Tasks", "Advanced"}
    assert {task: names - always for task, names in shown.items()} == {
        "POSE": {"Handles", "Deform", "Other Objects"},
        "STYLE": {"Stylize", "Other Objects"},
        "WRAP": {"Wrap", "Other Objects"},
        "RIG": {"Skin", "Poses"},
        "ANIMATE": {"Bake and Export", "Secondary Motion"},
    }
    assert all(2 <= len(names - {"Tasks"}) <= 4 for names in shown.values())
    assert all(always <= names for names in shown.values())


def test_every_grey_button_says_why():
    """Each operator's poll either holds or gives a reason, in states where it does not hold."""
    polled = [
        cls
        for module in registration.MODULES
        for cls in getattr(module, "CLASSES", [])
        if issubclass(cls, bpy.types.Operator) and "poll" in dir(cls)
    ]
    assert len(polled) > 10
    for state in ("nothing", "edit mode", "running", "library missing", "a mesh"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        undo = prepared(state)
        refused = 0
        try:
            for cls in polled:
                group, name = cls.bl_idname.split(".")
                operator = getattr(getattr(bpy.ops, group), name)
                if operator.poll():
                    continue
                refused += 1
                try:
                    operator()
                except RuntimeError as error:
                    reason = str(error).split("poll()")[-1].strip()
                    assert not reason.startswith("failed, context is incorrect"), (cls.__name__, state)
        finally:
            undo()
        assert refused > 0, state


# The panel by use: what is in view at first, what a button would refuse, what a fit and a job tell.


def test_everyday_sections_come_first_and_numbers_are_under_advanced():
    prepared("handles")
    jobs.add_message("INFO", "Bar: done")
    shown_texts = drawn()
    jobs.board.messages.clear()
    panels = {name: getattr(bpy.types, name) for name in shown_texts if "_PT_" in name}
    first = {n: cls.bl_order for n, cls in panels.items() if not hasattr(cls, "bl_parent_id")}
    order = ["tasks", "handles", "deform", "stylize", "wrap", "skin", "others", "poses", "animation"]
    order += ["secondary", "advanced", "status"]
    assert sorted(first, key=first.get) == [f"ARAPFIELDS_PT_{name}" for name in order]
    closed = {name for name, cls in panels.items() if "DEFAULT_CLOSED" in getattr(cls, "bl_options", ())}
    others = {f"ARAPFIELDS_PT_{name}" for name in ("carried", "contact")}  # open in Other Objects
    folded = {f"ARAPFIELDS_PT_{name}" for name in ("others", "poses", "secondary", "advanced")}
    assert closed == {*panels} - {*first} - others | folded
    jargon = {"Samples", "Iterations", "Handle Weight", "Geometry", "Resolution", "No Limit"}
    for name, texts in shown_texts.items():
        if name in first:
            assert not jargon & {*texts}, name
    assert jargon <= {text for texts in shown_texts.values() for text in texts}


def test_advanced_shows_what_counts_for_the_method_alone():
    deform = scenes.bar().arapfields.deform
    for field, fall_off, shown in (("auto", False, set()), ("radial", True, {"Falloff"})):
        deform.field, deform.exact_handles = field, fall_off
        texts = {*drawn()["ARAPFIELDS_PT_deform_settings"]}
        assert texts & {"Falloff", "Network Width", "Start", "Optimizer"} == shown and "Iterations" in texts
    for field, start in (("neural", True), ("invertible", False)):
        deform.field = field
        texts = {*drawn()["ARAPFIELDS_PT_deform_settings"]}
        assert {"Network Width", "Optimizer"} <= texts and ("Start" in texts) == start
    deform.field, deform.width = "auto", 64  # which makes the method neural
    assert "Network Width" in drawn()["ARAPFIELDS_PT_deform_settings"]


def test_a_switch_stands_for_zero_and_numbers_go_one_way():
    style = scenes.bar().arapfields.stylize
    assert style.sharpness_is_zero and style.sharpness == 0.0
    style.sharpness_is_zero = False
    assert style.sharpness == style.sharpness_above_zero == 8.0
    style.sharpness_above_zero = 0.0  # nearly off, and not automatic
    assert 0 < style.sharpness < 0.01 and not style.sharpness_is_zero
    style.sharpness = 9.0  # as scripts and files say it
    assert style.sharpness_above_zero == 9.0 and not style.sharpness_is_zero
    for frame, value in ((1, 2.0), (11, 4.0)):
        style.sharpness_above_zero = value
        style.keyframe_insert("sharpness_above_zero", frame=frame)
    bpy.context.scene.frame_set(6)
    assert 2.5 < style.sharpness < 3.5
    style.sharpness_is_zero = True
    assert style.sharpness == 0.0


REFUSED = {
    "no handle": ("ARAPFIELDS_PT_deform", "Drag a pin or add a handle first"),
    "no group": ("ARAPFIELDS_PT_deform", "Bar has no vertex group gone"),
    "holds nothing": ("ARAPFIELDS_PT_deform", "No part of the surface lies in the rest region of Far"),
    "no style object": ("ARAPFIELDS_PT_stylize", "Choose the object that gives the style its normals"),
    "no axes": ("ARAPFIELDS_PT_stylize", "Choose the object along whose axes the style stands"),
    "no region": ("ARAPFIELDS_PT_stylize", "Bar has no vertex group gone"),
    "follows no handle": ("ARAPFIELDS_PT_stylize", "Drag a pin or add a handle first"),
    "no faces": ("ARAPFIELDS_PT_source", "Bar: the mesh has no faces"),
    "empty": ("ARAPFIELDS_PT_source", "Bar: the mesh is empty"),
    "a key of a surface": ("ARAPFIELDS_PT_stylize", "A shape key keeps the mesh"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_button_would_refuse_is_said_before(case):
    bar = scenes.bar()
    ours = bar.arapfields
    if case == "no group":
        bar.vertex_groups.new(name="gone").add([0, 1], 1.0, "REPLACE")
        bpy.ops.arapfields.add_handle(kind="GROUP", group="gone")
        bar.vertex_groups.clear()
    elif case == "holds nothing":
        scenes.activate(scenes.cube_empty((30, 0, 0), (1, 1, 1), "Far"), bar)
        bpy.context.view_layer.update()
        bpy.ops.arapfields.add_handle()
    elif case == "no style object":
        ours.stylize.style = "OBJECT"
    elif case == "no axes":
        ours.stylize.frame = "EMPTY"
    elif case == "no region":
        ours.stylize.region = "gone"
    elif case == "follows no handle":
        ours.stylize.use_handles = True
    elif case in ("no faces", "empty"):
        points = [] if case == "empty" else [vertex.co for vertex in bar.data.vertices]
        bar.data.clear_geometry()
        bar.data.from_pydata(points, [], [])
    elif case == "a key of a surface":
        ours.output, ours.result = "SURFACE", "KEY"
    section, text = REFUSED[case]
    assert text in " ".join(drawn()[section])


def test_what_the_panel_refuses_the_operators_refuse_too():
    bar = scenes.bar()
    points = [vertex.co for vertex in bar.data.vertices]
    bar.data.clear_geometry()
    bar.data.from_pydata(points, [], [])
    for operator in ("deform", "stylize", "fit", "extract", "bake", "live"):
        with pytest.raises(RuntimeError, match="Bar: the mesh has no faces"):
            getattr(bpy.ops.arapfields, operator)()
        assert not getattr(bpy.ops.arapfields, operator).poll()


def test_a_menu_offers_what_the_mesh_has():
    bar = scenes.bar()
    assert not empties.can_place(None, "CUBE", "CURSOR")
    assert empties.can_place(bar, "CUBE", "CURSOR") and not empties.can_place(bar, "GROUP", "AUTO")
    bar.vertex_groups.new(name="one")
    assert empties.can_place(bar, "GROUP", "AUTO")
    bpy.ops.object.mode_set(mode="EDIT")
    for action in ("SELECT", "DESELECT"):
        bpy.ops.mesh.select_all(action=action)
        assert empties.can_place(bar, "CUBE", "SELECTION") == (action == "SELECT")
    bpy.ops.object.mode_set(mode="OBJECT")


def test_a_fit_tells_its_errors():
    prepared("fitted")
    texts = drawn()["ARAPFIELDS_PT_surface"]
    errors = [text for text in texts if "error at the surface" in text]
    report = json.loads(bpy.data.objects["Bar"].arapfields.fit_report)
    assert errors == [
        f"Mean error at the surface: {report['near_mean']:.2g}",
        f"Largest error at the surface: {report['near_max']:.2g}",
    ]
    assert 0 < report["near_mean"] < report["near_max"]


def test_the_status_bar_shows_the_job_and_its_cancel():
    def texts():
        labels = []
        display.draw(type("Header", (), {"layout": Layout(labels)})(), bpy.context)
        return labels

    assert texts() == []
    undo = prepared("running")
    try:
        assert texts() == ["Deform: Bar", "0%", "Cancel"]
    finally:
        undo()
    assert texts() == []
    assert display.draw in bpy.types.STATUSBAR_HT_header.draw._draw_funcs


@pytest.mark.parametrize("field", ["auto", "radial", "neural"])
def test_the_fold_barrier_acts_on_every_field(field):
    _, _, moving = scenes.bar_with_handles()
    moving.location.x -= 1.2  # the bar is pressed together
    bpy.context.view_layer.update()
    shapes = []
    for barrier in (0.0, 50.0):
        assert bpy.ops.arapfields.deform(**scenes.QUICK, field=field, barrier=barrier) == {"FINISHED"}
        shapes.append(scenes.world_points(bpy.data.objects["Bar"]))
    assert abs(shapes[1] - shapes[0]).max() > 1e-3


def said_of(item):
    """The lines of Status while an object is active; None where there is none."""
    scenes.activate(item)
    return drawn().get("ARAPFIELDS_PT_status")


def test_status_is_that_of_the_active_object():
    bar, fixed, moving = scenes.bar_with_handles()
    other = bar.copy()
    other.data, other.name = bar.data.copy(), "Other"
    bpy.context.collection.objects.link(other)
    moving.location.z += 0.5
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK)
    done = said_of(bar)
    assert any("Bar" in text for text in done) and said_of(fixed) == said_of(moving) == done
    assert said_of(other) is None and said_of(bar) == done
    scenes.activate(other)
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.QUICK)
    assert any("Other" in text for text in said_of(other)) and said_of(bar) is None
    scenes.activate(other, bar)
    bpy.ops.arapfields.stylize(style="CUBE", scope="SELECTED", **scenes.QUICK)
    assert said_of(bar) == said_of(other) and {"Bar", "Other"} <= {
        text.split(":")[0] for text in said_of(bar)
    }


def test_status_has_what_is_about_no_object():
    bar, _, _ = scenes.bar_with_handles()
    other = scenes.bar("Other")
    jobs.add_message("INFO", "Deform cancelled")
    jobs.add_message("ERROR", "Bar is flat", {bar.session_uid})
    assert said_of(other) == ["Deform cancelled"] and said_of(bar) == ["Deform cancelled", "Bar is flat"]
    bpy.data.objects.remove(bar)
    assert said_of(other) == ["Deform cancelled"]
    jobs.forget_messages()


def test_a_live_shape_says_it_of_its_object():
    bar, _, _ = scenes.bar_with_handles()
    other = scenes.bar("Other")
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    sessions.end_with_error(bar.session_uid, sessions.live[bar.session_uid], UserError("no"))
    assert said_of(other) is None and "live mode ended" in " ".join(said_of(bar))
    jobs.forget_messages()


def test_one_button_poses_and_one_undoes_it():
    bar, _, moving = scenes.bar_with_handles()
    rest = scenes.world_points(bar)
    assert {"Pose"} <= {*drawn()["ARAPFIELDS_PT_deform"]} and "Factor" not in drawn()["ARAPFIELDS_PT_deform"]
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    for way in ("live", "finished"):
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        texts = {*drawn()["ARAPFIELDS_PT_deform"]}
        assert "Finish Pose" in texts and not texts & {"Pose", "Keep Shape", "Live Deform", "Deform"}
        if way == "finished":
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
            assert not sessions.is_live(bar) and "Pose" in drawn()["ARAPFIELDS_PT_deform"]
            assert "Factor" in drawn()["ARAPFIELDS_PT_deform"]
        assert abs(scenes.world_points(bar) - rest).max() > 0.3
        assert bpy.ops.arapfields.remove_result(kind="DEFORM") == {"FINISHED"}
        assert not bar.modifiers and not sessions.is_live(bar)
        assert (scenes.world_points(bar) == rest).all()
    assert not bpy.ops.arapfields.remove_result.poll()


def test_a_pose_by_pins_goes_with_one_press():
    """What a drag keeps is removed too, and what it lies on stays."""
    bar, _, moving = scenes.bar_with_handles()
    rest = scenes.world_points(bar)
    sessions.begin(bpy.context, bar, keeps_shape=True)
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    sessions.settle(bpy.context, bar.session_uid)
    assert abs(scenes.world_points(bar) - rest).max() > 0.3
    assert bpy.ops.arapfields.remove_result(kind="DEFORM") == {"FINISHED"}
    assert not bar.modifiers and (scenes.world_points(bar) == rest).all()


def test_each_result_is_removed_where_it_is_made():
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.QUICK)
    styled = scenes.world_points(bar)
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    shown = drawn()
    for section in ("deform", "stylize"):
        assert "Factor" in shown[f"ARAPFIELDS_PT_{section}"], section
    assert "Factor" not in shown["ARAPFIELDS_PT_wrap"]
    with pytest.raises(RuntimeError, match="Another result of Bar lies on this one"):
        bpy.ops.arapfields.remove_result(kind="STYLIZE")
    with pytest.raises(RuntimeError, match="Bar has no such result"):
        bpy.ops.arapfields.remove_result(kind="WRAP")
    bpy.ops.arapfields.remove_result(kind="DEFORM")
    assert (scenes.world_points(bar) == styled).all() and len(bar.modifiers) == 1
    bpy.ops.arapfields.remove_result(kind="STYLIZE")
    assert not bar.modifiers


def test_what_is_seldom_used_is_under_advanced():
    scenes.bar_with_handles()
    shown = drawn()
    seldom = {"Contact Sheet", "Wrap Sequence", "Field as Nodes", "Exact Handles", "Weight"}
    everyday = [
        name for name in shown if "_PT_" in name and not hasattr(getattr(bpy.types, name), "bl_parent_id")
    ]
    assert not seldom & {text for name in everyday for text in shown[name]}
    assert seldom <= {text for texts in shown.values() for text in texts}


# Where users look for things: Blender's menus, tooltips, manual pages, a word at the first start.

OPERATORS = (
    "PIN_TOOL",
    "PIN_ADD",
    "ADD_HANDLE",
    "SET_REST",
    "RESET_HANDLE",
    "KEY_HANDLE",
    "DEFORM",
    "LIVE",
    "STYLIZE",
    "SKIN",
    "LIVE_KEEP",
    "REMOVE_RESULT",
    "BAKE",
    "FIT",
)


def test_the_object_menu_has_all_that_the_panel_does():
    asked = []

    class Noting(Layout):
        def operator(self, name, **options):
            asked.append(name)
            return super().operator(name, **options)

    stand_in = type("Menu", (), {"layout": Noting([])})()
    menus.ARAPFIELDS_MT_object.draw(stand_in, bpy.context)
    assert {getattr(Op, name) for name in OPERATORS} <= {*asked}
    for name, draw in menus.PLACES.items():
        assert getattr(bpy.types, name).draw._draw_funcs.count(draw) == 1
        draw(stand_in, bpy.context)


def test_an_empty_added_as_a_handle_is_one():
    bar = scenes.bar()
    asked = {}

    class Noting:
        def separator(self):
            pass

        def operator(self, name, **_):
            asked["name"] = name
            asked["properties"] = properties = type("Properties", (), {})()
            return properties

    menus.draw_in_empties(type("Menu", (), {"layout": Noting()})(), bpy.context)
    group, name = asked["name"].split(".")
    getattr(getattr(bpy.ops, group), name)(**vars(asked["properties"]))
    assert len(bar.arapfields.handles) == 1


def test_every_operator_names_its_page_and_every_page_exists():
    address, patterns = source_operator.manual_map()
    folder = Path(url2pathname(urlparse(address).path))
    assert all((folder / page).is_file() for _, page in patterns)

    def page(name):
        return next((page for pattern, page in patterns if fnmatch.fnmatchcase(name.lower(), pattern)), None)

    own = [cls for cls in registration.CLASSES if issubclass(cls, bpy.types.Operator)]
    own = [cls for cls in own if not cls.bl_idname.endswith("_preset")]
    assert len(own) > 15
    for cls in own:
        tooltip = cls.description(bpy.context, None)
        assert tooltip.startswith(cls.__doc__) and f"Guide: {source_operator.LABELS[cls.guide]}" in tooltip, (
            cls
        )
        assert page(f"bpy.ops.{cls.bl_idname}").startswith(cls.guide)
    assert page("bpy.types.ARAPFIELDS_PG_deform.bending").startswith("deform")
    assert page("bpy.types.ARAPFIELDS_PG_object.target").startswith("results")
    assert page("bpy.ops.object.delete") is None
    assert bpy.utils.manual_map is not None and source_operator.manual_map in bpy.utils._manual_map
    source_operator.end()
    assert source_operator.manual_map not in bpy.utils._manual_map
    source_operator.begin(registration.CLASSES)


def test_the_tooltips_of_live_mode_are_those_of_their_buttons():
    live = type("Properties", (), {"kind": "STYLIZE"})()
    describe = next(c for c in registration.CLASSES if c.__name__ == "ARAPFIELDS_OT_live").description
    assert describe(bpy.context, live).startswith("Show the style on the object")
    assert "Guide: Stylize" in describe(bpy.context, live)
    live.kind = "DEFORM"
    assert describe(bpy.context, live).startswith("Let the shape follow its handles")
    assert "Guide: Deform" in describe(bpy.context, live)


def test_the_first_start_says_where_the_extension_is_and_only_the_first():
    stored = type("Preferences", (), {"was_welcomed": False})()
    kept = first_run.bpy, first_run.preferences
    saved = type("Saved", (), {"is_dirty": False})()  # Blender's own, which it saves where they have changed
    manager = type("Manager", (), {"windows": []})()
    context = type("C", (), {"window_manager": manager, "preferences": saved})
    first_run.bpy = type("Bpy", (), {"context": context})
    first_run.preferences = lambda: stored
    said = []
    try:
        for _ in range(2):
            first_run.show()
            said.append(first_run.lines())
            first_run.welcome.clear()
    finally:
        first_run.bpy, first_run.preferences = kept
    assert "pin tool" in said[0][0] and "press N" in said[0][1] and "F3" in said[0][2] and said[1] == []
    assert stored.was_welcomed and saved.is_dirty
    assert bpy.app.background


def test_the_first_start_waits_until_the_preferences_are_closed():
    """There the extension was installed, in a window before that with the text."""

    def window(kind, is_temporary):
        screen = type("Screen", (), {"is_temporary": is_temporary})
        screen.areas = [type("Area", (), {"type": kind, "regions": []})]
        return type("Window", (), {"screen": screen})

    kept, manager = first_run.bpy, type("Manager", (), {"windows": [window("VIEW_3D", False)]})
    first_run.bpy = type("Bpy", (), {"context": type("C", (), {"window_manager": manager})})
    try:
        first_run.welcome.until = time.monotonic() + 0.5
        manager.windows.append(window("PREFERENCES", True))
        assert first_run.end() is not None
        assert first_run.welcome.until > time.monotonic() + first_run.SECONDS - 1.0 and first_run.lines()
        manager.windows.pop()
        assert first_run.end() is not None
        first_run.welcome.until = time.monotonic()
        assert first_run.end() is None and first_run.lines() == []
    finally:
        first_run.bpy = kept
        first_run.welcome.clear()


# Every text that a user may read is in the translations, and templates keep their fields.


def test_every_text_is_translated():
    texts = panels.every()
    assert len(texts) > 250

    def fields(text):
        return sorted(field for _, field, _, _ in string.Formatter().parse(text) if field)

    tables = translations()
    assert "de_DE" in tables
    for language, table in tables.items():
        missing = [text for text in texts if ("*", text) not in table]
        assert not missing, (language, missing)
        stale = {text for _, text in table} - set(texts) - panels.UNTRANSLATED
        assert not stale, (language, stale)
        for (_, text), translated in table.items():
            assert translated and fields(text) == fields(translated), text


def test_messages_are_filled_in_after_translation():
    assert translated("{count} frames baked", count=3) == "3 frames baked"
    assert translated(UserError("{name} is not a mesh object", name="{x}")) == "{x} is not a mesh object"
    assert translated(ValueError("as it is")) == "as it is"


def test_a_message_names_what_it_is_about_once():
    lost = UserError("{name} was deleted while it was worked on", name="Bar")
    said = "Bar was deleted while it was worked on"
    assert about("Bar", lost) == said and about("Bar", str(lost)) == said
    assert about("Hat", lost) == f"Hat: {said}"
    ended = UserError("{error}; live mode ended", error=lost)
    assert str(ended) == about("Bar", ended) == f"{said}; live mode ended"
    ended = UserError("{error}; live mode ended", error=ValueError("x"))
    assert about("Bar", ended) == "Bar: x; live mode ended"
    other = UserError("The bones of {name} are handles of {source}", name="Rig", source="Bar")
    assert about("Bar", other) == str(other)
    assert about("Bar", "Bars were deleted") == "Bar: Bars were deleted"


def test_an_error_within_another_is_translated():
    lookup, german = language._lookup, translations()["de_DE"]
    language._lookup = lambda text, _: german.get(("*", text), text)
    try:
        lost = UserError("{name} was deleted while it was worked on", name="Bar")
        ended = translated(UserError("{error}; live mode ended", error=lost))
    finally:
        language._lookup = lookup
    assert ended == "Bar wurde während der Arbeit gelöscht; Live-Modus beendet"


def test_wrapped_lines_and_every_form_of_a_po_file_are_read():
    path = Path(tempfile.mkdtemp()) / "de_DE.po"
    path.write_text(
        'msgid ""\nmsgstr "Content-Type: text/plain; charset=UTF-8\\n"\n\n'
        '# a remark\nmsgid ""\n"{name} was deleted "\n"while it was worked on"\n'
        'msgstr ""\n"{name} wurde gelöscht, "\n"während daran gearbeitet wurde"\n\n'
        'msgctxt "Operator"\nmsgid "Fit \\"it\\""\nmsgstr "„Anpassen“"\n\n'
        'msgid "not yet"\nmsgstr ""\n',
        encoding="utf-8",
    )
    texts = read_po(path)
    assert texts == {
        "{name} was deleted while it was worked on": "{name} wurde gelöscht, während daran gearbeitet wurde",
        'Fit "it"': "„Anpassen“",
    }
    path.write_text('msgid "a"\nnonsense\nmsgstr "b"\n')
    with pytest.raises(OSError):
        read_po(path)
