# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve of a live object does: it takes over the pose, and live mode ends by itself."""

from ..blender.object_references import settings_of
from ..results import placement
from . import sessions


def give_way(context, source, output, target):
    """Ends live mode before a solve whose result goes there.

    Where the result moves the same modifier, the live shape is seen until it comes, and stays if it never
    does; otherwise the source is what it was before live mode.
    """
    session = sessions.live.get(source.session_uid)
    if session is None:
        settings_of(source).live_kind = ""  # what a file or an undone step says, with nothing behind it
        return
    stays = session.display.in_place and settings_of(source).target == target
    sessions.end(context, source, keep=stays and placement.keeps_mesh(output, target))
    context.view_layer.update()
