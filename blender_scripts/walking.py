# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk on the spot, as keys of three handles: two feet and the hips. All that is not held follows."""

import math

import bpy
from mathutils import Vector

HANDLES = {  # place and half-extents
    "Foot.L": ((0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Foot.R": ((-0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Hips": ((0, 0.12, 0.80), (0.22, 0.24, 0.20)),
}
CYCLE, CYCLES = 24, 3  # frames of one, and how many: what swings takes one or two to repeat
LAST = CYCLE * CYCLES
KEYS = 12  # a cycle
STRIDE, LIFT = 0.20, 0.17  # half a step along y, and how high a foot goes


def foot(phase):
    """(shift, turn about x in radians) of a foot: half the cycle on the ground, half in the air."""
    if phase < 0.5:
        return Vector((0, STRIDE * (4 * phase - 1), 0)), 0.0
    way = 2 * phase - 1
    return Vector((0, STRIDE * math.cos(math.pi * way), LIFT * math.sin(math.pi * way))), 0.5 * math.sin(
        2 * math.pi * way
    )


def hips(phase):
    """They dip at each step, and turn and roll once a cycle."""
    once, twice = 2 * math.pi * phase, 4 * math.pi * phase
    shift = Vector((0.05 * math.cos(once), 0, 0.045 * math.cos(twice) - 0.02))
    return shift, (0.05 * math.sin(twice), 0.08 * math.cos(once), 0.22 * math.sin(once))


def set_keys(empties):
    """Keys of CYCLES cycles from frame 1 on."""
    rest = {name: empty.location.copy() for name, empty in empties.items()}
    for number in range(KEYS * CYCLES + 1):
        frame, phase = 1 + number * CYCLE / KEYS, number / KEYS
        for name, empty in empties.items():
            if name == "Hips":
                shift, turn = hips(phase % 1)
            else:
                shift, about = foot((phase + (0.5 if name.endswith("R") else 0.0)) % 1)
                turn = (about, 0, 0)
            empty.location, empty.rotation_euler = rest[name] + shift, turn
            empty.keyframe_insert("location", frame=frame)
            empty.keyframe_insert("rotation_euler", frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, LAST
    scene.frame_set(1)
