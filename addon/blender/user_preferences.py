# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences, with defaults if there are none."""

import os
import tempfile
from pathlib import Path

import bpy

from ..core.runtime.fit_cache import FitCache
from ..names import PACKAGE


def preferences():
    """The add-on's preferences; None if it runs from its source folder."""
    entry = bpy.context.preferences.addons.get(PACKAGE)
    return entry.preferences if entry else None


def machine_options():
    """Options that depend on the machine alone."""
    stored = preferences()
    return {"threads": stored.threads, "device": stored.device} if stored else {}


def shows(name):
    """Whether the preference of that name, show_boxes or show_previews, is on, which is the default."""
    stored = preferences()
    return stored is None or getattr(stored, name)


def cache_folder():
    """Folder of stored fits: the user's choice, the extension's user folder, or a temporary one."""
    stored = preferences()
    if stored and stored.cache_folder:
        return Path(bpy.path.abspath(stored.cache_folder))
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, path="fits", create=False))
    except ValueError:  # not run as an extension
        return (
            Path(tempfile.gettempdir())
            / f"arapfields-fits-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        )


def fit_cache():
    return FitCache(cache_folder())
