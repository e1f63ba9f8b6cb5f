# SPDX-License-Identifier: GPL-3.0-or-later
"""Handle tracks: the targets of handles in each frame; docs/animate.md describes the two formats."""

import json

import numpy as np

from .._files import existing_file, read_arrays, read_text
from .._native import InvalidInput
from .handles import build_handles

SUFFIXES = (".json", ".npz")
KEYS = {"fps", "start", "handles"}
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
    unknown = set(content) - KEYS
    if unknown:
        raise InvalidInput(f"{path}: unknown key {sorted(unknown)[0]!r}; known are {sorted(KEYS)}")
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
