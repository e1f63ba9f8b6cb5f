# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of a source's carried objects: caches, shape keys, or keyframes.

Meshes are baked as their source is: to a cache of their own, or to an object with a shape key per frame. So
are hair, point clouds and Grease Pencil, by a mesh of their points. Curves and lattices get a shape key per
frame; rigid objects and bones get keyframes.
"""

import contextlib

import bpy

from ..blender import modifier_stack, references
from ..blender.evaluation import key_at
from ..blender.language import translated
from ..carried import points
from ..carried.carriers import MeshCarrier
from ..carried.carrying import carrier_class, find
from ..carried.points import (
    BAKED_KEY,
    AttributeCarrier,
    KeyCarrier,
    drop_key,
    forget_baked_keys,
    key_points,
    own_key,
    put_key,
)
from ..carried.transforms import BAKED_GROUP, BonesCarrier, PoseCarrier, TransformCarrier, forget_baked
from ..core.errors import UserError, as_user_error
from ..core.runtime.jobs import Pause
from ..field_modifier import cache_modifier
from ..results import placement
from ..solver.frame_range import playing
from .caches import CacheFile, plain


class CarriedBake:
    """Receives the shapes of each frame in turn on the worker; placed on the main thread.


    `cache_of(name)` is the path of an object's cache; None for shape keys.
    `is_shared`: other processes solve other frames, of the source alone.
    """

    def __init__(self, carrying, frames, cache_of, fps, is_shared):
        self.carrying, self.frames, self.warnings = carrying, frames, []
        self.shapes, self.caches, self.keyed = {}, {}, {}  # by carried object; keyed: snapshots per frame
        self.worlds = {}  # {carried object that moves as a whole: {frame: its world matrix}}
        if carrying.nodes is not None:
            name = carrying.source.name
            self.warnings.append(UserError("The field of {name} as nodes is not baked: it stands", name=name))
        for carried in list(carrying.objects):
            name = carried.reference.name
            if is_shared:
                carrying.leave(carried, UserError("{name} is not baked in parts; bake it whole", name=name))
            elif cache_of is not None and isinstance(carried.carrier, (MeshCarrier, AttributeCarrier)):
                self.caches[carried] = CacheFile(cache_of(name), frames, fps)

    def prepare(self):
        """Opens the caches; on the worker."""
        for carried, cache in self.caches.items():
            cache.open_for(len(carried.carrier.points))

    def add(self, shapes):
        """Stores the carried objects' shapes of one frame; on the worker."""
        for carried, shape in shapes:
            if carried is self.carrying.nodes:
                continue
            if carried in self.caches:
                self.caches[carried].add(shape)
            else:
                self.shapes.setdefault(carried, []).append(shape)

    def finish(self):
        for cache in self.caches.values():
            cache.finish()

    def discard(self):
        for cache in self.caches.values():
            cache.discard()
        self.shapes.clear()

    def read_keyframes(self, context, source, job):
        """Coroutine: plays the frames and records the delta transforms and poses to key, on top of the
        objects' own animation; restores the objects afterwards."""
        bound = {}
        for carried, shapes in self.shapes.items():
            if isinstance(carried.carrier, PoseCarrier) and len(shapes) == self.frames.count:
                with contextlib.suppress(UserError):  # reported by `place`
                    found = carried.item_and_entry(source)
                    bound[carried] = *found, carried.carrier.snapshot(*found)
        if not bound:
            return
        try:
            with playing(context.scene) as show:
                for number, frame in enumerate(self.frames):
                    text = translated("Storing frame {frame}", frame=plain(frame))
                    job.report_main_thread(number / self.frames.count, text)
                    show(frame)
                    for carried, (item, entry, _) in bound.items():
                        carried.carrier.bind(context, item, entry)
                        carried.carrier.write(item, entry, self.shapes[carried][number])
                        self.keyed.setdefault(carried, []).append(carried.carrier.snapshot(item, entry))
                    context.view_layer.update()
                    for carried, (item, _, _) in bound.items():
                        if not isinstance(carried.carrier, BonesCarrier):
                            self.worlds.setdefault(carried, {})[frame] = item.matrix_world.copy()
                    yield Pause.REDRAW
        finally:
            with contextlib.suppress(ReferenceError):  # the file was left
                for carried, (item, entry, before) in bound.items():
                    carried.carrier.restore(item, entry, before)

    def place(self, context, source):
        """Coroutine: adds caches, keys and keyframes to the objects; reports those that cannot take them."""
        for carried in self.carrying.objects:
            try:
                item, entry = carried.reference.get(), find(source, carried.reference.get())
                if entry is None:
                    raise UserError("{name} is no longer carried", item)
                if carried in self.caches:
                    self.play(carried, item)
                elif len(self.shapes.get(carried, ())) != self.frames.count:
                    raise UserError("{name} was not there at every frame", item)
                elif isinstance(carried.carrier, AttributeCarrier):
                    played = points.play(item, carried.carrier.points, carried.carrier.counts)
                    yield from self.add_frames(carried, played)
                elif isinstance(carried.carrier, MeshCarrier):
                    yield from self.add_object(context, carried, item)
                elif isinstance(carried.carrier, KeyCarrier):
                    self.add_keys(carried, item)
                else:
                    yield from self.add_keyframes(context, carried, item, entry)
            except (UserError, OSError, RuntimeError) as error:
                self.warnings.append(as_user_error(error))
        self.warnings += self.carrying.take_warnings()

    def lend(self, context, source, stack):
        """(objects that play the carried objects' frames until the ExitStack is closed, names of those that
        cannot without a bake): for an export."""
        players, missing = [], []
        for carried in self.carrying.objects:
            item, entry = carried.reference.find(), find(source, carried.reference.find())
            if entry is None:
                missing.append(carried.reference.name)
            elif carried in self.caches and isinstance(carried.carrier, MeshCarrier):
                self.caches[carried].commit()
                stack.callback(cache_modifier.restore, item, cache_modifier.snapshot(item))
                self.caches[carried].play_on(item)
                players.append(item)
            elif carried in self.worlds and item.type in SOLID:
                players.append(moved_twin(context, item, self.worlds[carried], stack))
            elif item.type != "EMPTY":
                missing.append(item.name)
        return players, missing

    def play(self, carried, item):
        self.caches[carried].commit()
        if isinstance(carried.carrier, AttributeCarrier):
            item = points.play(item, carried.carrier.points, carried.carrier.counts)
        self.caches[carried].play_on(item)

    def add_object(self, context, carried, item):
        mesh = placement.shown_mesh(context, item, len(self.shapes[carried][0]), in_place=True)
        report = {"frames": self.frames.count}
        baked = placement.show(context, item, "BAKE", "BAKE", mesh, report, select=False)
        partial = references.copy_modifiers(baked, modifier_stack.behind(item))
        if partial:
            names = ", ".join(partial)
            self.warnings.append(UserError("{name}: bind or comb {modifiers} again", baked, modifiers=names))
        source = self.carrying.source.get()
        own = {source: placement.existing(context, source, "BAKE", "BAKE")}
        references.remap(references.parts_of(baked), own)
        yield from self.add_frames(carried, baked)
        placement.show_alone(item, baked)

    def add_frames(self, carried, item):
        frames = [plain(frame) for frame in self.frames]
        for number, shape in enumerate(self.shapes[carried]):
            placement.add_frame(item, frames, number, shape)
            yield Pause.REDRAW

    def add_keys(self, carried, item):
        """Adds a shape key per frame; removes those of an earlier bake."""
        mask = own_key(item).vertex_group if own_key(item) is not None else ""
        forget_baked_keys(item)
        drop_key(item, also_basis=False)
        if item.data.shape_keys is None:
            item.shape_key_add(name="Basis", from_mix=False)
        keys = item.data.shape_keys
        basis, frames = key_points(keys.reference_key), [plain(frame) for frame in self.frames]
        for number, shape in enumerate(self.shapes[carried]):
            key = item.shape_key_add(name=f"{BAKED_KEY}{frames[number]}", from_mix=False)
            key.vertex_group = mask
            put_key(key, basis + (shape - carried.carrier.points))
            for frame in frames[max(0, number - 1) : number + 2]:
                key.value = float(frame == frames[number])
                key_at(key, "value", frame)

    def add_keyframes(self, context, carried, item, entry):
        turns = {}
        if not isinstance(carried.carrier, BonesCarrier):
            forget_baked(item)
        with playing(context.scene):  # at its end, the current frame's keys show
            for frame, state in zip(self.frames, self.keyed[carried], strict=True):
                carried.carrier.restore(item, entry, state)
                insert(item, carried.carrier, frame, turns)
                yield Pause.REDRAW


