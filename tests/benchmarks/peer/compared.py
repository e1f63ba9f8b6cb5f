# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons by task: registrations, styles, skin weights."""

import time
from pathlib import Path

import bpy
import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

import arapfields as af

from .. import shapes
from . import theirs, yardstick

# A dog wrapped onto a twin that a known map bends and swells, beside coherent point drift of pycpd.
#
# Both begin in place. Coherent point drift gets samples of both surfaces, and moves all vertices by its
# kernel.

REGISTRATION = "a dog onto its bent twin"
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


REGISTRATIONS = (  # and how many pairs of places that correspond each is given
    ("ours, default", by_wrap, 0),
    ("ours, default", by_wrap, 10),
    ("pycpd, coherent point drift", by_drift, 0),
)


def registration_rows():
    rest, triangles = shapes.own_mesh("dog")
    twin, goal_triangles = af.extract_surface(af.MeshSdf(rest, triangles), 70)
    goal = known(twin), goal_triangles
    diagonal = np.linalg.norm(np.ptp(goal[0], axis=0)) / 100
    chosen = np.random.default_rng(SEED).choice(
        len(rest), max(count for *_, count in REGISTRATIONS), replace=False
    )
    for name, method, count in REGISTRATIONS:
        pairs = [(rest[row], known(rest[[row]])[0]) for row in chosen[:count]]
        begin = time.process_time()
        moved = method(rest, triangles, goal, pairs)
        seconds = time.process_time() - begin
        off = np.linalg.norm(moved - known(rest), axis=1) / diagonal
        yield {
            "what": REGISTRATION,
            "by": name,
            "pairs": count,
            "cpu_s": round(seconds, 2),
            "mean error, % of the diagonal": round(float(off.mean()), 2),
            "largest of 95 %": round(float(np.quantile(off, 0.95)), 2),
            "distance to the target, %": round(float(np.abs(af.MeshSdf(*goal)(moved)).mean() / diagonal), 3),
        }


# Styles of clean meshes beside gaussStylization's, of one strength and of the same energy.

OTHERS = ("spot", "bunny", "rockerArm")  # meshes of gaussStylization's checkout
COW = "common-3d-test-models"  # a checkout that has the cow; without it the cow is left out
CREATURES = ("dinosaur", "lizard")  # the dog has slivers, which gaussStylization does not take
STYLES = ("cube", "octahedron", "dodecahedron", "hexagonal prism")
LAMBDA = 4.0  # as in its own example
WEIGHTS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # of our finish, for the one of the same energy


def meshes(checkout):
    from support.geometry.meshes import read

    files = {name: checkout / "meshes" / f"{name}.obj" for name in OTHERS}
    if (cow := checkout.parent / COW / "data" / "cow.obj").is_file():
        files["cow"] = cow
    found = {name: read(Path(file))[:2] for name, file in files.items()}
    return found | {f"our {name}": shapes.own_mesh(name) for name in CREATURES}


def ours(vertices, triangles, style):
    """The field's vertices and the finished ones, and processor seconds of all."""
    begin = time.process_time()
    samples = af.sample_mesh(vertices, triangles)
    before = {"centers": af.CENTERS_BEFORE_SHARPEN, "iterations": af.ITERATIONS_BEFORE_SHARPEN}
    field = af.stylize(samples, style, af.StylizeOptions(**before))
    moved = field(vertices)
    return moved, af.sharpen(vertices, triangles, moved, style), time.process_time() - begin


def at_energy(energy, found):
    """The angle at an energy, from rows measured at several."""
    energies, angles = np.array(sorted((row["mesh_energy"], row["mean_angle"]) for row in found)).T
    if not energies[0] <= energy <= energies[-1]:
        return "not reached"
    return round(float(np.interp(energy, energies, angles)), 2)


