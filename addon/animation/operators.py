# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators of the animation panel."""

import bpy

from ..blender import modifier_stack
from ..blender.language import about, translated
from ..blender.object_references import owner_of, settings_of, source_of
from ..blender.property_definitions import effective_value, path_text
from ..blender.source_operator import SourceOperator
from ..blender.splat_layouts import holds_splats
from ..carried import carrying
from ..carried.carriers import MeshCarrier
from ..carried.carrying import carrier_class
from ..carried.points import AttributeCarrier
from ..core.errors import UserError, refuse
from ..field_modifier import cache_modifier, field_nodes, node_group
from ..live import sessions
from ..names import FIELD_NODES
from ..poses import applying
from . import caches, carried_bake, splat_export
from .bake_job import BakeOperator, WrapBake, effective_kind, frames_of, refusal_of, scans_in
from .object_bake import ObjectBake
from .properties import folder, settings
from .splat_export import SplatBake


def cached_with(source):
    """The carried objects whose frames a bake of the source stores in caches of their own."""
    entries = [entry for entry in settings_of(source).carried if entry.item is not None]
    kinds = (MeshCarrier, AttributeCarrier)
    return [entry.item for entry in entries if carrier_class(entry.item, entry.way) in kinds]


class CacheOperator(BakeOperator):
    """Mixin of operators that store the frames in caches or shape keys."""

    __annotations__ = {
        "folder": folder(options={"SKIP_SAVE"}),
        "filepath": path_text(
            "File",
            "Where one object's cache goes; empty for a file with its name in the folder",
            "FILE",
            options={"SKIP_SAVE"},
        ),
    }

    def path(self, context, source, active, values):
        """The path by cache_path(); None for shape keys. That of splats may be of a file for each frame."""
        suffix = caches.SUFFIXES.get(values["format"])
        if holds_splats(source):
            suffix = splat_export.SUFFIXES[values["splat_format"]]
        if suffix is None:
            return None
        folder = effective_value("folder", settings_of(active).bake, self)
        return caches.cache_path(source, context.scene, suffix, folder, self.filepath)

    def places(self, context):
        """UserError if two objects would share a file."""
        active, found, owners, self.failures = source_of(context), {}, {}, []
        for source in self.sources(context):
            path = self.path(context, source, active, self.values(active))
            if path is None:
                continue
            beside = [(one, caches.cache_beside(path, one.name)) for one in cached_with(source)]
            for item, place in ((source, path), *beside):
                other = owners.setdefault(caches.same_place(place), item)
                if other != item:
                    raise UserError(
                        "{first} and {second} would share {path}; rename one",
                        first=other.name,
                        second=item.name,
                        path=place.name,
                    )
                found[place] = caches.is_own(item, place, named=not self.filepath)
                if holds_splats(item):
                    found |= dict.fromkeys(splat_export.frames_there(place)[:1], found[place])
        return found

    def plan_frames(self, context, job):
        active = source_of(context)
        sources = [(source, self.kind_of(source)) for source in self.sources(context)]
        if self.filepath and len(sources) > 1:
            raise UserError("One file cannot take several objects; choose a folder")
        values = self.values(active)
        taken = [path for path, own in self.places(context).items() if path.exists() and not own]
        if taken and not self.overwrite:
            names = ", ".join(path.name for path in taken)
            raise UserError("{names} is there, and not of this object; Overwrite replaces it", names=names)

        def make(source, kind, frames):
            path = self.path(context, source, active, values)
            bake = self.bake_of(context, source, kind, frames, path, values)
            self.warn_of_weight(bake)
            return bake

        return (yield from self.begin(context, job, sources, values, make))

    def warn_of_weight(self, bake):
        weight = caches.keys_weight(len(bake.reader.surface.local), bake.frames.count)
        if isinstance(bake.store, caches.ShapeKeys) and weight > caches.HEAVY:
            size = caches.size_text(weight)
            line = translated(
                "Shape keys of {size} in the .blend and in memory; a cache would take neither", size=size
            )
            self.warnings.append(about(bake.name, line))


class ARAPFIELDS_OT_bake(CacheOperator, bpy.types.Operator):
    """Solve the frames of an animation and keep them, so that they play anywhere, without this extension"""

    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    title = "Bake"
    guide = "animation"

    __annotations__ = {
        **settings(options={"SKIP_SAVE"}),
        "part": bpy.props.IntVectorProperty(
            name="Part",
            description="I of N, where N processes share the frames; 0 of 0 for one that solves all at once",
            size=2,
            default=(0, 0),
            min=0,
            options={"HIDDEN", "SKIP_SAVE"},
        ),
    }

    def kind_of(self, source):
        return effective_kind(source, self)

    def bake_of(self, context, source, kind, frames, path, values):
        part = tuple(self.part) if any(self.part) else None
        if holds_splats(source):
            return SplatBake(context, source, kind, frames, path, part=part, loop=values["loop"])
        if part is not None and (values["format"] == "KEYS" or not 1 <= part[0] <= part[1]):
            raise UserError(
                "Part {i} of {n}: caches alone have parts, from 1 of N to N of N", i=part[0], n=part[1]
            )
        return ObjectBake(context, source, kind, frames, path, part=part, loop=values["loop"])


