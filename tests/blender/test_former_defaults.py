# SPDX-License-Identifier: GPL-3.0-or-later
"""Defaults that have changed since a file was saved."""

import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.blender import former_defaults

pytestmark = pytest.mark.in_blender

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


def test_an_object_without_handles_has_the_newest():
    bar = scenes.bar()
    former_defaults.keep()
    assert bar.arapfields.deform.locality == pytest.approx(USUAL)


def test_a_strength_of_an_older_file_keeps_its_weight(tmp_path):
    """Once: what is saved after that stays. So does the whole strength."""
    bars = {}
    for strength in (0.1, 0.5, 1.0):
        bar = scenes.bar()
        bar.arapfields.stylize.strength = strength
        bars[bar.name] = strength
    file = str(tmp_path / "styled.blend")
    stamp, former_defaults.stamp = former_defaults.stamp, lambda: None  # the older extension had none
    try:
        bpy.ops.wm.save_as_mainfile(filepath=file)
    finally:
        former_defaults.stamp = stamp
    for _ in range(2):
        bpy.ops.wm.open_mainfile(filepath=file)
        for name, share in bars.items():
            strength = bpy.data.objects[name].arapfields.stylize.strength
            growth = former_defaults.GROWTH
            weight = (growth**strength - 1) / (growth - 1)
            assert weight == pytest.approx(share, rel=1e-4)
        bpy.ops.wm.save_as_mainfile(filepath=file)


def test_a_strength_that_is_saved_now_stays(tmp_path):
    bar = scenes.bar()
    bar.arapfields.stylize.strength = 0.5
    name, file = bar.name, str(tmp_path / "styled.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    assert bpy.data.objects[name].arapfields.stylize.strength == pytest.approx(0.5)
