# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes of handles."""

from . import movers

TURNS = {"QUATERNION": "quaternion", "AXIS_ANGLE": "axis_angle"}


def insert(entry):
    """Keyframes where a handle is and how it is turned, on the current frame; its size where that counts."""
    moved = entry.rig.pose.bones[movers.bone_of(entry)] if entry.kind == "BONE" else entry.empty
    paths = ["location", f"rotation_{TURNS.get(moved.rotation_mode, 'euler')}"]
    for path in paths + ["scale"] * entry.allow_scale:
        moved.keyframe_insert(path)
