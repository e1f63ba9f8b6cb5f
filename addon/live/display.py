# SPDX-License-Identifier: GPL-3.0-or-later
"""The display of a live session: the source's field modifier, or an object of its own."""

from typing import Any, NamedTuple

from ..field_modifier.layers import Way
from .live_modifier import LiveModifier
from .live_object import LiveObject


class Former(NamedTuple):
    """What a session that has ended hands over to the one that replaces it."""

    uid: int  # session_uid of its source
    display: Any
    carried: dict  # what carried objects had before
    keeps_shape: bool
    way: Way  # what layers.make_way() has changed


def display_of(context, source, surface, earlier):
    """The display of a new session: the earlier session's if both are in the same place, else a new one."""
    display = earlier.display if earlier else None
    if display is not None and display.in_place == surface.in_place:
        display.bind(context, source)
        return display
    if display is not None:
        display.take_away(source)
    return (LiveModifier if surface.in_place else LiveObject)(context, source, surface)
