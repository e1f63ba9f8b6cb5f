# SPDX-License-Identifier: GPL-3.0-or-later
"""Refits garments of one body to another: wraps the bodies, carries the garments, keeps them outside."""

import os
from pathlib import Path

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..blender.property_definitions import effective_values, number, options_of, path_text
from ..blender.references import remove_modifier
from ..core.errors import UserError, refuse
from ..core.geometry import transfer
from ..core.geometry.spaces import facing, transform
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..core.settings.parameters import WRAP
from ..handles.empties import matrix_of
from ..jobs.job_operator import JobOperator
from . import garments, landmarks
from .properties import onto

FAR = 0.02  # of the target's diagonal: most median distance of a body that a saved field moves
ROUNDS, SMOOTH = 12, 4  # of pushes out of the target; so many of them are smoothed first


class ARAPFIELDS_OT_refit(JobOperator, bpy.types.Operator):
    """Fit copies of the garments that the object wears to its target; without a selection, what it carries"""

    bl_label = "Refit to Target"
    bl_options = {"UNDO"}
    title = "Refit to Target"
    guide = "wrap"

    __annotations__ = {
        "onto": onto(),
        "gap": number(
            "Gap",
            "Least distance of a garment's vertices from the target",
            default=0.002,
            min=0.0,
            soft_max=0.05,
            subtype="DISTANCE",
            options={"SKIP_SAVE"},
        ),
        "field": path_text(
            "Field",
            "A .safetensors that keeps the wrap: read where it is there, else written; empty for none",
            "FILE",
            options={"SKIP_SAVE"},
        ),
    }

    @classmethod
    def refuses(cls, source):
        return landmarks.refusal(source) if has_window() else None

    def plan(self, context, source, weights):
        context.view_layer.update()
        target = landmarks.target_of(source, self.onto)
        bodies = [Body(context, item) for item in (source, target)]
        worn = [Garment(item) for item in garments_of(context, source, target)]
        refit = Refit(bodies, worn, self.gap, place_of(self.field), pairs_of(source))
        refit.values = effective_values(WRAP, settings_of(source).wrap, None)
        return Item(source.name, refit.work, lambda shapes: self.put(bpy.context, refit, shapes))

    def put(self, context, refit, shapes):
        """Makes the fitted copies, or moves those of an earlier run; returns the line to report."""
        source, target = (body.reference.get() for body in refit.bodies)
        posing, made = posing_rigs(source, target), {}
        items = [garment.unchanged() for garment in refit.worn]
        for item, shape in zip(items, shapes, strict=True):
            made[item] = garments.copy_of(item, target, posing)
            garments.put(context, made[item], target, np.array(made[item].matrix_world), shape, posing)
        garments.remap_copies(made, garments.counterparts(source, target) | posing)
        for copied in made.values():
            for modifier in [one for one in copied.modifiers if modifier_stack.rig_of(one) is not None]:
                if modifier.object not in posing.values():
                    lost = UserError(
                        "{rig} poses it no longer: {name} has no such armature",
                        target,
                        rig=modifier.object.name,
                    )
                    self.warnings.append(about(copied.name, lost))
                    remove_modifier(modifier)
        names = ", ".join(copied.name for copied in made.values())
        return translated(
            "{count} garments fitted to {name}: {names}", count=len(made), name=target.name, names=names
        )


def garments_of(context, source, target):
    """The selected meshes beside both bodies; else the meshes that the source carries."""
    chosen = [item for item in context.selected_objects if item.type == "MESH"]
    if not (found := [item for item in chosen if item not in (source, target)]):
        carried = [entry.item for entry in settings_of(source).carried]
        found = [item for item in carried if in_scene(item) and item.type == "MESH"]
    if not found:
        raise UserError("Select the garments too, then {name} as the active object", source)
    for item in found:
        refuse(mesh_arrays.nothing_in(item.name, len(item.data.vertices), len(item.data.polygons)))
    return found


def place_of(field):
    if not field:
        return None
    if field.startswith("//") and not bpy.data.filepath:
        raise UserError("Save the .blend first, or choose another place: the field lies beside it")
    path = Path(os.path.normpath(bpy.path.abspath(field)))
    if path.suffix.lower() != ".safetensors":
        raise UserError("{path}: the format needs the extension {suffix}", path=path, suffix=".safetensors")
    return path


def pairs_of(source):
    """[(on the source, on the target)] landmarks in the world."""
    ends = [
        [matrix_of(end)[:3, 3] for end in (entry.rest, entry.on_target)] for entry in landmarks.used(source)
    ]
    return [tuple(pair) for pair in ends]


def posing_rigs(source, target):
    """{armature of the source: the target's}: by modifiers of one name, or where each has a single one."""
    pairs = garments.pairs(source, target)
    own, other = (
        [rig for one in item.modifiers if (rig := modifier_stack.rig_of(one))] for item in (source, target)
    )
    return pairs or ({own[0]: other[0]} if len(own) == len(other) == 1 else {})


