# SPDX-License-Identifier: GPL-3.0-or-later
"""Results: objects made for them, where they go, which is seen, and how the last is taken off."""

import contextlib
import json
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import is_driven, key_at, with_ancestors
from ..blender.language import translated
from ..blender.object_references import in_scene, results_of, settings_of
from ..blender.property_definitions import effective_value
from ..blender.references import remove_mesh_object, takes_references
from ..blender.splat_layouts import holds_splats
from ..carried import carrying, rest_bones
from ..core.errors import UserError, refuse
from ..core.geometry.edges import Topology
from ..core.geometry.spaces import space_of
from ..field_modifier import field_nodes, layers, motion
from ..handles import empties
from ..handles.held_counts import Followers
from ..names import REPORT, RESULT_SUFFIX, RESULTS, WARP_KEY

# Result objects: made once for a source and kind, updated in place by later runs.


def collection(context):
    """The scene's collection for results; each scene has its own."""
    for child in context.scene.collection.children:
        if child.name.split(".")[0] == RESULTS and child.library is None:
            return child
    home = bpy.data.collections.new(RESULTS)
    context.scene.collection.children.link(home)
    return home


def discard(item):
    """Removes a result object with its mesh, its keys' action, and its collection if that is empty."""
    homes = list(item.users_collection)
    remove_mesh_object(item)
    for home in homes:
        if home.name.split(".")[0] == RESULTS and not home.all_objects and not home.children:
            bpy.data.collections.remove(home)


def existing(context, source, kind, output):
    """The result object of an earlier run, if it can be written to; else None."""
    for entry in results_of(source):
        item = entry.item
        if entry.kind == kind and entry.output == output:
            if item.mode == "EDIT" or item.library or context.scene.objects.get(item.name) != item:
                continue
            return item
    return None


def register(source, kind, output, item):
    """Notes a result in its source's list; that of a linked source is an object of its own."""
    if not takes_references(source):
        return
    settings_of(item).made_from = source.name
    entries = settings_of(source).results
    earlier = (entry for entry in entries if entry.kind == kind and entry.output == output)
    entry = next(earlier, None) or entries.add()
    entry.kind, entry.output, entry.item = kind, output, item


def show(context, source, kind, output, mesh, report, select=True):
    """Gives the mesh to the source's result object of that kind, with the source's transform."""
    item = existing(context, source, kind, output)
    mesh.name = f"{source.name}{RESULT_SUFFIX[kind]}"
    if item is None:
        item = bpy.data.objects.new(f"{source.name}{RESULT_SUFFIX[kind]}", mesh)
        collection(context).objects.link(item)
        look_like(source, item)
    else:
        old, item.data = item.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    register(source, kind, output, item)
    place(context, source, item)
    item[REPORT] = json.dumps(report)
    if select and context.view_layer.objects.active == source:
        select_only(context, item)
    return item


SEEN_BY = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
LOOKS = ("color", "pass_index", "is_shadow_catcher", "is_holdout", *(f"visible_{ray}" for ray in SEEN_BY))


def look_like(source, item):
    """Copies the source's object-level look to a new result: material slots, ray visibility."""
    for given, slot in zip(source.material_slots, item.material_slots, strict=False):
        if given.link == "OBJECT":
            slot.link, slot.material = "OBJECT", given.material
    for name in LOOKS:
        setattr(item, name, getattr(source, name))


CHANNELS = ("rotation_mode", "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle")
CHANNELS += ("scale", "delta_location", "delta_rotation_euler", "delta_rotation_quaternion", "delta_scale")


def place(context, source, item):
    """Gives a result its source's transform: the same parent and the same channels.

    A world matrix alone would lose the shear of non-uniformly scaled parents. It is used only if
    constraints or the like move the source beyond its channels.
    """
    item.parent, item.parent_type, item.parent_bone = source.parent, source.parent_type, source.parent_bone
    if source.parent_type in ("VERTEX", "VERTEX_3"):
        item.parent_vertices = source.parent_vertices
    item.matrix_parent_inverse = source.matrix_parent_inverse
    for channel in CHANNELS:
        setattr(item, channel, getattr(source, channel))
    context.view_layer.update()
    if not np.allclose(item.matrix_world, source.matrix_world, rtol=1e-6, atol=1e-6):
        item.parent = None
        item.matrix_world = source.matrix_world.copy()
        context.view_layer.update()


