# SPDX-License-Identifier: GPL-3.0-or-later
"""The problems that all are given, and calls of peers in their own processes: moved vertices and seconds."""

import functools
import hashlib
import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NamedTuple

import numpy as np

import arapfields as af

from .. import shapes
from ..shapes import inside, meshes

# The problems that all are given: a mesh, which of its vertices are held, which are moved, and where to.

RESOLUTION = 96
POINT = {  # of the hand whose index finger is pulled by one point: palm's box, point, goal
    True: (((-0.38, -0.43, -0.73), (0.12, 0.47, 0.01)), (0.17, -0.26, 0.54), (0.50, -0.26, 0.28)),
    False: (((-1, -1, -1), (1, 1, 0.05)), (0.2, -0.03, 0.61), (0.2, -0.35, 0.40)),
}


class Problem(NamedTuple):
    name: str  # as rows have it
    shape: str
    vertices: np.ndarray  # (n, 3)
    triangles: np.ndarray  # (m, 3)
    held: np.ndarray  # indices of vertices that stay
    moved: np.ndarray  # indices of vertices that go
    goals: np.ndarray  # (len(moved), 3)
    motion: np.ndarray  # (4, 4) of what goes
    handles: list  # the same for us: cuboids, and a point

    @property
    def fixed(self):
        return np.concatenate([self.held, self.moved])

    @property
    def wanted(self):
        return np.concatenate([self.vertices[self.held], self.goals])


def even_mesh(shape, rounds=12):
    """The shape's surface by marching cubes, its vertices relaxed along it: slivers would be unfair to
    those who work on the mesh."""
    sdf = shapes.sdf(shape)
    vertices, triangles = af.extract_surface(sdf, RESOLUTION)
    ends = np.concatenate([triangles[:, pair] for pair in ((0, 1), (1, 2), (2, 0))])
    count = np.bincount(ends[:, 0], minlength=len(vertices))[:, None]
    for _ in range(rounds):
        total = np.zeros_like(vertices)
        np.add.at(total, ends[:, 0], vertices[ends[:, 1]])
        vertices = (vertices + total / count) / 2
        for _ in range(2):
            slope = sdf.gradient(vertices)
            vertices = vertices - sdf(vertices)[:, None] * slope / (slope**2).sum(1)[:, None]
    return vertices, triangles


@functools.cache
def turned(shape):
    """A part of the shape turned by 70°, its base held: the constraints of figure 7."""
    vertices, triangles = even_mesh(shape)
    (held, moved), goal = shapes.placements(shape), shapes.targets(shape, shapes.FULL)[1]
    rows = np.flatnonzero(inside(moved, vertices))
    motion = goal @ np.linalg.inv(moved)
    goals = vertices[rows] @ motion[:3, :3].T + motion[:3, 3]
    handles = [af.Cuboid(held, held), af.Cuboid(moved, goal)]
    name = f"{shapes.label(shape)}, turned by {shapes.FULL}°"
    fixed = np.flatnonzero(inside(held, vertices))
    return Problem(name, shape, vertices, triangles, fixed, rows, goals, motion, handles)


@functools.cache
def pulled():
    """The hand's index finger pulled by one point, its palm held: the constraints of figure 6."""
    corners, point, goal = POINT[shapes.is_published("hand")]
    palm = shapes.cases.box(*corners)
    vertices, triangles = even_mesh("hand")
    row = np.linalg.norm(vertices - point, axis=1).argmin()
    goals = vertices[[row]] + np.subtract(goal, point)
    handles = [af.Cuboid(palm, palm), af.Point(vertices[row], goals[0])]
    name = f"{shapes.label('hand')}, one finger pulled by a point"
    fixed = np.flatnonzero(inside(palm, vertices))
    motion = shapes.cases.shift(goals[0] - vertices[row])
    return Problem(name, "hand", vertices, triangles, fixed, np.array([row]), goals, motion, handles)


