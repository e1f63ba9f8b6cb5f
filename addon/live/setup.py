# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live solver is set up for; where that changes, it is set up anew."""

import bpy

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_values, from_single_precision
from ..core.settings.parameters import DEFORM
from ..core.settings.styles import STYLIZE
from ..handles import empties, movers
from . import body

# Options of the panels that weigh the terms of the live energy.
ENERGY = {"bending", "bending_unit", "barrier", "handle_weight", "symmetry", "rigidity", "keep_stance"}


def energy_weights(settings, kind):
    """The weights of the energy's terms by name, as the section that is live has them."""
    shown = DEFORM if kind == "DEFORM" else STYLIZE
    group = settings.deform if kind == "DEFORM" else settings.stylize
    weights = effective_values([option for option in shown if option.name in ENERGY], group)
    return weights | {"handle_weight": from_single_precision(settings.deform.handle_weight)}


def differ_in_handles(a, b):
    """Whether two layouts differ in handles alone, and the solver can take those of `a` as it stands."""
    return a[2:] == b[2:] and bool(a[0]) and not any(group for _, _, group, *_ in a[0])


def uses_handles(settings, kind):
    return kind == "DEFORM" or settings.stylize.use_handles


def layout_of(source, kind, scene):
    """What the solver was set up for: the handles and their rest regions, and what is shown. The energy's
    weights are not among it: they may be animated."""
    settings = settings_of(source)
    held = [
        (movers.key_of(e), e.kind, e.group, tuple(movers.asked_of(e).values()), tuple(e.rest))
        for e in empties.used(source)
    ]
    style = settings.stylize.region, settings.stylize.region_material
    stiff = settings.stiffness
    further = (settings.output, settings.target, settings.surface)
    further += (stiff.group, stiff.times, stiff.bend_group, stiff.bend_times)
    if kind == "STYLIZE":
        further += (*style, settings.stylize.use_handles)
    further += tuple((e.item.session_uid if e.item else 0, e.way) for e in settings.carried)
    used = uses_handles(settings, kind)
    further += (body.layout_of(source, scene),)
    return (held if used else [], used and empties.holds_far(source), further, stack_of(source))


def stack_of(source):
    """The modifiers before the field's, and where its offsets can lie."""
    kept = modifier_stack.before(source, in_place=True)
    shown = [(modifier.name, modifier.type, modifier.show_viewport) for modifier in kept]
    return shown, source.data.users > 1


def has_motion_before(source):
    """Whether the points at the field's place may move without an edit of the mesh."""
    return bool(modifier_stack.shown_before(source, in_place=True)) or source.data.shape_keys is not None


def moves(item, source):
    """Whether an update of this may move the points of the source before its field does."""
    if isinstance(item, bpy.types.Object):
        return item == source or (item.type != "EMPTY" or settings_of(item).handle_of != source)
    return isinstance(item, bpy.types.Key | bpy.types.Armature | bpy.types.Lattice | bpy.types.Curve)
