# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the stylization, and the list of styles."""

from .parameters import parameters

STYLIZE = parameters("stylize")

STYLES = [  # (native name, label in the menu)
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

CUSTOM = {  # styles by an object of the scene: {identifier: (label, tip)}
    "AXES": ("Axes of an Object", "Turns the surface along the axes of an object of your choice"),
    # Last, as Faces of a Mesh was: .blend files store its index.
    "OBJECT": ("Object", "Turns the surface towards what a mesh object of your choice has in each direction"),
}


def style_identifier(name):
    """Blender's identifier of a native style: "square prism" → "SQUARE_PRISM"."""
    return name.upper().replace(" ", "_")


def style_name(identifier):
    """The native style of a Blender identifier."""
    return identifier.lower().replace("_", " ")
