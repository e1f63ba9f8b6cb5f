# SPDX-License-Identifier: GPL-3.0-or-later
"""All Shapes by name; shapes.py explains them."""

import functools

import numpy as np
from creatures import dinosaur, dog, lizard, octopus
from shapes import Cone, Ellipsoid, Ring, RoundBox, Shape, build, mirrored, tube


@functools.cache
def hand():
    """A left hand, palm towards -y, fingers up; genus 0, with fingers close to each other."""
    skin, nail = (0.66, 0.33, 0.20), (0.80, 0.50, 0.40)
    palm = [
        RoundBox((0.0, 0.0, 0.42), (0.36, 0.12, 0.38), 0.115),
        Ellipsoid((0.26, -0.07, 0.28), (0.2, 0.13, 0.26)),
    ]
    wrist = [Cone((0.0, 0.02, -0.25), (0.0, 0.0, 0.25), 0.2, 0.24)]
    fingers = []
    for x, lean, length, radius in (
        (0.285, 0.20, 0.68, 0.080),
        (0.095, 0.05, 0.80, 0.083),
        (-0.10, -0.10, 0.72, 0.080),
        (-0.285, -0.25, 0.55, 0.070),
    ):
        root, tip = np.array([x, 0.0, 0.74]), np.array([x + lean * length, -0.05, 0.74 + length])
        middle = (root + tip) / 2 + (0, 0.02, 0)
        fingers += tube([root, middle, tip], [1.06 * radius, radius, 0.88 * radius], blend=0.035)
        fingers += [Ellipsoid(tuple(np.add(tip, (0, 0.055, -0.005))), (0.052, 0.035, 0.072), nail, 0.02)]
    thumb = tube(
        [(0.26, -0.04, 0.28), (0.52, -0.12, 0.50), (0.68, -0.16, 0.78)], [0.15, 0.115, 0.092], blend=0.09
    )
    return build([*palm, *wrist, *fingers, *thumb], 0.12, base=skin)


@functools.cache
def mug():
    """A mug with a handle: genus 1, thin walls."""
    wall = Cup((0, 0, 0.6), 0.5, 0.6, 0.07)
    grip = Ring((0.56, 0, 0.62), 0.33, 0.085, (0.75, 0.20, 0.06), 0.08)
    return build(
        [wall, grip], 0.08, carve=[Cup((0, 0, 0.72), 0.40, 0.62, 0.06)], base=(0.86, 0.82, 0.74), cells=84
    )


class Cup(RoundBox):
    """An upright cylinder with rounded rims."""

    def __init__(self, centre, radius, half_height, rounding, colour=None, blend=None):
        super().__init__(centre, (radius, radius, half_height), rounding, colour, blend)

    def distance(self, p):
        q = p - np.asarray(self.centre)
        d = (
            np.stack([np.hypot(q[:, 0], q[:, 1]) - self.half[0], np.abs(q[:, 2]) - self.half[2]], 1)
            + self.radius
        )
        return np.linalg.norm(np.maximum(d, 0), axis=1) + np.minimum(d.max(1), 0.0) - self.radius


@functools.cache
def chapel():
    """A building with planar and curved parts: a nave with buttresses and an apse, a tower, a dome."""
    wall, roof, dark = (0.70, 0.60, 0.44), (0.42, 0.12, 0.06), (0.05, 0.04, 0.05)
    nave = [
        RoundBox((0, 0.1, 0.36), (0.36, 0.62, 0.36), 0.03),
        Cone((0, -0.45, 0.70), (0, 0.65, 0.70), 0.29, 0.29, roof),
        Cone((0, 0.72, 0.1), (0, 0.72, 0.5), 0.27, 0.27),
        Ellipsoid((0, 0.25, 0.95), (0.25, 0.25, 0.36), roof),
    ]
    tower = [
        RoundBox((0, -0.68, 0.72), (0.21, 0.21, 0.72), 0.03),
        Cone((0, -0.68, 1.44), (0, -0.68, 2.05), 0.20, 0.03, roof),
    ]
    side = [RoundBox((0.39, y, 0.24), (0.08, 0.06, 0.24), 0.02) for y in (-0.25, 0.1, 0.45)]
    doors = [Ellipsoid((0, -0.90, 0.1), (0.09, 0.06, 0.24), dark)]
    return build([*nave, *tower, *mirrored(side)], 0.03, paint=doors, base=wall, cells=110)


@functools.cache
def bar(length=1.6, width=0.22):
    """A slender box along x with rounded edges."""
    return build(
        [RoundBox((0, 0, width), (length / 2, width, width), 0.05)], base=(0.72, 0.42, 0.08), cells=120
    )


@functools.cache
def slender_bar():
    """A thinner one, for bending."""
    return bar(1.64, 0.12)


@functools.cache
def ring():
    """A torus about the y axis."""
    return build([Ring((0, 0, 0.8), 0.6, 0.2)], base=(0.10, 0.30, 0.55), cells=64)


SHAPES = {f.__name__: f for f in (hand, lizard, dinosaur, dog, octopus, mug, chapel, bar, slender_bar, ring)}


def load(name) -> Shape:
    return SHAPES[name]()
