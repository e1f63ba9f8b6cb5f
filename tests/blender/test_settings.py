# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: stored, animated, presets, and defaults of older files."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import at, cache_file
    from support.blender.live import step

    import addon
    import addon.registration as registration
    from addon.blender import former_defaults
    from addon.blender.property_definitions import effective_values
    from addon.core.settings.choices import STYLES, STYLIZE
    from addon.core.settings.parameters import DEFORM, FIT, TABLE
    from addon.solver import frame_solver

pytestmark = pytest.mark.in_blender

# The panel's settings are the native library's options: same names, same defaults.


def test_names_and_defaults_are_the_librarys():
    addons_own = {option["name"] for block in TABLE.values() for option in block["further"]}
    tables = {"DeformOptions": DEFORM, "StylizeOptions": STYLIZE, "FitOptions": FIT}
    for name, table in tables.items():
        options = getattr(af, name)()
        for parameter in table:
            if parameter.name in addons_own:
                continue
            assert parameter.name in type(options).fields, (name, parameter.name)
            assert getattr(options, parameter.name) == parameter.default, (name, parameter.name)


def test_values_survive_single_precision():
    item = scenes.bar()

    class Operator:
        properties = type("P", (), {"is_property_set": staticmethod(lambda name: False)})

    values = effective_values(DEFORM, item.arapfields.deform, Operator)
    assert values == {p.name: p.default for p in DEFORM}
    assert bpy.context.object == item


def test_every_property_and_operator_is_described():
    bare = []
    for module in registration.MODULES:
        for cls in getattr(module, "CLASSES", []):
            if issubclass(cls, bpy.types.Operator):
                group, name = cls.bl_idname.split(".")
                if not getattr(getattr(bpy.ops, group), name).get_rna_type().description:
                    bare.append(cls.__name__)
            for prop in cls.bl_rna.properties:
                ours = prop.identifier in getattr(cls, "__annotations__", {})
                if ours and not prop.description:
                    bare.append(f"{cls.__name__}.{prop.identifier}")
    assert not bare, bare


# Settings that are keyed or driven: each frame has its own value, live and baked alike.

SAME = 1e-6  # of a shape of size 2: single precision
FRAMES = 1, 2, 3
SETTINGS = {  # {what: (kind of shape, group of settings, property, values at the first and the last frame)}
    "stiffness": ("DEFORM", "deform", "bending", (0.2, 8.0)),
    "locality": ("DEFORM", "deform", "locality", (0.0, 0.3)),
    "margin": ("DEFORM", "contact.obstacle_list[0]", "margin", (0.0, 0.15)),
    "style": ("STYLIZE", "stylize", "strength", (0.1, 0.9)),
}


def bent_bar():
    """A bar whose right end is lifted below a box that is in the way."""
    frame_solver.SAMPLES = 500
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(1.0, 0.0, 1.15))
    scenes.activate(bpy.context.object, bar)
    bpy.ops.arapfields.add_obstacle()
    moving.location.z += 0.6
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar


def ball():
    frame_solver.SAMPLES = 500
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    return bpy.context.object


def vary(bar, group, name, values, is_driven):
    """Keys a property from one value to another, or drives it by the frame."""
    owner = bar.arapfields.path_resolve(group)
    if not is_driven:
        for frame, value in zip(FRAMES[::2], values, strict=True):
            setattr(owner, name, value)
            assert owner.keyframe_insert(name, frame=frame)
        return
    first, last = values
    curve = owner.driver_add(name)
    curve.driver.type = "SUM"
    variable = curve.driver.variables.new()
    target = variable.targets[0]
    target.id_type, target.id, target.data_path = "SCENE", bpy.context.scene, "frame_current"
    line = curve.modifiers[0] if curve.modifiers else curve.modifiers.new("GENERATOR")
    slope = (last - first) / (FRAMES[-1] - FRAMES[0])
    line.coefficients = (first - slope * FRAMES[0], slope)


@pytest.mark.parametrize("is_driven", [False, True])
@pytest.mark.parametrize("what", SETTINGS)
def test_each_frame_has_its_own_value_live_and_baked(what, is_driven):
    kind, group, name, values = SETTINGS[what]
    bar = ball() if kind == "STYLIZE" else bent_bar()
    bar.arapfields.contact.use = what == "margin"
    vary(bar, group, name, values, is_driven)
    bpy.context.scene.frame_set(FRAMES[0])
    bpy.ops.arapfields.live(kind=kind)
    live = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        live.append(at(bar, frame))
    bpy.ops.arapfields.live(kind=kind)
    scenes.activate(bar)
    given = {"start": FRAMES[0], "end": FRAMES[-1], "kind": kind}
    assert bpy.ops.arapfields.bake(format="PC2", filepath=cache_file(), **given) == {"FINISHED"}
    baked = [at(bar, frame) for frame in FRAMES]
    assert all(np.abs(a - b).max() > 1e-3 for a, b in pairwise(live))
    assert max(np.abs(a - b).max() for a, b in zip(live, baked, strict=True)) < SAME


