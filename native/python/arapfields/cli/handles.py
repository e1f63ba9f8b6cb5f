# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from files and flags, and their motion over frames."""

import argparse
import json

import numpy as np

from .._files import existing_file, read_arrays, read_text
from .._native import CuboidHandle, InvalidInput, PointHandle

# Handles from a JSON file and from flags; docs/command-line.md describes the format.

AROUND_POINT = 0.03  # of the size: distance within which a point handle holds vertices
KEYS = {
    "cuboid": {
        *("rest", "target", "corners", "center", "half_extents", "rotation", "move", "weight"),
        *("allow_scale", "reach"),
    },
    "point": {"rest", "target", "weight", "reach"},
}


def read_handles(path):
    """The descriptions of handles in a JSON file: a list, or an object with a list `handles`."""
    path = existing_file(path)
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{path}: not JSON ({error})") from error
    if isinstance(content, dict) and set(content) == {"handles"}:
        content = content["handles"]
    if not isinstance(content, list) or not all(isinstance(item, dict) for item in content):
        raise InvalidInput(f'{path}: expected {{"handles": [...]}} with an object for each handle')
    if not content:
        raise InvalidInput(f"{path}: lists no handle; at least one is needed")
    return [(f"{path}: handles[{i}]", item) for i, item in enumerate(content)]


