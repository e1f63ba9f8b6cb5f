# SPDX-License-Identifier: GPL-3.0-or-later
"""Public code of others on the same constraints as ours: make bench PEERS=path.

PEERS holds checkouts of dbaieri/implicit-arap and ugogon/gaussStylization, and of
alecjacobson/common-3d-test-models for a cow in styles; Blender's own deformers are those of .venv. All are
measured at the same vertices. Moved vertices stay in build/bench/peers, for pictures.
"""

import os
import time

import numpy as np

import arapfields as af

from . import shapes
from .peer import compared, theirs, yardstick
from .peer.theirs import Refused, awkward, of_figures

# Of the processor, for each training of implicit-arap; 0 is its own settings. Its own 1,000 steps run to the
# end, each with as many of its 1,000 patches on the surface and as many in space as the time allows.
MINUTES = float(os.environ.get("PEERS_MINUTES", "20"))
PATCHES_A_MINUTE = 7.5
LEAST_PATCHES = 60, 10  # on the surface each point of a handle has one
CUBE = np.vstack([np.eye(3), -np.eye(3)])
METHODS = {"Laplacian Deform": "laplacian", "Lattice": "lattice", "Surface Deform": "surface"}  # Blender's
CAGE = 24  # cells a side of Surface Deform's cage
POISSON = 0.4  # of the material; .5 keeps the volume
BRUSH_RADIUS = 0.1  # of the brush, over the size: a finger's length


def clocked(call):
    begin = time.process_time()
    result = call()
    return result, time.process_time() - begin


def ours(problem, **options):
    """A default deform, from the mesh on."""
    samples = af.sample_mesh(problem.vertices, problem.triangles)
    return af.deform(samples, problem.handles, af.DeformOptions(**options))(problem.vertices)


def grabbed(points, centre, pull, radius):
    """The points moved by a grab of this radius that takes the centre along by `pull`."""
    away = points - centre
    far = np.sqrt((away**2).sum(1, keepdims=True) + radius**2)
    b = 1 / (4 * (1 - POISSON))
    along = (away @ pull)[:, None] * away
    moved = ((1 - b) / far + radius**2 / (2 * far**3)) * pull + b / far**3 * along
    at_centre = (1 - b) / radius + 1 / (2 * radius)
    return points + moved / at_centre


def elastic_stroke(problem):
    """A stroke of Blender's Elastic Deform brush (de Goes, James 2017): the pulled vertex meets its goal."""
    (row,), (goal,) = problem.moved, problem.goals
    centre = problem.vertices[row]
    radius = BRUSH_RADIUS * np.ptp(problem.vertices, axis=0).max()
    return grabbed(problem.vertices, centre, goal - centre, radius)


def by_libigl(problem, most=1000, tolerance=1e-4):
    """ARAP of the mesh until a step is less than this share of the whole motion."""
    import igl

    data = igl.ARAPData()
    triangles = problem.triangles.astype(np.int64)
    igl.arap_precomputation(problem.vertices, triangles, 3, problem.fixed, data)
    data.max_iter, moved = 1, problem.vertices.copy()
    for _ in range(most):
        before, moved = moved, igl.arap_solve(problem.wanted, data, moved)
        if np.linalg.norm(moved - before) < tolerance * np.linalg.norm(moved - problem.vertices):
            break
    return moved


def cage_of(problem):
    """A coarse mesh around the problem's, with the same parts held and moved."""
    apart = 0.75 * np.ptp(problem.vertices, axis=0).max() / CAGE
    distance = af.MeshSdf(problem.vertices, problem.triangles)

    class Around(af.ImplicitFunction):
        def __call__(self, points):
            return distance(points) - apart

    vertices, triangles = af.extract_surface(Around(distance.frame), CAGE)
    near = [
        np.linalg.norm(vertices[:, None] - problem.vertices[rows][None], axis=2).min(1)
        for rows in (problem.held, problem.moved)
    ]
    held, moved = (np.flatnonzero(found < 1.6 * apart) for found in near)
    held = np.setdiff1d(held, moved)
    goals = vertices[moved] @ problem.motion[:3, :3].T + problem.motion[:3, 3]
    return problem._replace(vertices=vertices, triangles=triangles, held=held, moved=moved, goals=goals)


