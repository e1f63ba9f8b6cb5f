# SPDX-License-Identifier: GPL-3.0-or-later
"""A dog wrapped onto a twin that a known map bends and swells, beside coherent point drift of pycpd.

Both begin in place. Coherent point drift gets samples of both surfaces, and moves all vertices by its kernel.
"""

import time

import numpy as np
from scipy.spatial.distance import cdist

import arapfields as af

from .. import shapes

WHAT = "a dog onto its bent twin"
POINTS = 2500  # of coherent point drift, on each surface: its time grows with their product
BEND = 0.5  # turn about the vertical, in radians over the half size
SWELL = 0.15  # of the fore part's thickness
SEED = 3


def known(points):
    """The map: a bend about the vertical axis, and a swelling towards the front."""
    front = np.clip(-points[:, 1] / shapes.HALF_EXTENT, -1, 1)
    x, z = points[:, 0] * (1 + SWELL * np.maximum(front, 0)), points[:, 2]
    angle = BEND * front
    return np.stack(
        [
            np.cos(angle) * x - np.sin(angle) * points[:, 1],
            np.sin(angle) * x + np.cos(angle) * points[:, 1],
            z,
        ],
        1,
    )


def by_drift(rest, triangles, goal, pairs):
    """Coherent point drift with pycpd's own settings, which are for points of unit spread."""
    from pycpd import DeformableRegistration

    source = af.sample_mesh(rest, triangles, POINTS, seed=SEED).points
    target = af.sample_mesh(*goal, POINTS, seed=SEED + 1).points
    middle, spread = target.mean(0), target.std()
    solver = DeformableRegistration(X=(target - middle) / spread, Y=(source - middle) / spread)
    solver.register()
    places = (rest - middle) / spread
    kernel = np.exp(-cdist(places, solver.Y, "sqeuclidean") / (2 * solver.beta**2))
    return (places + kernel @ solver.W) * spread + middle


def by_wrap(rest, triangles, goal, pairs):
    """The default wrap."""
    return np.asarray(af.wrap(af.sample_mesh(rest, triangles), af.MeshSdf(*goal), pairs)(rest))


METHODS = (  # and how many pairs of places that correspond each is given
    ("ours, default", by_wrap, 0),
    ("ours, default", by_wrap, 10),
    ("pycpd, coherent point drift", by_drift, 0),
)


def rows():
    rest, triangles = shapes.own_mesh("dog")
    twin, goal_triangles = af.extract_surface(af.MeshSdf(rest, triangles), 70)
    goal = known(twin), goal_triangles
    diagonal = np.linalg.norm(np.ptp(goal[0], axis=0)) / 100
    chosen = np.random.default_rng(SEED).choice(len(rest), max(count for *_, count in METHODS), replace=False)
    for name, method, count in METHODS:
        pairs = [(rest[row], known(rest[[row]])[0]) for row in chosen[:count]]
        begin = time.process_time()
        moved = method(rest, triangles, goal, pairs)
        seconds = time.process_time() - begin
        off = np.linalg.norm(moved - known(rest), axis=1) / diagonal
        yield {
            "what": WHAT,
            "by": name,
            "pairs": count,
            "cpu_s": round(seconds, 2),
            "mean error, % of the diagonal": round(float(off.mean()), 2),
            "largest of 95 %": round(float(np.quantile(off, 0.95)), 2),
            "distance to the target, %": round(float(np.abs(af.MeshSdf(*goal)(moved)).mean() / diagonal), 3),
        }
