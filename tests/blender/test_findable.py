# SPDX-License-Identifier: GPL-3.0-or-later
"""Where users look for things: Blender's menus, tooltips, manual pages, a word at the first start."""

import fnmatch
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.panels import Layout

    import addon.registration as registration
    from addon import first_run, menus
    from addon.blender import guide
    from addon.names import Op

pytestmark = pytest.mark.in_blender

OPERATORS = (
    "PIN_TOOL",
    "PIN_ADD",
    "ADD_HANDLE",
    "SET_REST",
    "RESET_HANDLE",
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
    address, patterns = guide.manual_map()
    folder = Path(url2pathname(urlparse(address).path))
    assert all((folder / page).is_file() for _, page in patterns)

    def page(name):
        return next((page for pattern, page in patterns if fnmatch.fnmatchcase(name.lower(), pattern)), None)

    own = [cls for cls in registration.CLASSES if issubclass(cls, bpy.types.Operator)]
    own = [cls for cls in own if not cls.bl_idname.endswith("_preset")]
    assert len(own) > 15
    for cls in own:
        tooltip = cls.description(bpy.context, None)
        assert tooltip.startswith(cls.__doc__) and f"Guide: {guide.LABELS[cls.guide]}" in tooltip, cls
        assert page(f"bpy.ops.{cls.bl_idname}").startswith(cls.guide)
    assert page("bpy.types.ARAPFIELDS_PG_deform.bending").startswith("deform")
    assert page("bpy.types.ARAPFIELDS_PG_object.target").startswith("results")
    assert page("bpy.ops.object.delete") is None
    assert bpy.utils.manual_map is not None and guide.manual_map in bpy.utils._manual_map
    guide.end()
    assert guide.manual_map not in bpy.utils._manual_map
    guide.begin(registration.CLASSES)


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
