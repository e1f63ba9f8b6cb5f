# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps carried objects in place while a wrap fits the bones that they are parented to."""

import contextlib

from ..blender.evaluation import depsgraph_of
from ..blender.object_references import settings_of
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import inverse
from . import refusals
from .carried_objects import CarriedObject, find
from .rest_bones import above_field
from .world_matrices import hangs_on, world_matrices


def follow(context, source, shapes, fit):
    """Calls `fit`, which moves rest bones of the source's armatures, and keeps the objects of `shapes`,
    [(CarriedObject, shape that its carrier wrote)], in place."""
    under = above_field(source)
    found = [(carried, shape, carried.reference.find()) for carried, shape in shapes]
    found = [one for one in found if one[2] is not None and hangs_on(one[2], under)]

    def places():
        depsgraph = depsgraph_of(context)
        return [world_matrices(item, (), depsgraph, under=under) for *_, item in found]

    before = places()
    fit()
    context.view_layer.update()
    for (carried, shape, item), was, now in zip(found, before, places(), strict=True):
        own, parent = inverse(now.now) @ was.now, inverse(now.parent) @ was.parent
        with contextlib.suppress(UserError):  # reported when it was written first
            carried.carrier.write(item, find(source, item), carried.carrier.rebased(shape, own, parent))


def present(context, source):
    """[(CarriedObject, its present shape)] for `follow`, without warnings."""
    found = []
    for entry in settings_of(source).carried:
        with contextlib.suppress(UserError, ValueError):
            refuse(refusals.of_entry(source, entry))
            carried = CarriedObject(context, entry)
            shape = carried.carrier.present(entry.item, entry)
            found += [] if shape is None else [(carried, shape)]
    return found
