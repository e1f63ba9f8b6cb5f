# SPDX-License-Identifier: GPL-3.0-or-later
"""Creatures and things, smooth unions of simple bodies, and the scan of a dog."""

import functools
import math

import numpy as np
from shapes import Cone, Ellipsoid, Ring, RoundBox, Shape, build, mirrored, tube

# Animals; shapes.py explains Shapes.

DARK = (0.02, 0.02, 0.03)


@functools.cache
def lizard():
    """A gecko with a thin tail and twenty toes, head towards -y."""
    skin, belly, spot = (0.13, 0.42, 0.08), (0.66, 0.62, 0.25), (0.80, 0.22, 0.03)
    spine = [(0, -0.62, 0.2), (0, -0.32, 0.2), (0.02, 0.05, 0.2), (0, 0.42, 0.19), (-0.08, 0.75, 0.15)]
    body = tube(spine, [0.1, 0.165, 0.2, 0.15, 0.1])
    tail = tube(
        [
            (-0.08, 0.75, 0.15),
            (-0.12, 1.05, 0.12),
            (0.02, 1.35, 0.09),
            (0.28, 1.52, 0.07),
            (0.52, 1.46, 0.05),
        ],
        [0.1, 0.085, 0.062, 0.042, 0.02],
    )
    head = [
        Ellipsoid((0, -0.80, 0.22), (0.19, 0.22, 0.12)),
        Ellipsoid((0, -1.0, 0.19), (0.125, 0.15, 0.085)),
        Ellipsoid((0, -0.9, 0.15), (0.13, 0.17, 0.06), belly, 0.04),
        Ellipsoid((0, 0.0, 0.12), (0.15, 0.42, 0.1), belly, 0.05),
    ]
    side = [Ellipsoid((0.135, -0.87, 0.3), (0.062, 0.062, 0.06), DARK, 0.02)]
    for y, knee, foot in (
        (-0.36, (0.42, -0.52, 0.22), (0.58, -0.70, 0.05)),
        (0.42, (0.42, 0.36, 0.24), (0.58, 0.56, 0.05)),
    ):
        side += tube([(0.1, y, 0.17), knee, foot], [0.085, 0.07, 0.055], blend=0.07)
        heading = math.atan2(foot[1] - knee[1], foot[0] - knee[0])
        for turn in (-1.15, -0.55, 0.0, 0.55, 1.15):
            a = heading + turn
            toe = (foot[0] + 0.17 * math.cos(a), foot[1] + 0.17 * math.sin(a), 0.035)
            side += [
                Cone((*foot[:2], 0.045), toe, 0.03, 0.024, blend=0.03),
                Ellipsoid(toe, (0.038, 0.038, 0.028), blend=0.02),
            ]
    spots = [
        Ellipsoid((x, y, 0.3), (r, r, 0.14), spot)
        for x, y, r in (
            (0.06, -0.3, 0.07),
            (-0.08, -0.1, 0.08),
            (0.09, 0.12, 0.075),
            (-0.06, 0.32, 0.07),
            (0.0, 0.55, 0.05),
        )
    ]
    return build([*body, *tail, *head, *mirrored(side)], 0.11, paint=spots, base=skin, cells=130)


