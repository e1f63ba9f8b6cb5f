# SPDX-License-Identifier: GPL-3.0-or-later
"""Every section and menu draws in every state, naming only properties, operators and menus that exist."""

import pytest
from inside import in_blender

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


class Layout:
    """Stands for Blender's: checks what it is asked to show, and notes the texts."""

    def __init__(self, texts):
        self.__dict__["texts"] = texts

    def __setattr__(self, name, value):
        assert name in (
            *("use_property_split", "use_property_decorate", "ui_units_x", "alignment", "emboss", "enabled"),
            *("active", "alert", "scale_y"),
        ), name

    def prop(self, data, name, **options):
        own = name.startswith('["') and data.get(name[2:-2]) is not None  # an input of a node group
        assert own or name in data.bl_rna.properties, (data, name)
        self.texts.append(options["text"] if own else options.get("text", data.bl_rna.properties[name].name))

    def prop_search(self, data, name, source, collection, **options):
        self.prop(data, name)
        assert collection in source.bl_rna.properties

    def operator(self, name, **options):
        import bpy

        group, operator = name.split(".")
        rna = getattr(getattr(bpy.ops, group), operator).get_rna_type()
        self.texts.append(options.get("text", rna.name))
        return type("Arguments", (), dict.fromkeys(rna.properties.keys()))()

    def operator_menu_enum(self, name, prop, **options):
        assert prop in self.operator(name).__class__.__dict__

    def menu(self, name, **options):
        import bpy

        assert hasattr(bpy.types, name), name

    def template_list(self, kind, _, data, name, active_data, active, **options):
        import bpy

        for row, item in enumerate(getattr(data, name)):
            getattr(bpy.types, kind).draw_item(None, bpy.context, self, data, item, 0, data, active, row)

    def label(self, text="", **options):
        self.texts.append(text)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.texts.append(text)

    def template_icon(self, icon_value, scale):
        assert icon_value > 0

    def separator(self):
        pass

    def panel(self, name, default_closed):
        return self, self

    def row(self, **options):
        return self

    column = box = grid_flow = row


def drawn():
    """The texts of all sections that show, by section; menus are drawn as well."""
    import bpy
    from test_panels import Layout

    import addon.registration as registration

    found = {}
    for module in registration.MODULES:
        for cls in getattr(module, "CLASSES", []):
            if not issubclass(cls, (bpy.types.Panel, bpy.types.Menu)) or "preset" in cls.__name__:
                continue
            if issubclass(cls, bpy.types.Panel) and not cls.poll(bpy.context):
                continue
            texts = found[cls.__name__] = []
            stand_in = type("Section", (), {"layout": Layout(texts), "fill": getattr(cls, "fill", None)})()
            if hasattr(cls, "draw_header_preset"):
                cls.draw_header_preset(stand_in, bpy.context)
            cls.draw(stand_in, bpy.context)
    return found


def prepared(state):
    """Puts Blender into that state; returns what puts it back."""
    import bpy
    import scenes

    from addon.core.errors import UserError
    from addon.core.runtime import jobs, native

    if state == "a camera":
        bpy.ops.object.camera_add()
    if state in ("nothing", "a camera"):
        return lambda: None
    bar, fixed, _ = scenes.bar_with_handles() if state != "a mesh" else (scenes.bar(), None, None)
    ours, undo = bar.arapfields, lambda: None
    if state == "modifiers and keys":
        bar.modifiers.new("S", "SUBSURF")
        bar.shape_key_add(name="Basis")
    elif state == "edit mode":
        bpy.ops.object.mode_set(mode="EDIT")
        return lambda: bpy.ops.object.mode_set(mode="OBJECT")
    elif state == "a handle active":
        scenes.activate(fixed)
    elif state == "a deleted handle":
        bpy.data.objects.remove(fixed)
    elif state == "a group's handle":
        bar.vertex_groups.new(name="G").add([0, 1, 2], 1.0, "REPLACE")
        bpy.ops.arapfields.add_handle(kind="GROUP", place="CURSOR")
    elif state == "a mesh":
        ours.surface = "FIT"
    elif state in ("fitted", "fit cleared"):
        ours.surface = "FIT"
        for name, value in {"iterations": 5, "width": 16, "layers": 2, "near_points": 2000}.items():
            setattr(ours.fit, name, value)
        bpy.ops.arapfields.fit()
        if state == "fit cleared":
            bpy.ops.arapfields.clear_cache()
    elif state == "custom style":
        ours.stylize.style = "OBJECT"
    elif state == "live":
        bpy.ops.arapfields.live()
    elif state == "running":
        gate = __import__("threading").Event()
        jobs.begin(
            jobs.Job("Deform", [jobs.Item("Bar", lambda tracker: gate.wait(60))], native.library().Task)
        )
        return lambda: (gate.set(), jobs.stop())
    elif state == "a failure":
        jobs.add_message("ERROR", "Bar: the mesh has no faces")
    elif state == "library missing":
        native._state.problem = UserError("The native library is not part of this installation.")
        return native.forget
    return undo


EXPECTED = {
    "nothing": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a camera": ("ARAPFIELDS_PT_source", "Select a mesh object"),
    "a mesh": ("ARAPFIELDS_PT_surface", "Not fitted yet"),
    "modifiers and keys": ("ARAPFIELDS_PT_source", "Read before S"),
    "edit mode": ("ARAPFIELDS_PT_source", "Bar is in Edit Mode; leave it first"),
    "a handle active": ("ARAPFIELDS_PT_source", "Bar"),
    "a deleted handle": ("ARAPFIELDS_PT_handles", "(deleted)"),
    "fitted": ("ARAPFIELDS_PT_surface", "Fit in the cache"),
    "fit cleared": ("ARAPFIELDS_PT_surface", "Fit was cleared"),
    "custom style": ("ARAPFIELDS_PT_stylize", "Normals Of"),
    "live": ("ARAPFIELDS_PT_deform", "Keep Shape"),
    "running": ("ARAPFIELDS_PT_source", "Cancel"),
    "a failure": ("ARAPFIELDS_PT_status", "Bar: the mesh has no faces"),
    "library missing": ("ARAPFIELDS_PT_source", "The native library is not part of this"),
}


@pytest.mark.parametrize("state", STATES)
@in_blender
def test_the_panel_draws(state):
    from test_panels import EXPECTED, drawn, prepared

    from addon.core.runtime import jobs

    jobs.board.messages.clear()
    undo = prepared(state)
    try:
        found = drawn()
    finally:
        undo()
    shown = [name for name in found if "_PT_" in name]
    if state == "library missing" or state in ("nothing", "a camera"):
        assert shown == ["ARAPFIELDS_PT_source"]
    else:
        said = "ARAPFIELDS_PT_status" in shown
        assert len(shown) == 16 + said and said == (
            state in ("fitted", "fit cleared", "running", "a failure")
        )
    if state in EXPECTED:
        section, text = EXPECTED[state]
        assert text in " ".join(found[section]), found[section]  # long texts take several labels


@in_blender
def test_every_grey_button_says_why():
    """Each operator's poll either holds or gives a reason, in states where it does not hold."""
    import bpy
    from test_panels import prepared

    import addon.registration as registration

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
                    told = str(error).split("poll()")[-1].strip()
                    assert not told.startswith("failed, context is incorrect"), (cls.__name__, state)
        finally:
            undo()
        assert refused > 0, state
