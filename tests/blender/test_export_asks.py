# SPDX-License-Identifier: GPL-3.0-or-later
"""What bakes and exports ask for before they write: an exporter, a folder, leave to overwrite."""

import types
from pathlib import Path

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender.baking import saved_animation
    from support.blender.panels import Layout

    from addon.animation import bake_operator, export_operators, exporters, operators
    from addon.animation.properties import ARAPFIELDS_PG_bake
    from addon.blender import property_definitions
    from addon.core.errors import UserError

pytestmark = pytest.mark.in_blender


def five_frames():
    """The folder of a saved animation."""
    bpy.context.scene.frame_end = 5
    return saved_animation()[1]


def test_a_folder_is_made_where_its_parent_exists():
    folder = five_frames()
    bpy.ops.arapfields.export_animation(format="GLTF", filepath="//new/a.glb")
    assert [path.name for path in (folder / "new").iterdir()] == ["a.glb"]


def test_an_export_that_fails_leaves_no_new_folder():
    folder, write = five_frames(), exporters.write

    def fails(*_):
        raise UserError("The exporter failed")
        yield  # as a coroutine, like the real one

    exporters.write = fails
    try:
        with pytest.raises(RuntimeError, match="The exporter failed"):
            bpy.ops.arapfields.export_animation(format="GLTF", filepath="//new/a.glb")
    finally:
        exporters.write = write
    assert not (folder / "new").exists()


def test_a_format_that_this_blender_lacks_is_greyed_and_says_so():
    """As in builds without Alembic and USD, and where the glTF add-on is off."""
    _, folder = saved_animation()
    lacking = {kind: ("wm", "an_operator_that_is_not_there") for kind in exporters.OPERATORS}
    known = dict(exporters.OPERATORS)
    try:
        exporters.OPERATORS.update(lacking)
        for kind, suffix in exporters.SUFFIXES.items():
            with pytest.raises(RuntimeError, match="This Blender has no exporter for"):
                bpy.ops.arapfields.export_animation(format=kind, filepath=str(folder / f"a{suffix}"))
        rows = menu_rows()
        assert [enabled for _, enabled in rows] == [False] * 3
        assert all("not in this Blender" in text for text, _ in rows)
    finally:
        exporters.OPERATORS.update(known)
    assert menu_rows() == [("Alembic", True), ("USD", True), ("glTF", True)]
    assert [path.name for path in folder.iterdir()] == ["scene.blend"]


def menu_rows():
    """(text, whether it can be pressed) of each row of the menu."""
    rows = []

    class Row(Layout):
        def row(self, **options):
            return Row([])

        def operator(self, name, text, **options):
            rows.append((text, self.__dict__.get("enabled", True)))
            return super().operator(name, text=text, **options)

        def __setattr__(self, name, value):
            self.__dict__[name] = value

    stand_in = types.SimpleNamespace(layout=Row([]))
    export_operators.ARAPFIELDS_MT_export.draw(stand_in, bpy.context)
    return rows


def test_a_press_overwrites_only_what_is_the_objects_own_or_confirmed():
    """A script confirms a bake by an argument, an export by its call."""
    folder = five_frames()
    cache, file, asked = folder / "a.pc2", folder / "a.glb", []
    has_window, ask = bake_operator.has_window, bake_operator.ask
    bake_operator.has_window, bake_operator.ask = lambda: True, lambda *given: asked.append(given[-1])
    bake, export = operators.ARAPFIELDS_OT_bake, export_operators.ARAPFIELDS_OT_export_animation
    try:
        for path, cls, given in ((cache, bake, {}), (file, export, {"format": "GLTF"})):
            assert pressed(cls, filepath=str(path), **given) == {"FINISHED"}
            path.write_bytes(b"another's")
            assert pressed(cls, filepath=str(path), **given) == {"CANCELLED"} and asked.pop() == [path]
            assert pressed(cls, filepath=str(path), overwrite=True, **given) == {"FINISHED"}
        with pytest.raises(RuntimeError, match="is there, and not of this object"):
            bpy.ops.arapfields.bake(filepath=str(cache))
        bpy.ops.arapfields.bake(filepath=str(cache), overwrite=True)
        bpy.ops.arapfields.bake(filepath=str(cache))
        assert pressed(bake, filepath=str(cache)) == {"FINISHED"} and not asked
    finally:
        bake_operator.has_window, bake_operator.ask = has_window, ask


def test_the_button_that_overwrites_has_the_same_arguments():
    given = bpy.context.window_manager.operator_properties_last("arapfields.bake")
    given.filepath, given.format, given.part = "//a.mdd", "MDD", (1, 2)
    button, shown = types.SimpleNamespace(), {}
    layout = types.SimpleNamespace(operator=lambda name, **_: shown.update(name=name) or button)
    manager = types.SimpleNamespace(popup_menu=lambda draw, title, icon: shown.update(draw=draw, title=title))
    operator = types.SimpleNamespace(properties=given, bl_idname="arapfields.bake")
    bake_operator.ask(types.SimpleNamespace(window_manager=manager), operator, [Path("a.mdd")])
    shown["draw"](types.SimpleNamespace(layout=layout), None)
    assert (shown["name"], shown["title"]) == ("arapfields.bake", "a.mdd exists already")
    assert (button.filepath, button.format, tuple(button.part)) == ("//a.mdd", "MDD", (1, 2))
    assert button.overwrite and not hasattr(button, "kind")


def pressed(cls, **given):
    """What a press on the operator's button returns, where all goes well."""

    class Operator(bake_operator.BakeOperator):
        scope, overwrite, places, path = "ACTIVE", False, cls.places, getattr(cls, "path", None)
        properties = types.SimpleNamespace(is_property_set=lambda name: name in given)

        def execute(self, context):
            return {"FINISHED"}

    for name, value in given.items():
        setattr(Operator, name, value)
    return Operator().invoke(bpy.context, None)


def test_blender_knows_that_paths_may_be_relative_to_the_file():
    """Else Blender from 4.5 on warns of // and shows the setting in red."""
    known = "is_path_supports_blend_relative"
    if known not in bpy.types.Property.bl_rna.properties:
        assert not property_definitions.RELATIVE
        return
    names = "bake", "export_animation", "apply_pose", "load_pose", "export_pose"
    owners = [getattr(bpy.ops.arapfields, name) for name in names if name in dir(bpy.ops.arapfields)]
    owners = [owner.get_rna_type() for owner in owners] + [ARAPFIELDS_PG_bake.bl_rna]
    own = "Where", "A pose", "The pose"  # the first words of their tooltips
    found = [one for owner in owners for one in owner.properties if one.subtype in ("FILE_PATH", "DIR_PATH")]
    found = [one for one in found if one.description.startswith(own)]
    assert len(found) >= 5 and all(getattr(path, known) for path in found)
