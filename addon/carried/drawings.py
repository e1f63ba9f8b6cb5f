# SPDX-License-Identifier: GPL-3.0-or-later
"""Attribute collections with the points of hair curves, point clouds and Grease Pencil."""


def layers_of(item):
    """The attribute collections that hold an object's points; Grease Pencil has one per drawing."""
    if item.type != "GREASEPENCIL":
        return [item.data.attributes]
    drawings = [frame.drawing for layer in item.data.layers for frame in layer.frames]
    return [drawing.attributes for drawing in drawings if "position" in drawing.attributes]
