# SPDX-License-Identifier: GPL-3.0-or-later
"""The bar of the contact page pulled over the ball, beside the same without contact."""

import bpy
import numpy as np
from dressing import seen_mesh

from .common import stack
from .looping import film
from .workflows import followed, in_examples, snapshot


def depth():
    """How deep the bar's deepest vertex lies in the ball, as a share of the ball's radius."""
    bar, ball = bpy.data.objects["Bar"], bpy.data.objects["Ball"]
    away = np.linalg.norm(seen_mesh(bar)[0] - ball.location, axis=1)
    return round(max(0.0, 1 - float(away.min()) / (ball.dimensions.z / 2)), 4)


def loop(output):
    names = followed("contact")
    bar, ends = names["bar"], names["ends"]
    touching, depths = bar.arapfields.contact, {"with": depth()}
    shown = snapshot(output / "contact-with.png", 480)
    touching.use = False
    bpy.ops.arapfields.deform()
    depths["without"] = depth()
    stack(
        [snapshot(output / "contact-without.png", 480), shown],
        output / "workflow-contact.png",
        gap=0,
        horizontal=True,
    )
    touching.use = True
    there = {end: end.location.copy() for end in ends}
    bpy.ops.arapfields.live(kind="DEFORM")

    def pose(share):
        for end, place in there.items():
            end.location = names["rest"][end.name].lerp(place, share)
        bpy.context.view_layer.update()

    return {**film(output, "loop-contact", pose), "depth": depths}


def render(output):
    return in_examples(lambda: loop(output.resolve()))
