# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness as the library takes it: factors of the vertices."""

import numpy as np

from ..blender import vertex_groups
from ..blender.object_references import settings_of
from ..core.errors import refuse
from ..core.runtime.coroutines import run_to_completion

# name, label, tip: (times as stiff, times as stiff against bending)
PRESETS = {
    "SKIN": ("Skin", "Gives way: half as stiff, and easily bent", (0.5, 0.2)),
    "RUBBER": ("Rubber", "Stretches, and bends as the rest", (0.1, 10.0)),
    "WOOD": ("Wood", "Neither stretches nor bends", (1000.0, 1.0)),
}


def refusal(source):
    """Why the groups cannot be read, as a UserError; None where they can."""
    mask = settings_of(source).stiffness.mask
    return vertex_groups.missing(source, [*names(source), *filter(None, [mask])])


def names(source):
    return [group for group, times in pairs(source) if group and times != 1.0]


def pairs(source):
    """(group, times as stiff), and the same against bending."""
    settings = settings_of(source).stiffness
    return (settings.group, settings.times), (settings.bend_group, settings.bend_times)


def read(context, source, in_place):
    """((n,) factors of the vertices' stiffness, (n,) of that against bending); None each where all are 1."""
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
    """From 1 where the weight is 0 to `times` where it is 1, evenly in proportion."""
    return np.power(float(times), np.asarray(weights, dtype=np.float64))


def same(a, b):
    return all(
        (one is None) == (other is None) and (one is None or np.array_equal(one, other))
        for one, other in zip(a, b, strict=True)
    )
