# SPDX-License-Identifier: GPL-3.0-or-later
"""Icon of an object as a style: a ball shaded with the style's preferred normals."""

import numpy as np

from ..blender import icons
from ..core.errors import UserError
from ..core.runtime import native
from ..solver import style_settings

SIZE, FINER = 32, 2
# As in the pictures of the other styles (blender_scripts/style_icons.py): from where, the light, the colours.
VIEW = np.array([[0.80, 0.60, 0.0], [-0.27, 0.36, 0.89], [0.535, -0.71, 0.45]])
LIGHT = np.array([-0.45, 0.65, 0.62])
LOW, HIGH = np.array([0.16, 0.25, 0.42]), np.array([0.98, 0.72, 0.38])
NAME = "STYLE_OBJECT"


def icon(item):
    """The icon_id of an object as a style; 0 if it cannot be one."""
    try:
        style, key = style_settings.style_of(item)
    except (UserError, native.library().InvalidInput):
        return 0
    return icons.drawn(NAME, key, SIZE, lambda: picture(style))


def picture(style):
    """(SIZE, SIZE, 4) RGBA in 0 to 1, from the bottom row up."""
    view = VIEW / np.linalg.norm(VIEW, axis=1, keepdims=True)
    count = SIZE * FINER
    places = (np.arange(count) + 0.5) / count * 2.1 - 1.05
    x, y = (part.reshape(-1, 1) for part in np.meshgrid(places, places))
    depth = 1.0 - x**2 - y**2
    ball = depth[:, 0] > 0
    normals = (x * view[0] + y * view[1] + np.sqrt(np.maximum(depth, 0)) * view[2])[ball]
    if isinstance(style, np.ndarray):
        normals = style[(normals @ style.T).argmax(axis=1)]
    else:
        normals = style.normals(normals)
    light = (LIGHT / np.linalg.norm(LIGHT)) @ view
    whole = np.zeros((count * count, 4))
    whole[ball, :3] = LOW + (HIGH - LOW) * (np.clip(normals @ light, 0, 1)[:, None] * 0.85 + 0.15)
    whole[ball, 3] = 1.0
    whole = whole.reshape(SIZE, FINER, SIZE, FINER, 4).mean(axis=(1, 3))
    whole[..., :3] /= np.maximum(whole[..., 3:], 1e-6)
    return np.clip(whole, 0, 1)
