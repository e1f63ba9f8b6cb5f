# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles as the native solver takes them, with the samples that each holds."""

import numpy as np

from ..blender.vertex_groups import at_points
from ..core.geometry.handles import far_from, require_held

HELD = 0.5  # weight from which a vertex group's handle holds a sample


def native_handles(af, handles, rest, samples):
    """Native handles; UserError that names those without a sample. Runs on the worker.

    `handles` are core.geometry.handles.Handle, `rest` is the source's surface at rest.
    """
    counts, natives = {}, []
    for handle in handles:
        if handle.kind == "POINT":
            natives.append(af.Point(handle.rest[:3, 3], handle.target[:3, 3], weight=handle.weight))
        elif handle.kind == "GROUP":
            held = np.flatnonzero(at_points(rest.vertices, handle.weights, samples.points) >= HELD)
            counts[handle.name] = len(held)
            natives.append(region(af, handle, held))
        elif handle.kind == "PIN":
            natives.append(region(af, handle, handle.pinned(samples.points)))
        elif handle.kind == "FAR":
            natives.append(region(af, handle, far_from(handles, samples.points)))
        else:
            counts[handle.name] = int(handle.inside(samples.points).sum())
            natives.append(af.Cuboid(handle.rest, handle.target, weight=handle.weight))
    require_held(counts)
    return natives


def region(af, handle, held):
    return af.Region(held.tolist(), handle.rest, handle.target, weight=handle.weight)
