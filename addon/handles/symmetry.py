# SPDX-License-Identifier: GPL-3.0-or-later
"""The mirror plane of a source whose sides are deformed symmetrically."""

import numpy as np

from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from .movers import matrix_of


def mirror_of(source):
    """(4, 4) world → world reflection across the plane of the source's Symmetry; None without one.

    Also None while a style, which ignores symmetry, is live, or if the source's scale flattens it.
    """
    settings = settings_of(source)
    plane = settings.deform.symmetry.lower()
    if plane == "none" or settings.live_kind == "STYLIZE":
        return None
    try:
        return space_of(matrix_of(source), source.name).mirror("xyz".index(plane))
    except UserError:
        return None


def is_on_plane(mirror, box):
    """Whether the center of a box, cube [-1, 1]³ → world, is on the mirror plane."""
    extent = np.linalg.norm(box[:3, :3], axis=0).max()
    return np.linalg.norm((mirror @ box - box)[:3, 3]) <= 1e-3 * extent
