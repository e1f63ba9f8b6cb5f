# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview icons of the styles, loaded once."""

from pathlib import Path

import bpy.utils.previews

FOLDER = Path(__file__).resolve().parents[1] / "icons"
_collections = []  # one preview collection, while the extension is enabled
_drawn = {}  # {name: key of the image drawn last}


def icon(identifier):
    """The icon_id of a style's image; 0 without one."""
    if not _collections or identifier not in _collections[0]:
        return 0
    return _collections[0][identifier].icon_id


def drawn(name, key, size, pixels):
    """The icon_id of an image drawn at run time, cached by name and key; `pixels()` returns (size, size, 4)
    from the bottom row up. 0 if icons are not loaded."""
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
