# SPDX-License-Identifier: GPL-3.0-or-later
"""The child of the character page on the way to its pose: eyes, shirt and hair are objects of their own."""

import bpy

from .looping import film
from .workflows import followed, in_examples


def loop(output):
    names = followed("character")
    bones = names["rig"].pose.bones
    ends = {bone.name: bone.rotation_euler.copy() for bone in bones}

    def pose(share):
        for bone in bones:
            bone.rotation_euler = [share * angle for angle in ends[bone.name]]
        names["select"]()
        bpy.ops.arapfields.deform()

    return film(output, "loop-character", pose, width=400)


def render(output):
    return in_examples(lambda: loop(output.resolve()))