def select_only(context, item):
    if context.mode != "OBJECT" or context.view_layer.objects.get(item.name) != item:
        return
    for other in context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    context.view_layer.objects.active = item


def surface_mesh(source, vertices, topology):
    """A mesh of the implicit surface, in local coordinates, with the source's materials."""
    mesh = mesh_arrays.new_mesh(source.name, vertices, topology)
    for material in source.data.materials:
        mesh.materials.append(material)
    if settings_of(source).normals == "FLAT":
        mesh.shade_flat()
    return mesh


def warp_mesh(context, source, before, after):
    """A copy of the source's mesh with its vertices moved from `before` to `after`, (n, 3) each.

    All other data are kept. If modifiers change the vertices, the evaluated mesh is copied.
    """
    copied = source.data.copy()
    if keeps_vertices(source) and len(copied.vertices) == len(before):
        motion.write_to(copied, motion.Motion(None))
        if copied.shape_keys is None:
            mesh_arrays.set_positions(copied, after)
        return copied
    bpy.data.meshes.remove(copied)
    applied = shown_mesh(context, source, len(after))
    mesh_arrays.set_positions(applied, after)
    return applied


def shown_mesh(context, source, count, in_place=False):
    """A new mesh with the source's shape keys and modifiers applied: all, or with `in_place` those before the
    field's modifier."""
    applied = modifier_stack.mesh_copy(context, source, in_place)
    if len(applied.vertices) != count:
        bpy.data.meshes.remove(applied)
        raise UserError("{name} changed while it was worked on; run again", source)
    return applied


def add_frame(item, frames, number, shape):
    """Adds a shape key for a frame, keyframed with 1 at it and 0 at the frames beside it."""
    if number == 0:
        item.shape_key_add(name="Basis", from_mix=False)
    key = item.shape_key_add(name=f"frame {frames[number]}", from_mix=False)
    mesh_arrays.put_vectors(key.data, shape, "co")
    for frame in frames[max(0, number - 1) : number + 2]:
        key.value = float(frame == frames[number])
        key_at(key, "value", frame)


def keeps_vertices(source, in_place=False):
    """Whether the shape to solve has the vertices of the object's own mesh: no modifier acts on it, except
    the field's lower layers with `in_place`."""
    keys = source.data.shape_keys
    usable = keys is None or (keys.use_relative and not source.show_only_shape_key)
    before = modifier_stack.shown_before(source, in_place)
    return usable and all(in_place and modifier_stack.is_layer(modifier) for modifier in before)


def add_warp_key(item, before, after):
    """Adds the motion as a shape key to a mesh with keys: all other keys and values stay."""
    keys = item.data.shape_keys
    old = keys.key_blocks.get(WARP_KEY)
    if old is not None:
        item.shape_key_remove(old)
    key = item.shape_key_add(name=WARP_KEY, from_mix=False)
    basis = mesh_arrays.vectors(key.relative_key.data, "co")
    mesh_arrays.put_vectors(key.data, basis + (after - before), "co")
    key.value = 1.0
    item.data.update()


# Where results go, which of a source and its results is seen, and how the last is taken off.

# Shows only the newest of a source and its result objects in one place, and hides the others.


def source_and_results(source):
    """The source, and its result objects that are in a scene."""
    results = [entry.item for entry in results_of(source) if in_scene(entry.item)]
    return [source, *(item for item in results if item != source)]


def show_alone(source, shown, for_now=False):
    """Hides the rest of the family in the same place as `shown` in viewports and renders, and unhides `shown`
    if it was set aside; `for_now`: until `give_back`. Returns the names of hidden objects.

    If the user hides `shown`, or its collection, nothing else changes.
    """
    if settings_of(shown).set_aside:
        set_aside(shown, False, for_now)
    if shown != source and not shown.visible_get():
        return [shown.name]
    names = []
    for item in source_and_results(source):
        seen = not (item.hide_render and item.hide_get())
        if item != shown and seen and (item == source or is_where(shown, item)):
            names.append(item.name)
            set_aside(item, True, for_now)
    return names


