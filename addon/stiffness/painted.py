# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness as arguments of the library: a factor per vertex."""

import numpy as np

from ..blender import vertex_groups
from ..blender.object_references import settings_of
from ..core.errors import refuse
from ..core.runtime.jobs import run_to_completion

# {(identifier, label, tooltip): (factor of stretch stiffness, of bending stiffness)}
PRESETS = {
    "SKIN": ("Skin", "Gives way: half as stiff, and easily bent", (0.5, 0.2)),
    "RUBBER": ("Rubber", "Stretches, and bends as the rest", (0.1, 10.0)),
    "WOOD": ("Wood", "Neither stretches nor bends", (1000.0, 1.0)),
}


def refusal(source):
    """UserError that says why the groups cannot be read; else None."""
    mask = settings_of(source).stiffness.mask
    return vertex_groups.missing(source, [*names(source), *filter(None, [mask])])


def names(source):
    return [group for group, times in pairs(source) if group and times != 1.0]


def pairs(source):
    """[(vertex group, factor)] of stretch and of bending stiffness."""
    settings = settings_of(source).stiffness
    return (settings.group, settings.times), (settings.bend_group, settings.bend_times)


def read(context, source, in_place):
    """(n,) factors of stretch and of bending stiffness of the vertices; None instead of all ones."""
    refuse(refusal(source))
    return of_weights(
        source, run_to_completion(vertex_groups.read_weights(context, source, names(source), in_place))
    )


def of_weights(source, weights):
    """The same from {group: (n,) weights}."""
    return tuple(
        factors(weights[group], times) if group in weights and times != 1.0 else None
        for group, times in pairs(source)
    )


def factors(weights, times):
    """Factors interpolated geometrically by the weights, from 1 at weight 0 to `times` at weight 1."""
    return np.power(float(times), np.asarray(weights, dtype=np.float64))


def same(a, b):
    return all(
        (one is None) == (other is None) and (one is None or np.array_equal(one, other))
        for one, other in zip(a, b, strict=True)
    )
