# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the styles, loaded once."""

from pathlib import Path

import bpy.utils.previews

FOLDER = Path(__file__).resolve().parents[1] / "icons"
_collections = []  # one, while the extension is on


def icon(identifier):
    """The number of a style's picture; 0 where there is none."""
    if not _collections or identifier not in _collections[0]:
        return 0
    return _collections[0][identifier].icon_id


def load():
    pictures = bpy.utils.previews.new()
    _collections.append(pictures)
    for path in sorted(FOLDER.glob("*.png")):
        pictures.load(path.stem.upper(), str(path), "IMAGE")


def clear():
    while _collections:
        bpy.utils.previews.remove(_collections.pop())
