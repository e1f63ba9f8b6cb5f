# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of walks: of shapes, by the gestures of the window, and of everything."""

import tempfile

import bpy
import numpy as np
from mathutils import Euler, Vector
from support.blender import scenes

import addon
from addon import registration
from addon.blender.object_references import in_view, settings_of
from addon.core.errors import UserError
from addon.live import sessions
from addon.pin_tool import drag, pins
from tests.blender.walk import world

# The steps of a walk of shapes, by the operators and calls that the window's gestures make. A step changes
# the scene as a user does and returns what it did; None where it cannot be done now.

STYLES = ("CUBE", "OCTAHEDRON", "ICOSAHEDRON", "CYLINDER")
FRAMES = ("OBJECT", "WORLD", "UPRIGHT")
SHORT = {"iterations": 20, "samples": 400}


class Undoing:
    def undo(self):
        bpy.ops.ed.undo()
        return "undo"

    def redo(self):
        bpy.ops.ed.redo()
        return "redo"


class Steps(Undoing):
    """`source` is the object that the step at hand works on, `old` its name before; `rng` is drawn from."""

    def __init__(self):
        self.rng, self.source, self.old = None, None, ""

    def take(self, name, rng):
        self.rng, items = rng, world.shape_sources()
        self.source = items[rng.integers(len(items))]
        self.old = self.source.name
        scenes.activate(self.source)
        return getattr(self, name)()

    @property
    def settings(self):
        return self.source.arapfields

    def size(self):
        return float(np.ptp(scenes.world_points(self.source), axis=0).max())

    def place(self):
        points = scenes.world_points(self.source)
        return points[self.rng.integers(len(points))]

    def look(self):
        """The window's timer may have come round, with a shape or without."""
        if self.rng.random() < 0.6:
            bpy.context.view_layer.update()
            sessions.update(bpy.context, wait=world.WAIT if self.rng.random() < 0.5 else 0.0)

    def moves(self, dragged):
        start = np.array(dragged.empty.get().matrix_world.translation)
        way = self.rng.normal(size=3) * 0.2 * self.size()
        if self.rng.random() < 0.25:
            dragged.turn(bpy.context, Vector(self.rng.normal(size=3)).normalized(), self.rng.normal())
        for share in np.linspace(0, 1, self.rng.integers(2, 5))[1:]:
            dragged.move(bpy.context, start + share * way)
            self.look()

    def pin(self):
        if len(self.settings.handles) >= 4 or pins.refusal(self.source) is not None:
            return None
        where, anchor = self.place(), self.rng.random() < 0.4
        dragged = drag.of_new_pin(bpy.context, self.source, where, 0.15 * self.size(), anchor=anchor)
        if not anchor:
            self.moves(dragged)
        dragged.end(bpy.context)
        return "anchor" if anchor else "drag of a new pin"

    def entry(self):
        entries = list(self.settings.handles)
        return entries[self.rng.integers(len(entries))] if entries else None

    def drag(self):
        entry = self.entry()
        if entry is None or pins.refusal(self.source) is not None:
            return None
        dragged, way = drag.of_entry(bpy.context, self.source, entry), self.rng.random()
        if way > 0.15:
            self.moves(dragged)
        if way > 0.85:
            dragged.cancel(bpy.context)
            return "cancelled drag"
        dragged.end(bpy.context)
        return "drag" if way > 0.15 else "press"

    def transform(self):
        """G, R or S of pins, of which the extension hears by the scene alone."""
        if not self.settings.handles:
            return None
        for number, entry in enumerate(self.settings.handles):
            if number == 0 or self.rng.random() < 0.6:
                empty = entry.empty
                empty.location += Vector(self.rng.normal(size=3) * 0.1 * self.size())
                if self.rng.random() < 0.4:
                    empty.rotation_euler.rotate(Euler(self.rng.normal(size=3) * 0.4))
                if self.rng.random() < 0.1:
                    empty.scale *= 1.3
        self.look()
        return "G, R, S of pins"

    def place_source(self):
        """G, R or S of the object, or of its parent."""
        item = self.source.parent or self.source
        item.location += Vector(self.rng.normal(size=3) * 0.1)
        item.rotation_euler.rotate(Euler(self.rng.normal(size=3) * 0.2))
        if self.rng.random() < 0.3:
            item.scale *= 1.1
        if self.rng.random() < 0.2:
            item.scale.z *= 1.1
        return "G, R, S of the object"

    def live(self):
        kind = "DEFORM" if self.settings.handles and self.rng.random() < 0.6 else "STYLIZE"
        try:
            bpy.ops.arapfields.live(kind=kind)
        except RuntimeError:
            return None
        return f"Live {kind}"

    def keep(self):
        if not sessions.is_live(self.source):
            return None
        bpy.ops.arapfields.live_keep()
        return "Keep Shape"

    def style(self):
        style, which = self.settings.stylize, self.rng.integers(6)
        if which < 2:
            style.style = str(self.rng.choice(STYLES))
        elif which == 2:
            style.strength = float(self.rng.choice((0.0, 0.5, 1.0)))
        elif which == 3:
            style.frame = str(self.rng.choice(FRAMES))
        elif which == 4:
            style.use_handles = not style.use_handles
        else:  # still to be chosen
            chosen = bpy.data.objects["Die"] if self.rng.random() < 0.5 else None
            style.style, style.style_object = "OBJECT", chosen
        self.look()
        return "style"

    def setting(self):
        entry, which = self.entry(), self.rng.integers(4)
        if which == 0:
            self.settings.deform.bending = float(self.rng.choice((0.05, 0.1, 1.0)))
        elif which == 1:
            self.settings.stylize.keep_stance = float(self.rng.choice((0.1, 1.0)))
        elif entry is not None and which == 2:
            entry.weight = float(self.rng.choice((0.5, 1.0, 2.0)))
        elif entry is not None:
            entry.anchor = not entry.anchor
        self.look()
        return "setting"

    def delete_pin(self):
        entry = self.entry()
        if entry is None:
            return None
        pins.choose(bpy.context, entry.empty)
        bpy.ops.arapfields.pin_delete()
        return "pin deleted"

    def delete(self):
        if len(world.shape_sources()) < 3:
            return None
        bpy.ops.object.delete()
        return "object deleted"

    def rename(self):
        self.source["walks"] = self.source.get("walks", self.source.name)
        self.source.name = f"Renamed {self.rng.integers(1000)}"
        return "renamed"

    def solve(self):
        """Deform or Stylize, onto the modifier."""
        name = "deform" if self.settings.handles and self.rng.random() < 0.6 else "stylize"
        try:
            getattr(bpy.ops.arapfields, name)(**SHORT)
        except RuntimeError:
            return None
        return name

    def wrap(self):
        others = [item for item in world.shape_sources() if item != self.source]
        self.settings.wrap.onto = others[self.rng.integers(len(others))]
        bpy.ops.arapfields.wrap(samples=400, iterations=3, centers=20, stages=1)
        return "wrap"

    def mode(self):
        name = str(self.rng.choice(("EDIT", "SCULPT", "WEIGHT_PAINT")))
        bpy.ops.object.mode_set(mode=name)
        self.look()
        bpy.ops.object.mode_set(mode="OBJECT")
        return name

    def save(self):
        with tempfile.TemporaryDirectory() as folder:
            bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/walk.blend")
            bpy.ops.wm.open_mainfile(filepath=f"{folder}/walk.blend")
        return "save and reload"


