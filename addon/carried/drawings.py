# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the points of hair curves, point clouds and Grease Pencil lie."""


def layers_of(item):
    """The collections of attributes on which an object's points lie; Grease Pencil has one a drawing."""
    if item.type != "GREASEPENCIL":
        return [item.data.attributes]
    drawings = [frame.drawing for layer in item.data.layers for frame in layer.frames]
    return [drawing.attributes for drawing in drawings if "position" in drawing.attributes]
