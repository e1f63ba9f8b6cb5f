# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that are scaled without Allow Scale."""

import numpy as np

from ..core.errors import UserError
from . import empties, movers

LEAST = 1e-3  # relative difference from the rest size above which a box counts as scaled


def ignored(source):
    """UserError that names the handles whose scale is ignored; else None."""
    names = [movers.name_of(entry) for entry in empties.used(source) if is_ignored(source, entry)]
    if not names:
        return None
    return UserError("{names} is scaled, which counts only with Allow Scale", names=", ".join(names))


def is_ignored(source, entry):
    if entry.allow_scale or entry.kind == "POINT":
        return False
    rest, now = empties.rest_box(source, entry)[:3, :3], movers.box_now(entry)[:3, :3]
    if not np.isfinite(now).all() or abs(np.linalg.det(rest)) == 0.0:
        return False  # refused elsewhere
    stretches = np.linalg.svd(now @ np.linalg.inv(rest), compute_uv=False)
    return bool(np.abs(stretches - 1.0).max() > LEAST)
