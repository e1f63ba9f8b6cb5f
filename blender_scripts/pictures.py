# SPDX-License-Identifier: GPL-3.0-or-later
"""How the documentation's pictures are stored: a rendered one takes a tenth of a PNG's bytes."""

SUFFIX = ".webp"
STORED = {"format": "WEBP", "quality": 95, "method": 6}


def store(path):
    """A PNG as a picture of the documentation, in its place; returns the new path."""
    from PIL import Image

    target = path.with_suffix(SUFFIX)
    Image.open(path).convert("RGB").save(target, **STORED)
    path.unlink()
    return target
