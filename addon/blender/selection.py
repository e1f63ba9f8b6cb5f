# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting objects, and rows of lists that are selected together with them."""

import contextlib


class Rows:
    """`quiet`: a row is being chosen by ourselves, which selects nothing."""

    quiet = False


rows = Rows()


def select_alone(context, item, extend=False):
    """Makes an object the active one and, unless it is to `extend` what is, the only one that is selected.

    Not where it cannot be seen.
    """
    layer = context.view_layer
    if context.mode != "OBJECT" or layer.objects.get(item.name) != item or not item.visible_get():
        return
    for other in () if extend else context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    layer.objects.active = item


@contextlib.contextmanager
def quietly():
    """Rows chosen within select nothing."""
    before, rows.quiet = rows.quiet, True
    try:
        yield
    finally:
        rows.quiet = before


def choose_row(settings, index):
    """Makes that handle's row the chosen one; the selection of objects stays."""
    with quietly():
        settings.active_handle = index


def row_chosen(settings, context):
    """A row was chosen in the list of handles: its Empty is selected."""
    handles = settings.handles
    if not rows.quiet and 0 <= settings.active_handle < len(handles):
        empty = handles[settings.active_handle].empty
        if empty is not None:
            select_alone(context, empty)