class ARAPFIELDS_OT_wrap_sequence(CacheOperator, bpy.types.Operator):
    """Wrap the object onto each frame of a scan, each from the last; kept as Bake and Export says"""

    bl_label = "Wrap Sequence"
    bl_options = {"UNDO"}
    title = "Wrap Sequence"
    guide = "wrap"
    used = ("format", "range", "step", "subframes")
    scans = None  # {frame: ObjectReference} of a collection

    __annotations__ = {
        name: one
        for name, one in settings(options={"SKIP_SAVE"}).items()
        if name not in ("splat_format", "kind", "loop")
    }

    @classmethod
    def refuses(cls, source):
        return refusal_of(source, "WRAP")

    def kind_of(self, source):
        return "WRAP"

    def choose(self, context, sources, values):
        collection = settings_of(source_of(context)).wrap.frames
        if collection is None:
            return super().choose(context, sources, values)
        self.scans = scans_in(collection, context.scene, [source for source, _ in sources], values)
        return frames_of(self.scans)

    def bake_of(self, context, source, kind, frames, path, values):
        return WrapBake(context, source, frames, self.scans, path)


class ARAPFIELDS_OT_remove_bake(SourceOperator, bpy.types.Operator):
    """Take the modifiers that play the bake away, of carried objects too; the caches' files stay"""

    bl_label = "Remove Bake"
    bl_options = {"REGISTER", "UNDO"}
    guide = "animation"

    @classmethod
    def refuses(cls, source):
        played = modifier_stack.find_cache(source)
        return UserError("{name} plays no bake", source) if played is None else None

    def change(self, context, source):
        cache_modifier.remove(source)
        for entry in settings_of(source).carried:
            if entry.item is not None and entry.item.library is None:
                carried_bake.remove(entry.item, entry)


class ARAPFIELDS_OT_field_as_nodes(SourceOperator, bpy.types.Operator):
    """Have the other selected objects move by this one's field, by nodes that need no extension: instances, \
curves and what changes its topology as well. They follow each further solve"""

    bl_label = "Field as Nodes"
    bl_options = {"REGISTER", "UNDO"}
    guide = "characters"

    def change(self, context, source):
        others = [item for item in context.selected_objects if item != source and owner_of(item) != source]
        if not others and field_nodes.of(source) is None:
            raise UserError("Select the objects to move by nodes as well")
        for item in others:
            require_free(source, item)
        is_live, rows = sessions.is_live(source), None
        if not is_live:
            pose = applying.solved_pose(context, source)
            rows = field_nodes.rows_of(pose.field, pose.local_to_solve)
        carrier = field_nodes.of(source) or field_nodes.make(source)
        for item in others:
            follow(item, carrier)
        if is_live:
            sessions.settle(context, source.session_uid)
        else:
            field_nodes.write(carrier, rows)
        count = len(bpy.data.user_map(subset=[carrier])[carrier] - {source})
        return translated("Objects that move by the field of {name}: {count}", count=count, name=source.name)


def require_free(source, item):
    """Raises UserError if an object cannot have the modifier, or moves with the source already."""
    if item.library is not None:
        raise UserError("{name} is linked from another file; make it local to carry it", item)
    if not hasattr(item.data, "attributes") and item.type not in ("CURVE", "FONT", "SURFACE"):
        raise UserError("{name} has no geometry that nodes could move", item)
    refuse(carrying.of_splats(item))
    if carrying.find(source, item) is not None:
        raise UserError("{name} moves with {other} already", item, other=source.name)


def follow(item, carrier):
    """Adds the modifier to an object that does not have it."""
    if any(is_following(modifier, carrier) for modifier in item.modifiers):
        return
    index = modifier_stack.end(list(item.modifiers))
    modifier = item.modifiers.new("ARAP Field", "NODES")
    modifier.node_group = field_nodes.find_or_make()
    node_group.put(modifier, "Field", carrier)
    item.modifiers.move(item.modifiers.find(modifier.name), index)


def is_following(modifier, carrier):
    return (
        modifier.type == "NODES"
        and FIELD_NODES in (modifier.node_group or ())
        and node_group.get(modifier, "Field") == carrier
    )


CLASSES = [
    ARAPFIELDS_OT_bake,
    ARAPFIELDS_OT_wrap_sequence,
    ARAPFIELDS_OT_remove_bake,
    ARAPFIELDS_OT_field_as_nodes,
]
