# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in contact: a bar pressed onto solids, figures and hands, and how deep parts overlap."""

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import arapfields as af

from .cases import box, moved, shift, turn
from .characters import Capsules
from .meshes import LEFT, RIGHT, read, turned
from .nudge import nudged, nudges

# A bar pressed onto solids.

# Contact goes without locality, and so do the solves that it is compared with.
QUICK = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=150, locality=0)
DEEPEST = 0.004  # 0.1 % of the bar's length
ALIKE = 0.04  # 1 % of it: difference of solves that end a little earlier
DOWN = turned(0, shift=(0, 0, -0.9))
DEEP = [LEFT, DOWN @ RIGHT]


def solid(mesh, center):
    return af.MeshSdf(nudged(mesh.vertices + np.array(center)), mesh.faces)


BALL = solid(trimesh.creation.icosphere(3, 0.5), [1.2, 0, -1.2])
BLOCK = solid(trimesh.creation.box((0.6, 3, 0.6)), [1.0, 0, -1.1])
PLATE = solid(trimesh.creation.box((3, 3, 0.03)), [1.5, 0, -0.8])
SHEET = af.MeshSdf(
    np.array([[0, -2, -0.8], [4, -2, -0.8], [4, 2, -0.8], [0, 2, -0.8]]), np.array([[0, 1, 2], [0, 2, 3]])
)


class Plane(af.ImplicitFunction):
    gradient_bound = 1.0

    def __call__(self, points):
        return points[:, 2] + 0.8


def live(samples, contact=None):
    return af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], QUICK, contact=contact)


# Random poses that press shapes onto obstacles or themselves.

VERTICES = 50_000