def awkward():
    """Meshes that not all take, by what is odd; lower ends are held, upper ones turned by 40°."""
    vertices, triangles = meshes.sphere(1.0, 3)
    middles = vertices[triangles].mean(1)
    apex = len(vertices)
    fin = np.array([[triangles[40][0], triangles[40][1], apex]])
    other = 0.3 * vertices + np.array([0.9, 0, 0])
    sliver = np.array([[triangles[7][0], triangles[7][0], triangles[7][1]]])
    made = {
        "closed": (vertices, triangles),
        "a hole": without_loose(vertices, triangles[middles[:, 0] < 0.8]),
        "an edge of three triangles": (np.r_[vertices, [1.3 * vertices[fin[0, 0]]]], np.r_[triangles, fin]),
        "two parts that overlap, one without handles": (
            np.r_[vertices, other],
            np.r_[triangles, triangles + len(vertices)],
        ),
        "triangles that share no vertices": (
            vertices[triangles].reshape(-1, 3),
            np.arange(3 * len(triangles)).reshape(-1, 3),
        ),
        "a triangle without area": (vertices, np.r_[triangles, sliver]),
    }
    return {name: ends_turned(name, *mesh) for name, mesh in made.items()}


def without_loose(vertices, triangles):
    used, corners = np.unique(triangles, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3)


def ends_turned(name, vertices, triangles):
    boxes = [shapes.cases.box((-2, -2, low), (2, 2, high)) for low, high in ((-1.1, -0.6), (0.6, 1.5))]
    motion = shapes.cases.turn([0, 1, 0], 40, (0, 0, 0.2))
    held, rows = (np.flatnonzero(inside(box, vertices)) for box in boxes)
    goals = vertices[rows] @ motion[:3, :3].T + motion[:3, 3]
    handles = [af.Cuboid(boxes[0], boxes[0]), af.Cuboid(boxes[1], motion @ boxes[1])]
    return Problem(name, "odd", vertices, triangles, held, rows, goals, motion, handles)


def of_figures():
    return {"figure 6": pulled(), "figure 7": turned("bunny")}


# Calls what peers run in processes of their own: a problem as a file in, moved vertices and seconds out.

HERE = Path(__file__).resolve().parent
KEPT = shapes.ROOT / "build" / "bench" / "peers"
CODES = ("implicit-arap", "gaussStylization")
POINTS = 20  # of a handle: its own examples have one to some hundred


class NoCode(ModuleNotFoundError):
    """PEERS names no folder."""


class Refused(Exception):
    """What a peer said instead of a result."""


def folder():
    """Where the peers' code is: make bench PEERS=path."""
    found = os.environ.get("PEERS", "")
    if not found or not Path(found).is_dir():
        raise NoCode("no folder with their code is named: make bench PEERS=path")
    missing = [name for name in CODES if not (Path(found) / name).is_dir()]
    if missing:
        raise NoCode(f"{found} has no checkout {' and no '.join(missing)}")
    return Path(found).resolve()


def commit(checkout):
    command = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
    found = subprocess.run(command, capture_output=True, text=True)
    return found.stdout.strip()[:12] if found.returncode == 0 else "no git"


def called(script, *words, python=sys.executable):
    """Runs a script of this folder; its last line is the reason where it fails."""
    command = [python, str(HERE / script), *map(str, words)]
    log = KEPT / f"{Path(script).stem}-{os.getpid()}.log"
    with log.open("w") as lines:
        done = subprocess.run(command, stdout=lines, stderr=subprocess.STDOUT)
    if done.returncode:
        lines = [line for line in log.read_text().strip().splitlines() if line.strip()] or ["no word"]
        raise Refused(lines[-1][:200] if done.returncode > 0 else f"ended by signal {-done.returncode}")


