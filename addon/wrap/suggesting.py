# SPDX-License-Identifier: GPL-3.0-or-later
"""Proposes pairs of landmarks by shape, for the user to check and move."""

import bpy
import numpy as np

from ..blender.language import translated
from ..blender.native_options import options_of
from ..blender.object_references import ObjectReference, refusal_of_linked, settings_of
from ..blender.property_definitions import effective_values, integer
from ..core.geometry.spaces import transform
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..core.settings.parameters import WRAP
from ..jobs.job_operator import JobOperator
from ..surface.source_surface import read_surface
from . import landmarks


class ARAPFIELDS_OT_suggest_landmarks(JobOperator, bpy.types.Operator):
    """Propose pairs of landmarks: ends of the object, and where they belong on the target by shape"""

    bl_label = "Suggest Landmarks"
    bl_options = {"UNDO"}
    title = "Suggest Landmarks"
    guide = "wrap"

    count: integer("Count", "How many pairs at most", default=8, min=1, soft_max=20, options={"SKIP_SAVE"})

    @classmethod
    def refuses(cls, source):
        return refusal_of_linked(source) or landmarks.refusal(source)

    def plan(self, context, source, weights):
        values, af = effective_values(WRAP, settings_of(source).wrap, None), native.library()
        options, count = options_of("wrap", values), self.count
        surface = read_surface(context, source, exact=True)
        target = landmarks.target_of(source)
        vertices, triangles = landmarks.read_target(context, target, surface.space)
        ends = ObjectReference(source), ObjectReference(target)

        def work(tracker):
            samples = surface.samples(tracker, values["samples"], values["seed"], own_triangles=True)
            task = tracker.start("Comparing", 1.0)
            return af.suggest_landmarks(samples, af.MeshSdf(vertices, triangles), count, options, task=task)

        def apply(pairs):
            item, onto = (end.get() for end in ends)
            size = landmarks.SIZE * np.linalg.norm(np.ptp(surface.vertices, axis=0))
            known = [pair[0] for pair in landmarks.read(item, surface.space)]
            made = [pair for pair in pairs if all(np.linalg.norm(pair[0] - one) > size for one in known)]
            for pair in made:
                landmarks.add(bpy.context, item, onto, transform(surface.space.solve_to_world, pair))
            return translated("Pairs of landmarks added: {count}", count=len(made))

        return Item(source.name, work, apply)


CLASSES = [ARAPFIELDS_OT_suggest_landmarks]
