# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of contact, and the Contact made of them."""

import contextlib
import hashlib
from pathlib import Path

from .._native import Contact, InvalidInput, Obstacle
from . import sources

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def contact_flags(parser):
    group = parser.add_argument_group("contact: what the surface does not pass")
    group.add_argument(
        "--obstacle",
        action="append",
        default=[],
        metavar="FILE[:MARGIN]",
        help="a mesh, or a signed distance that fit saved, and the distance kept from it [0]; several may be "
        "given",
    )
    group.add_argument(
        "--ground", nargs=2, metavar=("AXIS", "HEIGHT"), help="a level ground, such as z 0 or y -0.7"
    )
    group.add_argument(
        "--itself",
        action="store_true",
        help="parts of the shape do not pass each other, but for what touches at rest",
    )


def contact_of(args):
    """The Contact by the flags; None without any."""
    obstacles = [_obstacle(text) for text in args.obstacle]
    ground, up = None, None
    if args.ground:
        axis, height = args.ground
        try:
            up, ground = AXES[axis.strip()], float(height)
        except (KeyError, ValueError):
            raise InvalidInput(f"--ground: {axis} {height} is not an axis, x, y or z, and a height") from None
    if not (obstacles or args.ground or args.itself):
        return None
    return Contact(obstacles, ground=ground, up=up, itself=args.itself)


def contact_key(args):
    """Values that determine the Contact, for names of solved frames."""
    read = [(text, hashlib.blake2b(Path(_parts(text)[0]).read_bytes()).hexdigest()) for text in args.obstacle]
    return [read, args.ground, args.itself] if read or args.ground or args.itself else []


def _parts(text):
    """(path, margin) of "path:margin"; paths may contain colons."""
    head, colon, tail = text.rpartition(":")
    if colon and not Path(text).exists():
        with contextlib.suppress(ValueError):
            return head, float(tail)
    return text, 0.0


def _obstacle(text):
    path, margin = _parts(text)
    function = sources.read_distance(path)
    try:
        return Obstacle(function, margin)
    except InvalidInput as error:
        raise InvalidInput(f"--obstacle: {text}: {error}") from None
