# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wrapped object has, carried over to its target: shape keys, groups, attributes, edges, armature."""

import numpy as np
from mathutils.kdtree import KDTree

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError, refuse
from ..core.geometry import uv_transfer
from ..core.geometry.edge_paths import carried_marks
from ..core.geometry.spaces import transform
from ..core.runtime import native
from ..core.settings.choices import TRANSFERRED
from ..handles.empties import matrix_of
from ..names import NEUTRAL_KEY
from ..results.placement import single_user
from . import garments, keys, rigs
from .given import Given

LEAST_WEIGHT = 1e-4  # what is below is no member of a group
LEAST_POSE = 1e-5  # of the target's size: an armature at rest moves by less, by rounding
FAR = 0.05  # of the target's diagonal: a wrap leaves half of the vertices nearer than that
LOOKED_AT = 1000  # vertices at most, to see how far two surfaces are apart


def not_wrapped(source):
    """Why a source has nothing to hand on yet, as a UserError; None where it has."""
    if modifier_stack.top(source) is None:
        return UserError("Wrap {name} first, with Modifier as its result", source)
    return None


def refusal(source, target):
    """Why nothing can be carried over, as a UserError; None where it can."""
    if reason := not_wrapped(source):
        return reason
    if target.library is not None or target.data.library is not None:
        return UserError("{name} is linked from another file and cannot be changed", target)
    if target.override_library is not None or target.data.override_library is not None:
        return UserError("{name} is a library override; its mesh cannot be changed", target)
    if target.mode == "EDIT":
        return UserError("Leave Edit Mode of {name} first", target)
    return mesh_arrays.nothing_in(target.name, len(target.data.vertices), len(target.data.polygons))


def keeps_vertices(modifier):
    return modifier.type in modifier_stack.KEEPING or modifier_stack.is_field(modifier)


