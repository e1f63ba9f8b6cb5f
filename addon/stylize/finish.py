# SPDX-License-Identifier: GPL-3.0-or-later
"""The last part of a stylization: what a field has moved is sharpened by the mesh's own vertices."""

from dataclasses import dataclass

import numpy as np

from ..blender import vertex_groups
from ..core.runtime import native
from ..handles.native_handles import held_points
from ..solver.style_settings import Style


@dataclass(frozen=True)
class Finish:
    """Read on the main thread, used on the worker."""

    style: Style
    options: object  # native SharpenOptions
    handles: list  # core.geometry.handles.Handle; what they hold stays where the field has it
    region: np.ndarray | None  # (n,) weights of the source's vertices, with which the style acts

    def finished(self, tracker, surface, points, triangles, moved, weight):
        """(k, 3) positions of `moved` points, of which `points` (k, 3) are those at rest, in solve space."""
        weights = self.region
        if weights is not None and points is not surface.vertices:
            weights = vertex_groups.at_points(surface.vertices, weights, points)
        if self.handles:
            held = held_points(self.handles, surface, points)
            weights = np.where(held, 0.0, 1.0 if weights is None else weights)
        af, stands = native.library(), None if self.handles else self.style.up
        further = {"weights": weights, "up": stands, "task": tracker.start("Finishing", weight)}
        return af.sharpen(points, triangles, moved, self.style.directions(af), self.options, **further)
