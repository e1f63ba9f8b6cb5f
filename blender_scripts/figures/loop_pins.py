# SPDX-License-Identifier: GPL-3.0-or-later
"""The dinosaur of the pin page, its pins drawn, on the way to its pose."""

import bpy
import stage
from mathutils import Matrix

from .looping import film
from .workflows import followed, in_examples


def parts(share):
    """Of the way of the head and of the tail: the head goes first."""
    return [min(1, max(0, 1.8 * share - start)) for start in (0.0, 0.8)]


def loop(output):
    dinosaur = followed("pins")["dinosaur"]
    handles = list(dinosaur.arapfields.handles)
    ends = [handle.empty.matrix_world.copy() for handle in handles]
    rests = [Matrix([handle.rest[k : k + 4] for k in range(0, 16, 4)]) for handle in handles]
    markers = [stage.pin((0, 0, 0), handle.anchor) for handle in handles]
    out = stage_side()

    def pose(share):
        shares = [0.0] * (len(handles) - 2) + parts(share)
        for handle, rest, end, part, drawn in zip(handles, rests, ends, shares, markers, strict=True):
            place = rest.lerp(end, part)
            handle.empty.matrix_world = place
            drawn.matrix_world = Matrix.Translation(out * 0.20) @ Matrix.Translation(place.translation)
        bpy.ops.object.select_all(action="DESELECT")
        dinosaur.select_set(True)
        bpy.context.view_layer.objects.active = dinosaur
        bpy.ops.arapfields.deform()

    return film(output, "loop-pins", pose)


def stage_side():
    """Towards the camera."""
    camera = bpy.context.scene.camera
    return camera.matrix_world.to_3x3().col[2].normalized()


def render(output):
    return in_examples(lambda: loop(output.resolve()))
