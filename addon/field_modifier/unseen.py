# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks whether the user has disabled the field's modifier."""

from ..blender import modifier_stack
from ..blender.actions import has_keys
from ..core.errors import UserError
from . import inputs


def reasons(source):
    """[UserError] if the field's modifier is off or its Factor 0, and neither is animated."""
    modifier = modifier_stack.find(source)
    if modifier is None or (modifier.show_viewport and inputs.get(modifier, "Factor") != 0.0):
        return []
    path, data = f'modifiers["{modifier.name}"]', source.animation_data
    drivers = data.drivers if data is not None else ()
    if has_keys(source, path) or any(driver.data_path.startswith(path) for driver in drivers):
        return []
    return [
        UserError("The modifier {modifier} of {name} is off, or its Factor 0", source, modifier=modifier.name)
    ]
