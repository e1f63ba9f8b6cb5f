# SPDX-License-Identifier: GPL-3.0-or-later
"""A dog between its shape and the style of a cube, above the slider that does it."""

import numpy as np
import stage
from mathutils import Matrix

import arapfields as af

from .common import add, samples_of, shape, turned, warped
from .looping import film
from .styles import OPTIONS

LENGTH = 1.3


def rod(name, centre, half, colour):
    import bpy

    bpy.ops.mesh.primitive_cube_add(size=2)
    item = bpy.context.object
    item.name, item.matrix_world = name, Matrix.Translation(centre) @ Matrix.Diagonal((*half, 1))
    item.data.materials.append(stage.material(name, colour, roughness=0.6))
    return item


def slider():
    """What shows the strength: a rail, a knob, a caption."""
    rail = rod("rail", (0, -1.2, 0.05), (LENGTH / 2, 0.015, 0.015), (0.25, 0.25, 0.27))
    knob = rod("knob", (0, -1.2, 0.06), (0.05, 0.06, 0.06), stage.RESULT)
    return [rail, knob, stage.caption("strength", (0, -1.5, 0.01), 0.12)]


def render(output):
    dog = shape("dog")
    live = af.LiveDeformer(samples_of(dog), options=af.LiveOptions(**OPTIONS))
    stage.clear()
    item = add(dog, "dog", turned(dog, 0, 48))
    parts = slider()
    stage.set_up(
        [item, *parts], width=440, elevation=9, margin=0.06, around=[(-0.9, 0, 1.75), (0.9, 0, 1.75)]
    )
    stage.brighten(1.3)
    preferences = []

    def pose(share):
        live.set_style("cube", max(0.9 * share, 1e-3))
        moved = warped(dog, live.solve()).vertices
        moved[:, 2] -= moved[:, 2].min() - dog.vertices[:, 2].min()
        item.data.vertices.foreach_set("co", np.ascontiguousarray(moved, np.float32).ravel())
        item.data.update()
        parts[1].location.x = LENGTH * (share - 0.5)
        preferences.append(round(live.report.preference, 3))

    return {**film(output, "loop-style", pose), "preferences": [preferences[0], preferences[-1]]}
