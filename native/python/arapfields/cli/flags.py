# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of several verbs."""

import arapfields as af

from . import usd
from .handles import AddHandle, MoveHandle, triple
from .options import add_option_flag
from .touching import contact_flags

MESH = "mesh: .ply, .obj, .stl or .off"
SOURCE = f"{MESH}; or .safetensors: a signed distance that fit saved"
SPLATS = "splats: .ply, .glb, or .usd, .usda, .usdc by usd-core"


def solve_flags(parser):
    parser.add_argument("input", help=SOURCE)
    outputs = parser.add_argument_group("outputs (one or more)")
    moved = f"the input mesh with its vertices moved; {SPLATS}"
    outputs.add_argument("-o", "--output", metavar="FILE", help=moved)
    outputs.add_argument("--surface", metavar="FILE", help="the implicit surface, deformed (see --through)")
    outputs.add_argument("--save-field", metavar="FILE", help=".safetensors with the deformation field")
    report_flag(outputs)
    up_axis_flag(parser)
    extraction_flags(parser)
    inverse_flag(parser)
    sdf_flag(parser)
    stiffness_flags(parser)
    contact_flags(parser)
    handles = parser.add_argument_group(
        "handles (x, y, z in the mesh's coordinates; inf and -inf leave a side of a box open)"
    )
    handles.add_argument("--handles", metavar="FILE", help="JSON file, see docs/command-line.md")
    settings = {"dest": "flagged", "default": None}
    handles.add_argument(
        "--box",
        nargs=2,
        type=triple,
        metavar=("LOW", "HIGH"),
        action=AddHandle,
        **settings,
        help="the surface in this box is held, or moved by what follows",
    )
    handles.add_argument(
        "--turn",
        nargs=2,
        metavar=("AXIS", "DEGREES"),
        action=MoveHandle,
        **settings,
        help="turns the last box",
    )
    handles.add_argument(
        "--pivot",
        type=triple,
        metavar="POINT",
        action=MoveHandle,
        **settings,
        help="about this point [the box's centre]",
    )
    handles.add_argument(
        "--shift", type=triple, metavar="VECTOR", action=MoveHandle, **settings, help="shifts the last box"
    )
    handles.add_argument(
        "--scale",
        metavar="FACTORS",
        action=MoveHandle,
        **settings,
        help="scales the last box about its pivot: a number, or x,y,z along its edges",
    )
    handles.add_argument(
        "--reach",
        type=float,
        metavar="LENGTH",
        action=MoveHandle,
        **settings,
        help="the last box or point moves only what is this near, through the inside of the shape",
    )
    handles.add_argument(
        "--point",
        nargs=2,
        type=triple,
        metavar=("FROM", "TO"),
        action=AddHandle,
        **settings,
        help="one point of the surface goes there",
    )


def stiffness_flags(parser):
    stiffness = parser.add_argument_group(
        "stiffness: a number for each of the mesh's vertices (.txt, .csv or .npy), 1 for what is not painted"
    )
    stiffness.add_argument("--weights", metavar="FILE", help="how much it resists all change of shape")
    stiffness.add_argument("--bend-weights", metavar="FILE", help="how much it resists bending")


def extraction_flags(parser):
    for name in ("resolution", "refine_thin"):
        add_option_flag(parser, "extraction", name)


def inverse_flag(parser):
    parser.add_argument(
        "--through",
        choices=("warp", "inverse"),
        default="warp",
        help="a deformed surface's triangles: those at rest, moved (warp), or new and even ones, extracted "
        "through the field's inverse [warp]",
    )


def sdf_flag(parser):
    parser.add_argument(
        "--sdf",
        choices=("exact", "fit"),
        default="exact",
        help="a mesh's implicit surface: its own triangles, as far as they lie between inside and outside, "
        "or a smooth fit, which takes a while and closes holes [exact]",
    )


def up_axis_flag(parser):
    text = (
        "what is up in the input: USD has it in its header, and splats are turned for .glb, whose y is up [z]"
    )
    parser.add_argument("--up-axis", choices=usd.AXES, default="z", help=text)


def report_flag(parser):
    parser.add_argument("--report", metavar="FILE", help=".json with what was measured")


def style_flags(parser):
    """Adds the flags of the style and its orientation."""
    style = parser.add_mutually_exclusive_group(required=True)
    style.add_argument("--style", metavar="NAME", help=f"one of {', '.join(af.style_names())}")
    style.add_argument(
        "--normals", metavar="FILE", help="rows x y z (.txt, .csv, .npy), or the face normals of a mesh"
    )
    style.add_argument(
        "--style-object",
        metavar="FILE",
        help="a closed mesh, as upright as the input: normals turn to what it has in their direction",
    )
    parser.add_argument("--style-turn", nargs=2, metavar=("AXIS", "DEGREES"), help="turns the style")
    parser.add_argument(
        "--up",
        metavar="X,Y,Z",
        help="what is up in the file (z without it): the style's axis and the figure's stance",
    )
