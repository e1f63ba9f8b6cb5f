# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed meshes of blocks on an uneven lattice, such as figures with fingers and toes."""

import itertools

import numpy as np

import arapfields as af


def block_surface(blocks, steps):
    """Vertices (n, 3) and triangles (m, 3) of the union of boxes ((low, high) corners each); the lattice has
    a line at each of their sides, and between them lines that are at most `steps` (3) apart."""
    blocks = np.array(blocks, dtype=float)
    lines = []
    for axis in range(3):
        sides = np.unique(np.round(blocks[:, :, axis].ravel(), 9))
        parts = [
            np.linspace(a, b, max(1, round((b - a) / steps[axis])), endpoint=False)
            for a, b in itertools.pairwise(sides)
        ]
        lines.append(np.concatenate([*parts, sides[-1:]]))
    middles = np.stack(np.meshgrid(*[0.5 * (x[1:] + x[:-1]) for x in lines], indexing="ij"), axis=-1)
    filled = np.zeros(np.array(middles.shape[:3]) + 2, dtype=bool)
    filled[1:-1, 1:-1, 1:-1] = np.any(
        [((low < middles) & (middles < high)).all(axis=-1) for low, high in blocks], axis=0
    )
    quads = []
    for axis in range(3):
        along = [np.eye(3, dtype=int)[(axis + k) % 3] for k in (1, 2)]
        ahead = np.roll(filled, -1, axis)
        for sign, face in ((1, filled & ~ahead), (-1, ~filled & ahead)):
            corner = np.argwhere(face) - 1 + np.eye(3, dtype=int)[axis]
            around = [corner, corner + along[0], corner + along[0] + along[1], corner + along[1]]
            quads.append(np.stack(around[::sign], axis=1))
    quads = np.concatenate(quads)
    used, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    vertices = np.stack([lines[axis][used[:, axis]] for axis in range(3)], axis=1)
    quads = index.reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


FINGERS, TOES = 4, 3
FINGER, TOE = 0.018, 0.02  # widths


def figure_with_fingers(gap):
    """(vertices, triangles, bones, {name of a bone: mask of its finger's or toe's outer half}) of a figure of
    height 1.7 whose arms are spread along y; the gaps are those between fingers and between toes."""
    blocks = [((-0.1, -0.15, -0.2), (0.1, 0.15, 0.5)), ((-0.09, -0.08, 0.5), (0.09, 0.08, 0.8))]
    bones = [af.Bone((0, 0, -0.1), (0, 0, 0.45), name="spine"), af.Bone((0, 0, 0.5), (0, 0, 0.8), 0)]
    ends = {}
    for side, y in (("L", 1), ("R", -1)):

        def block(low, high, y=y):
            blocks.append((np.minimum(low * np.array([1, y, 1]), high * np.array([1, y, 1])),
                           np.maximum(low * np.array([1, y, 1]), high * np.array([1, y, 1]))))  # fmt: skip

        def bone(name, head, tail, parent, y=y, side=side):
            head, tail = (np.array(p, float) * [1, y, 1] for p in (head, tail))
            bones.append(af.Bone(head, tail, parent, name=name + side))
            return len(bones) - 1

        block((-0.045, 0.15, 0.37), (0.045, 0.62, 0.46))
        block((-0.05, 0.62, 0.4), (0.05, 0.7, 0.43))
        block((-0.06, 0.04, -0.85), (0.06, 0.14, -0.2))
        block((-0.06, 0.04, -0.9), (0.13, 0.14, -0.85))
        arm = bone("arm", (0, 0.15, 0.415), (0, 0.6, 0.415), 0)
        hand = bone("hand", (0, 0.6, 0.415), (0, 0.68, 0.415), arm)
        leg = bone("leg", (0, 0.09, -0.2), (0, 0.09, -0.86), 0)
        foot = bone("foot", (0, 0.09, -0.875), (0.12, 0.09, -0.875), leg)
        for k in range(FINGERS):
            x = (k - 0.5 * (FINGERS - 1)) * (FINGER + gap)
            block((x - FINGER / 2, 0.7, 0.406), (x + FINGER / 2, 0.8, 0.424))
            bone(f"finger{k}", (x, 0.68, 0.415), (x, 0.795, 0.415), hand)
            ends[bones[-1].name] = (x, y * 0.775, 0.415), (0.5 * FINGER, 0.025, 0.01)
        for k in range(TOES):
            at = 0.09 + (k - 0.5 * (TOES - 1)) * (TOE + gap)
            block((0.13, at - TOE / 2, -0.9), (0.19, at + TOE / 2, -0.88))
            bone(f"toe{k}", (0.12, at, -0.89), (0.185, at, -0.89), foot)
            ends[bones[-1].name] = (0.175, y * at, -0.89), (0.015, 0.5 * TOE, 0.01)
    vertices, triangles = block_surface(blocks, (0.02, 0.03, 0.03))
    masks = {
        name: (np.abs(vertices - middle) <= np.array(half) + 1e-6).all(axis=1)
        for name, (middle, half) in ends.items()
    }
    return vertices, triangles, bones, masks
