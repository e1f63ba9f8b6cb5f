# SPDX-License-Identifier: GPL-3.0-or-later
"""References of a data-block to others, between steps of undo too, and the removal of what becomes unused."""

import contextlib
from contextlib import contextmanager

import bpy

from ..core.errors import UserError

# What may refer to what between two steps of Blender's undo.
#
# Undo leaves a data-block that is the same in both steps as it is in memory, with what it refers to by
# then; what is not in the step that is restored is freed. So whatever is done without a step of its own, by
# timers and handlers, gives no data-block a reference to a new one: undo would leave it dangling. And what
# may come back without a step stays in the file, unused, until that is saved.

is_between, keeps_unused = False, False
pushed = 0  # number of steps pushed so far by push()


def push(message):
    """Pushes a step for what no operator's own step has."""
    global pushed
    pushed += 1
    bpy.ops.ed.undo_push(message=message)


@contextmanager
def between():
    """Context manager for what goes into no step: a reference to new data raises UserError."""
    global is_between
    earlier, is_between = is_between, True
    try:
        with unused_kept():
            yield
    finally:
        is_between = earlier


@contextmanager
def unused_kept():
    """Context manager in which data that become unused are not removed."""
    global keeps_unused
    earlier, keeps_unused = keeps_unused, True
    try:
        yield
    finally:
        keeps_unused = earlier


def refuse_new(source):
    """UserError if what is done now must refer to nothing new."""
    if is_between:
        raise UserError("{name} needs new data for its motion; start again", source)


def referred(items):
    """{(object, modifier, data path, data-block)}, by their uids, of all that modifiers of nodes refer to."""
    return {
        (item.session_uid, one.persistent_uid, path, value.session_uid)
        for item in items
        for one in item.modifiers
        if one.type == "NODES"
        for path, value in references(one)
    }


def push_new(message, items, before):
    """Pushes a step if modifiers refer to data that `before`, by referred(), has not: what is refused or
    cancelled has no step, and undo would leave the references dangling."""
    if not referred(items) <= before:
        push(message)


def takes_references(block):
    """Whether a data-block can be given references to others of the file. A linked one cannot: undo leaves it
    as it is, with references to what undo has removed, and Blender crashes."""
    return block.library is None


# References of a data-block to others, and the removal of objects and modifiers with what becomes unused.

# References of a data-block to others: by modifiers with their inputs of nodes, constraints and drivers.


def parts_of(block):
    """The parts of a data-block that refer to others: modifiers, constraints of it and its bones with their
    targets, and the targets of its drivers' variables."""
    yield from getattr(block, "modifiers", ())
    bones = block.pose.bones if getattr(block, "pose", None) else ()
    for constraint in (one for owner in (block, *bones) for one in getattr(owner, "constraints", ())):
        yield constraint
        yield from getattr(constraint, "targets", ())
    data = getattr(block, "animation_data", None)
    for curve in data.drivers if data else ():
        yield from read_by(curve)


def read_by(curve):
    """The targets of a driver's variables."""
    return [target for variable in curve.driver.variables for target in variable.targets]


def paths_of(part, kind=None):
    """Data paths of the writable properties of a modifier, constraint or target, and of inputs of nodes.

    `kind`: only those of this type, such as "POINTER".
    """
    paths = writable(part, kind)
    if getattr(part, "type", "") != "NODES":
        return paths
    if not hasattr(part, "properties"):  # before Blender 5.2, inputs are ID properties
        return paths + [f'["{name}"]' for name in part.keys()]  # noqa: SIM118
    if part.properties is None:  # in Blender 5.3, of a modifier without a node group
        return paths
    for side in ("inputs", "outputs"):
        slots = getattr(part.properties, side)
        names = [one.identifier for one in slots.bl_rna.properties if one.type == "POINTER"]
        for name in names[1:]:  # the first is rna_type
            paths += [f"properties.{side}.{name}.{value}" for value in writable(getattr(slots, name), kind)]
    return paths


