# SPDX-License-Identifier: GPL-3.0-or-later
"""How often each step of a walk is drawn, relative to others. The names are those of methods in steps.py, of
shapes, and in all_steps.py."""

SHAPES = {"pin": 6, "drag": 8, "transform": 8, "place_source": 2, "live": 6, "keep": 1, "style": 5}
SHAPES |= {"setting": 3, "delete_pin": 1, "delete": 0.3, "rename": 0.5, "solve": 1.5, "wrap": 0.3, "mode": 1}
TIME = {"undo": 12, "redo": 7, "save": 0.6}

# Of the extension, then of Blender itself.
ALL = {
    "live": 5,
    "solve": 4,
    "operator": 10,
    "setting": 8,
    "entry": 2,
    "handle": 4,
    "move_handle": 5,
    "pin": 2,
}
ALL |= {"bake": 1, "carry": 1, "keep": 1}
ALL |= {"add_modifier": 2, "change_modifier": 3, "duplicate": 1.5, "delete": 1, "join": 0.3, "share": 0.6}
ALL |= {"single_user": 0.4, "hide": 1, "parent": 0.6, "mode": 1, "edit": 1.5, "group": 0.8, "shape_key": 0.8}
ALL |= {"frame": 1.5, "keyframe": 1, "rename": 0.4, "add": 0.5, "link": 0.3, "override": 0.3, "place": 2}
ALL |= {"apply": 0.4, "purge": 0.3, "register": 0.3, "select": 1}


def of(kind):
    return (SHAPES if kind == "SHAPES" else ALL) | TIME