SOLID = ("MESH", "CURVE", "SURFACE", "FONT", "META")  # objects whose shape every exported file holds


def moved_twin(context, item, worlds, stack):
    """A copy of an object, with its name, that moves by world matrices until the ExitStack is closed."""
    twin, name = item.copy(), item.name
    twin.animation_data_clear()
    twin.constraints.clear()
    twin.parent, twin.rotation_mode = None, "QUATERNION"
    twin.delta_location, twin.delta_scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    twin.delta_rotation_euler, twin.delta_rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    context.scene.collection.objects.link(twin)

    def give_back():
        action = twin.animation_data.action if twin.animation_data is not None else None
        bpy.data.objects.remove(twin)
        if action is not None and action.users == 0:
            bpy.data.actions.remove(action)
        item.name = name

    stack.callback(give_back)
    item.name, twin.name = f"{name}.own", name
    turn = None
    for frame, world in worlds.items():
        twin.matrix_world = world
        if turn is not None:
            twin.rotation_quaternion.make_compatible(turn)
        turn = twin.rotation_quaternion.copy()
        for path in ("location", "rotation_quaternion", "scale"):
            key_at(twin, path, frame)
    return twin


def remove(item, entry):
    """Removes the modifier, shape keys or F-curves of a carried object's bake; keyframes of bones stay."""
    kind = carrier_class(item, entry.way)
    if item.type == "MESH" and modifier_stack.find_cache(item) is not None:
        cache_modifier.remove(item)
    if kind is AttributeCarrier:
        points.remove(item)
    elif kind is KeyCarrier:
        forget_baked_keys(item)
    elif kind is TransformCarrier:
        forget_baked(item)
        kind.put_state(item, kind.own_state(item, entry))


def insert(item, carrier, frame, turns):
    """Keyframes the channels that a carrier has written. `turns`: {(owner's name, channel): its rotation at
    the last frame}, with which each rotation is made compatible, to avoid flips between frames."""
    euler, quaternion = "rotation_euler", "rotation_quaternion"
    if not isinstance(carrier, BonesCarrier):
        turned = quaternion if item.rotation_mode == "QUATERNION" else euler
        channels, group = [(item, f"delta_{turned}", ["delta_location"])], BAKED_GROUP
    else:
        modes, group = {"QUATERNION": quaternion, "AXIS_ANGLE": "rotation_axis_angle"}, ""
        channels = [
            (bone, modes.get(bone.rotation_mode, euler), ["location", "scale"]) for bone in item.pose.bones
        ]
    for owner, turned, others in channels:
        if turned != "rotation_axis_angle":
            turn = getattr(owner, turned).copy()
            if (owner.name, turned) in turns:
                turn.make_compatible(turns[owner.name, turned])
            turns[owner.name, turned] = turn
            setattr(owner, turned, turn)
        for path in (turned, *others):
            key_at(owner, path, frame, group=group)
