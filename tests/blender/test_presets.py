# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that users store under names, by Blender's own preset system."""

from pathlib import Path

import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    import addon
    from addon.core.settings.styles import STYLES

pytestmark = pytest.mark.in_blender

CASES = {"fit": ("iterations", 777), "deform": ("bending", 0.25), "stylize": ("sharpness", 9.0)}


@pytest.mark.parametrize("section", CASES)
def test_presets_are_stored_applied_and_removed(section):
    bar, fixed, _ = scenes.bar_with_handles()
    settings, (name, value) = getattr(bar.arapfields, section), CASES[section]
    plain = getattr(settings, name)
    setattr(settings, name, value)
    operator = getattr(bpy.ops.arapfields, f"{section}_preset")
    assert operator(name="Mine") == {"FINISHED"}
    folder = Path(bpy.utils.user_resource("SCRIPTS", path=f"presets/arapfields/{section}"))
    (path,) = folder.glob("*.py")
    assert path.stem.lower() == "mine"
    setattr(settings, name, plain)
    scenes.activate(fixed)  # a handle is active: its source is meant
    menu = f"ARAPFIELDS_MT_{section}_presets"
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname=menu)
    assert getattr(settings, name) == pytest.approx(value)
    assert getattr(fixed.arapfields, section) != settings
    cls = getattr(bpy.types, menu)
    assert cls.bl_label == "Mine"  # the header shows what was chosen
    operator(name="Mine", remove_name=True)
    cls.bl_label = f"{section.capitalize()} Presets"
    assert not list(folder.glob("*.py"))


def test_each_style_has_its_picture():
    folder = Path(addon.__file__).parent / "icons"
    styles = {name.replace(" ", "_") for name, _ in STYLES}
    assert {path.stem for path in folder.glob("*.png")} == styles | {"anchor"}
    assert all(
        path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size < 8000 for path in folder.glob("*.png")
    )


@pytest.mark.parametrize("section", ["deform", "stylize"])
def test_the_papers_own_settings_are_a_preset_and_the_defaults_come_back(section):
    bar = scenes.bar()
    group = getattr(bar.arapfields, section)
    options = {"deform": af.DeformOptions, "stylize": af.StylizeOptions}[section]
    preset = options.preset("paper")
    group.width = 100
    operator = getattr(bpy.ops.arapfields, f"{section}_given_preset")
    before = bar.arapfields.result
    assert operator(preset="PAPER") == {"FINISHED"}
    shown = [name for name in group.__annotations__ if hasattr(preset, name)]
    assert {"field", "optimizer", "learning_rate", "iterations", "bending_unit"} <= {*shown}
    for name in shown:
        assert getattr(group, name) == pytest.approx(getattr(preset, name)), name  # texts and flags: equal
    assert operator(preset="DEFAULT") == {"FINISHED"} and bar.arapfields.result == before
    assert group.width == options().width and group.optimizer == options().optimizer


def test_a_result_as_in_the_paper():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.3
    bpy.ops.arapfields.deform_given_preset(preset="PAPER")
    bar.arapfields.deform.iterations = 30
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert scenes.world_points(bar)[:, 2].max() > 0.4