def hidden_note(names):
    """Text that names hidden objects, to append to a result's name; empty without any."""
    if not names:
        return ""
    one = translated("{name} is hidden", name=names[0])
    return f" ({translated('{names} are hidden', names=', '.join(names)) if names[1:] else one})"


def is_where(shown, item):
    return np.allclose(item.matrix_world, shown.matrix_world, rtol=1e-5, atol=1e-5)


def set_aside(item, aside, for_now):
    settings = settings_of(item)
    if for_now and not settings.live_hidden:
        settings.live_hidden = json.dumps([item.hide_get(), item.hide_render, settings.set_aside])
    settings.set_aside = aside
    set_hidden(item, aside, aside)


def set_hidden(item, hidden, hidden_in_renders):
    item.hide_render = hidden_in_renders
    with contextlib.suppress(RuntimeError):  # in a collection that the view layer leaves out
        item.hide_set(hidden)


def give_back(source):
    """Restores the family's visibility from before `for_now`."""
    for item in source_and_results(source):
        settings = settings_of(item)
        if settings.live_hidden:
            hidden, hidden_in_renders, settings.set_aside = json.loads(settings.live_hidden)
            set_hidden(item, hidden, hidden_in_renders)
            settings.live_hidden = ""


def show_landmarks(source, shown):
    """Shows or hides the landmarks of a source's wrap in viewports; those elsewhere stay as they are."""
    for entry in settings_of(source).wrap.landmarks:
        for item in (entry.rest, entry.on_target):
            if item is not None:
                with contextlib.suppress(RuntimeError):  # in a collection that the view layer leaves out
                    item.hide_set(not shown)


def keep_visibility(source):
    """Makes visibility set `for_now` permanent."""
    for item in source_and_results(source):
        settings_of(item).live_hidden = ""


# Takes the last result off its source.


def take_off(context, source):
    """Removes the modifier of the last result with its motion; the result below it is the last one then.
    Returns an error of bones that cannot be put back, or None."""
    reason = None
    layers.uncover(source, baked=True)
    followers = Followers(context, source) if settings_of(source).moved_by == "WRAP" else None
    try:
        if not modifier_stack.layers(source):
            rest_bones.reset(context, source)
    except UserError as error:
        reason = error
    motion.remove(source)
    layers.uncover(source)
    carrying.give_back_all(source)
    field_nodes.clear(source)
    if followers is not None:
        followers.follow(context, source, back=True)
        show_landmarks(source, True)
    return reason


# Places a solve's result: in the modifier, a new object, the mesh itself, or a shape key.


@dataclass
class SolvedMesh:
    """Result of a solve on the worker, in local coordinates."""

    vertices: np.ndarray
    topology: Topology | None  # of the implicit surface; None for the source's own mesh
    report: dict
    turns: np.ndarray | None = None  # (n, 3) rotation vectors (axis · angle), for free custom normals
    changes: dict | None = None  # the splats' changed attributes
    carried: list = field(default_factory=list)  # [(CarriedObject, shape)] by Carrying.moved
    place: np.ndarray | None = None  # (4, 4) new world matrix of the object, if it is moved


def destination(settings, operator):
    """(output, result) of an operator call; `target` is the earlier name of `result`."""
    given = operator.properties.is_property_set
    name = "target" if given("target") and not given("result") else "result"
    output = effective_value("output", settings, operator)
    return output, effective_result(output, effective_value(name, settings, operator))


def placement_refusal(source):
    """UserError that says why the result of the object's settings cannot be placed; else None."""
    settings = settings_of(source)
    return refusal(source, settings.output, effective_result(settings.output, settings.result))


def replaced_by(source, kind):
    """UserError that says which result a run of that kind replaces; else None."""
    is_lost = settings_of(source).live_kind != kind and settings_of(source).result != "NEW"
    return layers.replaced(source, kind) if is_lost else None


def effective_result(output, result):
    """`result`, but NEW for implicit surfaces, which the modifier cannot make of the mesh."""
    return "NEW" if result == "MODIFIER" and output != "WARP" else result


def keeps_mesh(output, result):
    """Whether the result is the source's modifier, which leaves its mesh as it is."""
    return output == "WARP" and result == "MODIFIER"


def in_place(output, result):
    """Whether a solve reads the mesh at the modifier's place in the stack, not after all modifiers."""
    return output == "WARP" and result != "NEW"


