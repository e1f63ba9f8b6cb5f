# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a live shape is shown, from one session of a source to the next."""

from typing import Any, NamedTuple

from .live_modifier import LiveModifier
from .live_object import LiveObject


class Former(NamedTuple):
    """What stays of a session that has ended, for one that takes its place."""

    uid: int  # session_uid of its source
    display: Any
    carried: dict  # what carried objects had before
    keeps_shape: bool
    gone: list  # what layers.make_way() has taken away


def display_of(context, source, surface, earlier):
    """Where the shape is shown; what an earlier session made is used again, or goes."""
    display = earlier.display if earlier else None
    if display is not None and display.in_place and surface.in_place:
        display.bind(context, source)
        return display
    if display is not None:
        display.take_away(source)
    return (LiveModifier if surface.in_place else LiveObject)(context, source, surface)
