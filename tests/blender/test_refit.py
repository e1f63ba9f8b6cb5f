# SPDX-License-Identifier: GPL-3.0-or-later
"""Garments of one body refitted to another, whose twins are known: both bodies are one shape, mapped."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.character import link
    from support.geometry.characters import Capsules

    import arapfields as af
    from addon.blender import mesh_arrays
    from addon.handles.empties import matrix_of
    from addon.wrap import landmarks

pytestmark = pytest.mark.in_blender

PARTS = [
    ((0, 0, 0.75), (0, 0, 1.25), 0.17),
    ((0, 0, 1.3), (0, 0, 1.55), 0.11),
    *(((side * 0.1, 0, 0.1), (side * 0.09, 0, 0.8), 0.08) for side in (-1, 1)),
    *(((side * 0.15, 0, 1.2), (side * 0.65, 0, 1.15), 0.055) for side in (-1, 1)),
]
AWAY, GAP = 0.02, 0.002  # of garments from the skin; least
CLOSE = 0.03  # of the body's size


def mapped(points):
    """The other body's place of a point of the first: wider, longer, leaning."""
    x, y, z = np.asarray(points, float).T
    return np.column_stack([1.15 * x * (1 + 0.1 * z), 1.3 * y + 0.05 * z * z, 1.12 * z])


def surface(offset=0.0):
    parts = [(start, end, radius + offset) for start, end, radius in PARTS]
    return af.extract_surface(Capsules(parts, af.Frame([0, 0, 0.85], 1.0)), resolution=64)[:2]


def mesh_object(name, vertices, triangles):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices).tolist(), [], np.asarray(triangles).tolist())
    return link(name, mesh)


def garment(name, inside):
    """(object, its vertices) of the offset surface where `inside` holds, with weights, a key, a material."""
    vertices, triangles = surface(AWAY)
    triangles = triangles[inside(vertices)[triangles].all(axis=1)]
    used, flat = np.unique(triangles, return_inverse=True)
    vertices = vertices[used]
    item = mesh_object(name, vertices, flat.reshape(-1, 3))
    item.data.materials.append(bpy.data.materials.new(f"{name} Cloth"))
    group = item.vertex_groups.new(name="Upper")
    for index, height in enumerate(vertices[:, 2]):
        group.add([index], float(np.clip(height, 0, 1)), "REPLACE")
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="Long")
    mesh_arrays.put_vectors(key.data, longer(vertices), "co")
    return item, vertices


def longer(vertices):
    low = vertices[:, 2].min()
    return vertices - np.column_stack(
        [*np.zeros((2, len(vertices))), 0.1 * np.exp(-8 * (vertices[:, 2] - low))]
    )


def scene():
    """(body, other, {name: (garment, vertices)})"""
    vertices, triangles = surface()
    body = mesh_object("Ada", vertices, triangles)
    other = mesh_object(
        "Bea", mapped(vertices), triangles[np.random.default_rng(0).permutation(len(triangles))]
    )
    other.location = (2.0, 0.5, 0.0)
    bpy.context.view_layer.update()
    body.arapfields.wrap.onto, body.arapfields.wrap.samples = other, 4000
    for place in (
        [0, 0, 1.66],
        [0.7, 0, 1.15],
        [-0.7, 0, 1.15],
        [0.1, 0, 0.02],
        [-0.1, 0, 0.02],
        [0, -0.17, 1.0],
    ):
        nearest = vertices[((vertices - place) ** 2).sum(axis=1).argmin()]
        landmarks.add(
            bpy.context, body, other, (nearest, mapped(nearest[None])[0] + np.array(other.location))
        )
    worn = {
        "Shirt": lambda p: (p[:, 2] > 0.85) & (p[:, 2] < 1.3) & (np.abs(p[:, 0]) < 0.4),
        "Trousers": lambda p: (p[:, 2] > 0.15) & (p[:, 2] < 0.9),
        "Cap": lambda p: p[:, 2] > 1.5,
    }
    return body, other, {name: garment(name, inside) for name, inside in worn.items()}


def points_of(block):
    return mesh_arrays.vectors(block.data, "co").astype(float)


def inside(other, copied):
    solid = af.MeshSdf(scenes.world_points(other), mesh_arrays.triangles(other.data))
    return solid(scenes.world_points(copied))


def test_garments_fit_the_other_body_as_their_known_twins_do(tmp_path):
    body, other, worn = scene()
    field = tmp_path / "Ada to Bea.safetensors"
    scenes.activate(*(worn[name][0] for name in ("Shirt", "Trousers")), body)
    assert bpy.ops.arapfields.refit(gap=GAP, field=str(field)) == {"FINISHED"}
    assert field.exists()
    written = field.read_bytes()
    scenes.activate(worn["Cap"][0], body)
    assert bpy.ops.arapfields.refit(gap=GAP, field=str(field)) == {"FINISHED"}
    assert field.read_bytes() == written
    size = np.linalg.norm(np.ptp(scenes.world_points(other), axis=0))
    for name, (item, vertices) in worn.items():
        copied = bpy.data.objects[f"{name} Bea"]
        assert inside(other, copied).min() > 0.99 * GAP, name
        twin = mapped(vertices) + np.array(other.location)
        off = np.linalg.norm(scenes.world_points(copied) - twin, axis=1)
        assert off.mean() < CLOSE * size and np.percentile(off, 99) < 2 * CLOSE * size, (
            name,
            off.mean() / size,
        )
        keys = copied.data.shape_keys.key_blocks
        assert [key.name for key in keys] == ["Basis", "Long"]
        way = (points_of(keys[1]) - points_of(keys[0])) @ np.array(matrix_of(copied))[:3, :3].T
        wanted = mapped(longer(vertices)) - mapped(vertices)
        assert np.abs(way - wanted).max() < CLOSE * size
        assert np.linalg.norm(way - wanted) < 0.2 * np.linalg.norm(wanted), name
        assert [group.name for group in copied.vertex_groups] == ["Upper"]
        given, got = ([one.groups[0].weight for one in data.vertices] for data in (item.data, copied.data))
        assert given == got and copied.data.materials[0] == item.data.materials[0]
        assert copied.parent == other and copied.data != item.data
        assert np.abs(scenes.world_points(item) - vertices).max() < 1e-6


def test_a_second_run_moves_the_first_ones_copies_and_another_field_is_refused(tmp_path):
    body, other, worn = scene()
    shirt = worn["Shirt"][0]
    given = {"field": str(tmp_path / "a.safetensors")}
    for _ in range(2):
        scenes.activate(shirt, body)
        assert bpy.ops.arapfields.refit(**given) == {"FINISHED"}
    assert sorted(one.name for one in bpy.data.objects if one.name.startswith("Shirt")) == [
        "Shirt",
        "Shirt Bea",
    ]
    other.location.x += 1.0
    scenes.activate(shirt, body)
    with pytest.raises(RuntimeError, match="is of other bodies"):
        bpy.ops.arapfields.refit(**given)
    scenes.activate(body)
    with pytest.raises(RuntimeError, match="Select the garments too"):
        bpy.ops.arapfields.refit()
    scenes.activate(shirt, body)
    with pytest.raises(RuntimeError, match="needs the extension"):
        bpy.ops.arapfields.refit(field=str(tmp_path / "a.txt"))