def place_result(context, source, kind, output, result, moved, before):
    """Places `moved`, a SolvedMesh, by `result`; `before`: (n, 3) vertices at rest."""
    if result == "NEW":
        return new_object(context, source, kind, output, moved, before)
    refuse(refusal(source, output, result))
    if keeps_mesh(output, result):
        motion.bind(context, source, len(before))
        motion.write(source, motion.Motion(moved.vertices - before, moved.turns, moved.changes))
        layers.note(source, kind)
        source[REPORT] = json.dumps(moved.report)
        return source
    if moved.topology is None and len(source.data.vertices) != len(before):
        raise UserError("{name} changed while it was worked on; run again", source)
    if moved.topology is not None:
        mesh = surface_mesh(source, moved.vertices, moved.topology)
        old, source.data = source.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    elif result == "KEY" or source.data.shape_keys is not None:
        single_user(source)
        if source.data.shape_keys is None:
            source.shape_key_add(name="Basis", from_mix=False)
        add_warp_key(source, before, moved.vertices)
    else:
        single_user(source)
        mesh_arrays.set_positions(source.data, moved.vertices)
    motion.silence_armatures(source)
    motion.discard(source)  # the mesh contains its motion now
    if source.data.shape_keys is None:
        layers.discard(source)
    layers.uncover(source)
    source[REPORT] = json.dumps(moved.report)
    if result == "REPLACE":
        for entry in empties.used(source):
            empties.store_rest(source, entry)
    return source


def holds_place(source, target):
    """Whether the source's transform must stay: because animation, constraints, handles, armatures or a
    sheared parent depend on it, or the target of its wrap is its child."""
    bound = is_driven(source) or settings_of(source).carried or empties.used(source)
    posed = any(modifier.type == "ARMATURE" for modifier in source.modifiers)
    parent = source.parent
    sheared = parent is not None and not np.array_equal(
        space_of(parent.matrix_world).local_to_solve, np.eye(4)
    )
    return bool(bound or posed or sheared or source in with_ancestors(target))


def put(context, item, place):
    """Sets an object's world matrix to (4, 4) `place`, even if the object was moved meanwhile."""
    item.matrix_world = Matrix(place.tolist())
    context.view_layer.update()


def new_object(context, source, kind, output, moved, before):
    if moved.topology is not None:
        mesh = surface_mesh(source, moved.vertices, moved.topology)
    else:
        mesh = warp_mesh(context, source, before, moved.vertices)
    item = show(context, source, kind, output, mesh, moved.report)
    if mesh.shape_keys is not None:
        add_warp_key(item, before, moved.vertices)
    return item


def refusal(source, output, result):
    """UserError that says why the source itself cannot take the result; else None."""
    if not keeps_mesh(output, result) and holds_splats(source):
        return UserError(
            "{name} holds splats; choose Original Mesh as geometry, Modifier for the result", source
        )
    if result == "NEW":
        return None
    if keeps_mesh(output, result):
        reason = motion.refusal(source)
    elif source.library is not None or source.data.library is not None:
        reason = UserError("{name} is linked from another file; choose New Object for the result", source)
    else:
        reason = None
    if reason is None and result == "REPLACE" and settings_of(source).carried:
        reason = UserError("{name} carries other objects; choose Modifier for the result", source)
    if reason is None and output != "WARP" and result == "KEY":
        reason = UserError("A shape key keeps the mesh; choose Original Mesh as its geometry")
    if reason is None and output == "WARP" and not keeps_mesh(output, result):
        reason = refusal_of_stack(source)
    return reason


def refusal_of_stack(source):
    """UserError that says why the mesh itself cannot take moved vertices; else None."""
    if keeps_vertices(source, in_place=True):
        return None
    before = modifier_stack.shown_before(source, in_place=True)
    names = [modifier.name for modifier in before if not modifier_stack.is_layer(modifier)]
    if not names:
        return UserError("{name} shows one shape key alone, or absolute ones; choose Modifier", source)
    return UserError(
        "{name} has modifiers that change its vertices before ({modifiers}); apply them, "
        "or choose Modifier for the result",
        source,
        modifiers=", ".join(names),
    )


def single_user(source):
    """Makes the source's mesh single-user, so that other objects keep theirs."""
    if source.data.users > 1:
        source.data = source.data.copy()
