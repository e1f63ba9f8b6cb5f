# SPDX-License-Identifier: GPL-3.0-or-later
"""Deformation problems of several tests and benchmarks."""

import functools

import numpy as np
from support.geometry.nudge import nudged

import arapfields as af


def box(low, high):
    """(4, 4) map of the cube [-1, 1]³ onto the box between two corners."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    matrix = np.diag([*(high - low) / 2, 1.0])
    matrix[:3, 3] = (low + high) / 2
    return matrix


def turn(axis, degrees, pivot=(0.0, 0.0, 0.0)):
    """(4, 4) rotation about an axis through a pivot, by Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    matrix[:3, 3] = pivot - matrix[:3, :3] @ pivot
    return matrix


def shift(offset):
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def moved(rest, motion=None, **keywords):
    """A cuboid handle with this motion; by default it stays."""
    return af.Cuboid(rest, rest if motion is None else motion @ rest, **keywords)


def bar_samples(count=1500, seed=0):
    """Samples of the box [-0.8, 0.8] × [-0.15, 0.15]², with frame identity."""
    rng = np.random.default_rng(seed)
    size = np.array([0.8, 0.15, 0.15])
    areas = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
    axis = rng.choice(3, size=count, p=areas / areas.sum())
    points = rng.uniform(-1, 1, size=(count, 3))
    side = rng.choice([-1.0, 1.0], size=count)
    points[np.arange(count), axis] = side
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = side
    return af.SurfaceSamples(nudged(points * size), normals, frame=af.Frame([0, 0, 0], 1.0))


def bar_handles(degrees=60.0):
    """Handles that fix the bar's left end and rotate its right end about y."""
    left, right = box([-0.9, -0.3, -0.3], [-0.6, 0.3, 0.3]), box([0.6, -0.3, -0.3], [0.9, 0.3, 0.3])
    return [moved(left), moved(right, turn([0, 1, 0], degrees, (0.0, 0.0, 0.0)))]


@functools.cache
def published_samples(path, count=20000, seed=0):
    """Uniform samples of a published network's zero set, with frame identity."""
    from support.oracles import Network  # needs torch, which a Blender's Python may lack

    sdf = af.NeuralSdf.from_layers(*Network.published(path).layers)
    return af.sample_surface(sdf, count=count, seed=seed)


def bunny_handles():
    """Handles of the paper's bunny: the bottom is fixed, the ears are rotated by 70 degrees."""
    bottom, ears = box([-1, -1, -1], [1, 1, -0.35]), box([-1, -1, 0.6], [1, 1, 1])
    return [moved(bottom), moved(ears, turn([0, 1, 0], 70, (-0.1, 0, 0.3)))]


FINGERS = {  # fingertips of the published hand
    "thumb": (0.285, -0.378, 0.122), "index": (0.227, -0.258, 0.573), "middle": (0.181, -0.064, 0.741),
    "ring": (0.215, 0.161, 0.625), "little": (0.171, 0.369, 0.362),
}  # fmt: skip


def hand_handles(degrees=40.0):
    """Handles of the published hand: the palm is fixed, the middle fingertip is rotated about its knuckle."""
    palm, tip = box([-0.5, -0.5, -0.8], [0.06, 0.5, -0.05]), np.array(FINGERS["middle"])
    knuckle = turn([0, 1, 0], degrees, (-0.16, -0.05, 0.12))
    return [moved(palm), af.Point(tip, knuckle[:3, :3] @ tip + knuckle[:3, 3])]


def fingertips(samples):
    """Indices of the samples of each of the published hand's fingertips."""
    return {
        name: np.flatnonzero(np.linalg.norm(samples.points - tip, axis=1) < 0.08)
        for name, tip in FINGERS.items()
    }