class Body:
    """A body's surface in the world, unposed: without armatures and without a field."""

    def __init__(self, context, item):
        self.reference, world = ObjectReference(item), matrix_of(item)
        left_out = (modifier_stack.is_field, modifier_stack.is_cache, modifier_stack.is_layer)
        kept = [one for one in item.modifiers if one.show_viewport and one.type != "ARMATURE"]
        kept = [one for one in kept if not any(is_one(one) for is_one in left_out)]
        with modifier_stack.mesh_of(context, item, kept) as mesh:
            self.vertices = transform(world, mesh_arrays.positions(mesh))
            self.triangles = facing(mesh_arrays.triangles(mesh), world)
        refuse(mesh_arrays.nothing_in(item.name, len(self.vertices), len(self.triangles)))
        refuse(mesh_arrays.flat(item.name, self.vertices, self.triangles))

    @property
    def surface(self):
        return self.vertices, self.triangles


class Garment:
    """A garment's own mesh in the world: its vertices, and those of its shape keys."""

    def __init__(self, item):
        self.reference, world, keys = ObjectReference(item), matrix_of(item), item.data.shape_keys
        self.mark = mesh_arrays.fingerprint(item.data)
        basis = None if keys is None else mesh_arrays.vectors(keys.reference_key.data, "co")
        self.rest = transform(world, mesh_arrays.positions(item.data) if basis is None else basis)
        self.triangles = facing(mesh_arrays.triangles(item.data), world)
        blocks = [] if keys is None else keys.key_blocks
        self.keys = [transform(world, mesh_arrays.vectors(block.data, "co")) - self.rest for block in blocks]

    def unchanged(self):
        item = self.reference.get()
        if mesh_arrays.fingerprint(item.data) != self.mark:
            raise UserError("{name} changed while it was worked on; run again", item)
        return item


class Refit:
    """The work of one run, on the worker: the bodies' field, then each garment."""

    values = None  # settings of the wrap

    def __init__(self, bodies, worn, gap, place, pairs):
        self.bodies, self.worn, self.gap, self.place, self.pairs = bodies, worn, gap, place, pairs

    def work(self, tracker):
        """[((n, 3) vertices, (k, n, 3) keys or None)] of the garments, in the world."""
        af, (body, target) = native.library(), self.bodies
        samples = af.sample_mesh(*body.surface, self.values["samples"], seed=self.values["seed"])
        self.solid = af.MeshSdf(*target.surface)
        field = self.field(af, samples, tracker)
        moved = field(body.vertices)
        fit = transfer.Body(af, (body.vertices, moved, body.triangles), target.surface)
        shapes = []
        for done, garment in enumerate(self.worn):
            task = tracker.start(garment.reference.name, 1 / (len(self.worn) - done))
            carried = af.Attachment(samples, garment.rest, task=task).positions(field)
            shape = self.outside(fit.fit(garment.rest, carried, garment.triangles), garment, tracker)
            keys = None
            if garment.keys:
                surfaces = (garment.rest, garment.triangles), (shape, garment.triangles)
                same = af.Correspondence(shape, *surfaces, task=task)
                keys = shape + same.displacements(np.array(garment.keys), task=task)
            shapes.append((shape, keys))
        return shapes

    def field(self, af, samples, tracker):
        """The saved field, where it moves this body onto this target; else a new wrap, which is saved."""
        body, target = self.bodies
        if self.place is not None and self.place.exists():
            field = af.DeformationField.load(self.place)
            moved = field(body.vertices)
            size = np.linalg.norm(np.ptp(target.vertices, axis=0))
            if not np.median(np.abs(self.solid(moved))) < FAR * size:
                raise UserError("{path} is of other bodies; choose another file", path=self.place)
            return field
        task = tracker.start("Wrapping", 0.7)
        field = af.wrap(samples, self.solid, self.pairs, options_of("wrap", self.values), task=task)
        tracker.warnings += [UserError("note: {text}", text=text) for text in field.report.notes]
        if self.place is not None:
            field.save(self.place)
        return field

    def outside(self, shape, garment, tracker):
        """The shape with every vertex at least the gap away from the target's inside."""
        edges = np.unique(np.sort(garment.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        for done in range(ROUNDS):
            lack = np.maximum(self.gap - self.solid(shape), 0.0)
            if not lack.any():
                return shape
            push = lack[:, None] * self.solid.gradient(shape)
            around = transfer.smoothed(push, edges) if done < SMOOTH else push
            shape = shape + np.where(lack[:, None] > 0, push, around)
        if count := np.count_nonzero(self.solid(shape) < 0.0):
            left = UserError("{count} vertices are inside of the target", count=count)
            tracker.warnings.append(UserError("{name}: {error}", garment.reference, error=left))
        return shape


CLASSES = [ARAPFIELDS_OT_refit]
