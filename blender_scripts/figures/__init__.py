# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation's pictures, one module each: `render(output)` writes PNGs, returns what it measured."""

from typing import NamedTuple


class Figure(NamedTuple):
    name: str  # module of this package
    shows: str
    published: bool = False  # needs the published networks or meshes; written outside the repository
    peers: bool = False  # shows results of others' code
    pages: tuple = ()  # of docs, whose scripts it runs
    window: bool = False  # needs a Blender with a window: see windowed.py
    timed: bool = False  # tells how long something took: nothing else is rendered meanwhile


WORKFLOWS = tuple(f"workflows/{name}.md" for name in ("pins", "character", "animate", "stylize"))
FIGURES = [
    Figure("hero", "a shape at rest, deformed, and in two styles"),
    Figure("shapes", "our own shapes"),
    Figure("deformations", "six shapes under cuboid handles, at rest and deformed"),
    Figure("bending", "one bar, four weights of the bend"),
    Figure("inverse", "the surface moved forward beside the zero set of Φ∘f⁻¹", timed=True),
    Figure("exact", "soft and exact handles"),
    Figure("styles", "six styles of three shapes, with their preferences on a sphere"),
    Figure("style_sheet", "all styles of six shapes, as stylize makes them by default"),
    Figure("style_objects", "three shapes in the styles of six objects"),
    Figure("live", "six frames of a handle dragged live", timed=True),
    Figure("character", "materials and UVs of a deformed and a stylized mesh"),
    Figure("workflows", "the ends of the workflow pages, by the pages' own scripts", pages=WORKFLOWS),
    Figure("wrapping", "a rigged template wrapped onto a scan, and posed"),
    Figure("batch", "a folder of meshes in one style"),
    Figure(
        "loop_window",
        "the steps of the pin page in Blender's window, moving",
        pages=WORKFLOWS[:1],
        window=True,
        timed=True,
    ),
    Figure("loop_pins", "a creature posed by pins, moving", pages=WORKFLOWS[:1]),
    Figure(
        "loop_character", "a character that waves, eyes, shirt and hair carried, moving", pages=WORKFLOWS[1:2]
    ),
    Figure(
        "loop_skin",
        "weights of a body in pieces, beside Blender's automatic ones, and moving",
        pages=("workflows/skin.md",),
    ),
    Figure("loop_walk", "a walk without and with secondary motion, and moving", pages=("workflows/walk.md",)),
    Figure("loop_wrap", "a dog that takes the shape of a scan, and moving", pages=("workflows/wrap.md",)),
    Figure(
        "loop_transfer",
        "a child's keys, weights, eyes and shirt on a grown-up, and moving",
        pages=("workflows/transfer.md",),
    ),
    Figure(
        "loop_contact",
        "a bar pulled over a ball, without and with contact, and moving",
        pages=("workflows/contact.md",),
    ),
    Figure("loop_style", "a style's strength from none to all, moving"),
    Figure("loop_splats", "a scan of Gaussian splats, posed with and without its covariances, and moving"),
    Figure("published", "the published bunny by three methods", published=True, timed=True),
    Figure("published_hand", "one finger of the published hand pulled", published=True),
    Figure(
        "published_peers",
        "the paper's comparisons, figures 6 and 7, with its competitor",
        published=True,
        peers=True,
    ),
]
