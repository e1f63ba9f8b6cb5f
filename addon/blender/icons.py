# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the styles, loaded once."""

from pathlib import Path

import bpy.utils.previews

FOLDER = Path(__file__).resolve().parents[1] / "icons"
_collections = []  # one, while the extension is on
_drawn = {}  # name → key of what was drawn last


def icon(identifier):
    """The number of a style's picture; 0 where there is none."""
    if not _collections or identifier not in _collections[0]:
        return 0
    return _collections[0][identifier].icon_id


def drawn(name, key, size, pixels):
    """The number of a picture that is made while Blender runs; `pixels()`, (size, size, 4) from below, is
    asked where the last of that name had another key. 0 where there are no pictures."""
    if not _collections:
        return 0
    pictures = _collections[0]
    picture = pictures[name] if name in pictures else pictures.new(name)
    if _drawn.get(name) != key:
        picture.icon_size = size, size
        picture.icon_pixels_float.foreach_set(pixels().astype("float32").ravel())
        _drawn[name] = key
    return picture.icon_id


def load():
    pictures = bpy.utils.previews.new()
    _collections.append(pictures)
    for path in sorted(FOLDER.glob("*.png")):
        pictures.load(path.stem.upper(), str(path), "IMAGE")


def clear():
    _drawn.clear()
    while _collections:
        bpy.utils.previews.remove(_collections.pop())
