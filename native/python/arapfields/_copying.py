# SPDX-License-Identifier: GPL-3.0-or-later
"""Options, handles and frames are copied and pickled by what makes them."""

import copyreg
import functools
from typing import Any

from . import _native

NAMES: dict[type[Any], tuple[str, ...]] = {
    _native.CuboidHandle: ("rest", "target", "weight", "allow_scale", "reach"),
    _native.PointHandle: ("rest", "target", "weight", "reach"),
    _native.RegionHandle: ("samples", "rest", "target", "weight", "allow_scale", "reach"),
    _native.CurveHandle: ("samples", "motion", "weight"),
    _native.Frame: ("center", "scale"),
}


def reduced(item: Any) -> tuple[functools.partial[Any], tuple[()]]:
    kind = type(item)
    names = NAMES.get(kind) or kind.fields
    return functools.partial(kind, **{name: getattr(item, name) for name in names}), ()


def register() -> None:
    options = [kind for name, kind in vars(_native).items() if name.endswith("Options")]
    for kind in [*NAMES, *options]:
        copyreg.pickle(kind, reduced)
