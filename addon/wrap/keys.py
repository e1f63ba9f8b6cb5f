# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers shape keys, with their values, to a target.

A wrap fits the evaluated shape, with its keys' values, to the target. On the target the same values would
move it a second time: one more key subtracts their motion, so that the target keeps its shape at them.
"""

import json

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.evaluation import updated
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..names import NEUTRAL_KEY


def of(source):
    """The keys to transfer: all but the Basis and NEUTRAL_KEY."""
    keys = source.data.shape_keys
    if keys is None:
        return []
    return [block for block in keys.key_blocks[1:] if block.name != NEUTRAL_KEY]


def refusal(source, target):
    """UserError that says why the keys of a source cannot be transferred; else None."""
    for item in (source, target):
        if item.data.shape_keys is not None and not item.data.shape_keys.use_relative:
            return UserError(
                "The shape keys of {name} are absolute; only relative ones can be transferred", item
            )
    if not modifier_stack.keeps_vertices(source):
        return UserError(
            "Modifiers of {name} change its vertices; apply them, or leave out Shape Keys", source
        )
    return None


def shown(source):
    """{name: value} of the keys that act in the evaluated shape."""
    blocks, values = of(source), {}
    if source.show_only_shape_key:
        block = source.active_shape_key
        while block in blocks and block.name not in values:
            values[block.name], block = 1.0, block.relative_key
        return values
    return {block.name: block.value for block in blocks if block.value and not block.mute}


def since_wrapped(source):
    """{name: value} of the keys at the time of the wrap; None if these have not changed."""
    kept = settings_of(source).wrap.shown_keys
    values = json.loads(kept) if kept else {}
    if not kept or values == shown(source):
        return None
    return {block.name: values.get(block.name, 0.0) for block in of(source)}


def shape_at(context, item, kept, values):
    """(n, 3) vertices of an object with the modifiers `kept` and the keys at `values`, {name: value}."""
    mesh = item.data.copy()
    try:
        with modifier_stack.staged(context, item, kept) as (copied, layer):
            copied.data, copied.show_only_shape_key = mesh, item.show_only_shape_key and not values
            if mesh.shape_keys is not None:
                mesh.shape_keys.animation_data_clear()
            for name, value in values.items():
                key = mesh.shape_keys.key_blocks[name]
                key.mute, key.value = False, value
            return mesh_arrays.positions(copied.evaluated_get(updated(layer)).data)
    finally:
        bpy.data.meshes.remove(mesh)


def offsets(source):
    """(k, n, 3) offsets of the keys, each from the key that it is relative to."""
    blocks = of(source)
    if not blocks:
        return np.empty((0, len(source.data.vertices), 3))
    points = {block: points_of(block) for block in source.data.shape_keys.key_blocks}
    basis = source.data.shape_keys.reference_key
    starts = [basis if is_in_circle(block) else block.relative_key for block in blocks]
    return np.array([points[block] - points[start] for block, start in zip(blocks, starts, strict=True)])


def carry(source, target, displacements):
    """Makes the source's keys on the target with these displacements (k, m, 3); returns their number."""
    blocks = of(source)
    if not blocks:
        return 0
    basis = source.data.shape_keys.reference_key
    if target.data.shape_keys is None:
        target.shape_key_add(name=basis.name, from_mix=False)
    from_basis = {block for block in blocks if is_in_circle(block)}
    carried = dict(zip(blocks, displacements, strict=True))
    made = {block: key_named(target, block.name) for block in blocks}
    made[basis] = target.data.shape_keys.reference_key
    start_of = {block: block.relative_key if block.relative_key in made else basis for block in blocks}
    locked = {block for block in blocks if made[block].lock_shape}
    shapes = {block: points_of(made[block]) for block in (basis, *locked)}

    def shape_of(block):
        """(m, 3) points of a key, recursively, as keys may be relative to other new ones."""
        if block not in shapes:
            start = basis if block in from_basis else start_of[block]
            shapes[block] = shape_of(start) + carried[block]
        return shapes[block]

    for block in [block for block in blocks if block not in locked]:
        key = made[block]
        mesh_arrays.put_vectors(key.data, shape_of(block), "co")
        key.relative_key = made[start_of[block]]
        for name in ("slider_min", "slider_max", "value", "mute", "vertex_group", "interpolation"):
            setattr(key, name, getattr(block, name))
    return len(blocks) - len(locked)


def is_in_circle(block):
    """Whether a key is relative to itself, directly or through other keys."""
    passed, start = set(), block.relative_key
    while start not in passed and start != block:
        passed.add(start)
        start = start.relative_key
    return start == block


def points_of(block):
    return mesh_arrays.vectors(block.data, "co").astype(float)


def key_named(target, name):
    return target.data.shape_keys.key_blocks.get(name) or target.shape_key_add(name=name, from_mix=False)


def take_back(source, target):
    """Makes the key that subtracts the values of the wrap; call it after the target has its vertex groups."""
    kept, keys = settings_of(source).wrap.shown_keys, target.data.shape_keys.key_blocks
    values = json.loads(kept) if kept else shown(source)
    moved = {keys[block.name]: values[block.name] for block in of(source) if values.get(block.name)}
    if not moved:
        if NEUTRAL_KEY in keys:
            target.shape_key_remove(keys[NEUTRAL_KEY])
        return
    masks = {key.vertex_group for key in moved} & set(target.vertex_groups.keys())
    indices = {name: target.vertex_groups[name].index for name in masks}
    weights = vertex_groups.weights_in(target.data, indices)
    shape, everywhere = points_of(keys[0]), np.ones(len(target.data.vertices))
    for key, value in moved.items():
        weight = value * weights.get(key.vertex_group, everywhere)
        shape -= weight[:, None] * (points_of(key) - points_of(key.relative_key))
    key = key_named(target, NEUTRAL_KEY)
    mesh_arrays.put_vectors(key.data, shape, "co")
    key.relative_key, key.value, key.mute = keys[0], 1.0, False
