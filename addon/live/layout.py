# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live session's solver is set up for; where that changes, it is set up anew."""

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..handles import empties, movers
from ..solver import secondary_motion
from ..solver.source_reader import uses_handles


def layout_of(source, kind, scene):
    """The handles and their rest regions, and what is shown. The energy's weights are not among it: they may
    be animated."""
    settings = settings_of(source)
    held = [
        (movers.key_of(e), e.kind, e.group, tuple(movers.user_settings(e).values()), tuple(e.rest))
        for e in empties.used(source)
    ]
    style, stiffness = settings.stylize, settings.stiffness
    further = (settings.output, settings.result, settings.surface)
    further += (stiffness.group, stiffness.times, stiffness.bend_group, stiffness.bend_times)
    if kind == "STYLIZE":
        further += (style.region, style.region_material, style.use_handles)
    further += tuple((e.item.session_uid if e.item else 0, e.way) for e in settings.carried)
    further += (secondary_motion.layout_of(source, scene),)
    used = uses_handles(settings, kind)
    return (held if used else [], used and empties.holds_far(source), further, stack_of(source))


def differ_in_handles(a, b):
    """Whether two layouts differ in handles alone, and the solver can take those of `a` as it stands."""
    return a[2:] == b[2:] and bool(a[0]) and not any(group for _, _, group, *_ in a[0])


def stack_of(source):
    """The modifiers before the field's, and where its offsets can lie."""
    before = modifier_stack.before(source, in_place=True)
    shown = [(modifier.name, modifier.type, modifier.show_viewport) for modifier in before]
    return shown, source.data.users > 1