# The steps of a walk of everything: the extension's operators and properties between Blender's own.

MODIFIERS = ("MIRROR", "SUBSURF", "WELD", "ARRAY", "TRIANGULATE", "SOLIDIFY", "SIMPLE_DEFORM", "DECIMATE")
MODIFIERS += ("ARMATURE", "LATTICE", "SHRINKWRAP", "NODES", "SMOOTH", "MESH_CACHE", "REMESH")
MODES = ("EDIT", "SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT")
# What needs a window, a file of its own, or ends the walk's scene.
LEFT_OUT = {"pin_tool", "pin_hover", "pin_drag", "click_landmarks", "cancel", "clear_cache", "wrap_sequence"}
LEFT_OUT |= {"export_animation", "bake", "open_log", "check"}
# Large values of these take long: a fit's quality stands for others, a small share divides into many faces.
LARGE = ("iterations", "samples", "width", "layers", "batch", "centers", "stages", "resolution", "octaves")
LARGE += ("points", "threads", "device", "subframes", "seed", "start", "end", "step", "seconds", "memory")
LARGE += ("size", "quality", "share")
GROUPS = ("deform", "stylize", "wrap", "stiffness", "secondary", "contact", "bake", "skin", "fit", "pin")


def operators():
    """{name: class} of the extension's operators."""
    classes = [one for one in registration.CLASSES if issubclass(one, bpy.types.Operator)]
    names = {one.bl_idname.split(".")[-1]: one for one in classes}
    return {name.removeprefix("ARAPFIELDS_OT_"): one for name, one in names.items()}


