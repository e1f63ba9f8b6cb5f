# SPDX-License-Identifier: GPL-3.0-or-later
"""Modifier stacks that include the field modifier."""

STACKS = {  # FIELD: the field modifier; "keys": shape keys
    "alone": ["FIELD"],
    "subdivision after": ["FIELD", "SUBSURF"],
    "subdivision before": ["SUBSURF", "FIELD"],
    "mirror before": ["MIRROR", "FIELD"],
    "mirror after": ["FIELD", "MIRROR"],
    "armature before": ["ARMATURE", "FIELD"],
    "armature after": ["FIELD", "ARMATURE"],
    "shape keys": ["keys", "FIELD"],
    "all": ["keys", "MIRROR", "ARMATURE", "FIELD", "SUBSURF"],
}
