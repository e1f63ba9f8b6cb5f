# SPDX-License-Identifier: GPL-3.0-or-later
"""An HTML page with a picture and figures of each wrap, the worst first."""

import base64
import html
import struct
import zlib

import numpy as np

from .._native import sample_mesh

SIDE, POINTS = 160, 150_000  # width and height of pictures in pixels; number of points drawn per surface
VIEW = np.array([[0.8, 0.0, -0.6], [-0.21, 0.94, -0.28], [0.56, 0.35, 0.75]])  # right, up, towards the viewer
LIGHT = np.array([-0.4, 0.5, 0.77])  # direction of light in the camera's axes
WRAPPED, TARGET = (217, 140, 77), (140, 153, 166)  # colours


def cell(name, figures, wrapped, target):
    """HTML of one wrap: pictures of its target, if that is a mesh, and of the wrapped mesh; y is up."""
    middle = (wrapped[0].max(axis=0) + wrapped[0].min(axis=0)) / 2
    half = 0.55 * float(np.linalg.norm(np.ptp(wrapped[0], axis=0)))
    both = (target, TARGET), (wrapped, WRAPPED)
    shown = [picture(mesh, colour, middle, half) for mesh, colour in both if mesh is not None]
    data = base64.b64encode(png(np.concatenate(shown, axis=1))).decode()
    text = html.escape(name), html.escape(figures)
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{text[0]}: target, wrapped">'
        f"<figcaption><b>{text[0]}</b><br>{text[1]}</figcaption></figure>"
    )


def page(cells):
    """HTML of these cells, in this order."""
    style = "figure{display:inline-block;margin:8px;font:14px sans-serif;max-width:320px;vertical-align:top}"
    return (
        f"<!doctype html><meta charset=utf-8><title>Wraps</title><style>{style}</style>\n"
        + "\n".join(cells)
        + "\n"
    )


def picture(mesh, colour, middle, half):
    """(SIDE, SIDE, 3) uint8 picture of a surface in the axes VIEW, within `half` around `middle`."""
    samples = sample_mesh(*mesh, POINTS)
    points = (samples.points - middle) @ VIEW.T / half
    shade = np.clip(samples.normals @ VIEW.T @ LIGHT, 0, 1) * 0.75 + 0.25
    at = np.round((points[:, :2] * [1, -1] + 1) * (SIDE - 1) / 2).astype(int)
    inside = ((at >= 0) & (at < SIDE)).all(axis=1)
    order = np.flatnonzero(inside)[np.argsort(points[inside, 2])]  # from back to front
    image = np.full((SIDE, SIDE, 3), 255.0)
    image[at[order, 1], at[order, 0]] = shade[order, None] * colour
    return image.astype(np.uint8)


def png(pixels):
    """The content of a PNG file; `pixels`: (height, width, 3 or 4) uint8, RGB or RGBA."""
    height, width, channels = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows, 9))
        + chunk(b"IEND", b"")
    )