@functools.cache
def dinosaur():
    """A tyrannosaur on two legs that faces -y."""
    skin, belly, crest = (0.06, 0.27, 0.38), (0.70, 0.62, 0.42), (0.80, 0.20, 0.04)
    body = tube(
        [
            (0, -0.45, 1.28),
            (0, -0.32, 1.0),
            (0, -0.02, 0.78),
            (0, 0.42, 0.74),
            (0, 0.95, 0.72),
            (0, 1.45, 0.86),
        ],
        [0.16, 0.2, 0.31, 0.25, 0.12, 0.03],
    )
    head = [
        Ellipsoid((0, -0.56, 1.42), (0.2, 0.25, 0.19)),
        RoundBox((0, -0.82, 1.40), (0.14, 0.21, 0.11), 0.09, blend=0.12),
        RoundBox((0, -0.76, 1.25), (0.115, 0.2, 0.05), 0.045, belly, 0.03),
        Ellipsoid((0, -0.2, 0.8), (0.2, 0.28, 0.3), belly, 0.05),
    ]
    crests = [
        Cone((0, y, z), (0, y + 0.05, z + 0.12), 0.055, 0.012, crest, 0.03)
        for y, z in (
            (-0.36, 1.55),
            (-0.18, 1.28),
            (-0.02, 1.07),
            (0.16, 1.0),
            (0.36, 0.95),
            (0.56, 0.88),
            (0.76, 0.81),
        )
    ]
    side = [
        Ellipsoid((0.16, -0.62, 1.5), (0.055, 0.06, 0.065), blend=0.02),
        *tube(
            [(0.17, 0.08, 0.72), (0.27, -0.1, 0.45), (0.27, 0.12, 0.24), (0.27, 0.03, 0.08)],
            [0.2, 0.15, 0.09, 0.09],
            blend=0.09,
        ),
        *[
            Cone((0.27, 0.03, 0.07), (0.27 + dx, -0.18, 0.05), 0.075, 0.045, blend=0.04)
            for dx in (-0.1, 0.0, 0.1)
        ],
        *tube(
            [(0.17, -0.3, 0.93), (0.27, -0.42, 0.80), (0.25, -0.58, 0.82)], [0.075, 0.055, 0.045], blend=0.06
        ),
        Cone((0.25, -0.56, 0.82), (0.22, -0.66, 0.78), 0.032, 0.018, blend=0.03),
        Cone((0.25, -0.56, 0.82), (0.27, -0.66, 0.85), 0.032, 0.018, blend=0.03),
    ]
    eyes = mirrored(
        [
            Ellipsoid((0.17, -0.63, 1.5), (0.06, 0.065, 0.07), (0.9, 0.85, 0.6)),
            Ellipsoid((0.21, -0.66, 1.505), (0.036, 0.036, 0.042), DARK),
        ]
    )
    return build([*body, *head, *crests, *mirrored(side)], 0.14, paint=eyes, base=skin, cells=120)


@functools.cache
def dog():
    """A dog with pricked ears and a curled tail, on four legs, facing -y."""
    fur, light = (0.62, 0.27, 0.06), (0.85, 0.76, 0.60)
    body = tube([(0, -0.42, 0.72), (0, 0.0, 0.72), (0, 0.45, 0.70)], [0.27, 0.24, 0.23])
    head = [
        *tube([(0, -0.42, 0.78), (0, -0.58, 1.12)], [0.2, 0.17]),
        Ellipsoid((0, -0.64, 1.22), (0.26, 0.24, 0.22)),
        Cone((0, -0.78, 1.14), (0, -0.98, 1.11), 0.125, 0.085, light, 0.06),
        Ellipsoid((0, -1.07, 1.15), (0.055, 0.04, 0.042), DARK, 0.02),
        Ellipsoid((0, -0.52, 0.68), (0.17, 0.17, 0.24), light, 0.05),
    ]
    tail = tube(
        [(0, 0.62, 0.80), (0.02, 0.80, 1.0), (0.05, 0.70, 1.22), (0.08, 0.50, 1.18)],
        [0.09, 0.105, 0.1, 0.06],
        blend=0.07,
    )
    side = [
        Ellipsoid((0.115, -0.835, 1.26), (0.042, 0.04, 0.05), blend=0.01),
        Cone((0.16, -0.6, 1.36), (0.2, -0.58, 1.56), 0.105, 0.03, blend=0.06),
        *tube(
            [(0.15, -0.42, 0.6), (0.17, -0.43, 0.3), (0.17, -0.45, 0.08)], [0.14, 0.095, 0.085], blend=0.08
        ),
        Ellipsoid((0.17, -0.52, 0.065), (0.095, 0.13, 0.068), light, 0.04),
        *tube([(0.15, 0.46, 0.62), (0.18, 0.42, 0.34), (0.17, 0.52, 0.08)], [0.18, 0.11, 0.085], blend=0.08),
        Ellipsoid((0.17, 0.46, 0.065), (0.095, 0.13, 0.068), light, 0.04),
    ]
    eyes = mirrored([Ellipsoid((0.115, -0.85, 1.26), (0.05, 0.05, 0.058), DARK)])
    return build([*body, *head, *tail, *mirrored(side)], 0.13, paint=eyes, base=fur, cells=120)


