# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the stylization, and the styles there are."""

from .parameters import parameters

STYLIZE = parameters("stylize")

STYLES = [  # as the native library names them, and how the menu does
    ("cube", "Cube"),
    ("tetrahedron", "Tetrahedron"),
    ("octahedron", "Octahedron"),
    ("dodecahedron", "Dodecahedron"),
    ("icosahedron", "Icosahedron"),
    ("square prism", "Square Prism"),
    ("hexagonal prism", "Hexagonal Prism"),
    ("triangular prism", "Triangular Prism"),
    ("square pyramid", "Square Pyramid"),
    ("hexagonal pyramid", "Hexagonal Pyramid"),
    ("triangular pyramid", "Triangular Pyramid"),
    ("cylinder", "Cylinder"),
    ("cone", "Cone"),
    ("plane pair", "Flat Top and Bottom"),
]

CUSTOM = {  # styles whose normals an object of the scene gives: identifier → label, tip
    "AXES": ("Axes of an Object", "Turns the surface along the axes of an object of your choice"),
    # Last, as Faces of a Mesh was: Blender's files hold its number.
    "OBJECT": ("Object", "Turns the surface towards what a mesh object of your choice has in each direction"),
}


def style_identifier(name):
    """Blender's identifier of a native style: "square prism" → "SQUARE_PRISM"."""
    return name.upper().replace(" ", "_")


def style_name(identifier):
    """The native style of a Blender identifier."""
    return identifier.lower().replace("_", " ")
