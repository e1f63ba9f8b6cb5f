# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes a handle's row active when its Empty becomes active; blender/selection.py does the reverse."""

from ..blender.object_references import owner_of, settings_of
from ..blender.selection import choose_row
from . import empties

seen = {}  # "active": session_uid of the active object at the last check


def follow(context):
    """Checks the active object; called after depsgraph updates."""
    layer = getattr(context, "view_layer", None)
    active = layer.objects.active if layer is not None else None
    uid = active.session_uid if active is not None else None
    if seen.get("active") == uid:
        return
    seen["active"] = uid
    source = owner_of(active) if active is not None and active.type == "EMPTY" else None
    if source is None or source.library is not None:
        return
    index = empties.find(source, active)
    if index >= 0 and index != settings_of(source).active_handle:
        choose_row(settings_of(source), index)
