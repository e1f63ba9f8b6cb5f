# SPDX-License-Identifier: GPL-3.0-or-later
"""An adult, the target of a wrap of the child: longer legs, a smaller head, hanging arms."""

import bpy
import child
from mathutils import Vector
from shapes import Cone, Ellipsoid, build, mirrored, tube

PAIRS = (  # crown, nose, hands, feet: on the child, and on the scan
    ((0, 0.02, 1.81), (0, 0.01, 2.24)),
    ((0, -0.335, 1.45), (0, -0.255, 1.99)),
    *(((s * 0.82, 0, 0.97), (s * 0.82, -0.06, 1.05)) for s in (-1, 1)),
    *(((s * 0.13, -0.2, 0.04), (s * 0.19, -0.24, 0.04)) for s in (-1, 1)),
)


def body():
    """The Shape, 2.25 high."""
    middle = [
        Ellipsoid((0, 0.01, 2.03), (0.185, 0.215, 0.225)),
        Ellipsoid((0, -0.22, 1.99), (0.03, 0.045, 0.035), blend=0.03),
        Cone((0, 0.02, 1.62), (0, 0.02, 1.88), 0.08, 0.08, blend=0.05),
        *tube([(0, 0, 1.12), (0, 0, 1.3), (0, 0, 1.58)], [0.19, 0.2, 0.17]),
        *tube([(0, 0, 0.95), (0, 0, 1.05)], [0.2, 0.2], blend=0.06),
    ]
    half = [
        *tube([(0.14, 0.01, 1.57), (0.48, 0, 1.33), (0.72, -0.05, 1.12)], [0.095, 0.075, 0.06], blend=0.07),
        Ellipsoid((0.78, -0.06, 1.06), (0.065, 0.05, 0.08), blend=0.04),
        Ellipsoid((0.18, 0.03, 2.02), (0.03, 0.05, 0.06), blend=0.03),
        *tube([(0.12, 0, 0.9), (0.17, -0.02, 0.5), (0.19, 0.02, 0.14)], [0.135, 0.11, 0.085], blend=0.06),
        Ellipsoid((0.19, -0.07, 0.065), (0.085, 0.19, 0.065), blend=0.03),
    ]
    return build([*middle, *mirrored(half)], 0.05, cells=110)


def beside_child(apart):
    """(child, adult at distance `apart` along x), with landmarks on both; the child carries its clothes."""
    whole, *worn = child.rigged()
    other = child.coloured("Grown-up", body())
    other.location.x = apart
    bpy.context.view_layer.update()
    bpy.ops.object.select_all(action="DESELECT")
    for item in (*worn, whole):
        item.select_set(True)
    bpy.context.view_layer.objects.active = whole
    bpy.ops.arapfields.carry(way="FOLLOW")
    whole.arapfields.wrap.onto = other
    for rest, there in PAIRS:
        bpy.ops.arapfields.add_landmark(rest=rest, on_target=Vector(there) + other.location)
    return whole, other