# Settings that users store under names, by Blender's own preset system.

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


# Defaults that have changed since a file was saved.

USUAL = af.DeformOptions().locality


def reopened(tmp_path, defaults, locality=None):
    """Locality of a bar with handles, saved with that version of the defaults and opened again."""
    bar, *_ = scenes.bar_with_handles()
    assert bar.arapfields.defaults == former_defaults.NEWEST
    bar.arapfields.defaults = defaults
    if locality is not None:
        bar.arapfields.deform.locality = locality
    name, file = bar.name, str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    return bpy.data.objects[name].arapfields


def test_an_older_file_keeps_the_former_default(tmp_path):
    settings = reopened(tmp_path, 0)
    assert settings.deform.locality == 0.0 and settings.defaults == former_defaults.NEWEST


@pytest.mark.parametrize("locality", [0.05, 0.1])
def test_and_what_was_set_in_it(tmp_path, locality):
    assert reopened(tmp_path, 0, locality).deform.locality == pytest.approx(locality)


def test_a_new_file_keeps_the_newest(tmp_path):
    assert reopened(tmp_path, former_defaults.NEWEST).deform.locality == pytest.approx(USUAL)


def test_keep_the_rest_of_an_older_file_stays_until_its_handles_are_gone(tmp_path):
    bar, *_ = scenes.bar_with_handles()
    bar.arapfields.defaults, bar.arapfields.keep_rest, name = 0, True, bar.name
    file = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    bar = bpy.data.objects[name]
    assert bar.arapfields.keep_rest and bar.arapfields.deform.locality == 0.0
    scenes.activate(bar)
    for _ in range(len(bar.arapfields.handles)):
        bpy.ops.arapfields.remove_handle(delete=True)
    bpy.ops.arapfields.pin_add(location=(1, 0, 0.25), radius=0.2)
    assert not bar.arapfields.keep_rest
    assert bar.arapfields.deform.locality == pytest.approx(USUAL)


def test_an_object_without_handles_has_the_newest():
    bar = scenes.bar()
    former_defaults.keep()
    assert bar.arapfields.deform.locality == pytest.approx(USUAL)


def weight_of(bar):
    """The share of the style's weight that an older file's strength stands for."""
    growth = former_defaults.GROWTH
    return (growth**bar.arapfields.stylize.strength - 1) / (growth - 1)


def test_a_strength_of_an_older_file_is_converted(tmp_path):
    """Once: what is saved after that stays. So does the whole strength. Keyframes go along, also of an action
    that two objects share."""
    bars = {}
    for strength in (0.1, 0.5, 1.0):
        bar = scenes.bar()
        bar.arapfields.stylize.strength = strength
        bars[bar.name] = strength
    keyed = [scenes.bar() for _ in range(2)]
    for frame, share in ((1, 0.1), (11, 0.5)):
        keyed[0].arapfields.stylize.strength = share
        keyed[0].keyframe_insert("arapfields.stylize.strength", frame=frame)
    keyed[1].arapfields.stylize.strength = share
    keyed[1].animation_data_create().action = keyed[0].animation_data.action
    if hasattr(keyed[1].animation_data, "action_slot"):
        keyed[1].animation_data.action_slot = keyed[0].animation_data.action_slot
    keyed = [bar.name for bar in keyed]
    file = str(tmp_path / "styled.blend")
    stamp, former_defaults.stamp = former_defaults.stamp, lambda: None  # the older extension had none
    try:
        bpy.ops.wm.save_as_mainfile(filepath=file)
    finally:
        former_defaults.stamp = stamp
    for _ in range(2):
        bpy.ops.wm.open_mainfile(filepath=file)
        for name, share in bars.items():
            assert weight_of(bpy.data.objects[name]) == pytest.approx(share, rel=1e-4)
        for frame, share in ((1, 0.1), (11, 0.5)):
            bpy.context.scene.frame_set(frame)
            for name in keyed:
                assert weight_of(bpy.data.objects[name]) == pytest.approx(share, rel=1e-4)
        bpy.ops.wm.save_as_mainfile(filepath=file)


def test_a_strength_that_is_saved_now_stays(tmp_path):
    bar = scenes.bar()
    bar.arapfields.stylize.strength = 0.5
    name, file = bar.name, str(tmp_path / "styled.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    assert bpy.data.objects[name].arapfields.stylize.strength == pytest.approx(0.5)
