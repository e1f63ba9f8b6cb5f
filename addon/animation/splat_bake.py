# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes a posed scan of splats to files, as its modifier shows it, in world space."""

import numpy as np

from ..blender.evaluation import world_matrix
from ..blender.language import translated
from ..core.errors import UserError, refuse
from ..core.runtime import native
from ..results import placement
from ..solver import secondary_motion
from . import splat_files
from .caches import size_text
from .object_bake import ObjectBake


class SplatBake(ObjectBake):
    """Writes files, which nothing in the scene plays; the object stays as it is."""

    def __init__(self, context, source, kind, frames, path, part=None, loop=False):
        if part is not None and part[1] > 1:
            raise UserError("{name}: splats are not baked in parts; bake it whole", source)
        refuse(placement.placement_refusal(source))
        native.library()
        splat_files.require_writable(path)
        super().__init__(context, source, kind, frames, path, loop=loop)
        fps = secondary_motion.frame_rate(context.scene)
        self.store = splat_files.SplatFiles(path, frames, fps, source.name)
        self.worlds, self.kept = {}, 0  # world matrices, by frame; how many frames are stored

    def request(self, context):
        asked = super().request(context)
        frame = context.scene.frame_current + context.scene.frame_subframe
        self.worlds[round(frame, 3)] = np.array(world_matrix(self.reference.get()))
        return asked

    def keep(self, shape):
        frame = self.frames.start + self.kept * self.frames.step
        surface, self.kept = self.reader.surface, self.kept + 1
        splats = surface.splats.posed(native.library(), shape.points, shape.changes)
        self.store.add(splats.transformed(self.worlds.pop(round(frame, 3))))

    def place(self, context):
        self.unchanged_source()
        self.store.commit()
        yield from ()
        ends = dict.fromkeys((self.store.written[0].name, self.store.written[-1].name))
        values = {"count": self.frames.count, "path": " – ".join(ends), "size": size_text(self.store.size)}
        return translated("{count} frames of splats written to {path} ({size})", **values)
