# SPDX-License-Identifier: GPL-3.0-or-later
"""A source's carried objects during a session or job: refused or read, moved on a worker, shown, restored."""

import contextlib
from dataclasses import dataclass, replace

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import depsgraph_of, with_ancestors
from ..blender.modifier_stack import handle_rigs, is_posing
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import facing, inverse, transform, unflattened
from ..field_modifier import field_nodes, motion, node_group
from .carriers import MeshCarrier
from .points import AttributeCarrier, KeyCarrier
from .rest_bones import above_field
from .transforms import BonesCarrier, TransformCarrier, base_kind_of, constrained_to, hangs_on, world_matrices

# UserErrors that say why an object is not carried.

BINDING = {"LATTICE": "object", "CURVE": "object", "HOOK": "object"}  # modifiers that follow another object
BINDING |= {"MESH_DEFORM": "object", "SURFACE_DEFORM": "target"}


def bound_to(item):
    """The objects that shown modifiers of an object have it follow, None among them."""
    shown = [modifier for modifier in item.modifiers if modifier.show_viewport]
    return [getattr(modifier, BINDING[modifier.type]) for modifier in shown if modifier.type in BINDING]


def of_entry(source, entry):
    """UserError that says why an entry of a source's list is left out now; else None."""
    item = entry.item
    if not in_scene(item):
        return UserError("{name}, which {source} carries, was deleted", entry, source=source.name)
    reason = of_item(source, item)
    if reason is not None:
        return reason
    if item.mode == "EDIT":
        return UserError("{name} is in Edit Mode; leave it first", item)
    if not item.visible_get():
        return UserError("{name} is hidden; it is not carried", item)
    return None


def of_item(source, item):
    """UserError that says why an object cannot be carried at all; else None."""
    if item == source:
        return UserError("{name} cannot carry itself", item)
    if item.library is not None:
        return UserError("{name} is linked from another file; make it local to carry it", item)
    settings = settings_of(item)
    if len(settings.handles):
        return UserError("{name} has handles of its own; it is not carried", item)
    if reason := of_splats(item):
        return reason
    if settings.handle_of == source and any(e.empty == item for e in settings_of(source).handles):
        return UserError("{name} is a handle of {source} itself", item, source=source.name)
    rigs = handle_rigs(source)
    if item in rigs:
        return UserError("The bones of {name} are handles of {source}", item, source=source.name)
    if moves(item, source):
        return UserError("{name} moves {source} already; it is not carried", item, source=source.name)
    if constrained_to(item, [*rigs, *above_field(source)]):
        return UserError("{name} follows the armature by a constraint; it is not carried", item)
    return moves_anyway(source, item)


def of_splats(item):
    """UserError if an object holds splats, which another object's field cannot move; else None."""
    return (
        UserError("{name} holds splats; only handles of its own turn them", item)
        if holds_splats(item)
        else None
    )


def moves_anyway(source, item):
    """UserError if an object already follows another one that the field moves; else None."""
    carried = [entry.item for entry in settings_of(source).carried if entry.item not in (None, item)]
    for parent in with_ancestors(item.parent):
        if parent in carried and is_moved_whole(source, parent):
            return moves_with(item, parent)
    for target in bound_to(item):
        if target is not None and target in [source, *carried]:
            return moves_with(item, target)
    return None


def moves(item, source):
    """Whether an object moves the source: what the field does to it would reach the source once more."""
    posing = [one.object for one in source.modifiers if is_posing(source, one) and one.show_viewport]
    above = [*with_ancestors(source.parent), *posing, *bound_to(source)]
    return item in above or constrained_to(source, [item])


def is_moved_whole(source, item):
    """Whether a carried object moves as a whole, with all of its children."""
    way = next(entry.way for entry in settings_of(source).carried if entry.item == item)
    return way == "RIGID" or item.type not in POINTWISE


def moves_with(item, other):
    return UserError("{name} moves with {other} already", item, other=other.name)


POINTWISE = {"MESH", "CURVES", "POINTCLOUD", "GREASEPENCIL", "CURVE", "SURFACE", "LATTICE", "ARMATURE"}


# All carried objects of a source during a session or job: read, moved on a worker, shown, restored.

# A carried object during a session or job, and its release.

KINDS = {"MESH": MeshCarrier, "ARMATURE": BonesCarrier}
KINDS |= dict.fromkeys(("CURVES", "POINTCLOUD", "GREASEPENCIL"), AttributeCarrier)
KINDS |= dict.fromkeys(("CURVE", "SURFACE", "LATTICE"), KeyCarrier)


