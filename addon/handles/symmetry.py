# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the other side of a source is, while both sides move alike."""

import numpy as np

from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from .movers import matrix_of


def mirror_of(source):
    """(4, 4) world → world, across the plane of the source's Symmetry; None where there is none.

    Nor where the source is being stylized live, which heeds no symmetry, or its scale flattens it.
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
    """Whether the middle of a box, cube [-1, 1]³ → world, is where the mirror has it too."""
    extent = np.linalg.norm(box[:3, :3], axis=0).max()
    return np.linalg.norm((mirror @ box - box)[:3, 3]) <= 1e-3 * extent
