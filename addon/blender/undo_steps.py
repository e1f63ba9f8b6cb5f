# SPDX-License-Identifier: GPL-3.0-or-later
"""What may refer to what between two steps of Blender's undo.

Undo leaves a data-block that is the same in both steps as it is in memory, with what it refers to by then;
what is not in the step that is restored is freed. So whatever is done without a step of its own, by timers
and handlers, gives no data-block a reference to a new one: undo would leave it dangling. And what may come
back without a step stays in the file, unused, until that is saved.
"""

from contextlib import contextmanager

import bpy

from ..core.errors import UserError

is_between, keeps_unused = False, False
pushed = 0  # number of steps pushed so far by push()


def push(message):
    """Pushes a step for what no operator's own step has."""
    global pushed
    pushed += 1
    bpy.ops.ed.undo_push(message=message)


@contextmanager
def between():
    """Context manager for what goes into no step: a reference to new data raises UserError."""
    global is_between
    earlier, is_between = is_between, True
    try:
        with unused_kept():
            yield
    finally:
        is_between = earlier


@contextmanager
def unused_kept():
    """Context manager in which data that become unused are not removed."""
    global keeps_unused
    earlier, keeps_unused = keeps_unused, True
    try:
        yield
    finally:
        keeps_unused = earlier


def refuse_new(source):
    """UserError if what is done now must refer to nothing new."""
    if is_between:
        raise UserError("{name} needs new data for its motion; start again", source)
