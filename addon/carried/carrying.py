# SPDX-License-Identifier: GPL-3.0-or-later
"""All that a source carries, for one run: read, moved by fields on a worker, shown, and taken back."""

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import transform
from ..field_modifier import masks, motion
from . import refusals
from .carriers import MeshCarrier
from .passengers import Frame, Passenger, find, give_back, is_carried_otherwise
from .places import depsgraph_of, place_of
from .transforms import BonesCarrier

SAME_PLACE = 1e-6  # of an object's size: matrices in single precision


class Carrying:
    """What a source carries. `warnings`: what is left out and why, each told once."""

    def __init__(self, context, source):
        self.source, self.warnings, self.passengers, self.before = ObjectReference(source), [], [], {}
        self.rigs = modifier_stack.handle_rigs(source)
        for entry in settings_of(source).carried:
            try:
                reason = refusals.of_entry(source, entry)
                if reason is not None:
                    raise reason
                self.passengers.append(Passenger(context, entry))
            except (UserError, ValueError) as error:
                self.warnings.append(error)

    def solids(self, context, space):
        """[(vertices, triangles)] in solve space of what is sampled together with the body."""
        found, depsgraph = [], depsgraph_of(context)
        for passenger in self.passengers:
            if passenger.way != "TOGETHER" or not isinstance(passenger.carrier, MeshCarrier):
                continue
            item = passenger.reference.get()
            try:
                mesh = mesh_arrays.read(context, item, in_place=True)
            except UserError as error:
                self.warnings.append(error)
                continue
            rest = space.world_to_solve @ place_of(item, self.rigs, depsgraph).rest
            found.append((transform(rest, mesh.vertices), mesh.triangles))
        return found

    # Main thread, each time something may have moved.

    def frames(self, space, depsgraph):
        """Where all passengers are; those that are gone are left out, and named."""
        source, found = self.source.get(), []
        for passenger in list(self.passengers):
            try:
                item, entry = passenger.reference.get(), self.entry_of(source, passenger)
                basis = passenger.carrier.basis(item, entry, depsgraph)
                place = place_of(item, self.rigs, depsgraph, basis)
            except UserError as error:
                self.leave(passenger, error)
                continue
            matrices = (space.world_to_solve @ matrix for matrix in (place.rest, place.now, place.parent))
            found.append(Frame(passenger, passenger.carrier.points, *matrices))
        return found

    def watch(self, objects, data):
        """Notes whose points may be others: `objects` and `data` are session_uids that Blender updated."""
        for passenger in self.passengers:
            item = passenger.reference.find()
            if item is None or item.session_uid in motion.written:
                continue
            edited = item.data is not None and item.data.session_uid in data
            moved = item.session_uid in objects and passenger.moves_by_itself(item)
            passenger.may_be_edited |= edited or moved

    def expect_motion(self):
        """Another frame: what moves by itself may have other points."""
        for passenger in self.passengers:
            item = passenger.reference.find()
            passenger.may_be_edited |= item is not None and passenger.moves_by_itself(item)

    def refresh(self, context):
        """Reads again what may have been edited; whether any has other points."""
        changed = False
        for passenger in list(self.passengers):
            if not passenger.may_be_edited or isinstance(passenger.carrier, BonesCarrier):
                continue
            try:
                item = passenger.reference.get()
                if item.mode == "EDIT":
                    continue
                passenger.may_be_edited, points = False, passenger.carrier.read(context, item)
            except UserError as error:
                self.leave(passenger, error)
                continue
            if len(points) != len(passenger.carrier.points):
                raise Reshaped
            if not np.array_equal(points, passenger.carrier.points):
                passenger.carrier.points, changed = points, True
        return changed

    # On a worker.

    def moved(self, af, samples, field, frames, strength=1.0):
        """[(passenger, what its carrier writes)] of all where the field takes them, so much of the way."""
        return [(frame.passenger, self.moved_one(af, samples, field, frame, strength)) for frame in frames]

    def moved_one(self, af, samples, field, frame, strength=1.0):
        passenger = frame.passenger
        attached = passenger.attached
        if attached is None or attached[0] is not frame.points or not near(attached[1], frame.rest):
            attachment = af.Attachment(samples, transform(frame.rest, frame.points))
            attached = passenger.attached = frame.points, frame.rest, attachment
        after = np.asarray(attached[2].positions(field))
        if not np.isfinite(after).all():
            raise UserError("the shape has vertices that are NaN or infinite; move the handles less far")
        if strength != 1.0:
            rest = transform(frame.rest, frame.points)
            after = rest + strength * (after - rest)
        return passenger.carrier.moved(frame.rest, frame.now, frame.parent, after)

    # Main thread: showing and taking back.

    def bind(self, context, before=None):
        """Makes all ready to be moved; `before` is what they had before a run that goes on with this one."""
        source = self.source.get()
        for passenger in list(self.passengers):
            try:
                item, entry = passenger.reference.get(), self.entry_of(source, passenger)
                uid = passenger.reference.uid
                if is_carried_otherwise(item, entry, passenger.carrier):
                    give_back(item, entry)
                    before = None
                self.before[uid] = (before or {}).get(
                    uid, (passenger, passenger.carrier.snapshot(item, entry))
                )
                passenger.carrier.bind(context, item, entry)
                masks.lend(source, item)
            except (UserError, RuntimeError) as error:
                self.leave(passenger, error)

    def show(self, shapes):
        """Puts what `moved` made onto the objects; one that cannot take it is named and left out."""
        source = self.source.get()
        for passenger, shape in shapes:
            if passenger not in self.passengers:
                continue
            try:
                item = passenger.reference.get()
                if item.mode not in PAUSING:
                    passenger.carrier.write(item, self.entry_of(source, passenger), shape)
            except (UserError, RuntimeError) as error:
                self.leave(passenger, error)

    def put(self, context, shapes):
        """Leaves the objects where a field takes them."""
        self.bind(context)
        self.show(shapes)

    def renew(self):
        """What they have now is what they had before: an undone step put it there."""
        source = self.source.get()
        for passenger in self.passengers:
            item = passenger.reference.find()
            if item is not None and passenger.reference.uid in self.before:
                shape = passenger.carrier.snapshot(item, self.entry_of(source, passenger))
                self.before[passenger.reference.uid] = passenger, shape

    def take_away(self):
        """Gives all what they had before."""
        source = self.source.find()
        for passenger, before in self.before.values():
            item = passenger.reference.find()
            entry = None if source is None else find(source, item)
            if item is not None and entry is not None and item.mode != "EDIT":
                passenger.carrier.restore(item, entry, before)
        self.before.clear()

    def forget(self, settings):
        """Those that a list no longer has were given back already."""
        kept = {entry.item.session_uid for entry in settings.carried if entry.item is not None}
        self.before = {uid: kept_one for uid, kept_one in self.before.items() if uid in kept}

    def entry_of(self, source, passenger):
        entry = find(source, passenger.reference.get())
        if entry is None:
            raise UserError("{name} is no longer carried", name=passenger.reference.name)
        return entry

    def leave(self, passenger, error):
        self.passengers.remove(passenger)
        self.warnings.append(error)

    def take_warnings(self):
        found, self.warnings = self.warnings, []
        return found


class Reshaped(Exception):
    """A carried object has another number of points: all is set up again."""


PAUSING = ("EDIT", "SCULPT", "SCULPT_CURVES", "EDIT_GREASE_PENCIL")  # modes in which the user changes points


def near(a, b):
    return np.allclose(a, b, rtol=0.0, atol=SAME_PLACE * max(1e-12, np.abs(a[:3, :3]).max()))