@dataclass
class Solid:
    """A box (half extents), a ball (radius) or a rectangular sheet (half extents) normal to its z axis."""

    kind: str
    half: np.ndarray
    place: np.ndarray  # (4, 4) transform

    def local(self, points):
        return (points - self.place[:3, 3]) @ self.place[:3, :3]

    def distance(self, points):
        """Analytic signed distance, negative inside; for a sheet, negative below it along its z axis."""
        x = self.local(points)
        if self.kind == "ball":
            return np.linalg.norm(x, axis=1) - self.half[0]
        if self.kind == "sheet":
            beside = (np.abs(x[:, :2]) - self.half[:2]).max(1)
            return np.maximum(x[:, 2], beside)
        q = np.abs(x) - self.half
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)

    def function(self):
        import trimesh

        if self.kind == "ball":
            mesh = trimesh.creation.icosphere(5, self.half[0])
        elif self.kind == "sheet":
            x, y = self.half[:2]
            mesh = trimesh.Trimesh(
                [[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], [[0, 1, 2], [0, 2, 3]], process=False
            )
        else:
            mesh = trimesh.creation.box(2 * self.half)
        mesh.apply_transform(self.place)
        return af.MeshSdf(mesh.vertices, mesh.faces)


@dataclass
class Case:
    name: str
    shape: str
    handles: list  # with targets
    solids: list = field(default_factory=list)
    itself: bool = False
    frames: int = 0  # frames in which the obstacles arrive from the offset `way`; 0: they do not move
    way: tuple = (0.0, 0.0, 0.0)
    functions: list | None = None

    def pose(self, share):
        """Targets at a share of each handle's motion, interpolated about its center."""
        targets = []
        for handle in self.handles:
            motion = handle.target @ np.linalg.inv(handle.rest)
            part = np.eye(4)
            part[:3, :3] = Rotation.from_rotvec(
                share * Rotation.from_matrix(motion[:3, :3]).as_rotvec()
            ).as_matrix()
            start, end = handle.rest[:3, 3], handle.target[:3, 3]
            part[:3, 3] = (1 - share) * start + share * end - part[:3, :3] @ start
            targets.append(part @ handle.rest)
        return targets

    def contact(self, share=1.0):
        if self.functions is None:
            self.functions = [solid.function() for solid in self.solids]
        away = shift((share - 1.0) * np.asarray(self.way))
        return af.Contact([af.Obstacle(f, placement=away) for f in self.functions], itself=self.itself)


FIGURE = [
    ((0, 0, 0.55), (0, 0, 0.85), 0.12), ((0, 0, 1.0), (0, 0, 1.05), 0.1),
    ((0.1, 0, 0.9), (0.62, 0, 0.9), 0.045), ((-0.1, 0, 0.9), (-0.62, 0, 0.9), 0.045),
    ((0.1, 0, 0.5), (0.12, 0, 0.04), 0.06), ((-0.1, 0, 0.5), (-0.12, 0, 0.04), 0.06),
]  # fmt: skip
BEAST = [
    ((-0.5, 0, 0.5), (0.5, 0, 0.5), 0.15), ((0.6, 0, 0.65), (0.7, 0, 0.7), 0.13),
    ((0.4, 0.1, 0.45), (0.42, 0.1, 0.04), 0.05), ((0.4, -0.1, 0.45), (0.42, -0.1, 0.04), 0.05),
    ((-0.4, 0.1, 0.45), (-0.42, 0.1, 0.04), 0.05), ((-0.4, -0.1, 0.45), (-0.42, -0.1, 0.04), 0.05),
    ((-0.6, 0, 0.55), (-1.3, 0, 0.5), 0.04),
]  # fmt: skip
BODIES = {
    "figure": Capsules(FIGURE, af.Frame([0, 0, 0.57], 0.8)),
    "beast": Capsules(BEAST, af.Frame([-0.25, 0, 0.4], 1.2)),
    "bar": Capsules([((-0.8, 0, 0), (0.8, 0, 0), 0.12)], af.Frame([0, 0, 0], 1.0)),
}


@cache
@nudges
def surface(name, data, vertices=VERTICES):
    """(vertices, triangles) with about as many vertices as asked for."""
    if name in BODIES:
        source = BODIES[name]
    else:
        points, triangles = read(next(Path(data, "meshes").glob(name + ".*")))
        source = af.MeshSdf((points - points.mean(0)) / np.ptp(points, axis=0).max() * 1.6, triangles)
    rough, _ = af.extract_surface(source, 64)[:2]
    return af.extract_surface(source, round(64 * (vertices / len(rough)) ** 0.5))[:2]


def _pressed(shape, data, kind, seed):
    """A Case: the top of a shape along a random direction moves into an obstacle, its bottom is fixed."""
    rng = np.random.default_rng([seed, len(kind), len(shape)])
    points = surface(shape, data)[0]
    along = rng.normal(size=3) * [1, 1, 1.5]
    along /= np.linalg.norm(along)
    heights = points @ along
    low, high = np.quantile(heights, [0.3, 0.85])
    way = np.cross(along, rng.normal(size=3))
    way = way / np.linalg.norm(way) - 0.3 * along
    way /= np.linalg.norm(way)
    top = points[heights > high]
    lead, length = top[np.argmax(top @ way)], 0.4
    frame = np.eye(4)
    frame[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    half = {"ball": [0.25] * 3, "box": [0.2, 0.25, 0.3], "edge": [0.3, 0.3, 0.3]}.get(kind, [0.4, 0.4, 0.008])
    if kind != "ball":  # z is opposite to the motion; for an edge, two faces are
        z = -way
        x = np.cross(z, along) / np.linalg.norm(np.cross(z, along))
        basis = np.stack([x, np.cross(z, x), z], axis=1)
        tilt = {"box": rng.uniform(-0.5, 0.5, 3), "edge": [np.pi / 4, 0, 0]}.get(kind, [0, 0, 0.3])
        frame[:3, :3] = basis @ Rotation.from_euler("xyz", tilt).as_matrix()
    solid = Solid("box" if kind in ("edge", "plate", "moving plate") else kind, np.array(half), frame)
    for off in np.arange(0.0, 2.0, 0.01):
        solid.place[:3, 3] = lead + (off + 0.1) * way
        if solid.distance(points).min() > 0.02:
            break
    held, put = np.linalg.inv(_boxed(along, low)), np.linalg.inv(_boxed(-along, -high))
    motion = shift(length * way) @ turn(along, rng.uniform(-15, 15), top.mean(0))
    handles = [moved(np.linalg.inv(held)), moved(np.linalg.inv(put), motion)]
    case = Case(f"{shape} on {kind} {seed}", shape, handles, [solid])
    if kind == "moving plate":
        case.frames, case.way = 12, tuple(-0.3 * way)
        case.handles[1] = moved(np.linalg.inv(put))
        solid.place[:3, 3] -= 0.25 * way
    return case


def _boxed(along, low):
    """(4, 4) cuboid that contains all points whose height along a direction is less than `low`."""
    a = np.cross(along, [0.3, 0.5, 0.8])
    a /= np.linalg.norm(a)
    matrix = np.eye(4)
    matrix[:3, :3] = 2 * np.stack([a, np.cross(along, a), along], axis=1)
    matrix[:3, 3] = (low - 2) * along
    return matrix


def _ball(center, radius=0.07):
    return box(np.subtract(center, radius), np.add(center, radius))


def _posed(name, shape, parts, solids=(), itself=False):
    """A Case of handles `parts`: (center, radius, motion)."""
    handles = [moved(_ball(center, radius), motion) for center, radius, motion in parts]
    return Case(name, shape, handles, list(solids), itself)


def _block(low, high):
    place = box(low, high)
    return Solid("box", np.diag(place)[:3].copy(), shift(place[:3, 3]))


def figures():
    """Cases: feet on steps, sitting, arms, legs, tails, and bars on themselves."""
    still = np.eye(4)
    trunk, head = ((0, 0, 0.7), 0.16, still), ((0, 0, 1.1), 0.07, still)
    feet = [((side * 0.12, 0, 0.03), 0.08, still) for side in (-1, 1)]
    for k, rise in enumerate((0.1, 0.2)):
        steps = [_block([0.02, -0.6, -0.3], [0.5, -0.12, rise]), _block([-0.5, -0.6, -0.3], [-0.02, -0.1, 0])]
        foot = (feet[1][0], 0.08, shift([0, -0.2, rise - 0.08]))
        yield _posed(f"feet onto steps {k}", "figure", [trunk, feet[0], foot], steps)
    for k, drop in enumerate((0.24, 0.3)):
        chair = [_block([-0.3, 0.09, 0.24], [0.3, 0.6, 0.28]), _block([-0.3, 0.44, 0.28], [0.3, 0.48, 1.0])]
        upper = ((0, 0, 0.7), 0.16, shift([0, 0.24, -drop]))
        knees = [((side * 0.11, 0, 0.3), 0.07, shift([0, -0.03, 0])) for side in (-1, 1)]
        yield _posed(f"sitting on a chair {k}", "figure", [upper, *feet, *knees], chair)
    for k, angle in enumerate((75, 100)):
        arm = ((0.6, 0, 0.9), 0.08, turn([0, 1, 0], angle, (0.12, 0, 0.9)))
        yield _posed(f"arm onto trunk {k}", "figure", [trunk, *feet, arm], itself=True)
    for k, over in enumerate((0.3, 0.4)):
        ways = [shift([-s * over, 0.02 * s, 0]) for s in (-1, 1)]
        legs = [(center, radius, way) for (center, radius, _), way in zip(feet, ways, strict=True)]
        yield _posed(f"legs crossed {k}", "figure", [trunk, head, *legs], itself=True)
    paws = [((x, y, 0.04), 0.07, still) for x in (0.42, -0.42) for y in (0.1, -0.1)]
    for k, angle in enumerate((100, 120)):
        middle = ((-0.9, 0, 0.52), 0.05, turn([0, 1, 0], -60, (-0.62, 0, 0.55)))
        root = turn([0, 1, 0], -60, (-0.62, 0, 0.55))
        tip = ((-1.28, 0, 0.5), 0.06, root @ turn([0.2, 1, 0.1], -angle, (-0.9, 0, 0.52)))
        yield _posed(f"tail around leg {k}", "beast", [*paws, middle, tip], itself=True)
    for k, angle in enumerate((92, 97)):
        ends = [((s * 0.75, 0, 0), 0.15, turn([0, 1, 0], s * angle, (s * 0.25, 0, 0))) for s in (-1, 1)]
        middle = ((0, 0, 0), 0.15, still)
        yield _posed(f"bar onto itself {k}", "bar", [middle, *ends], itself=True)


def pressed_bar(kind):
    return _pressed("bar", None, kind, 1)


def family(data, seeds=(0, 1)):
    """At least thirty Cases; `data`: the folder with meshes/."""
    shapes = ("spot", "bunny", "rockerArm")
    kinds = ("ball", "box", "edge", "plate", "sheet", "moving plate")
    cases = [_pressed(shape, data, kind, seed) for kind in kinds for shape in shapes for seed in seeds[:1]]
    cases += [pressed_bar(kind) for kind in kinds if 1 in seeds]
    return cases + list(figures())


def deepest(case, points):
    """Largest depth of a point in an obstacle, as a share of the largest extent at rest."""
    return max((0.0, *(float(-s.distance(points).min()) for s in case.solids)))


# Two measures of self-intersection that is not present at rest.


def areas(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def overlapping(rest, vertices, triangles):
    """Share of the area that lies inside another part, by winding numbers."""
    import trimesh

    def inside(points):
        normals = trimesh.Trimesh(points, triangles, process=False).vertex_normals
        size = np.ptp(rest, axis=0).max()
        return np.asarray(af.winding_number(points, triangles, points - 5e-4 * size * normals)) > 1.5

    twice = inside(vertices) & ~inside(rest)
    weights = areas(rest, triangles)
    return float(weights @ twice[triangles].mean(1) / weights.sum())


def crossing(rest, vertices, triangles):
    """Share of the area of triangles cut by edges of others that are not their neighbors at rest."""
    corners, before = vertices[triangles], rest[triangles].mean(1)
    middles = corners.mean(1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max()
    tree = cKDTree(middles)
    pairs = tree.query_pairs(2 * radius, output_type="ndarray")
    far = np.linalg.norm(before[pairs[:, 0]] - before[pairs[:, 1]], axis=1) > 4 * radius
    pairs = pairs[far]
    cut = np.zeros(len(triangles), bool)
    for i, j in ((0, 1), (1, 0)):
        a, b, c = (corners[pairs[:, i], k] for k in range(3))
        normal = np.cross(b - a, c - a)
        for k in range(3):
            p, q = corners[pairs[:, j], k], corners[pairs[:, j], (k + 1) % 3]
            s, t = ((p - a) * normal).sum(1), ((q - a) * normal).sum(1)
            through = s * t < 0
            x = p + (s / np.where(through, s - t, 1))[:, None] * (q - p)
            for u, v in ((a, b), (b, c), (c, a)):
                through &= (np.cross(v - u, x - u) * normal).sum(1) > 0
            cut[pairs[through].ravel()] = True
    weights = areas(rest, triangles)
    return float(weights[cut].sum() / weights.sum())