def row(module, name, vertices, triangles, style):
    preferred = af.preferred_normals(style)

    def styled(moved):
        return yardstick.styled(vertices, triangles, moved, preferred)

    moved, seconds, _ = theirs.gauss(module, vertices, triangles, preferred, LAMBDA, "styles")
    field, finished, own_seconds = ours(vertices, triangles, style)
    own, is_finite = styled(finished), np.isfinite(moved).all()
    other = styled(moved) if is_finite else dict.fromkeys(own, "not finite")
    same = "not finite"
    if is_finite:
        options = [af.SharpenOptions(style_weight=weight) for weight in WEIGHTS]
        curve = [styled(af.sharpen(vertices, triangles, field, style, each)) for each in options]
        same = at_energy(other["mesh_energy"], curve)
    return {
        "what": f"Styles of meshes, gaussStylization at λ = {LAMBDA:g}",
        "by": f"{name}: {style}",
        "their_cpu_s": round(seconds, 2),
        "cpu_s": round(own_seconds, 2),
        "their_mesh_energy": other["mesh_energy"],
        "mesh_energy": own["mesh_energy"],
        "their_mean_angle": other["mean_angle"],
        "mean_angle": own["mean_angle"],
        "angle_at_their_energy": same,
        "folded_percent": own["folded_percent"],
    }


def style_rows(checkout):
    module = theirs.built_gauss(checkout)
    for name, (vertices, triangles) in meshes(checkout).items():
        size = np.ptp(vertices, axis=0).max()
        for style in STYLES:
            yield row(module, name, np.asarray(vertices, float) / size, np.asarray(triangles), style)


# Skin weights of a child's 25 bones by four methods, against 20 random poses of the field.
#
# Ours, Blender's automatic weights (bone heat), libigl's bounded biharmonic weights, and the nearest bone.

WHAT = "weights of a child's 25 bones"
INFLUENCES = 4
POSES, MOST = 20, np.radians(35)  # and a joint's largest turn
SAMPLES = 1500  # vertices at which a skin is compared with the field
CELLS = 60  # of the child's extraction: bounded biharmonic weights take minutes on a finer one
ON_BONES = 8  # places along a bone whose nearest vertex of the tetrahedra is the bone's


def clocked(call, *arguments):
    begin = time.process_time()
    return call(*arguments), time.process_time() - begin


def limited(weights, count=INFLUENCES):
    """At most so many weights a vertex, of sum one where there are any."""
    least = np.sort(weights, axis=1)[:, -count, None]
    weights = np.where(weights >= least, np.maximum(weights, 0), 0)
    total = weights.sum(1, keepdims=True)
    return weights / np.where(total > 0, total, 1)


def along(bone, count=ON_BONES):
    share = np.linspace(0, 1, count + 2)[1:-1, None]
    return (1 - share) * np.asarray(bone.head) + share * np.asarray(bone.tail)


def by_nearest_bone(vertices, triangles, bones):
    """All of a vertex to the bone whose line is nearest."""
    found = []
    for bone in bones:
        head, way = np.asarray(bone.head), np.subtract(bone.tail, bone.head)
        share = np.clip((vertices - head) @ way / (way @ way), 0, 1)
        found.append(np.linalg.norm(vertices - head - share[:, None] * way, axis=1))
    return np.eye(len(bones))[np.argmin(found, axis=0)]


def by_bone_heat(vertices, triangles, bones):
    """Blender's *With Automatic Weights*."""
    import people

    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    item = bpy.data.objects.new("body", mesh)
    bpy.context.collection.objects.link(item)
    parents = [None if bone.parent is None else bones[bone.parent].name for bone in bones]
    ends = [(tuple(bone.head), tuple(bone.tail)) for bone in bones]
    rig = people.rig({b.name: (p, *pair) for b, p, pair in zip(bones, parents, ends, strict=True)})
    for each in (item, rig):
        each.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    columns = {bone.name: column for column, bone in enumerate(bones)}
    names = [group.name for group in item.vertex_groups]
    weights = np.zeros((len(vertices), len(bones)))
    for vertex in mesh.vertices:
        for group in vertex.groups:
            weights[vertex.index, columns[names[group.group]]] = group.weight
    return weights


