# SPDX-License-Identifier: GPL-3.0-or-later
"""Native handles of bones."""

import bpy
from support.blender import scenes
from support.blender.stacks import add_modifier, armature

import arapfields as af
from addon.blender import mesh_arrays, vertex_groups
from addon.core.geometry.spaces import space_of
from addon.core.runtime.coroutines import run_to_completion
from addon.handles import empties
from addon.handles.native_handles import native_handles


def handles_of(bar):
    """[(indices of its samples, its (4, 4) motion)] of the bar's native handles."""
    space, mesh = space_of(bar.matrix_world), mesh_arrays.read(bpy.context, bar, in_place=True)
    reading = vertex_groups.read_weights(bpy.context, bar, empties.group_names(bar), in_place=True)
    handles = empties.solve_handles(bar, space, run_to_completion(reading))
    samples = af.sample_mesh(space.to_solve(mesh.vertices), mesh.triangles, count=2000, seed=0)
    return [(native.samples, native.motion) for native in native_handles(af, handles, mesh, samples)]


def rigged_bar(with_groups=True):
    """(bar, rig): a bar and an armature of two bones, which deforms it by a modifier `with_groups`."""
    bar = scenes.bar()
    if with_groups:
        add_modifier(bar, "ARMATURE")
        rig = bar.modifiers["Armature"].object
    else:
        rig = armature()
    rig.pose.bones["Second"].rotation_euler.z = 0.0
    scenes.activate(rig, bar)
    return bar, rig
