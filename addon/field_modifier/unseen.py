# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks whether the user has disabled the field's modifier, or something does not follow it."""

from ..blender import modifier_stack
from ..blender.actions import varies
from ..core.errors import UserError
from . import inputs


def reasons(source):
    """[UserError] if the field's modifier is off or its Factor 0, and neither is animated; and if modifiers
    before it, such as hair, use the surface that is not moved yet."""
    modifier = modifier_stack.find(source)
    return [] if modifier is None else switched_off(source, modifier) + standing(source)


def standing(source):
    left = modifier_stack.left_behind(source)
    if not left:
        return []
    names = ", ".join(one.name for one in left)
    return [
        UserError(
            "{name}: {modifiers} stays where the surface was; move it behind the field's modifier",
            source,
            modifiers=names,
        )
    ]


def switched_off(source, modifier):
    if modifier.show_viewport and inputs.get(modifier, "Factor") != 0.0:
        return []
    if varies(source, f'modifiers["{modifier.name}"]'):
        return []
    return [
        UserError("The modifier {modifier} of {name} is off, or its Factor 0", source, modifier=modifier.name)
    ]
