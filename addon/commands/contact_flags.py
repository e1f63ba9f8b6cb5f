# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of contact: obstacles, ground and self-contact."""

import argparse
import math

NAMES = ("obstacle", "ground", "itself")


def add_contact_flags(one):
    group = one.add_argument_group("contact: what the surface does not pass [the object's own]")
    group.add_argument(
        "--obstacle",
        action="append",
        metavar="NAME[:MARGIN]",
        help="an object of the .blend, or a mesh file, and the distance kept from it [0]; may be repeated",
    )
    group.add_argument("--ground", type=height, metavar="HEIGHT", help="a level ground, along z")
    text = "parts of the shape do not pass each other"
    group.add_argument("--itself", action=argparse.BooleanOptionalAction, default=None, help=text)


def height(text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is no height")
    return value
