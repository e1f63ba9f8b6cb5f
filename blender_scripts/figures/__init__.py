# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation's pictures: `draw_NAME(output)` of a module writes PNGs and returns what it measured."""

from typing import NamedTuple


class Figure(NamedTuple):
    name: str
    module: str  # of this package
    shows: str
    published: bool = False  # needs the published networks or meshes; written outside the repository
    peers: bool = False  # shows results of others' code
    pages: tuple = ()  # of docs, whose scripts it runs
    window: bool = False  # needs a Blender with a window: see at_hand.py
    timed: bool = False  # tells how long something took: nothing else is rendered meanwhile


WORKFLOWS = tuple(f"workflows/{name}.md" for name in ("pins", "character", "animate", "stylize"))
FIGURES = [
    Figure("hero", "deforming", "a shape at rest, deformed, and in two styles"),
    Figure("shapes", "deforming", "our own shapes"),
    Figure("deformations", "deforming", "six shapes under cuboid handles, at rest and deformed"),
    Figure("bending", "deforming", "one bar, four weights of the bend"),
    Figure("inverse", "deforming", "the surface moved forward beside the zero set of Φ∘f⁻¹", timed=True),
    Figure("exact", "deforming", "soft and exact handles"),
    Figure("styles", "styling", "six styles of three shapes, with their preferences on a sphere"),
    Figure("style_sheet", "styling", "all styles of six shapes, as stylize makes them by default"),
    Figure("style_finish", "styling", "two shapes in two styles, by the field alone and finished"),
    Figure("style_objects", "styling", "three shapes in the styles of six objects"),
    Figure("live", "deforming", "six frames of a handle dragged live", timed=True),
    Figure("character", "styling", "materials and UVs of a deformed and a stylized mesh"),
    Figure(
        "workflows", "workflows", "the ends of the workflow pages, by the pages' own scripts", pages=WORKFLOWS
    ),
    Figure("wrapping", "workflows", "a rigged template wrapped onto a scan, and posed"),
    Figure("batch", "deforming", "a folder of meshes in one style"),
    Figure(
        "loop_window",
        "loops",
        "the steps of the pin page in Blender's window, moving",
        pages=WORKFLOWS[:1],
        window=True,
        timed=True,
    ),
    Figure("loop_pins", "loops", "a creature posed by pins, moving", pages=WORKFLOWS[:1]),
    Figure(
        "loop_character",
        "loops",
        "a character that waves, eyes, shirt and hair carried, moving",
        pages=WORKFLOWS[1:2],
    ),
    Figure(
        "loop_skin",
        "loops",
        "weights of a body in pieces, beside Blender's automatic ones, and moving",
        pages=("workflows/skin.md",),
    ),
    Figure(
        "loop_walk",
        "loops",
        "a walk without and with secondary motion, and moving",
        pages=("workflows/walk.md",),
    ),
    Figure(
        "loop_wrap", "loops", "a dog that takes the shape of a scan, and moving", pages=("workflows/wrap.md",)
    ),
    Figure(
        "loop_transfer",
        "loops",
        "a child's keys, weights, eyes and shirt on a grown-up, and moving",
        pages=("workflows/transfer.md",),
    ),
    Figure(
        "loop_contact",
        "loops",
        "a bar pulled over a ball, without and with contact, and moving",
        pages=("workflows/contact.md",),
    ),
    Figure("loop_style", "loops", "a style's strength from none to all, moving"),
    Figure(
        "loop_splats",
        "loops",
        "a scan of Gaussian splats, posed with and without its covariances, and moving",
    ),
    Figure("published", "published", "the published bunny by three methods", published=True, timed=True),
    Figure("published_hand", "published", "one finger of the published hand pulled", published=True),
    Figure(
        "published_peers",
        "published",
        "the paper's comparisons, figures 6 and 7, with its competitor",
        published=True,
        peers=True,
    ),
]
