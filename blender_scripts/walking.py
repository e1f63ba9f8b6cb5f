# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk in place, as keyframes of three handles: the feet and the hips."""

import math

import bpy
from mathutils import Vector

HANDLES = {  # center and half extents
    "Foot.L": ((0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Foot.R": ((-0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Hips": ((0, 0.12, 0.80), (0.22, 0.24, 0.20)),
}
CYCLE, CYCLES = 24, 3  # frames per cycle; secondary motion is periodic after one or two
LAST = CYCLE * CYCLES
KEYS = 12  # per cycle
STRIDE, LIFT = 0.20, 0.17  # half a step along y, and the height of a raised foot


def foot(phase):
    """(shift, turn about x in radians) of a foot: half the cycle on the ground, half in the air."""
    if phase < 0.5:
        return Vector((0, STRIDE * (4 * phase - 1), 0)), 0.0
    way = 2 * phase - 1
    return Vector((0, STRIDE * math.cos(math.pi * way), LIFT * math.sin(math.pi * way))), 0.5 * math.sin(
        2 * math.pi * way
    )


def hips(phase):
    """(shift, rotation) of the hips: down at each step, yaw and roll once per cycle."""
    once, twice = 2 * math.pi * phase, 4 * math.pi * phase
    shift = Vector((0.05 * math.cos(once), 0, 0.045 * math.cos(twice) - 0.02))
    return shift, (0.05 * math.sin(twice), 0.08 * math.cos(once), 0.22 * math.sin(once))


def set_keys(empties):
    """Inserts keyframes of CYCLES cycles from frame 1."""
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
