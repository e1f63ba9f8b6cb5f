# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file, or a step that was undone, says of live mode where nothing stands behind it."""

from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of
from ..core.runtime import jobs
from ..field_modifier import motion
from ..names import RESULT_SUFFIX
from ..results import result_objects, visibility
from . import live_object


def clear(source):
    """After a step was undone or redone: a live object goes; the modifier has what that step says."""
    item = live_object.forget(source)
    if item is not None:
        result_objects.discard(item)


def adopt(source):
    """After a file was loaded that was saved while live: the shape is a result now, as it was seen then."""
    settings, kind = settings_of(source), settings_of(source).live_kind
    item = next((entry.item for entry in settings.results if entry.kind == live_object.LIVE), None)
    if item is not None and not in_scene(item):
        clear(source)
        return
    visibility.forget(source)
    if item is not None:
        live_object.forget(source)
        item.name = item.data.name = f"{source.name}{RESULT_SUFFIX[kind]}"
        result_objects.register(source, kind, settings.output, item)
    elif not moves(source):
        return
    told = translated("it was live when the file was saved; its shape is kept as a result")
    jobs.add_message("INFO", f"{source.name}: {told}")


def moves(source):
    shown = motion.snapshot(source)
    return shown is not None and shown.offsets is not None and bool(shown.offsets.any())