class CarriedObject:
    """One object that the field moves as well."""

    def __init__(self, context, entry):
        item, self.way = entry.item, entry.way
        self.reference = ObjectReference(item)
        self.carrier = carrier_class(item, self.way)(context, item)
        if isinstance(self.carrier, BonesCarrier):
            self.carrier.take_base(item, entry)
        self.may_be_edited = False
        self.attached = None  # (points, PointsBefore, rest, PointsBeside, Attachment); worker only

    def moves_by_itself(self, item):
        """Whether its points move without an edit of its data."""
        if isinstance(self.carrier, MeshCarrier):
            return bool(modifier_stack.shown_before(item, in_place=True)) or item.data.shape_keys is not None
        return isinstance(self.carrier, KeyCarrier) and item.data.shape_keys is not None

    def item_and_entry(self, source):
        """The object and its entry in the source's list; UserError if either was removed."""
        item = self.reference.get()
        entry = find(source, item)
        if entry is None:
            raise UserError("{name} is no longer carried", self.reference)
        return item, entry


@dataclass(frozen=True)
class CarriedPose:
    """A carried object's points, and (4, 4) matrices to solve space: at rest, now, and of its parent now."""

    carried: CarriedObject
    points: np.ndarray
    rest: np.ndarray
    now: np.ndarray
    parent: np.ndarray

    def same(self, other):
        pairs = (self.rest, other.rest), (self.now, other.now), (self.parent, other.parent)
        return self.points is other.points and all(np.array_equal(a, b) for a, b in pairs)


def find(source, item):
    """The entry of an object in a source's list, or None."""
    return next((e for e in settings_of(source).carried if item is not None and e.item == item), None)


def carrier_class(item, way):
    return TransformCarrier if way == "RIGID" else KINDS.get(item.type, TransformCarrier)


def release(source, index):
    """Removes an object from a source's list and restores its shape from before it was carried."""
    entry = settings_of(source).carried[index]
    item = entry.item
    if item is not None:
        settings_of(item).carried_by = None
        if item.library is None:
            give_back(item, entry)
    settings_of(source).carried.remove(index)


def give_back(item, entry):
    """Removes the field's modifier, keys and transforms from an object, whichever carrier wrote them."""
    for carrier in dict.fromkeys((KINDS.get(item.type, TransformCarrier), TransformCarrier)):
        carrier.release(item, entry)


def is_carried_otherwise(item, entry, carrier):
    """Whether an object still has the motion of another carrier."""
    if base_kind_of(entry) not in ("NONE", carrier.base_kind):
        return True
    return isinstance(carrier, TransformCarrier) and KINDS.get(item.type, TransformCarrier).is_on(item)


def with_carried(source):
    """A source and the objects that it carries."""
    return [source, *(entry.item for entry in settings_of(source).carried if entry.item is not None)]


def give_back_all(source):
    """Removes the field's motion from all carried objects of a source."""
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            give_back(entry.item, entry)


# All carried objects of a source during a session or job: read, moved on a worker, shown, restored.

written = set()  # session_uids of the objects that were moved in this file
SAME_PLACE = 1e-6  # tolerance as a share of an object's size, as matrices are in single precision


