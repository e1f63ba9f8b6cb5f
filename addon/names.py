# SPDX-License-Identifier: GPL-3.0-or-later
"""Every identifier that Blender or a script sees, in one place."""

from enum import StrEnum

PACKAGE = __package__
CATEGORY = "ARAP Fields"  # tab of the sidebar
RESULTS = "ARAP Fields"  # collection that holds results
PROPERTY = "arapfields"  # object.arapfields
REPORT = "arapfields_report"  # custom property of results: figures as JSON
WARP_KEY = "ARAP Fields"  # shape key that carries the motion
RESULT_SUFFIX = {
    "DEFORM": "_deformed",
    "STYLIZE": "_stylized",
    "EXTRACT": "_implicit",
    "LIVE": "_live",
    "BAKE": "_baked",
}
HANDLE_SUFFIX = "_handle"


class Op(StrEnum):
    """Operators, as in bpy.ops."""

    FIT = "arapfields.fit"
    ADD_HANDLE = "arapfields.add_handle"
    SET_REST = "arapfields.set_rest"
    RESET_HANDLE = "arapfields.reset_handle"
    REMOVE_HANDLE = "arapfields.remove_handle"
    DEFORM = "arapfields.deform"
    EXTRACT = "arapfields.extract"
    STYLIZE = "arapfields.stylize"
    SET_STYLE = "arapfields.set_style"
    LIVE = "arapfields.live"
    LIVE_KEEP = "arapfields.live_keep"
    MIRROR_HANDLE = "arapfields.mirror_handle"
    BAKE = "arapfields.bake"
    CANCEL = "arapfields.cancel"
    CLEAR_CACHE = "arapfields.clear_cache"
    COPY_REPORT = "arapfields.copy_report"
