# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation's pictures, one module each: `render(output)` writes PNGs, returns what it measured."""

from typing import NamedTuple


class Figure(NamedTuple):
    name: str  # module of this package
    shows: str
    published: bool = False  # needs the published networks or meshes; written outside the repository


FIGURES = [
    Figure("shapes", "our own shapes"),
    Figure("deformations", "six shapes under cuboid handles, at rest and deformed"),
    Figure("bending", "one bar, four weights of the bend"),
]