def may_be_put(item):
    """Whether an object's place can be changed, and stays: its keys may say another."""
    return item.library is None and item.animation_data is None


class AllSteps(Undoing):
    """`source` is the object that the step at hand works on; `rng` is drawn from."""

    def __init__(self):
        self.rng, self.source, self.old, self.folder = None, None, "", tempfile.mkdtemp()

    def take(self, name, seed):
        self.rng = np.random.default_rng(seed)
        items = world.sources()
        if not items:
            return self.add() if name == "add" else None
        self.source = items[self.rng.integers(len(items))]
        self.old = self.source.name
        scenes.activate(self.source)
        said = getattr(self, name)()
        for item in world.sources():  # within the step: a refused one changes nothing
            if item.library is None:
                world.small(item)  # a result has settings of its own, a preset others
        return said

    @property
    def settings(self):
        return settings_of(self.source)

    def chance(self, share):
        return self.rng.random() < share

    def one_of(self, things):
        things = list(things)
        return things[self.rng.integers(len(things))] if things else None

    def other(self):
        return self.one_of(item for item in in_view(bpy.context) if item != self.source)

    def call(self, operator, **given):
        """Calls an operator as a button does; what it refuses is no step."""
        try:
            if not operator.poll():
                return None
            return given.pop("says", operator.idname_py()) if "FINISHED" in operator(**given) else None
        except RuntimeError as error:
            if "Traceback" in str(error):
                raise
            return None
        except TypeError as error:  # an enum of another object
            if "enum" in str(error):
                return None
            raise

    def live(self):
        return self.call(bpy.ops.arapfields.live, kind=str(self.one_of(("DEFORM", "DEFORM", "STYLIZE"))))

    def keep(self):
        return self.call(bpy.ops.arapfields.live_keep)

    def solve(self):
        name = str(self.one_of(("deform", "deform", "stylize", "wrap")))
        if name == "wrap":
            target = self.other()
            self.settings.wrap.onto = target if target is not None and target.type == "MESH" else None
        return self.call(getattr(bpy.ops.arapfields, name))

    def bake(self):
        kind = str(self.one_of(("PC2", "MDD", "KEYS")))
        given = {"folder": self.folder, "range": "CUSTOM", "start": 1, "end": 2, "overwrite": True}
        return self.call(bpy.ops.arapfields.bake, format=kind, **given)

    def carry(self):
        other = self.other()
        if other is None:
            return None
        scenes.activate(other, self.source)
        return self.call(bpy.ops.arapfields.carry)

    def operator(self):
        """Any operator of the extension, as it is or with a drawn value of an argument."""
        name = self.one_of(sorted(set(operators()) - LEFT_OUT))
        operator = getattr(bpy.ops.arapfields, name, None)
        if operator is None:
            return None
        given = {}
        for argument in operator.get_rna_type().properties:
            if argument.identifier == "filepath":
                given["filepath"] = f"{self.folder}/file.json"
            elif argument.identifier not in ("rna_type", *LARGE) and self.chance(0.3):
                value = self.value(argument)
                given |= {} if value is None else {argument.identifier: value}
        if self.chance(0.3) and self.other() is not None:
            scenes.activate(self.other(), self.source)
        return self.call(operator, **given) and f"{name} {given}"

    def value(self, argument):
        """A value of a property of this RNA type; None for kinds that are left alone."""
        kind = argument.type
        if any(word in argument.identifier for word in LARGE) or getattr(argument, "is_array", False):
            return None
        if kind == "BOOLEAN":
            return bool(self.chance(0.5))
        if kind == "ENUM":
            names = [item.identifier for item in argument.enum_items]
            if not names:
                return None
            return set(names[:1]) if argument.is_enum_flag else str(self.one_of(names))
        if kind == "FLOAT":
            low, high = max(argument.soft_min, -10.0), min(argument.soft_max, 10.0)
            return float(self.one_of((low, high, self.rng.uniform(low, high))))
        if kind == "INT":
            return int(self.rng.integers(max(argument.soft_min, 0), min(argument.soft_max, 10) + 1))
        return None

    def setting(self):
        """A property of the object, or of one of its groups."""
        owner = self.settings
        name = self.one_of(("", *GROUPS))
        owner = getattr(owner, name, owner) if name else owner
        if owner is None:
            return None
        return self.put(owner)

    def entry(self):
        """A property of a handle, or of a carried object."""
        entry = self.one_of([*self.settings.handles, *self.settings.carried])
        return None if entry is None else self.put(entry)

    INTERNAL = ("uid", "record", "live_kind", "live_number", "live_hidden", "set_aside", "silenced", "held")
    INTERNAL += (
        "moved_by",
        "under_rig",
        "made_from",
        "rest",
        "base",
        "handle_of",
        "carried_by",
        "field_helper",
        "item",  # which is carried: by the operators, which bind and give back
    )

    def put(self, owner):
        chosen = self.one_of(p for p in owner.bl_rna.properties if not p.is_readonly and not p.is_hidden)
        if chosen is None or chosen.identifier.startswith(self.INTERNAL) or chosen.identifier == "name":
            return None
        if chosen.type == "POINTER":
            value = self.other() if self.chance(0.7) else None
        elif chosen.type == "STRING" and "group" in chosen.identifier:
            value = self.one_of(["", *(group.name for group in self.source.vertex_groups)])
        else:
            value = self.value(chosen)
            if value is None:
                return None
        try:
            setattr(owner, chosen.identifier, value)
        except TypeError:
            return None
        return f"{owner.path_from_id()}.{chosen.identifier} = {value}"

    def handle(self):
        """A new handle, of any kind, or one that is removed."""
        if self.chance(0.3):
            return self.call(bpy.ops.arapfields.remove_handle)
        if self.chance(0.5) and bpy.ops.arapfields.add_handle.poll():
            world.give_handles(self.source)
            return "two handles"
        kind = self.one_of(("CUBE", "SPHERE", "POINT", "PIN", "GROUP"))
        return self.call(bpy.ops.arapfields.add_handle, kind=str(kind), place="CURSOR")

    def move_handle(self):
        handles = [one.empty for one in self.settings.handles if one.empty is not None]
        empty = self.one_of(one for one in handles if may_be_put(one))
        if empty is None:
            return None
        empty.location += type(empty.location)(self.rng.normal(size=3) * 0.2)
        return f"{empty.name} moved"

    def pin(self):
        if not pins.is_own(self.source) or pins.refusal(self.source) is not None:
            return None  # the tool pins no results
        if not len(self.source.data.vertices):
            return None
        points = scenes.world_points(self.source)
        if not len(points):
            return None
        where = points[self.rng.integers(len(points))]
        try:
            dragged = drag.of_new_pin(bpy.context, self.source, where, 0.2, anchor=bool(self.chance(0.4)))
        except (UserError, ValueError):  # which the tool reports: a group's handle may lack its group
            return None
        if self.chance(0.7):
            dragged.move(bpy.context, np.array(where) + self.rng.normal(size=3) * 0.2)
        dragged.end(bpy.context) if self.chance(0.8) else dragged.cancel(bpy.context)
        return "pin"

    # Blender's own.

    def add_modifier(self):
        if self.source.library or self.source.override_library:
            return None
        kind = str(self.one_of(MODIFIERS))
        if kind in ("ARRAY", "SUBSURF") and len(self.source.modifiers) > 4:
            return None
        modifier = self.source.modifiers.new(kind.title(), kind)
        target = self.other()
        if kind in ("ARMATURE", "LATTICE") and target is not None:
            modifier.object = target
        elif kind == "SHRINKWRAP" and target is not None and target.type == "MESH":
            modifier.target = target
        if self.chance(0.4):
            self.source.modifiers.move(len(self.source.modifiers) - 1, 0)
        return f"{kind} added"

    def change_modifier(self):
        modifier = self.one_of(self.source.modifiers)
        if modifier is None or self.source.library or self.source.override_library:
            return None
        way, name = self.rng.integers(4), modifier.name
        if way == 0:
            self.source.modifiers.remove(modifier)
        elif way == 1:
            modifier.show_viewport = not modifier.show_viewport
        elif way == 2:
            self.source.modifiers.move(self.source.modifiers.find(name), 0)
        else:
            return self.call(bpy.ops.object.modifier_apply, modifier=name)
        return f"{name}: {('removed', 'toggled', 'first')[way]}"

    def select(self):
        item = self.one_of(in_view(bpy.context))
        if item.hide_get() or item.hide_viewport:
            return None
        scenes.activate(item)
        return f"{item.name} selected"

    def duplicate(self):
        if self.chance(0.4):
            for one in self.settings.handles:
                if one.empty is not None and one.empty.visible_get():
                    one.empty.select_set(True)
        if len(bpy.context.view_layer.objects) > 30:
            return None
        return self.call(bpy.ops.object.duplicate, linked=bool(self.chance(0.4)))

    def delete(self):
        item = self.one_of(in_view(bpy.context))
        if len(world.sources()) < 3 or item.hide_get() or item.hide_viewport:
            return None
        name = item.name
        scenes.activate(item)
        return self.call(bpy.ops.object.delete) and f"{name} deleted"

    def join(self):
        other = self.other()
        if other is None or other.type != "MESH" or len(world.sources()) < 4:
            return None
        scenes.activate(other, self.source)
        return self.call(bpy.ops.object.join)

    def share(self):
        other = self.other()
        if other is None or other.type != "MESH" or other.library or other.mode != "OBJECT":
            return None
        other.data = self.source.data
        return f"{other.name} shares the mesh"

    def single_user(self):
        return self.call(bpy.ops.object.make_single_user, object=False, obdata=True)

    def hide(self):
        way = self.rng.integers(3)
        if way == 0:
            self.source.hide_set(not self.source.hide_get())
        elif way == 1:
            self.source.hide_render = not self.source.hide_render
        else:
            self.source.hide_viewport = not self.source.hide_viewport
        return f"{('hide', 'hide_render', 'hide_viewport')[way]} of {self.source.name}"

    def parent(self):
        other = self.other()
        if self.source.parent is not None:
            return self.call(bpy.ops.object.parent_clear, type="CLEAR_KEEP_TRANSFORM")
        if other is None:
            return None
        scenes.activate(self.source, other)
        return self.call(bpy.ops.object.parent_set, type="OBJECT")

    def place(self):
        item = self.source.parent or self.source
        if not may_be_put(item):
            return None
        item.location += type(item.location)(self.rng.normal(size=3) * 0.2)
        if self.chance(0.3):
            item.scale *= self.rng.uniform(0.8, 1.25)
        if self.chance(0.2):
            item.scale.z *= 1.2
        return f"{item.name} placed"

    def apply(self):
        return self.call(bpy.ops.object.transform_apply, location=False, rotation=True, scale=True)

    def mode(self):
        name = str(self.one_of(MODES))
        if self.call(bpy.ops.object.mode_set, mode=name) is None:
            return None
        bpy.ops.object.mode_set(mode="OBJECT")
        return name

    def edit(self):
        """An edit of the mesh in Edit Mode."""
        if self.source.library or self.call(bpy.ops.object.mode_set, mode="EDIT") is None:
            return None
        bpy.ops.mesh.select_all(action="SELECT")
        way = self.rng.integers(4)
        if way == 0 and len(self.source.data.vertices) < 2000:
            bpy.ops.mesh.subdivide()
        elif way == 1:
            bpy.ops.mesh.select_random(ratio=0.1, seed=int(self.rng.integers(100)))
            bpy.ops.mesh.delete(type="FACE")
        elif way == 2:
            bpy.ops.transform.translate(value=(0.1, 0.0, 0.0))
        else:
            bpy.ops.mesh.quads_convert_to_tris()
        bpy.ops.object.mode_set(mode="OBJECT")
        return f"edit {way}"

    def group(self):
        if self.source.library:
            return None
        way, groups = self.rng.integers(3), self.source.vertex_groups
        if way == 0 or not groups:
            groups.new(name="Group").add(list(range(len(self.source.data.vertices) // 2)), 1.0, "REPLACE")
        elif way == 1:
            groups.remove(self.one_of(groups))
        else:
            groups.active_index = -1
        return f"vertex group {way}"

    def shape_key(self):
        if self.source.library or self.source.data.library:
            return None
        keys, way = self.source.data.shape_keys, self.rng.integers(3)
        if keys is None or way == 0:
            self.source.shape_key_add(name="Key", from_mix=False)
        elif way == 1 and keys.animation_data is not None:
            return None  # keyframes say the values
        elif way == 1:
            self.one_of(keys.key_blocks).value = float(self.rng.random())
        else:
            self.source.shape_key_clear()
        return f"shape key {way}"

    def frame(self):
        bpy.context.scene.frame_set(int(self.rng.integers(1, 4)))
        return f"frame {bpy.context.scene.frame_current}"

    def keyframe(self):
        moved = [
            one.empty for one in self.settings.handles if one.empty is not None and one.empty.library is None
        ]
        item = self.one_of([*moved, self.source])
        if item.library or item.override_library:
            return None
        if item.animation_data is not None and self.chance(0.3):
            item.animation_data_clear()
            return f"{item.name} not animated"
        item.keyframe_insert("location", frame=1)
        item.location.z += 0.1
        item.keyframe_insert("location", frame=3)
        bpy.context.scene.frame_set(bpy.context.scene.frame_current)  # the keys say where it is
        return f"{item.name} animated"

    def rename(self):
        item = self.one_of(in_view(bpy.context))
        if item.library:
            return None
        item.name = str(self.one_of(("Bar", "Object0", "Object1_offsets", "ARAP Fields", "Ü ö/\\")))
        return f"renamed to {item.name}"

    def add(self):
        if len(bpy.context.view_layer.objects) > 30:
            return None
        bar = world.bar(self.rng, "New", (5.0, float(self.rng.normal()), 0.0))
        return f"{bar.name} added"

    def link(self):
        """Links or appends a copy of an object from another file; of none with a parent, which Blender's undo
        loses, even without the extension."""
        if self.source.library or self.source.parent or len(bpy.context.view_layer.objects) > 30:
            return None
        path, name = f"{self.folder}/other{self.rng.integers(1 << 30)}.blend", self.source.name
        bpy.data.libraries.write(path, {self.source})
        with bpy.data.libraries.load(path, link=bool(self.chance(0.7))) as (_, into):
            into.objects = [name]
        for item in into.objects:
            if item is not None:
                bpy.context.collection.objects.link(item)
        return f"{name} from another file"

    def override(self):
        item = self.one_of(item for item in bpy.context.view_layer.objects if item.library)
        if item is None:
            return None
        made = item.override_create(remap_local_usages=True)
        if made is not None and made.name not in bpy.context.view_layer.objects:
            bpy.context.collection.objects.link(made)
        return f"override of {item.name}"

    def purge(self):
        bpy.data.orphans_purge(do_local_ids=True, do_linked_ids=True, do_recursive=True)
        return "purge"

    def register(self):
        addon.unregister()
        addon.register()
        return "unregister, register"

    def save(self):
        path = f"{self.folder}/walk{self.rng.integers(1 << 30)}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        return "save and reload"
