# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls what peers run in processes of their own: a problem as a file in, moved vertices and seconds out."""

import hashlib
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np

from .. import shapes
from .problems import Problem

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