class Carrying:
    """A source's carried objects. `warnings`: why objects are left out, each reported once."""

    def __init__(self, context, source):
        self.source, self.warnings, self.objects, self.before = ObjectReference(source), [], [], {}
        self.rigs, self.under = modifier_stack.handle_rigs(source), above_field(source)
        self.is_shown_posed = False  # whether shapes are shown after the armatures of `under`
        self.nodes = field_nodes.Follower(source) if field_nodes.of(source) else None
        for entry in settings_of(source).carried:
            try:
                refuse(of_entry(source, entry))
                self.objects.append(CarriedObject(context, entry))
            except (UserError, ValueError) as error:
                self.warnings.append(error)

    def solids(self, context, space):
        """[(vertices, triangles)] in solve space of the meshes that are sampled together with the source."""
        meshes, depsgraph = [], depsgraph_of(context)
        for carried in self.objects:
            if carried.way != "TOGETHER" or not isinstance(carried.carrier, MeshCarrier):
                continue
            item = carried.reference.get()
            try:
                mesh = mesh_arrays.read(context, item, in_place=True)
            except UserError as error:
                self.warnings.append(error)
                continue
            rest = space.world_to_solve @ world_matrices(item, self.rigs, depsgraph, under=self.under).rest
            meshes.append((transform(rest, mesh.vertices), facing(mesh.triangles, rest)))
        return meshes

    # Main thread, for each request.

    def poses(self, space, depsgraph):
        """[CarriedPose] of all objects; removed ones are left out with a warning."""
        source, poses = self.source.get(), []
        for carried in list(self.objects):
            try:
                item, entry = carried.item_and_entry(source)
                basis = carried.carrier.basis(item, entry, depsgraph)
                world = world_matrices(item, self.rigs, depsgraph, basis, self.under)
                if self.is_shown_posed:
                    posed = world_matrices(item, self.rigs, depsgraph, basis)
                    world = replace(world, now=posed.now, parent=posed.parent)
            except UserError as error:
                self.leave(carried, error)
                continue
            matrices = map(unflattened, (world.rest, world.now, world.parent))
            matrices = (space.world_to_solve @ matrix for matrix in matrices)
            poses.append(CarriedPose(carried, carried.carrier.points, *matrices))
        if self.nodes is not None:
            poses.append(CarriedPose(self.nodes, None, space.local_to_solve, np.eye(4), np.eye(4)))
        return poses

    def watch(self, objects, data):
        """Marks objects that may be edited: `objects` and `data` are session_uids of updated data-blocks."""
        for carried in self.objects:
            item = carried.reference.find()
            if item is None or item.session_uid in motion.written:
                continue
            edited = item.data is not None and item.data.session_uid in data
            moved = item.session_uid in objects and carried.moves_by_itself(item)
            carried.may_be_edited |= edited or moved

    def expect_motion(self):
        """Called at another frame: marks the objects that modifiers or shape keys may have moved."""
        for carried in self.objects:
            item = carried.reference.find()
            carried.may_be_edited |= item is not None and carried.moves_by_itself(item)

    def refresh(self, context):
        """Reads marked objects again; returns whether the points of any have changed."""
        changed = False
        for carried in list(self.objects):
            if not carried.may_be_edited or isinstance(carried.carrier, BonesCarrier):
                continue
            try:
                item = carried.reference.get()
                if item.mode == "EDIT":
                    continue
                carried.may_be_edited, points = False, carried.carrier.read(context, item)
            except UserError as error:
                self.leave(carried, error)
                continue
            if len(points) != len(carried.carrier.points):
                raise Reshaped
            if not np.array_equal(points, carried.carrier.points):
                carried.carrier.points, changed = points, True
        return changed

    # On a worker.

    def moved(self, af, samples, field, poses, strength=1.0, before=None):
        """[(CarriedObject, shape for its carrier)] moved by the field, scaled by `strength`.

        `before`: PointsBefore of the source (surface/source_surface.py), if its points may have moved.
        """
        before = None if before is None or before.is_at_rest else before
        moved = [(pose.carried, self.moved_one(af, samples, field, pose, strength, before)) for pose in poses]
        return [pair for pair in moved if pair[1] is not None]

    def moved_one(self, af, samples, field, pose, strength=1.0, before=None):
        carried = pose.carried
        if carried is self.nodes:
            return self.rows_of_nodes(field, pose.rest, strength)
        attached = carried.attached
        is_same = attached is not None and attached[0] is pose.points and attached[1] is before
        if not is_same or not near(attached[2], pose.rest):
            points = transform(pose.rest, pose.points)
            beside = None if before is None else before.beside(points)
            attachment = af.Attachment(samples, points if beside is None else beside.at_rest)
            attached = carried.attached = pose.points, before, pose.rest, beside, attachment
        *_, beside, attachment = attached
        after = np.asarray(attachment.positions(field))
        after = after if beside is None else beside.moved(after, field)
        if not np.isfinite(after).all():
            raise UserError("The shape has vertices at invalid locations; move the handles less far")
        if strength != 1.0:
            rest = transform(pose.rest, pose.points)
            after = rest + strength * (after - rest)
        return carried.carrier.moved(pose.rest, pose.now, pose.parent, after)

    def rows_of_nodes(self, field, local_to_solve, strength):
        """The field as rows for the nodes; None, with a warning, if nodes cannot evaluate it."""
        try:
            return field_nodes.rows_of(field, local_to_solve, strength)
        except UserError as error:
            self.warnings.append(error)
            return None

    # Main thread: show and restore.

    def bind(self, context, before=None):
        """Prepares all objects for motion; `before`: snapshots of the session that this one replaces."""
        source, before = self.source.get(), dict(before or {})
        for carried in list(self.objects):
            try:
                item, entry = carried.item_and_entry(source)
                uid = carried.reference.uid
                if is_carried_otherwise(item, entry, carried.carrier):
                    give_back(item, entry)
                    before.pop(uid, None)
                self.before[uid] = before.get(uid) or (carried, carried.carrier.snapshot(item, entry))
                carried.carrier.bind(context, item, entry)
                node_group.lend_mask(source, item)
            except (UserError, RuntimeError) as error:
                self.leave(carried, error)
        if self.nodes is not None:
            uid = self.nodes.uid
            self.before[uid] = before.get(uid) or (self.nodes, self.nodes.read())

    def show(self, shapes):
        """Writes shapes by `moved` to the objects; one that fails is left out with a warning."""
        source = self.source.get()
        for carried, shape in shapes:
            if carried is self.nodes:
                carried.write(shape)
            if carried not in self.objects:
                continue
            try:
                item, entry = carried.item_and_entry(source)
                if item.mode not in PAUSING:
                    written.add(item.session_uid)
                    carried.carrier.write(item, entry, shape)
            except (UserError, RuntimeError) as error:
                self.leave(carried, error)

    def put(self, context, shapes):
        """Binds the objects and writes their shapes."""
        self.bind(context)
        self.show(shapes)

    def renew(self):
        """Replaces the snapshots `before` by the present shapes, e.g. after undo."""
        source = self.source.get()
        for carried in self.objects:
            if carried.reference.find() is not None and carried.reference.uid in self.before:
                shape = carried.carrier.snapshot(*carried.item_and_entry(source))
                self.before[carried.reference.uid] = carried, shape
        if self.nodes is not None and self.nodes.reference.find() is not None:
            self.before[self.nodes.uid] = self.nodes, self.nodes.read()

    def take_away(self):
        """Restores the snapshots of all objects."""
        source = self.source.find()
        for carried, before in self.before.values():
            if isinstance(carried, field_nodes.Follower):
                carried.write(before)
                continue
            item = carried.reference.find()
            entry = None if source is None else find(source, item)
            if item is not None and entry is not None and item.mode != "EDIT":
                carried.carrier.restore(item, entry, before)
        self.before.clear()

    def forget(self, settings):
        """Drops the snapshots of objects that are no longer in the list: these were restored already."""
        listed = {entry.item.session_uid for entry in settings.carried if entry.item is not None}
        if self.nodes is not None:
            listed.add(self.nodes.uid)
        self.before = {uid: before for uid, before in self.before.items() if uid in listed}

    def leave(self, carried, error):
        self.objects.remove(carried)
        self.warnings.append(error)

    def take_warnings(self):
        warnings, self.warnings = self.warnings, []
        return warnings