def by_bounded_biharmonic_weights(vertices, triangles, bones):
    """libigl's, on TetGen's tetrahedra; a bone owns the vertices nearest to its line."""
    import igl
    import tetgen

    points, cells = tetgen.TetGen(vertices, triangles).tetrahedralize(order=1, mindihedral=10, minratio=1.5)[
        :2
    ]
    owner = {}
    for column, bone in enumerate(bones):
        for place in along(bone):
            owner.setdefault(int(np.linalg.norm(points - place, axis=1).argmin()), column)
    rows = np.array(sorted(owner))
    values = np.eye(len(bones))[[owner[row] for row in rows]]
    weights = igl.bbw(points, cells.astype(np.int64), rows.astype(np.int64), values, max_iter=8)
    return weights[cKDTree(points).query(vertices)[1]]  # TetGen joins vertices at one place


def by_field(vertices, triangles, bones):
    return np.asarray(af.skin_weights((vertices, triangles), bones))


METHODS = {
    "ours, default": by_field,
    "Blender, automatic weights": by_bone_heat,
    "libigl, bounded biharmonic weights": by_bounded_biharmonic_weights,
    "nearest bone": by_nearest_bone,
}


def turned(generator):
    """A rotation by at most MOST about a random axis."""
    axis = generator.normal(size=3)
    x, y, z = axis / np.linalg.norm(axis)
    angle = generator.uniform(0, MOST)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def poses(bones, seed=7):
    """(POSES, bones, 4, 4): every joint turned, a bone after its parent."""
    generator, found = np.random.default_rng(seed), []
    for _ in range(POSES):
        motions = []
        for bone in bones:
            local, head = np.eye(4), np.asarray(bone.head)
            if bone.parent is not None:
                local[:3, :3] = turned(generator)
                local[:3, 3] = head - local[:3, :3] @ head
            motions.append(local if bone.parent is None else motions[bone.parent] @ local)
        found.append(motions)
    return np.array(found)


def posed_by_field(vertices, triangles, bones, motions, places):
    samples = af.sample_mesh(vertices, triangles, 10000)
    live, found = af.LiveDeformer(samples, af.bone_handles(samples, bones)), []
    for pose in motions:
        live.reset()
        goals = [motion @ bone.box for motion, bone in zip(pose, bones, strict=True)]
        found.append(np.asarray(live.solve(goals)(places)))
    return np.array(found)


def errors(weights, motions, places, wanted):
    """Root mean square over the poses, of each place."""
    homogeneous = np.c_[places, np.ones(len(places))]
    off = [np.einsum("nb,bij,nj->ni", weights, pose[:, :3], homogeneous) for pose in motions] - wanted
    return np.sqrt((off**2).sum(2).mean(0))


def unwelded(vertices, triangles):
    """The same triangles, without a vertex in common."""
    return vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)


def weight_rows():
    import people

    body = people.body(cells=CELLS)
    vertices, triangles = body.vertices.astype(float), body.triangles
    names = list(people.JOINTS)
    bones = [
        af.Bone(head, tail, None if parent is None else names.index(parent), name=name)
        for name, (parent, head, tail) in people.JOINTS.items()
    ]
    motions = poses(bones)
    some = np.sort(np.random.default_rng(1).permutation(triangles.size)[:SAMPLES])  # corners of triangles
    places = vertices[triangles.ravel()[some]]
    wanted = posed_by_field(vertices, triangles, bones, motions, places)
    size = np.ptp(vertices[:, 2]) / 100
    for name, method in METHODS.items():
        weights, seconds = clocked(method, vertices, triangles, bones)
        off = errors(limited(weights)[triangles.ravel()[some]], motions, places, wanted) / size
        row = {"what": WHAT, "by": name, "cpu_s": round(seconds, 2)}
        row |= {
            "mean error, % of the height": round(float(off.mean()), 2),
            "worst": round(float(off.max()), 1),
        }
        try:
            weights = limited(method(*unwelded(vertices, triangles), bones))
            off = errors(weights[some], motions, places, wanted) / size
            row["mean error where triangles share no vertex"] = round(float(off.mean()), 2)
            row["without weights there, %"] = round(100 * float((weights.sum(1) == 0).mean()), 1)
        except Exception as error:
            row["mean error where triangles share no vertex"] = f"refused: {error}"
        yield row