@functools.cache
def octopus():
    """A head on eight curling arms."""
    skin, sucker = (0.50, 0.08, 0.22), (0.80, 0.45, 0.45)
    head = [Ellipsoid((0, 0, 0.86), (0.38, 0.38, 0.46)), Ellipsoid((0, 0, 0.42), (0.33, 0.33, 0.25))]
    arms = []
    for i in range(8):
        a = (i + 0.5) * math.pi / 4
        out = np.array([math.cos(a), math.sin(a), 0.0])
        bend = np.array([-math.sin(a), math.cos(a), 0.0]) * (0.22 if i % 2 else -0.22)
        points = [
            0.2 * out + (0, 0, 0.36),
            0.5 * out + (0, 0, 0.13),
            0.85 * out + bend * 0.6 + (0, 0, 0.1),
            1.1 * out + bend * 1.7 + (0, 0, 0.2),
        ]
        arms += tube([tuple(p) for p in points], [0.15, 0.12, 0.09, 0.035], blend=0.08)
        arms += [
            Ellipsoid(
                tuple((0.42 + 0.15 * j) * out + bend * (0.0, 0.15, 0.4, 0.75)[j] + (0, 0, 0.03)),
                (0.05, 0.05, 0.03),
                sucker,
                0.02,
            )
            for j in range(4)
        ]
    eyes = mirrored(
        [
            Ellipsoid((0.17, -0.33, 0.84), (0.12, 0.12, 0.13), (0.9, 0.87, 0.75)),
            Ellipsoid((0.165, -0.41, 0.84), (0.06, 0.07, 0.075), DARK),
        ]
    )
    bumps = mirrored([Ellipsoid((0.17, -0.3, 0.84), (0.115, 0.1, 0.125), blend=0.03)])
    return build([*head, *arms, *bumps], 0.15, paint=eyes, base=skin, cells=120)


# All Shapes by name; shapes.py explains them.


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


# A simulated scan of another dog: grey, rough, open below.

CLAY = (0.45, 0.46, 0.48)
ROUGHNESS = 0.0025


@functools.cache
def hound():
    """The scan of a taller dog with a long muzzle, a deep chest and a hanging tail."""
    body = tube([(0, -0.50, 0.90), (0, -0.05, 0.93), (0, 0.50, 0.95)], [0.31, 0.23, 0.21])
    head = [
        *tube([(0, -0.52, 0.98), (0, -0.70, 1.30)], [0.19, 0.14]),
        Ellipsoid((0, -0.76, 1.40), (0.20, 0.22, 0.19)),
        Cone((0, -0.92, 1.34), (0, -1.27, 1.28), 0.115, 0.07, blend=0.06),
        Ellipsoid((0, -1.31, 1.31), (0.045, 0.04, 0.04), blend=0.02),
    ]
    tail = tube(
        [(0, 0.66, 1.02), (0, 0.86, 0.98), (0, 1.06, 1.04), (0, 1.20, 1.22)],
        [0.09, 0.07, 0.06, 0.035],
        blend=0.06,
    )
    side = [
        Cone((0.15, -0.68, 1.53), (0.24, -0.66, 1.74), 0.10, 0.025, blend=0.06),
        *tube(
            [(0.17, -0.50, 0.75), (0.19, -0.50, 0.38), (0.19, -0.55, 0.08)], [0.14, 0.085, 0.075], blend=0.08
        ),
        Ellipsoid((0.19, -0.61, 0.06), (0.085, 0.13, 0.062), blend=0.04),
        *tube([(0.16, 0.50, 0.82), (0.20, 0.44, 0.45), (0.19, 0.58, 0.08)], [0.19, 0.10, 0.075], blend=0.08),
        Ellipsoid((0.19, 0.52, 0.06), (0.085, 0.13, 0.062), blend=0.04),
    ]
    whole = build([*body, *head, *tail, *mirrored(side)], 0.12, base=CLAY, cells=110)
    return as_scanned(whole)


def as_scanned(shape, seed=0):
    """The shape with noise, without the faces towards the floor."""
    a, b, c = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    seen = normals[:, 2] > -0.75
    kept, triangles = np.unique(shape.triangles[seen], return_inverse=True)
    noise = np.random.default_rng(seed).normal(0, ROUGHNESS, (len(kept), 3))
    return Shape(shape.vertices[kept] + noise, triangles.reshape(-1, 3), shape.colours[kept])