class Reshaped(Exception):
    """Raised when a carried object's number of points has changed: the solver must be set up again."""


PAUSING = ("EDIT", "SCULPT", "SCULPT_CURVES", "EDIT_GREASE_PENCIL")  # modes in which the user changes points


def near(a, b):
    return np.allclose(a, b, rtol=0.0, atol=SAME_PLACE * max(1e-12, np.abs(a[:3, :3]).max()))


# Keeps carried objects in place while a wrap fits the bones that they are parented to.


def follow(context, source, shapes, fit):
    """Calls `fit`, which moves rest bones of the source's armatures, and keeps the objects of `shapes`,
    [(CarriedObject, shape that its carrier wrote)], in place."""
    under = above_field(source)
    found = [(carried, shape, carried.reference.find()) for carried, shape in shapes]
    found = [one for one in found if one[2] is not None and hangs_on(one[2], under)]

    def places():
        depsgraph = depsgraph_of(context)
        return [world_matrices(item, (), depsgraph, under=under) for *_, item in found]

    before = places()
    fit()
    context.view_layer.update()
    for (carried, shape, item), was, now in zip(found, before, places(), strict=True):
        own, parent = inverse(now.now) @ was.now, inverse(now.parent) @ was.parent
        with contextlib.suppress(UserError):  # reported when it was written first
            carried.carrier.write(item, find(source, item), carried.carrier.rebased(shape, own, parent))


def present(context, source):
    """[(CarriedObject, its present shape)] for `follow`, without warnings."""
    found = []
    for entry in settings_of(source).carried:
        with contextlib.suppress(UserError, ValueError):
            refuse(of_entry(source, entry))
            carried = CarriedObject(context, entry)
            shape = carried.carrier.present(entry.item, entry)
            found += [] if shape is None else [(carried, shape)]
    return found
