# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that the cache that an object plays exists and still fits it."""

import json
from pathlib import Path

import bpy

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..core.errors import UserError
from ..core.runtime import native


def cache_of(source):
    """The path of the cache that the object plays; None if it plays none."""
    modifier = modifier_stack.find_cache(source)
    return None if modifier is None else Path(bpy.path.abspath(modifier.filepath, library=source.library))


def record_of(source):
    """The record of the object's bake, parsed from JSON; {} if it is missing or invalid."""
    try:
        record = json.loads(settings_of(source).bake.record or "{}")
    except ValueError:
        return {}
    return record if isinstance(record, dict) else {}


def problem(source, look_closely=False):
    """UserError that says why the object's bake cannot be played or is of another mesh; else None.

    `look_closely`: also reads the mesh and the cache's header.
    """
    path, record = cache_of(source), record_of(source)
    if path is None:
        return None
    if not path.is_file():
        return UserError(
            "{name}: its bake {path} is not there; choose the file in its modifier, or bake again",
            source,
            path=path,
        )
    if record.get("count") not in (None, len(points_of(source.data))):
        return changed(source)
    return closely(source, path, record) if look_closely else None


def closely(source, path, record):
    from_mesh, faces = mesh_arrays.fingerprint(source.data)
    if record.get("mesh") not in (None, from_mesh.hex()) or record.get("faces") not in (None, faces):
        return changed(source)
    native.library()
    from arapfields.point_cache import PointCacheReader

    try:
        with PointCacheReader(path) as cache:
            points = cache.points
    except (ValueError, OSError) as error:
        return UserError("{name}: {error}", source, error=error)
    if record.get("points") not in (None, points):
        return UserError(
            "{name}: {path} holds {found} points; its bake had {count}",
            source,
            path=path,
            found=points,
            count=record["points"],
        )
    return None


def changed(source):
    return UserError("{name}: its mesh changed since the bake; bake again", source)
