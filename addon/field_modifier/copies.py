# SPDX-License-Identifier: GPL-3.0-or-later
"""Disables duplicates of the field's modifier in one stack, which would double the motion."""

from ..blender import modifier_stack
from ..blender.language import translated
from ..core.runtime import jobs


def switch_off(source):
    """Disables all but the first field modifier of an object."""
    for modifier in [m for m in source.modifiers if modifier_stack.is_field(m)][1:]:
        if modifier.show_viewport or modifier.show_render:
            modifier.show_viewport = modifier.show_render = False
            text = translated("{name} is a second copy and was switched off", name=modifier.name)
            jobs.add_message("WARNING", f"{source.name}: {text}")
