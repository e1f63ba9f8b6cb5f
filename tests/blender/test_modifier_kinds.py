# SPDX-License-Identifier: GPL-3.0-or-later
"""Before or after: where the field stands among other modifiers, and what follows it there."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Vector
    from support.blender import scenes
    from support.blender.baking import animated
    from support.blender.live import step
    from support.blender.stacks import local_points

    from addon.blender import modifier_kinds, modifier_stack
    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

ROOTS = 1e-3  # roots lie within triangles, whose corners the field moves


def kinds():
    """The kinds of modifiers that meshes have."""
    every = (one.identifier for one in bpy.types.Modifier.bl_rna.properties["type"].enum_items)
    return [kind for kind in every if not kind.startswith("GREASE_PENCIL")]


def test_every_kind_of_this_blender_is_in_the_table():
    missing = set(kinds()) - set(modifier_kinds.KINDS)
    assert not missing
    assert all(kind.why for kind in modifier_kinds.KINDS.values())


def added(bar, kind):
    """The modifier; None where a mesh takes none of that kind."""
    try:
        return bar.modifiers.new("Other", kind)
    except (TypeError, RuntimeError):
        return None


def test_the_field_stands_where_the_table_says():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.2
    seen = {}
    for kind in kinds():
        bar.modifiers.clear()
        other = added(bar, kind)
        if other is None or kind == "NODES":
            continue
        place = modifier_stack.place(bar)
        seen[kind] = place
        follows = modifier_kinds.KINDS[kind].follows_field and kind not in modifier_stack.ORIGINAL
        assert place == int(not follows), kind
        before = len(bar.data.vertices)
        if modifier_kinds.KINDS[kind].keeps:
            assert len(local_points(bar)) == before, kind
    assert {
        seen[kind] for kind in ("PARTICLE_SYSTEM", "COLLISION", "SURFACE", "MASK", "BUILD", "SUBSURF")
    } == {0}
    assert {seen[kind] for kind in ("ARMATURE", "CLOTH", "BOOLEAN", "MIRROR", "UV_PROJECT")} == {1}
    bar.modifiers.clear()
    bar.modifiers.new("Fluid", "FLUID").fluid_type = "DOMAIN"
    assert modifier_stack.place(bar) == 1


def hairy(name="Bar"):
    """A bar whose right end rises from frame 1 to 5, with hair."""
    bar = animated(name)
    bar.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = bar.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 60, 0.3
    bpy.context.scene.frame_set(1)
    bpy.context.view_layer.update()
    return bar


def roots(bar):
    """(n, 3) world positions of the hair's roots."""
    seen = bar.evaluated_get(bpy.context.evaluated_depsgraph_get())
    hair = seen.particle_systems[0]
    return np.array([hair.co_hair(seen, particle_no=i, step=0) for i in range(len(hair.particles))])


def off(bar):
    """The largest distance of a root to the skin."""
    seen = bar.evaluated_get(bpy.context.evaluated_depsgraph_get())
    local = [bar.matrix_world.inverted() @ Vector(root) for root in roots(bar)]
    return max((point - seen.closest_point_on_mesh(point)[1]).length for point in local)


WAYS = ("MODIFIER", "KEY", "REPLACE", "bake", "live")


@pytest.mark.parametrize("way", WAYS)
def test_hair_stays_on_the_skin(way):
    bar = hairy()
    before, skin = roots(bar), local_points(bar)
    bpy.context.scene.frame_set(5)
    if way == "bake":
        folder = tempfile.mkdtemp()
        assert bpy.ops.arapfields.bake(start=1, end=5, filepath=str(Path(folder, "a.pc2"))) == {"FINISHED"}
        bpy.context.scene.frame_set(5)
    elif way == "live":
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        step(bar)
    else:
        assert bpy.ops.arapfields.deform(result=way, **scenes.QUICK) == {"FINISHED"}
    moved = np.abs(local_points(bar) - skin).max()
    assert moved > 0.3 and np.abs(roots(bar) - before).max() > 0.8 * moved
    assert off(bar) < ROOTS
    assert bar.particle_systems[0].settings.count == 60 and len(bpy.data.particles) == 1
    assert not any("stays where" in text for _, text in jobs.messages())


def test_hair_before_a_modifier_that_makes_the_shape_is_named():
    bar = hairy()
    bar.modifiers.new("Mirror", "MIRROR").use_axis = (False, True, False)
    bpy.context.scene.frame_set(5)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert [m.name for m in bar.modifiers] == ["Hair", "Mirror", "ARAP Fields"]
    warning = "Bar: Hair stays where the surface was; move it behind the field's modifier"
    assert ("WARNING", warning) in jobs.messages()
    path = str(Path(tempfile.mkdtemp(), "a.pc2"))
    assert bpy.ops.arapfields.bake(start=1, end=2, filepath=path) == {"FINISHED"}
    assert ("WARNING", f"Bar: {warning}") in jobs.messages() or ("WARNING", warning) in jobs.messages()
