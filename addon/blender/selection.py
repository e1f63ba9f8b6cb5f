# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection of objects, synchronized with active rows of lists."""

import contextlib


class Rows:
    """`quiet`: the add-on itself sets the active row; update callbacks then select nothing."""

    quiet = False


rows = Rows()


def select_alone(context, item, extend=False):
    """Makes an object active and selected, alone unless `extend`; does nothing if it is hidden."""
    layer = context.view_layer
    if context.mode != "OBJECT" or layer.objects.get(item.name) != item or not item.visible_get():
        return
    for other in () if extend else context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    layer.objects.active = item


@contextlib.contextmanager
def quietly():
    """Context manager: active rows set within it select nothing."""
    before, rows.quiet = rows.quiet, True
    try:
        yield
    finally:
        rows.quiet = before


def choose_row(settings, index):
    """Sets the active row of the handles; the selection of objects stays."""
    with quietly():
        settings.active_handle = index


def row_chosen(settings, context):
    """Update callback of the active handle: selects its Empty."""
    handles = settings.handles
    if not rows.quiet and 0 <= settings.active_handle < len(handles):
        empty = handles[settings.active_handle].empty
        if empty is not None:
            select_alone(context, empty)
