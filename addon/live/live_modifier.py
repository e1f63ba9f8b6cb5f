# SPDX-License-Identifier: GPL-3.0-or-later
"""What shows a live shape: the source's field modifier, or an object of its own."""

from typing import Any, NamedTuple

import numpy as np

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..field_modifier import armatures, cache_modifier, motion
from ..field_modifier.layers import Way
from ..results import placement, visibility
from . import stored
from .live_object import LIVE, LiveObject

# A live shape on the source itself: its field modifier moves, nothing is added or hidden.


class LiveModifier:
    """Made when live mode starts; keeps a snapshot of the source's earlier motion."""

    in_place = True

    def __init__(self, context, source, _):
        self.before, self.shown = motion.snapshot(source), None
        self.moved_by = settings_of(source).moved_by  # the earlier motion's
        self.first = self.before  # motion of the undo steps before live mode
        self.was_silent = bool(settings_of(source).silenced)
        self.was_playing = cache_modifier.is_playing(source)
        self.bind(context, source)
        visibility.show_alone(source, source, for_now=True)

    def bind(self, context, source):
        """Binds the modifier, also after an edit of the source; `before` stays as it is."""
        motion.bind(context, source, live=True)

    def is_there(self):
        return True

    @property
    def arrays(self):
        return (*stored.arrays_of(self.before), *stored.arrays_of(self.first))

    def require(self, source):
        """Raises UserError if the user has removed or applied the modifier."""
        if modifier_stack.find(source) is None:
            raise UserError("The modifier of {name} was removed", source)

    def show(self, source, shape):
        """Writes a Shape as the source's motion; False in Edit and Sculpt Mode."""
        if source.mode in PAUSING:
            return False
        motion.write(source, motion.Motion(shape.points - shape.rest, shape.turns, shape.changes))
        self.shown = shape
        return True

    def keep_shown(self, source):
        """Makes the motion on display the earlier one."""
        self.before, self.moved_by = motion.snapshot(source), settings_of(source).moved_by

    def take_away(self, source):
        """Restores the motion from before live mode, if any."""
        if source is not None:
            settings_of(source).live_kind = ""
            stored.put_mark(source, "")
            visibility.give_back(source)
            if source.mode != "EDIT":
                motion.restore(source, self.before)
                motion.drop_empty_helper(source)
                settings_of(source).moved_by = self.moved_by
                if not self.was_silent:
                    armatures.restore(source)
                if self.was_playing:
                    cache_modifier.set_playing(source, True)

    def keep(self, context, source, kind):
        """Keeps the motion in the modifier, or moves it to the mesh or a shape key, by the setting `result`;
        returns the source."""
        settings = settings_of(source)
        settings.live_kind = ""
        stored.put_mark(source, "")
        motion.drop_empty_helper(source)
        visibility.forget(source)
        result, shape = settings.result, self.shown
        is_placed = result in ("REPLACE", "KEY") and shape is not None
        if is_placed and not placement.refusal(source, "WARP", result):
            solved = placement.SolvedMesh(shape.points.astype(np.float64), None, {"output": LIVE})
            placement.place_result(context, source, kind, "WARP", result, solved, shape.rest)
        return source

    def leave(self, source):
        """After undo to a step without live mode: restores `first` if the mesh still has a live shape."""
        if stored.mark(source):
            motion.restore(source, self.first)
            stored.put_mark(source, "")


PAUSING = ("EDIT", "SCULPT")  # modes in which the user changes the mesh


# The display of a live session: the source's field modifier, or an object of its own.


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