def methods(problem, checkout):
    """(name, call): the moved vertices, processor seconds and what is to be told of the settings."""
    patches = [max(least, round(PATCHES_A_MINUTE * MINUTES / 2)) for least in LEAST_PATCHES]
    patient = ("--patches", *patches, "--minutes", MINUTES) if MINUTES else ()

    def implicit():
        found = theirs.implicit_arap(problem, checkout, *patient)
        steps, patches = (
            f"{found[key].sum()} of {found['own_' + key].sum()}" for key in ("steps", "patches")
        )
        told = f"{steps} steps of {patches} patches"
        return found["moved"], float(found["seconds"][1]), told

    yield "ours, default", lambda: (*clocked(lambda: ours(problem)), "")
    yield "libigl, ARAP of the mesh", lambda: (*clocked(lambda: by_libigl(problem)), "")
    for label, method in METHODS.items():
        cage = cage_of(problem) if method == "surface" else None
        yield (
            f"Blender, {label}",
            lambda method=method, cage=cage: (*theirs.blender(problem, method, cage), ""),
        )
    if len(problem.moved) == 1:
        yield (
            "Blender, Elastic Deform's formula",
            lambda: (*clocked(lambda: elastic_stroke(problem)), ""),
        )
    yield "implicit-arap", implicit


def fingers(problem, moved):
    """How far the tip of another finger than the index finger goes at the most, of the hand's length."""
    tips = [place for name, place in shapes.hand()["tips"].items() if name != "index"]
    rows = [np.linalg.norm(problem.vertices - place, axis=1).argsort()[:20] for place in tips]
    far = max(np.linalg.norm(moved[near] - problem.vertices[near], axis=1).mean() for near in rows)
    return {"others_percent": round(100 * far / shapes.hand()["length"], 1)}


def constraint_rows(problem, checkout):
    for name, call in methods(problem, checkout):
        try:
            moved, seconds, told = call()
        except Refused as refusal:
            yield {"what": problem.name, "by": name, "said": str(refusal)}
            continue
        kept = {"moved": moved, "vertices": problem.vertices, "triangles": problem.triangles}
        np.savez(theirs.KEPT / f"moved-{problem.shape}-{name.replace(' ', '-')}.npz", **kept)
        yield {
            "what": problem.name,
            "by": name,
            "vertices": len(problem.vertices),
            "cpu_s": round(seconds, 2),
            **yardstick.measured(problem, moved),
            **(fingers(problem, moved) if problem.shape == "hand" else {}),
            "said": told,
        }


def by_blender(method):
    def moved(problem):
        return theirs.blender(problem, method, cage_of(problem) if method == "surface" else None)[0]

    return moved


def verdict(problem, call):
    """What became of a mesh, in a few words."""
    try:
        moved = call(problem)
    except Exception as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return f"refused: {lines[-1][:90]}"
    if not np.isfinite(moved).all():
        return "not finite"
    measured = yardstick.measured(problem, moved)
    if measured["handle_error_percent"] > 2:
        return f"handles missed by {measured['handle_error_percent']:.0f} %"
    crack = widest_crack(problem.vertices, moved) / np.ptp(problem.vertices[:, 2])
    if crack > 1e-3:
        return f"cracks as wide as {100 * crack:.0f} % of its height"
    free = np.setdiff1d(np.arange(len(moved)), problem.fixed)
    still = np.abs(moved - problem.vertices)[free].max(1) < 1e-6
    if still.mean() > 0.1:
        return f"{100 * still.mean():.0f} % of what is free stays where it is"
    return "moved"


def widest_crack(rest, moved):
    """The largest distance between points that lay at one place."""
    order = np.lexsort(rest.T)
    same = (np.abs(np.diff(rest[order], axis=0)).max(1) < 1e-9).nonzero()[0]
    apart = np.linalg.norm(moved[order[same]] - moved[order[same + 1]], axis=1)
    return float(apart.max(initial=0.0))


def style_verdict(module, problem):
    try:
        moved, _, _ = theirs.gauss(module, problem.vertices, problem.triangles, CUBE, 4.0, "odd")
    except Refused as refusal:
        return f"refused: {refusal}"
    return "stylized" if np.isfinite(moved).all() else "not finite"


def awkward_rows(checkout):
    module = theirs.built_gauss(checkout)
    for name, problem in awkward().items():
        row = {"mesh": name, "ARAP Fields": verdict(problem, ours), "libigl": verdict(problem, by_libigl)}
        row["gaussStylization"] = style_verdict(module, problem)
        for label, method in METHODS.items():
            row[label] = verdict(problem, by_blender(method))
        yield row


def run_peers():
    arap, style = (theirs.folder() / name for name in theirs.CODES)
    quick = [
        *compared.style_rows(style),
        *awkward_rows(style),
        *compared.weight_rows(),
        *compared.registration_rows(),
    ]
    rows = [row for problem in of_figures().values() for row in constraint_rows(problem, arap)]
    rows += quick
    rows += [{"code": path.name, "commit": theirs.commit(path)} for path in (arap, style)]
    return rows
