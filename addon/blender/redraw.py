# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags regions for redraw."""

from ..names import CATEGORY


def redraw(context, *kinds):
    """Tags regions of these types in every 3D view for redraw; of sidebars those that show the panel."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type in kinds and shows_panel(region):
                        region.tag_redraw()


def shows_panel(region):
    """False for a sidebar that is closed or shows another tab."""
    if region.type != "UI":
        return True
    return region.width > 1 and getattr(region, "active_panel_category", CATEGORY) == CATEGORY