def build_handles(described, bounds):
    """Handles of descriptions (name, dict); infinite corners of boxes are cut to widened `bounds` (2, 3)."""
    handles = []
    for name, item in described:
        kind = item.get("type")
        if not isinstance(kind, str) or kind not in KEYS:
            raise InvalidInput(f"{name}: type is {kind!r}; 'cuboid' or 'point' is needed")
        unknown = set(item) - KEYS[kind] - {"type"}
        if unknown:
            raise InvalidInput(f"{name}: unknown key {sorted(unknown)[0]!r}; known are {sorted(KEYS[kind])}")
        try:
            make = _point if kind == "point" else _cuboid
            handles.append(make(item, bounds))
        except KeyError as error:
            raise InvalidInput(f"{name}: {error.args[0]!r} is missing") from None
        except (TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
            raise InvalidInput(f"{name}: {error}") from None
    if not handles:
        raise InvalidInput("handles: none are given; use --handles, --box or --point")
    return handles


def held_by(handles, points):
    """(n,) whether a handle holds these points at rest: a box those inside, a point those around."""
    held = np.zeros(len(points), bool)
    around = AROUND_POINT * np.ptp(points, axis=0).max()
    for handle in handles:
        if isinstance(handle, PointHandle):
            away = np.linalg.norm(points - handle.rest, axis=1)
            held |= away <= max(around, away.min())
        else:
            into = np.linalg.inv(handle.rest)
            held |= (np.abs(points @ into[:3, :3].T + into[:3, 3]) <= 1).all(axis=1)
    return held


def _point(item, _):
    rest, target = (_numbers(item[key], (3,)) for key in ("rest", "target"))
    return PointHandle(rest, target, item.get("weight", 1.0), reach=item.get("reach", 0.0))


def _cuboid(item, bounds):
    if "rest" in item:
        rest = _numbers(item["rest"], (4, 4))
    else:
        center, half = _corners(item["corners"], bounds) if "corners" in item else _box(item)
        if (half <= 0).any():
            raise ValueError("the box is empty; each half-extent must be positive")
        rest = np.eye(4)
        rest[:3, :3] = rotation(item.get("rotation")) * half
        rest[:3, 3] = center
    if "target" in item:
        if "move" in item:
            raise ValueError("'target' and 'move' exclude each other")
        target = _numbers(item["target"], (4, 4))
    else:
        target = _motion(item.get("move", {}), rest) @ rest
    scales = item.get("allow_scale", "scale" in item.get("move", {}))
    if not isinstance(scales, bool):
        raise ValueError(f"'allow_scale' is {scales!r}; true or false is needed")
    return CuboidHandle(
        rest, target, item.get("weight", 1.0), allow_scale=scales, reach=item.get("reach", 0.0)
    )


def _box(item):
    return _numbers(item["center"], (3,)), _numbers(item["half_extents"], (3,))


def _corners(corners, bounds):
    """Center and half extents of a box by its low and high corner; null and infinite sides are open."""
    low, high = (
        [sign * np.inf if side is None else side for side in corner]
        for sign, corner in zip((-1, 1), corners, strict=True)
    )
    corners = np.array([low, high], float)
    if corners.shape != (2, 3) or np.isnan(corners).any():
        raise ValueError(f"got {[low, high]!r}, expected two corners of three numbers")
    room = 0.1 * (bounds[1] - bounds[0]).max()
    low = np.where(np.isinf(corners[0]), np.minimum(bounds[0], corners[1]) - room, corners[0])
    high = np.where(np.isinf(corners[1]), np.maximum(bounds[1], corners[0]) + room, corners[1])
    if not np.isfinite([low, high]).all():
        raise ValueError("both corners are infinite on the same side")
    return (low + high) / 2, (high - low) / 2


def _motion(move, rest):
    """(4, 4) motion: scaling along the box's edges and rotation about the pivot, by default the box's center,
    then translation."""
    known = ("scale", "rotate", "pivot", "translate")
    unknown = set(move) - set(known)
    if unknown:
        raise ValueError(f"unknown key {sorted(unknown)[0]!r} in 'move'; known are {', '.join(known)}")
    motion = np.eye(4)
    motion[:3, :3] = rotation(move.get("rotate"))
    if "scale" in move:
        factors = np.broadcast_to(np.asarray(move["scale"], float), 3)
        edges = rest[:3, :3]
        motion[:3, :3] = motion[:3, :3] @ edges @ np.diag(_numbers(factors, (3,))) @ np.linalg.inv(edges)
    pivot = _numbers(move.get("pivot", rest[:3, 3]), (3,))
    shift = _numbers(move.get("translate", (0, 0, 0)), (3,))
    motion[:3, 3] = pivot - motion[:3, :3] @ pivot + shift
    return motion


def rotation(value):
    """(3, 3) rotation from None, a matrix, or {"axis": [x, y, z], "degrees": d}."""
    if value is None:
        return np.eye(3)
    if not isinstance(value, dict):
        return _numbers(value, (3, 3))
    axis, angle = _numbers(value["axis"], (3,)), np.radians(float(value["degrees"]))
    if not np.linalg.norm(axis) > 0:
        raise ValueError("a rotation's axis is zero")
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def turn_upright(up):
    """(3, 3) smallest rotation from z to the direction (3,)."""
    length = np.linalg.norm(up)
    if not 0 < length < np.inf:
        raise ValueError("a direction is zero or not finite")
    axis = np.array([-up[1], up[0], 0.0])
    if not axis.any():
        axis = np.array([1.0, 0.0, 0.0])
    return rotation({"axis": axis, "degrees": np.degrees(np.arccos(np.clip(up[2] / length, -1, 1)))})


def _numbers(value, shape):
    array = np.asarray(value, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"got {value!r}, expected finite numbers of shape {shape}")
    return array


def triple(text):
    """Argument type "x,y,z"."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text.strip()!r} is not x,y,z") from None
    return [x, y, z]


class AddHandle(argparse.Action):
    """Action of --box LOW HIGH and --point FROM TO: appends a handle's description."""

    def __call__(self, parser, namespace, values, option_string=None):
        if option_string == "--point":
            item = {"type": "point", "rest": values[0], "target": values[1]}
        else:
            item = {"type": "cuboid", "corners": values}
        described = [
            *(namespace.flagged or []),
            (f"{option_string} number {len(namespace.flagged or []) + 1}", item),
        ]
        namespace.flagged = described


class MoveHandle(argparse.Action):
    """Action of --turn, --scale, --pivot and --shift, for the last box, and of --reach, also for points."""

    def __call__(self, parser, namespace, values, option_string=None):
        if option_string == "--reach":
            if not namespace.flagged:
                raise argparse.ArgumentError(self, "follows the --box or --point that it is of")
            namespace.flagged[-1][1]["reach"] = values
            return
        if not namespace.flagged or namespace.flagged[-1][1]["type"] != "cuboid":
            raise argparse.ArgumentError(self, "follows the --box that it moves")
        move = namespace.flagged[-1][1].setdefault("move", {})
        if option_string == "--turn":
            try:
                move["rotate"] = {"axis": triple(values[0]), "degrees": float(values[1])}
            except (ValueError, argparse.ArgumentTypeError) as error:
                raise argparse.ArgumentError(self, f"expected AXIS as x,y,z and DEGREES: {error}") from None
        elif option_string == "--scale":
            try:
                move["scale"] = triple(values) if "," in values else float(values)
            except (ValueError, argparse.ArgumentTypeError) as error:
                raise argparse.ArgumentError(self, f"expected a number or x,y,z: {error}") from None
        else:
            move["pivot" if option_string == "--pivot" else "translate"] = values


# Handle tracks: the targets of handles in each frame; docs/animate.md describes the two formats.

SUFFIXES = (".json", ".npz")
TRACK_KEYS = {"fps", "start", "handles"}
ARRAYS = {"fps", "start", "names", "kinds", "weights", "rest", "frames"}
MOST_FRAMES = 10_000_000
MOST_FPS = 1e6


class Tracks:
    """Handles of `count` frames from number `start`, `fps` per second."""

    def __init__(self, path, fps, start, described):
        self.path, self.fps, self.start = path, fps, start
        self._described = described  # [(name, description at rest, (n, 4, 4) or (n, 3) targets)]
        counts = {len(moves) for _, _, moves in described}
        if not described or counts == {0}:
            raise InvalidInput(f"{path}: has no {'frame' if described else 'handle'}; one or more are needed")
        if len(counts) > 1:
            each = ", ".join(f"{name} {len(moves)}" for name, _, moves in described)
            raise InvalidInput(f"{path}: the handles' numbers of frames differ: {each}")
        (self.count,) = counts

    def handles(self, index, bounds):
        """The handles of a frame with rest and target; InvalidInput names an invalid handle."""
        where = f"{self.path}: frame {self.start + index}, handle"
        items = [
            (f"{where} {name}", {**rest, "target": moves[index].tolist()})
            for name, rest, moves in self._described
        ]
        return build_handles(items, bounds)

    def targets(self, index):
        """The targets of a frame."""
        return [moves[index] for _, _, moves in self._described]


def read_tracks(path):
    path = existing_file(path, SUFFIXES)
    fps, start, described = (_of_json if path.suffix.lower() == ".json" else _of_arrays)(path)
    for name, value, low, high in (("fps", fps, 0, MOST_FPS), ("start", start, -MOST_FRAMES, MOST_FRAMES)):
        if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
            raise InvalidInput(f"{path}: {name} is {value!r:.40}; a number from {low} to {high:g} is needed")
    if fps == 0 or start != int(start):
        raise InvalidInput(f"{path}: fps must be above 0, start an integer; they are {fps:g} and {start:g}")
    return Tracks(path, float(fps), int(start), described)


def _of_json(path):
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{path}: not JSON ({error})") from error
    if not isinstance(content, dict) or not isinstance(content.get("handles"), list):
        raise InvalidInput(f'{path}: expected {{"fps": 24, "start": 1, "handles": [...]}}')
    unknown = set(content) - TRACK_KEYS
    if unknown:
        raise InvalidInput(f"{path}: unknown key {sorted(unknown)[0]!r}; known are {sorted(TRACK_KEYS)}")
    described = []
    for number, item in enumerate(content["handles"]):
        if not isinstance(item, dict):
            raise InvalidInput(f"{path}: handles[{number}]: an object is needed")
        rest = dict(item)
        name = rest.pop("name", f"handles[{number}]")
        if not isinstance(name, str):
            raise InvalidInput(f"{path}: handles[{number}]: its name is no text")
        if {"target", "move"} & set(rest):
            raise InvalidInput(f"{path}: {name}: 'target' and 'move' are for single poses; give 'frames'")
        described.append((name, rest, _moves(f"{path}: {name}", rest.get("type"), rest.pop("frames", None))))
    return content.get("fps"), content.get("start", 1), described


def _of_arrays(path):
    arrays = read_arrays(path, ARRAYS)
    missing = {"fps", "rest", "frames"} - set(arrays)
    if missing:
        raise InvalidInput(f"{path}: has no array {sorted(missing)[0]!r}")
    rest, frames = arrays["rest"], arrays["frames"]
    count = len(rest) if rest.ndim else 0
    shaped = frames.ndim == 4 and frames.shape[1:] == (count, 4, 4) and rest.shape == (count, 4, 4)
    if not shaped or rest.dtype.kind not in "fiu" or frames.dtype.kind not in "fiu":
        raise InvalidInput(
            f"{path}: rest has shape {rest.shape}, frames {frames.shape}; numbers of shapes (k, 4, 4) and "
            "(n, k, 4, 4) are needed"
        )
    names = _column(path, arrays, "names", [f"handle {i + 1}" for i in range(count)])
    kinds = _column(path, arrays, "kinds", ["cuboid"] * count)
    weights = _column(path, arrays, "weights", [1.0] * count)
    described = []
    for i in range(count):
        point = kinds[i] == "point"
        item = {"type": kinds[i], "weight": weights[i]}
        item["rest"] = rest[i, :3, 3].tolist() if point else rest[i].tolist()
        described.append((str(names[i]), item, _moves(f"{path}: {names[i]}", kinds[i], frames[:, i])))
    scalars = [arrays.get(name, np.array(1)) for name in ("fps", "start")]
    if any(value.shape != () for value in scalars):
        raise InvalidInput(f"{path}: fps and start are single numbers")
    return *(value.item() for value in scalars), described


def _column(path, arrays, name, default):
    column = arrays.get(name, np.array(default))
    if column.shape != (len(default),):
        raise InvalidInput(
            f"{path}: {name} has shape {column.shape}; one for each of the rest poses is needed"
        )
    return column.tolist()


def _moves(where, kind, frames):
    """(n, 4, 4) targets, or (n, 3) of a point: only the translation of its matrices counts."""
    if frames is None:
        raise InvalidInput(f"{where}: 'frames' is missing")
    try:
        moves = np.asarray(frames, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(f"{where}: frames: {error}") from None
    if moves.shape == (0,):
        return moves
    single = kind == "point" and moves.ndim == 2 and moves.shape[1] == 3
    if not single and (moves.ndim != 3 or moves.shape[1:] != (4, 4)):
        needed = "4×4 matrices or rows of three numbers" if kind == "point" else "4×4 matrices"
        raise InvalidInput(f"{where}: frames has shape {moves.shape}; {needed} are needed, one a frame")
    bad = ~np.isfinite(moves).reshape(len(moves), -1).all(axis=1)
    if bad.any():
        raise InvalidInput(f"{where}: the frame at place {int(bad.argmax())} is NaN or infinite")
    return moves[:, :3, 3] if kind == "point" and not single else moves