def writable(struct, kind):
    properties = struct.bl_rna.properties
    return [one.identifier for one in properties if not one.is_readonly and kind in (None, one.type)]


def references(part):
    """[(data path, data-block)] of a part's references."""
    found = [(path, part.path_resolve(path)) for path in paths_of(part, "POINTER")]
    return [(path, value) for path, value in found if isinstance(value, bpy.types.ID)]


def put_at(item, path, value):
    """Sets the property, or the custom property, at a data path."""
    owner, _, name = path.rpartition("[" if path.endswith("]") else ".")
    owner = item.path_resolve(owner) if owner else item
    if path.endswith("]"):
        owner[name[1:-2]] = value
    else:
        setattr(owner, name, value)


def remap(parts, twins):
    """Replaces references of a copy's parts by `twins`, {data-block: its counterpart}."""
    for part in parts:
        for path, value in references(part):
            if twins.get(value) is not None:
                if isinstance(part, bpy.types.DriverTarget):
                    copy_property(value, twins[value], part.data_path)
                put_at(part, path, twins[value])


def copy_property(given, there, path):
    """Copies a custom property that a driver reads to a counterpart that lacks it."""
    name = bpy.utils.unescape_identifier(path[2:-2]) if path.startswith('["') else ""
    if name in given and name not in there:
        there[name] = given[name]
        there.id_properties_ui(name).update_from(given.id_properties_ui(name))


def copy_modifiers(item, given):
    """Replaces an object's modifiers by copies of these, of another object; returns the names of those that
    are not whole, as scripts can copy neither what is bound nor combed hair."""
    item.modifiers.clear()
    partial = []
    for one in given:
        made = item.modifiers.new(one.name, one.type)
        # Blender 5.2 puts new hooks first.
        item.modifiers.move(item.modifiers.find(made.name), len(item.modifiers) - 1)
        copy_properties(one, made)
        if one.type == "HOOK" and len(one.vertex_indices):
            made.vertex_indices_set(list(one.vertex_indices))
        if one.type == "PARTICLE_SYSTEM":
            own = made.particle_system.settings
            copy_properties(one.particle_system, made.particle_system)  # the settings are shared
            if own.users == 0:
                bpy.data.particles.remove(own)
        bound = any(getattr(one, name, False) for name in ("is_bound", "is_bind"))
        if bound or (one.type == "PARTICLE_SYSTEM" and one.particle_system.is_edited):
            partial.append(one.name)
    return partial


def copy_properties(given, made):
    """Copies the writable properties of a modifier, and of its groups of settings."""
    for path in paths_of(given):
        with contextlib.suppress(TypeError):  # an enum without items, whose value is ""
            put_at(made, path, given.path_resolve(path))
    for one in given.bl_rna.properties:
        if one.type == "POINTER" and one.is_readonly and one.identifier.endswith("settings"):
            group, own = getattr(given, one.identifier), getattr(made, one.identifier)
            if group is not None and own is not None:
                copy_properties(group, own)


# Removes objects and modifiers of the extension with the data-blocks that become unused.


def remove_mesh_object(item):
    """Removes the object, its mesh, and the action of the mesh's shape keys."""
    mesh = item.data
    keys = mesh.shape_keys
    action = keys.animation_data.action if keys is not None and keys.animation_data else None
    bpy.data.objects.remove(item)
    if mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)


def remove_modifier(modifier):
    """Removes a modifier; clears its inputs first: Blender 5.2 would keep their data-blocks' users."""
    for path, _ in references(modifier):
        if path.startswith("properties."):
            put_at(modifier, path, None)
    modifier.id_data.modifiers.remove(modifier)


def remove_node_modifier(modifier):
    """Removes a Geometry Nodes modifier, and its node group if that is unused then."""
    group = modifier.node_group
    remove_modifier(modifier)
    remove_unused_group(group)


def remove_unused_group(group):
    if group.users == 0 and not keeps_unused:
        bpy.data.node_groups.remove(group)
