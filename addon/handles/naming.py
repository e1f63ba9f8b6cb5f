# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and colours of handles."""

import re

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError

# Names of handles, by the vertex group that they hold, such as "head", else "Handle 3".

RIG_PREFIX = re.compile(r"^(DEF|ORG|MCH)-")  # prefixes of bones in generated rigs
BLENDERS_OWN = re.compile(r"(\.\d{3,})?$")  # suffix that Blender appends to a used name


def name_for(obj, point_world, kind) -> str:
    """A name for a handle of `obj` at a point: its strongest vertex group there, else its kind and a number.

    `obj` is the mesh object, `point_world` (3,) in world space, `kind` CUBE, POINT, GROUP or PIN.
    """
    group = group_at(obj, point_world) if obj.vertex_groups else ""
    return name_of_group(group) or numbered(obj, kind)


def name_of_group(group):
    """A vertex group's name without a rig's prefix."""
    return RIG_PREFIX.sub("", group)


def group_at(obj, point_world):
    """The vertex group with the largest weight at the vertex nearest to a world location; "" for none."""
    try:
        with modifier_stack.evaluated_mesh(bpy.context, obj, settings_of(obj).in_place) as mesh:
            index = nearest(mesh, obj, point_world)
            weights = [] if index is None else [(e.weight, e.group) for e in mesh.vertices[index].groups]
    except UserError:  # no mesh to read
        return ""
    weights = [entry for entry in weights if entry[0] > 0]
    return obj.vertex_groups[max(weights)[1]].name if weights else ""


def nearest(mesh, obj, point_world):
    """Index of the vertex nearest to a world location; None without vertices."""
    points = mesh_arrays.positions(mesh)
    if not len(points):
        return None
    matrix = np.array(obj.matrix_world, dtype=np.float64)
    return int(np.linalg.norm(points @ matrix[:3, :3].T + matrix[:3, 3] - point_world, axis=1).argmin())


def numbered(obj, kind):
    """ "Handle 3" for the third handle of the object, or the next number that no object has."""
    word = translated("Pin") if kind == "PIN" else translated("Handle")
    number = len(settings_of(obj).handles) + 1
    while f"{word} {number}" in bpy.data.objects:
        number += 1
    return f"{word} {number}"


def is_blenders_own(empty):
    """Whether Blender named an Empty, rather than the user."""
    plain = BLENDERS_OWN.sub("", empty.name)
    return plain in ("Empty", bpy.app.translations.pgettext_data("Empty"))


# Colours of handles: distinct from each other, from a grey viewport and from Blender's selection orange.

PALETTE = [
    *((0.27, 0.55, 1.0), (1.0, 0.42, 0.30), (0.35, 0.80, 0.40), (0.85, 0.45, 0.90), (1.0, 0.80, 0.25)),
    *((0.62, 0.92, 1.0), (0.55, 0.10, 1.0), (0.77, 0.18, 0.48), (0.62, 1.0, 0.10), (1.0, 0.70, 0.92)),
    *((0.48, 0.48, 0.25), (0.10, 0.77, 0.85), (0.10, 0.62, 0.10), (0.70, 0.62, 0.18), (0.48, 0.40, 0.62)),
    *((0.10, 1.0, 0.77), (1.0, 0.10, 0.70), (0.10, 0.55, 0.62)),
]


def free_colour(handles):
    """The colour that the fewest of these handles have."""
    counts = [sum(is_colour(entry.colour, colour) for entry in handles) for colour in PALETTE]
    return PALETTE[counts.index(min(counts))]


def is_colour(one, other):
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) < 1e-3
