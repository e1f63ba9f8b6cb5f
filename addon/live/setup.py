# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live solver is set up for; where that changes, it is set up anew."""

import numpy as np

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..handles import empties, movers


def energy_weights(settings, kind):
    """The weights of the energy's terms by name, as the section that is live has them."""
    group = settings.deform if kind == "DEFORM" else settings.stylize
    weights = {"bending": group.bending, "barrier": group.barrier}
    weights["handle_weight"] = settings.deform.handle_weight
    if kind == "STYLIZE":
        weights["rigidity"], weights["keep_stance"] = group.rigidity, group.keep_stance
    weights = {name: from_single_precision(value) for name, value in weights.items()}
    return weights | {"bending_unit": group.bending_unit.lower()}


def differ_in_handles(a, b):
    """Whether two layouts differ in handles alone, and the solver can take those of `a` as it stands."""
    return a[2:] == b[2:] and bool(a[0]) and not any(group for _, _, group, *_ in a[0])


def uses_handles(settings, kind):
    return kind == "DEFORM" or settings.stylize.use_handles


def layout_of(source, kind):
    """What the solver was set up for: the handles and their rest regions, and what is shown."""
    settings = settings_of(source)
    held = [
        (movers.key_of(e), e.kind, e.group, e.weight, e.hold_from, tuple(e.rest))
        for e in empties.used(source)
    ]
    style = settings.stylize.region, settings.stylize.region_material
    further = (*energy_weights(settings, kind).items(), settings.output, settings.target, settings.surface)
    if kind == "STYLIZE":
        further += (*style, settings.stylize.use_handles)
    further += tuple((e.item.session_uid if e.item else 0, e.way) for e in settings.carried)
    used = uses_handles(settings, kind)
    return (held if used else [], used and empties.holds_far(source), further, stack_of(source))


def stack_of(source):
    """The modifiers before the field's, and where its offsets can lie."""
    kept = modifier_stack.before(source, in_place=True)
    shown = [(modifier.name, modifier.type, modifier.show_viewport) for modifier in kept]
    return shown, source.data.users > 1


def same(a, b):
    """Whether two requests ask for the same."""
    if (a[1] and a[1][0]) != (b[1] and b[1][0]) or len(a[4]) != len(b[4]):
        return False
    if not all(one.same(other) for one, other in zip(a[4], b[4], strict=True)):
        return False
    return (
        a[2] is b[2] and a[3] is b[3] and all(np.array_equal(x, y) for x, y in zip(a[0], b[0], strict=True))
    )
