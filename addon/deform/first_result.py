# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview of a running solve on the source itself, by its field modifier.

The earlier motion is restored bit for bit before the result is placed, the job cancelled, a step undone or
the file saved. Undo steps pushed during the solve contain the preview, so the motion is also restored after
undo or redo to them.
"""

import contextlib
import hashlib

import bpy

from ..blender import host, modifier_stack, undo_steps
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..field_modifier import motion

WAIT = 0.2  # seconds between checks whether Edit Mode has ended


class Steps(dict):
    """{session_uid: {digest of previewed offsets: the motion before them}} of this file's jobs."""

    def note(self, source, shown, before):
        self.setdefault(source.session_uid, {})[digest(shown)] = before

    def recover(self):
        """After undo or redo: restores the motion of sources whose step contains a preview."""
        # A list: restoring removes helper objects, which may invalidate Blender's iterator.
        for source in [item for item in bpy.data.objects if item.session_uid in self]:
            known = self[source.session_uid]
            shown = motion.snapshot(source) if source.mode != "EDIT" else None
            if shown is not None and digest(shown) in known:
                motion.restore(source, known[digest(shown)])


steps = Steps()


def digest(moved):
    return None if moved.offsets is None else hashlib.sha1(moved.offsets.tobytes()).digest()


class FirstResult:
    """Shows a solve's points on the source that it works on; main thread but for `points`."""

    def __init__(self, surface):
        self._surface, self._shown, self._before = surface, False, None

    @property
    def points(self):
        """(n, 3) points at rest, in solve space."""
        return self._surface.vertices

    def show(self, points):
        """Moves the source's points to (n, 3) in solve space; not while the user works on the mesh."""
        source = self._surface.reference.find()
        if source is None or source.mode != "OBJECT":
            return
        try:
            if not self._shown:
                before = motion.snapshot(source)
                # Undo ends the preview: a modifier that it has added goes before; what others refer to stays.
                with contextlib.nullcontext() if before is None else undo_steps.between():
                    motion.bind(bpy.context, source)
                self._shown, self._before = True, before
            local = self._surface.space.to_local(points.astype(float))
            motion.write(source, motion.Motion(local - self._surface.local))
            steps.note(source, motion.snapshot(source), self._before)
        except UserError:  # the mesh has changed: the job reports it
            self.clear()

    def hand_over(self):
        """Restores the motion from before the preview, but leaves a modifier that the preview has added to
        the result: Blender crashes if a modifier is removed while one of its inputs is being typed."""
        source = self._surface.reference.find()
        modifier = modifier_stack.find(source) if self._shown and source is not None else None
        if modifier is None or self._before is not None or source.mode != "OBJECT":
            self.clear()
        else:
            motion.write_to(motion.carrier(source, modifier), motion.Motion(None))

    def keep(self):
        """Leaves the source as it is, now that the result is placed."""
        self._shown = False

    def clear(self):
        """Restores the motion from before the preview."""
        if self._shown:
            self._shown = False
            put_back(self._surface.reference, self._before)


def put_back(reference, before):
    """Restores the motion `before` as soon as the source is not in Edit Mode."""

    def attempt():
        source = reference.find()
        if source is not None and source.mode == "EDIT":
            return WAIT
        if source is not None:
            under_rig = settings_of(source).under_rig
            motion.restore(source, before)
            if settings_of(source).under_rig != under_rig:  # the result is still to come to that place
                settings_of(source).under_rig = under_rig
        return None

    if attempt() is not None:
        host.start(attempt, first=WAIT)
