# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights of a child's 25 bones by four methods, against 20 random poses of the field.

Ours, Blender's automatic weights (bone heat), libigl's bounded biharmonic weights, and the nearest bone.
"""

import time

import bpy
import numpy as np
from scipy.spatial import cKDTree

import arapfields as af

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


def rows():
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
