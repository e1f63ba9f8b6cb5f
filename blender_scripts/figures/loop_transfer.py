# SPDX-License-Identifier: GPL-3.0-or-later
"""The child and the grown-up of the transfer page, before and after, and both moved alike."""

import bpy
import numpy as np
from dressing import seen_mesh
from mathutils.bvhtree import BVHTree

from .common import stack
from .looping import film
from .workflows import followed, in_examples, snapshot


def cut(shirt, skin):
    """The share of a shirt's vertices that lie below the skin, as both are shown."""
    places, (points, _, triangles) = seen_mesh(shirt)[0], seen_mesh(skin)
    tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist())
    below = []
    for place in places:
        nearest, normal, _, _ = tree.find_nearest(place)
        below.append(np.dot(np.subtract(place, nearest), normal) < 0)
    return round(float(np.mean(below)), 4)


def loop(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/transfer.blend")
    before = snapshot(output / "transfer-before.png", 480)
    names = followed("transfer")
    after = snapshot(output / "transfer-after.png", 480)
    stack([before, after], output / "workflow-transfer.png", gap=0, horizontal=True)
    pose, below = names["pose"], {}
    for when, share in (("posed", 1.0), ("rest", 0.0)):
        pose(share)
        for of in ("", " Grown-up"):
            shirt, skin = (bpy.data.objects[name] for name in (f"Shirt{of}", of[1:] or "Child"))
            below[f"{skin.name}, {when}"] = cut(shirt, skin)
    return {**film(output, "loop-transfer", pose), "below_skin": below}


def render(output):
    return in_examples(lambda: loop(output.resolve()))
