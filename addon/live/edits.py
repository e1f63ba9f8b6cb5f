# SPDX-License-Identifier: GPL-3.0-or-later
"""How a live session notices that its source, or what that carries, is edited."""

import time

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..carried.carrying import Reshaped
from ..stiffness import painted

STROKE = 0.3  # seconds without a touch of the brush after which a stroke has ended


class Changed(Exception):
    """The source was edited, or its handles or settings: the solver must be set up again."""


class Edits:
    """Mixin of a session; on the main thread."""

    def read_points(self, context, source):
        """Where the modifiers before have the points now: the field is evaluated there."""
        self.may_have_moved = False
        with modifier_stack.evaluated_mesh(context, source, in_place=True) as mesh:
            points = mesh_arrays.positions(mesh)
        if len(points) != len(self.placed):
            raise Changed
        if not np.array_equal(points, self.placed):
            self.placed = points

    def refresh_carried(self, context):
        """Reads again what of the carried objects may have been edited."""
        try:
            self.carrying.refresh(context)
        except Reshaped:
            raise Changed from None

    def is_edited(self, source):
        """Whether the source's mesh is another than when it was read; looked at after an update of it."""
        if not self.may_be_edited:
            return False
        if source.mode == "WEIGHT_PAINT":  # between two strokes
            if time.monotonic() - self.edited_at < STROKE:
                return False
            self.may_be_edited = False
            return not painted.same(
                painted.read(bpy.context, source, self.surface.in_place), self.surface.stiffness
            )
        self.may_be_edited = False
        return mesh_arrays.fingerprint(source.data) != self.fingerprint
