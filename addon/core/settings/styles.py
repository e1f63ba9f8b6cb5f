# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the stylization, and the styles there are."""

from dataclasses import replace

from .parameters import BARRIER, LAYERS, LEARNING_RATE, OCTAVES, SAMPLES, SEED, TIME, WIDTH, Parameter

STYLIZE = [
    Parameter(
        "strength", 1.0, "Strength", "From 0, the shape itself, to 1, as stylized as it gets", 0.0, 1.0, 1.0
    ),
    Parameter(
        "sharpness",
        5.0,
        "Sharpness",
        "Low rounds the edges of the style, high keeps them crisp",
        0.5,
        50.0,
        15.0,
    ),
    Parameter(
        "iterations", 300, "Iterations", "Steps of the solve; more is finer and takes longer", 1, 100000, 1000
    ),
    Parameter(
        "rigidity",
        1.0,
        "Rigidity",
        "Resistance to stretching, which keeps the features' sizes",
        0.0,
        1000.0,
        10.0,
    ),
    Parameter(
        "bending",
        1e-3,
        "Stiffness",
        "Resistance to bending: low gives crisp edges, high gives rounded ones",
        0.0,
        10.0,
        0.1,
    ),
    TIME,
    SAMPLES,
    Parameter(
        "batch", 500, "Samples per Step", "Samples that each step looks at", 16, 100000, 4000, advanced=True
    ),
    replace(BARRIER, default=10.0),  # a style without it folds at its edges
    LEARNING_RATE,
    WIDTH,
    LAYERS,
    OCTAVES,
    SEED,
]

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
    "FACES": ("Faces of a Mesh", "Turns the surface towards the faces of a mesh object of your choice"),
}


def style_identifier(name):
    """Blender's identifier of a native style: "square prism" → "SQUARE_PRISM"."""
    return name.upper().replace(" ", "_")


def style_name(identifier):
    """The native style of a Blender identifier."""
    return identifier.lower().replace("_", " ")
