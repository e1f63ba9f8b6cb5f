# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the styles, loaded once."""

from pathlib import Path

import bpy.utils.previews

FOLDER = Path(__file__).resolve().parents[1] / "icons"
_loaded = None


def icon(identifier):
    """The number of a style's picture; 0 where there is none."""
    if _loaded is None or identifier not in _loaded:
        return 0
    return _loaded[identifier].icon_id


def register():
    global _loaded
    _loaded = bpy.utils.previews.new()
    for path in sorted(FOLDER.glob("*.png")):
        _loaded.load(path.stem.upper(), str(path), "IMAGE")


def unregister():
    global _loaded
    if _loaded is not None:
        bpy.utils.previews.remove(_loaded)
        _loaded = None