def distance(points, mesh):
    """How far from the surface of a mesh, its vertices and triangles, half of the points are at most."""
    surface = native.library().MeshSdf(*mesh)
    return np.median(np.abs(surface(points[:: -(-len(points) // LOOKED_AT)])))


class Transfer:
    """One source and one target: what is carried goes from the first's wrapped mesh to the second's own."""

    def __init__(self, context, source, target):
        refuse(refusal(source, target))
        self.context, self.source, self.target = context, source, target
        self.given = Given(context, source)
        to_target = np.linalg.inv(matrix_of(target)) @ matrix_of(source)
        self.moved = transform(to_target, self.given.moved)  # in the target's coordinates, as keys are
        self.triangles, self.notes = mesh_arrays.triangles(target.data), []
        self.unposed = self.seen(is_posed=False)
        self.own = min((self.unposed, self.seen(is_posed=True)), key=self.distance)
        self.refuse_elsewhere()
        self.places = self.places_of(self.own, self.triangles)

    def seen(self, is_posed):
        """(n, 3) vertices of the target as a wrap sees them, by its own keys, and by its modifiers or not."""
        target, blocks = self.target, self.target.data.shape_keys
        own = mesh_arrays.positions(target.data)
        kept = [one for one in target.modifiers if is_posed and one.show_viewport and keeps_vertices(one)]
        if not kept and blocks is None:
            return own
        given = {NEUTRAL_KEY, *(block.name for block in keys.of(self.source))}  # the wrap was without these
        values = dict.fromkeys(given & set(blocks.key_blocks.keys() if blocks else ()), 0.0)
        shape = keys.shape_at(self.context, target, kept, values)
        return shape if len(shape) == len(own) else own

    def distance(self, vertices):
        """How far from the wrapped source these are: a pose may have come after the wrap."""
        return distance(vertices, (self.moved, self.given.triangles))

    def refuse_elsewhere(self):
        """UserError where most of the wrapped source and most of the target lie far from the other."""
        far = FAR * np.linalg.norm(np.ptp(self.own, axis=0))
        if self.distance(self.own) > far and distance(self.moved, (self.own, self.triangles)) > far:
            raise UserError(
                "{name} does not lie on {target}; move it back, or wrap again",
                self.source,
                target=self.target.name,
            )

    def places_of(self, vertices, triangles):
        """Where the vertices of a mesh lie on the wrapped source."""
        rest = self.given.rest, self.given.triangles
        return native.library().Correspondence(self.moved, rest, (vertices, triangles))

    def carry(self, kinds):
        """Carries the kinds over; returns how many of each by label."""
        has_keys = "KEYS" in kinds and keys.of(self.source)
        if has_keys:
            refuse(keys.refusal(self.source, self.target))
        single_user(self.target)
        steps = {
            "KEYS": self.keys,
            "GROUPS": self.groups,
            "ATTRIBUTES": self.attributes,
            "EDGES": self.edges,
            "UV_MAPS": self.uv_maps,
            "ARMATURE": self.armature,
            "CARRIED": self.carried,
        }
        done = {label: steps[kind]() for kind, label, _ in TRANSFERRED if kind in kinds}
        if has_keys:
            keys.take_back(self.source, self.target)
            rigs.copy_drivers(self.source, self.target)
        return done

    def keys(self):
        return keys.carry(self.source, self.target, self.displacements)

    def displacements(self, offsets):
        """Those of the target's keys, by (k, n, 3) of the source's: what poses the target poses these too."""
        carried = self.places.displacements(offsets)
        if np.abs(self.own - self.unposed).max() <= LEAST_POSE * np.ptp(self.own, axis=0).max():
            return carried
        seen, unposed = (self.own, self.triangles), (self.unposed, self.triangles)
        return native.library().Correspondence(self.unposed, seen, unposed).displacements(carried)

    def groups(self):
        done = 0
        for name, weights in self.given.groups.items():
            there = self.target.vertex_groups.get(name)
            if there is None or not there.lock_weight:
                carried = self.places.values(weights)
                vertex_groups.put(self.target, name, np.where(carried > LEAST_WEIGHT, carried, 0.0))
                done += 1
        return done

    def attributes(self):
        mesh = self.target.data
        for layer in self.given.attributes:
            on_vertices = layer.domain == "POINT"
            at = (self.given.triangles if on_vertices else self.given.corners)[self.places.triangles]
            shares = self.places.shares
            shares = shares if layer.is_smooth else np.eye(3)[shares.argmax(axis=1)]
            carried = (shares[:, :, None] * layer.values[at].astype(float)).sum(axis=1)
            layer.put(mesh, carried if on_vertices else carried[mesh_arrays.corner_vertices(mesh)])
        mesh.update()
        return len(self.given.attributes)

    def edges(self):
        """Seams, sharp edges, creases and the like."""
        mesh, done = self.target.data, 0
        edges = np.empty(2 * len(mesh.edges), np.int32)
        mesh.edges.foreach_get("vertices", edges)
        tree = KDTree(len(self.own))
        for index, vertex in enumerate(self.own):
            tree.insert(vertex, index)
        tree.balance()
        for layer in self.given.marks:
            marked = np.flatnonzero(layer.values[:, 0])
            if len(marked):
                ends = self.moved[self.given.edges[marked]]
                nearest = np.array([[tree.find(end)[1] for end in pair] for pair in ends])
                values = layer.values[marked, 0].astype(float)
                layer.put(mesh, carried_marks(ends, values, nearest, self.own, edges.reshape(-1, 2)))
                done += 1
        mesh.update()
        return done

    def uv_maps(self):
        mesh = self.target.data
        starts = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("loop_start", starts)
        corners = mesh_arrays.corner_vertices(mesh)
        points, triangles, face = uv_transfer.fan(self.own, starts, corners)
        places = self.places_of(points, triangles)
        crossing = set()
        for layer in self.given.uv_maps:
            values, beyond = uv_transfer.corner_coordinates(
                *(points, places.triangles, places.shares, corners, face),
                *(self.moved[self.given.triangles], layer.values[self.given.corners].astype(float)),
            )
            there = mesh.uv_layers.get(layer.name) or mesh.uv_layers.new(name=layer.name, do_init=False)
            if there is None:
                raise UserError("{name} has no room for another UV map", self.target)
            there.uv.foreach_set("vector", values.astype(np.float32).ravel())
            crossing |= set(face[beyond].tolist())
        if crossing:
            self.notes.append(translated("{count} faces cross a seam of the texture", count=len(crossing)))
        mesh.update()
        return len(self.given.uv_maps)

    def armature(self):
        """A rig of the target's own; only where the wrap fitted the bones to the wrapped shape."""
        if not settings_of(self.source).under_rig:
            return 0
        done = 0
        for given in self.source.modifiers:
            if given.type != "ARMATURE" or given.object is None:
                continue
            if not settings_of(given.object).rest_bones:
                self.notes.append(translated("the bones of {rig} are not fitted", rig=given.object.name))
                continue
            modifier = self.target.modifiers.get(given.name)
            if modifier is None or modifier.type != "ARMATURE":
                modifier = self.target.modifiers.new(given.name, "ARMATURE")
            if modifier.object is None or modifier.object == given.object:
                modifier.object = rigs.copied(given.object, self.target)
            for name in ("use_deform_preserve_volume", "use_vertex_groups", "use_bone_envelopes"):
                setattr(modifier, name, getattr(given, name))
            done += 1
        return done

    def carried(self):
        own = self.own, self.triangles
        done, notes = garments.copies(
            self.context, self.source, self.target, self.given, own, rigs.pairs(self.source, self.target)
        )
        self.notes += notes
        return done


def message(target, counts, notes):
    """What was carried, as the line to report."""
    listed = ", ".join([*(f"{translated(label)}: {count}" for label, count in counts.items()), *notes])
    return translated("{name} has {what}", name=target.name, what=listed)