def spread(points, count):
    """Indices of at most so many points, spread evenly."""
    if len(points) <= count:
        return np.arange(len(points))
    chosen, far = [0], np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(far.argmax()))
        far = np.minimum(far, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def given_to_implicit_arap(problem: Problem):
    """Arrays of its problem: some of the points of each handle, and the network of the signed distance."""
    weights, biases, *encoding = shapes.layers(problem.shape)
    held = problem.vertices[problem.held]
    some = spread(problem.vertices[problem.moved], POINTS)
    return {
        "vertices": problem.vertices,
        "static": held[spread(held, POINTS)],
        "moving": problem.vertices[problem.moved][some],
        "goals": problem.goals[some],
        "encoding": np.array(encoding, float),
        **{f"weights_{i}": layer for i, layer in enumerate(weights)},
        **{f"biases_{i}": layer for i, layer in enumerate(biases)},
    }


def implicit_arap(problem: Problem, checkout, *options):
    """Its result, a dictionary of arrays; where it was trained on the same problem before, that one."""
    KEPT.mkdir(parents=True, exist_ok=True)
    names = ("given.npz", "implicit-arap.npz", "implicit-arap.key")
    given, result, key = (KEPT / f"{problem.shape}-{name}" for name in names)
    arrays, wanted = given_to_implicit_arap(problem), hashlib.sha256()
    for name, array in arrays.items():
        wanted.update(name.encode() + np.ascontiguousarray(array).tobytes())
    wanted.update(repr((commit(checkout), *map(str, options))).encode())
    if not (result.exists() and key.exists() and key.read_text() == wanted.hexdigest()):
        key.unlink(missing_ok=True)
        np.savez(given, **arrays)
        called("implicit_arap.py", checkout, given, result, *options)
        key.write_text(wanted.hexdigest())
    return dict(np.load(result))


def blender(problem: Problem, method, cage=None):
    """The vertices as a deformer of Blender leaves them, and processor seconds; `cage`: of Surface Deform."""
    KEPT.mkdir(parents=True, exist_ok=True)
    given, result = KEPT / "blender-given.npz", KEPT / f"{problem.shape}-{method}.npz"
    result.unlink(missing_ok=True)
    arrays = {
        name: getattr(problem, name) for name in ("vertices", "triangles", "fixed", "wanted", "held", "moved")
    }
    if cage is not None:
        arrays |= {"cage_vertices": cage.vertices, "cage_triangles": cage.triangles}
        arrays |= {"cage_fixed": cage.fixed, "cage_wanted": cage.wanted}
    np.savez(given, motion=problem.motion, **arrays)
    called("blender_deformers.py", method, given, result)
    found = np.load(result)
    return found["moved"], float(found["seconds"][1])


def gauss(module, vertices, triangles, normals, strength, name):
    """The vertices as gaussStylization leaves them, processor seconds, and its iterations."""
    given, result = KEPT / "gauss-given.npz", KEPT / f"{name}-gauss.npz"
    result.unlink(missing_ok=True)
    np.savez(given, vertices=vertices, triangles=triangles, normals=normals, strength=strength)
    called("gauss_stylization.py", module, given, result)
    found = np.load(result)
    return found["moved"], float(found["seconds"][1]), int(found["iterations"])


def built_gauss(checkout):
    """The folder of gauss_stylization.so, compiled if it is not there for this commit."""
    import pybind11

    folder = KEPT / f"gauss-{commit(checkout).replace(' ', '-')}"
    module = folder / "gauss_stylization.so"
    if module.exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    headers = [checkout / name for name in ("libigl/include", "utils_gauss", "utils_cubic")]
    headers += [Path(sys.prefix) / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}"]
    headers[-1] /= "site-packages/cmeel.prefix/include/eigen3"
    headers += [pybind11.get_include(), sysconfig.get_paths()["include"]]
    flags = ["-std=c++17", "-O3", "-DNDEBUG", "-w", "-fPIC", *(f"-I{path}" for path in headers)]
    sources = [checkout / "gaussStylization_python" / "main.cpp"]
    sources += [
        path for name in ("utils_gauss", "utils_cubic") for path in sorted((checkout / name).glob("*.cpp"))
    ]
    objects = []
    for source in sources:
        objects.append(folder / f"{source.stem}.o")
        compiled(["c++", *flags, "-c", source, "-o", objects[-1]])
    compiled(["c++", "-shared", *objects, "-o", module])
    return folder


def compiled(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise Refused(f"does not compile: {done.stderr.strip().splitlines()[-1][:200]}")
